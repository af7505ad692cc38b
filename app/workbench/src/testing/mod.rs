//! Models in known states, for tests. Feature `testing`.

pub mod sample;
