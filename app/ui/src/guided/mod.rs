//! Guided capture in the window: one button from the board in view to a calibration that was checked.

pub(crate) mod section;
#[cfg(test)]
mod tests;
