//! A camera of Video4Linux: a USB camera, or whatever else is `/dev/video0`.
//!
//! Everything that can be wrong without a camera at hand (pixels, stamps, what is said of a device) is in modules that know no
//! device; [`device`] alone talks to the kernel, through the crate `v4l`.

mod choice;
mod device;
mod pixels;
mod stamps;
mod trouble;

pub use device::{V4l, V4lOptions};
pub use pixels::PixelFormat;
