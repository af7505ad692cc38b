//! `handeye driver rosbridge`: ROS 1 and ROS 2.

use std::path::PathBuf;

use clap::Args;
use handeye_arm::urdf::Urdf;
use handeye_arm::{Joint, JointKind};
use handeye_driver::drivers::rosbridge::{Rosbridge, RosbridgeOptions};
use handeye_driver::message::{ArmMessage, JointMessage};

use super::serve;
use crate::Failure;
use handeye_workbench::arguments::heading;

/// Options of `handeye driver rosbridge`.
#[derive(Debug, Args)]
pub struct RosbridgeArgs {
    /// Address of the rosbridge.
    #[arg(long, value_name = "URL", default_value = "ws://127.0.0.1:9090", help_heading = heading::CELL)]
    url: String,
    /// Frame of tf in which poses are stated, often base_link. Without this and --image, the frames are listed.
    #[arg(long, value_name = "FRAME", requires = "tip_frame", help_heading = heading::CELL)]
    base_frame: Option<String>,
    /// Frame of tf of the tip, often tool0.
    #[arg(long, value_name = "FRAME", requires = "base_frame", help_heading = heading::CELL)]
    tip_frame: Option<String>,
    /// Topic of images, raw or compressed.
    #[arg(long, value_name = "TOPIC", help_heading = heading::CELL)]
    image: Option<String>,
    /// Topic of sensor_msgs/CameraInfo, where the lens is calibrated.
    #[arg(long, value_name = "TOPIC", requires = "image", help_heading = heading::CELL)]
    camera_info: Option<String>,
    /// The images are rectified: their lens is the projection matrix of the camera info, without distortion.
    #[arg(long, requires = "camera_info", help_heading = heading::CELL)]
    rectified: bool,
    /// Topic of raw depth images, aligned to the images.
    #[arg(long, value_name = "TOPIC", requires = "image", help_heading = heading::CELL)]
    depth: Option<String>,
    /// Topic of sensor_msgs/JointState. Which joints, say --joint-names or --urdf.
    #[arg(long, value_name = "TOPIC", requires = "base_frame", help_heading = heading::CELL)]
    joints: Option<String>,
    /// Names of the arm's joints from the base up, all revolute.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', requires = "joints", conflicts_with = "urdf", help_heading = heading::CELL)]
    joint_names: Vec<String>,
    /// The arm's URDF: its joints between the base frame and the tip frame.
    #[arg(long, value_name = "FILE", requires = "joints", help_heading = heading::CELL)]
    urdf: Option<PathBuf>,
    /// Images a second at most.
    #[arg(long, value_name = "HZ", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=100), help_heading = heading::CELL)]
    image_rate: u16,
    /// Have rosbridge cut longer messages into pieces of so many bytes, where a proxy between does not let them through.
    #[arg(long, value_name = "BYTES", value_parser = clap::value_parser!(u32).range(1000..), help_heading = heading::CELL)]
    fragment_size: Option<u32>,
}

pub fn run(args: &RosbridgeArgs) -> Result<(), Failure> {
    let (arm, arm_joints) = match &args.urdf {
        Some(file) => {
            let arm = Urdf::read(file)
                .and_then(|urdf| urdf.arm(args.base_frame.as_deref(), args.tip_frame.as_deref()))
                .map_err(Failure::unusable)?;
            // The workbench reads the file itself, wherever it was started.
            let path = file.canonicalize().unwrap_or_else(|_| file.clone());
            let message = ArmMessage::Urdf {
                urdf: path.display().to_string(),
                base_link: args.base_frame.clone(),
                tip_link: args.tip_frame.clone(),
            };
            (Some(message), arm.joints().iter().map(joint).collect())
        }
        None => (None, args.joint_names.iter().map(revolute).collect()),
    };
    serve(Rosbridge::new(RosbridgeOptions {
        base_frame: args.base_frame.clone(),
        tip_frame: args.tip_frame.clone(),
        joints: args.joints.clone(),
        arm_joints,
        image: args.image.clone(),
        camera_info: args.camera_info.clone(),
        is_rectified: args.rectified,
        depth: args.depth.clone(),
        image_rate_hz: f64::from(args.image_rate),
        fragment_size: args.fragment_size,
        arm,
        ..RosbridgeOptions::new(args.url.clone())
    }))
}

fn joint(joint: &Joint) -> JointMessage {
    let finite = |value: f64| value.is_finite().then_some(value);
    let (min, max) = (finite(joint.range.min), finite(joint.range.max));
    JointMessage { name: joint.name.clone(), kind: joint.kind, min, max }
}

#[expect(clippy::ptr_arg, reason = "as an iterator over names has it")]
fn revolute(name: &String) -> JointMessage {
    JointMessage { name: name.clone(), kind: JointKind::Revolute, min: None, max: None }
}
