//! Arguments that several subcommands share, and targets in words.

mod arm_errors;
pub mod heading;
mod object_arg;
mod target_words;

pub use arm_errors::ArmErrorsChoice;
pub use object_arg::ObjectArgs;
pub use target_words::{DescribedTarget, of_text};
