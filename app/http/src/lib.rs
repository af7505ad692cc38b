//! What is served over HTTP: the page of the workbench, and the recordings that Rerun's viewers read.

pub mod door;
pub mod names;
