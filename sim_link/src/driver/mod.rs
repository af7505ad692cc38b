//! Robots and cameras through programs that speak JSON lines, on standard input and output or over TCP.
//!
//! The protocol is on one page, `docs/drivers.md`. [`message`] is what is said.

pub mod message;
