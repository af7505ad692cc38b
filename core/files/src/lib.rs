//! Files as such: written as a whole or not at all, never through a link; digests; budgets of time and memory.
//!
//! ```
//! use handeye_files::atomic_file;
//!
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("result.json");
//! atomic_file::write(&file, b"{}")?;
//! assert_eq!(std::fs::read(&file)?, b"{}");
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! Never depends on what is in the files.

#![warn(missing_docs)]

#[cfg(feature = "atomic_file")]
pub mod atomic_file;
pub mod bounds;
pub mod budget;
#[cfg(feature = "digest")]
pub mod digest;
pub mod json_text;
pub mod own_folder;
