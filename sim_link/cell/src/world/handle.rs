//! The number by which clients name an object.

/// Number by which the API names an object.
pub type Handle = i64;
