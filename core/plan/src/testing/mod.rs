//! Simulated cells in which guided capture runs, for tests and studies. Feature `testing`.

pub mod clutter;
pub mod guided_cell;
pub mod hand;
