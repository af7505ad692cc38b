//! How well an answer is known, and whether the data bear out what is stated.

pub mod quality;
pub mod widening;
