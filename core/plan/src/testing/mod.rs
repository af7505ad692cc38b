//! Guided sessions in simulated cells (`handeye_simulate`), for tests and studies. Feature `testing`.

pub mod clutter;
pub mod guided_cell;
pub mod hand;
