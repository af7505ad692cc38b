//! How well an answer is known, and whether the data confirm what is stated.

pub mod overdispersion;
pub mod quality;
