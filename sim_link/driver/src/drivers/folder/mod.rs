//! A folder into which another program puts images and poses: each new pair is shown to the workbench as a robot at rest
//! and a camera that looks.

mod device;
mod side_file;
mod table;
mod watch;

pub use device::{Folder, FolderOptions};
