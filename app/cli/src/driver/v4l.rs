//! `handeye driver v4l`: a camera of Video4Linux.

use std::path::PathBuf;

use clap::Args;
use handeye_driver::drivers::v4l::{PixelFormat, V4l, V4lOptions};

use super::{serve, size};
use crate::Failure;
use handeye_workbench::arguments::heading;

/// Options of `handeye driver v4l`.
#[derive(Debug, Args)]
pub struct V4lArgs {
    /// The camera.
    #[arg(long, value_name = "FILE", default_value = "/dev/video0", help_heading = heading::CELL)]
    device: PathBuf,
    /// Size of the images; the largest of the format if not given.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size, help_heading = heading::CELL)]
    size: Option<(u32, u32)>,
    /// Pixel format: RGB3, YUYV, GREY or MJPG; the first of these that the camera offers in this size if not given.
    #[arg(long, value_name = "NAME", value_parser = format, help_heading = heading::CELL)]
    format: Option<PixelFormat>,
    /// Images a second; the camera's choice if not given.
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(1..=1000), help_heading = heading::CELL)]
    rate: Option<u32>,
}

pub fn run(args: &V4lArgs) -> Result<(), Failure> {
    serve(V4l::new(V4lOptions {
        device: args.device.clone(),
        format: args.format,
        size: args.size,
        rate_hz: args.rate,
    }))
}

fn format(text: &str) -> Result<PixelFormat, String> {
    let code = <[u8; 4]>::try_from(text.to_ascii_uppercase().as_bytes()).ok();
    code.and_then(PixelFormat::of).ok_or_else(|| "RGB3, YUYV, GREY or MJPG".into())
}
