//! The driver's first message: what it is and what it can do.

use std::fmt;

use handeye_arm::{JointKind, MAX_JOINTS};
use handeye_geometry::camera::{Distortion, Intrinsics};
use serde::{Deserialize, Serialize};

use super::PROTOCOL;
use super::error::BadMessage;
use super::images::check_size;
use super::robot::PoseMessage;

/// What a driver can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ability {
    /// It sends `state` by itself, ten times a second or more.
    State,
    /// Its states have `joints_rad`.
    Joints,
    /// It answers `next_image`.
    Image,
    /// It answers with `depth` as well.
    Depth,
    /// It moves to joint values.
    MoveJoints,
    /// It moves to a pose of the tip.
    MoveTip,
    /// Something that this version does not know, which does not matter.
    #[serde(other)]
    Unknown,
}

impl fmt::Display for Ability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::State => "state",
            Self::Joints => "joints",
            Self::Image => "image",
            Self::Depth => "depth",
            Self::MoveJoints => "move_joints",
            Self::MoveTip => "move_tip",
            Self::Unknown => "unknown",
        })
    }
}

handeye_wording::plain_values!(Ability);

/// A joint in the driver's `hello`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointMessage {
    /// The name that the driver gives.
    pub name: String,
    /// Kind of the joint; revolute where absent.
    #[serde(default = "revolute")]
    pub kind: JointKind,
    /// Smallest value, rad or m; none where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Largest value, rad or m; none where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

fn revolute() -> JointKind {
    JointKind::Revolute
}

/// The chain of the joints, in the driver's `hello`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ArmMessage {
    /// An arm that is built in, by its name.
    Name(String),
    /// An arm as a URDF file.
    Urdf {
        /// The path of a file, or the text itself, which begins with `<`.
        urdf: String,
        /// First link of the chain, where the file has several candidates.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        base_link: Option<String>,
        /// Last link of the chain.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        tip_link: Option<String>,
    },
}

/// The lens, where the driver knows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LensMessage {
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, column in pixels; (0, 0) is the centre of the first pixel.
    pub cx: f64,
    /// Principal point, row in pixels.
    pub cy: f64,
    /// Distortion; none where absent.
    #[serde(default = "no_distortion")]
    pub distortion: Distortion,
}

fn no_distortion() -> Distortion {
    Distortion::None
}

impl LensMessage {
    /// For images of this size.
    ///
    /// # Errors
    /// [`BadMessage::Value`] for numbers that no lens has.
    pub fn intrinsics(&self, width: u32, height: u32) -> Result<Intrinsics, BadMessage> {
        let Self { fx, fy, cx, cy, distortion } = *self;
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy, distortion };
        intrinsics.validate().map_err(|error| BadMessage::value("intrinsics", error))?;
        Ok(intrinsics)
    }
}

/// The camera in the driver's `hello`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraMessage {
    /// Width of the images in pixels.
    pub width: u32,
    /// Height of the images in pixels.
    pub height: u32,
    /// The lens, where the driver knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<LensMessage>,
}

/// The driver's first message.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the driver's protocol.
    pub protocol: u32,
    /// The name that the driver gives.
    pub name: String,
    /// Version of the driver, in its own numbering.
    #[serde(default)]
    pub version: String,
    /// Clock of its timestamps: `monotonic`, `unix`, or any other description. They are in seconds in each case.
    #[serde(default)]
    pub clock: String,
    /// Its abilities.
    pub can: Vec<Ability>,
    /// The joints from the base up; with `joints` in `can`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<JointMessage>,
    /// The chain of the joints, where known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmMessage>,
    /// Pose of that chain in the base frame of the poses; the identity where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_from_arm: Option<PoseMessage>,
    /// The camera; with `image` in `can`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraMessage>,
    /// Depths that the sensor can measure, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_limits_m: Option<[f32; 2]>,
}

impl Hello {
    /// Whether the driver reports this ability.
    pub fn can(&self, ability: Ability) -> bool {
        self.can.contains(&ability)
    }

    /// Whether it can move the arm in any way.
    pub(crate) fn can_move(&self) -> bool {
        self.can(Ability::MoveJoints) || self.can(Ability::MoveTip)
    }

    pub(super) fn check(&self) -> Result<(), BadMessage> {
        if self.protocol != PROTOCOL {
            return Err(BadMessage::Protocol { got: self.protocol });
        }
        if self.joints.len() > MAX_JOINTS {
            return Err(BadMessage::value("joints", format!("{} joints, at most {MAX_JOINTS}", self.joints.len())));
        }
        for joint in &self.joints {
            if let (Some(min), Some(max)) = (joint.min, joint.max)
                && min > max
            {
                let why = format!("joint {} has min {min} over max {max}", joint.name);
                return Err(BadMessage::value("joints", why));
            }
        }
        self.needs(Ability::Joints, "joints", !self.joints.is_empty())?;
        self.needs(Ability::MoveJoints, "joints", !self.joints.is_empty())?;
        self.needs(Ability::Image, "camera", self.camera.is_some())?;
        self.needs(Ability::Depth, "image in can", self.can(Ability::Image))?;
        self.needs(Ability::Joints, "state in can", self.can(Ability::State))?;
        for motion in [Ability::MoveJoints, Ability::MoveTip] {
            self.needs(motion, "state in can", self.can(Ability::State))?;
        }
        if let Some(CameraMessage { width, height, intrinsics }) = self.camera {
            check_size(width, height)?;
            intrinsics.map(|lens| lens.intrinsics(width, height)).transpose()?;
        }
        match self.depth_limits_m {
            Some([near, far]) if !(near >= 0.0 && near < far) => {
                Err(BadMessage::value("depth_limits_m", format!("{near} to {far} m is no range")))
            }
            _ => Ok(()),
        }
    }

    fn needs(&self, ability: Ability, needs: &'static str, is_there: bool) -> Result<(), BadMessage> {
        if self.can(ability) && !is_there { Err(BadMessage::Needs { ability, needs }) } else { Ok(()) }
    }
}
