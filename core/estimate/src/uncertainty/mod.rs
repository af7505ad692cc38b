//! How well an answer is known, and whether the data bear out what is stated.

pub mod overdispersion;
pub mod quality;
