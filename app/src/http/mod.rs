//! What is served over HTTP: the page of the workbench, and the recordings that Rerun's viewers read.

pub(crate) mod door;
pub(crate) mod names;
