//! `handeye driver`: a conformance run of a driver, and the drivers that come with the workbench.

mod fake;
mod folder;
mod rosbridge;
mod test;
mod ur_rtde;
#[cfg(target_os = "linux")]
mod v4l;

use clap::{Args, Subcommand};
use handeye_driver::drivers::{self, Device};

use super::Failure;

pub const EXAMPLES: &str = "Examples:
  handeye driver test \"handeye driver fake\" --allow-motion
  handeye driver test tcp://192.168.0.7:7000
  handeye driver fake --listen 127.0.0.1:7000";

const ROSBRIDGE_EXAMPLES: &str = "Examples, the first of which lists the frames of tf:
  handeye driver test \"handeye driver rosbridge --url ws://192.168.0.7:9090\"
  handeye driver test \"handeye driver rosbridge --url ws://192.168.0.7:9090 \\
      --base-frame base_link --tip-frame tool0 \\
      --image /camera/image_raw --camera-info /camera/camera_info\"";

/// Options of `handeye driver`.
#[derive(Debug, Args)]
pub struct DriverArgs {
    #[command(subcommand)]
    command: DriverCommand,
}

#[derive(Debug, Subcommand)]
enum DriverCommand {
    /// Say whether a driver keeps to the protocol, and where it does not, with the line.
    #[command(after_help = EXAMPLES)]
    Test(test::TestArgs),
    /// Be a driver with the built-in cell behind it, on standard input and output or over TCP.
    #[command(after_help = "Examples:\n  handeye driver test \"handeye driver fake\" --allow-motion")]
    Fake(fake::FakeArgs),
    /// Be a driver that reads a controller of Universal Robots through RTDE.
    #[command(
        after_help = "Examples:\n  handeye driver test \"handeye driver ur-rtde --host 192.168.0.10 --arm ur5e\""
    )]
    UrRtde(ur_rtde::UrRtdeArgs),
    /// Be a driver that reads ROS 1 or ROS 2 through a rosbridge.
    #[command(after_help = ROSBRIDGE_EXAMPLES)]
    Rosbridge(rosbridge::RosbridgeArgs),
    /// Be a driver that shows each image that comes into a folder, with its pose.
    #[command(
        after_help = "Examples:\n  handeye driver folder captures --length-unit mm --rotation rpy \\\n      --angle-unit deg \
                      --pose base_from_tip"
    )]
    Folder(folder::FolderArgs),
    /// Be a driver of a USB camera, or another one of Video4Linux.
    #[cfg(target_os = "linux")]
    #[command(
        after_help = "Examples:\n  handeye driver test \"handeye driver v4l --device /dev/video0 --size 1280x720\""
    )]
    V4l(v4l::V4lArgs),
}

pub fn run(args: &DriverArgs) -> Result<(), Failure> {
    match &args.command {
        DriverCommand::Test(args) => test::run(args),
        DriverCommand::Fake(args) => fake::run(args),
        DriverCommand::UrRtde(args) => ur_rtde::run(args),
        DriverCommand::Rosbridge(args) => rosbridge::run(args),
        DriverCommand::Folder(args) => folder::run(args),
        #[cfg(target_os = "linux")]
        DriverCommand::V4l(args) => v4l::run(args),
    }
}

/// Speaks for a device on standard input and output until the workbench leaves.
fn serve(device: impl Device) -> Result<(), Failure> {
    drivers::serve(device, std::io::stdin(), std::io::stdout()).map_err(Failure::failed)
}

/// Width and height in pixels.
fn size(text: &str) -> Result<(u32, u32), String> {
    let number = |text: &str| text.parse::<u32>().ok().filter(|&pixels| pixels > 0);
    let parts = text.split_once(['x', '×']).and_then(|(width, height)| Some((number(width)?, number(height)?)));
    parts.ok_or_else(|| "width and height in pixels, such as 1280x720".into())
}
