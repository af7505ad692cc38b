//! Files as such: written as a whole, never through a link, images, digests.

pub mod atomic_file;
pub mod bounds;
pub(crate) mod digest;
pub mod image_file;
pub(crate) mod json_text;
pub mod own_folder;
