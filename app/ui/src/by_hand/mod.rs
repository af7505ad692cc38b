//! Guided capture for an arm that is moved by hand: the window shows how the board should look in the image and what to
//! change.

pub(crate) mod overlay;
pub(crate) mod section;
#[cfg(test)]
mod tests;
