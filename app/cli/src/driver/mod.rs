//! `handeye driver`: a conformance run of a driver, and the drivers that come with the workbench.

mod fake;
pub(crate) mod python;
mod test;

use clap::{Args, Subcommand};

use super::Failure;
use python::{EjectArgs, PythonArgs};

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
    /// Check whether a driver follows the protocol; violations are listed with their line.
    #[command(after_help = EXAMPLES)]
    Test(test::TestArgs),
    /// Run a driver with the built-in cell behind it, on standard input and output or over TCP.
    #[command(after_help = "Examples:\n  handeye driver test \"handeye driver fake\" --allow-motion")]
    Fake(fake::FakeArgs),
    /// Write one of the drivers below as a Python file, to change it.
    #[command(after_help = "Examples:\n  handeye driver eject ur-rtde --out my_drivers")]
    Eject(EjectArgs),
    /// Run a driver that reads a controller of Universal Robots through RTDE.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver ur-rtde --host 192.168.0.10 --arm ur5e\""
    )]
    UrRtde(PythonArgs),
    /// Run a driver that reads a UFACTORY xArm.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver xarm --host 192.168.1.200\""
    )]
    Xarm(PythonArgs),
    /// Run a driver that reads a Franka arm.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver franka --host 172.16.0.2\""
    )]
    Franka(PythonArgs),
    /// Run a driver that reads ROS 1 or ROS 2 through a rosbridge.
    #[command(disable_help_flag = true, after_help = ROSBRIDGE_EXAMPLES)]
    Rosbridge(PythonArgs),
    /// Run a driver that reads ROS 2 by its own Python, rclpy.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver ros2 --base-frame base_link --tip-frame tool0\""
    )]
    Ros2(PythonArgs),
    /// Run a driver that shows each image that comes into a folder, with its pose.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver folder captures --length-unit mm --rotation rpy \\\n      --angle-unit deg \
                      --pose base_from_tip"
    )]
    Folder(PythonArgs),
    /// Run a driver of a USB camera, or another one of Video4Linux.
    #[cfg(target_os = "linux")]
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver v4l --device /dev/video0 --size 1280x720\""
    )]
    V4l(PythonArgs),
    /// Run a driver of an Intel RealSense camera.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver realsense --size 1280x720\""
    )]
    Realsense(PythonArgs),
    /// Run a driver of an Orbbec camera.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye driver test \"handeye driver orbbec --size 1280x720\""
    )]
    Orbbec(PythonArgs),
    /// Run a driver with a cell that MuJoCo simulates.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye auto --driver \"handeye driver mujoco\" --target 10x7x15 \\\n      --poses guided --allow-motion --speed 100"
    )]
    Mujoco(PythonArgs),
    /// Run a driver with a cell that PyBullet simulates.
    #[command(
        disable_help_flag = true,
        after_help = "Examples:\n  handeye auto --driver \"handeye driver pybullet --arm panda\" \\\n      --target 10x7x15 --poses guided --allow-motion --speed 100"
    )]
    Pybullet(PythonArgs),
}

pub fn run(args: &DriverArgs) -> Result<(), Failure> {
    match &args.command {
        DriverCommand::Test(args) => test::run(args),
        DriverCommand::Fake(args) => fake::run(args),
        DriverCommand::Eject(args) => python::eject(args),
        DriverCommand::UrRtde(args) => python::run(&python::UR_RTDE, args),
        DriverCommand::Xarm(args) => python::run(&python::XARM, args),
        DriverCommand::Franka(args) => python::run(&python::FRANKA, args),
        DriverCommand::Rosbridge(args) => python::run(&python::ROSBRIDGE, args),
        DriverCommand::Ros2(args) => python::run(&python::ROS2, args),
        DriverCommand::Folder(args) => python::run(&python::FOLDER, args),
        #[cfg(target_os = "linux")]
        DriverCommand::V4l(args) => python::run(&python::V4L, args),
        DriverCommand::Realsense(args) => python::run(&python::REALSENSE, args),
        DriverCommand::Orbbec(args) => python::run(&python::ORBBEC, args),
        DriverCommand::Mujoco(args) => python::run(&python::MUJOCO, args),
        DriverCommand::Pybullet(args) => python::run(&python::PYBULLET, args),
    }
}
