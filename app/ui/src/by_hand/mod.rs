//! Guided capture for an arm that a person moves: the window shows how the board is to look in the image and what to change,

pub(crate) mod overlay;
pub(crate) mod section;
#[cfg(test)]
mod tests;
