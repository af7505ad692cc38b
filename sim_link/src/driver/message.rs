//! The messages of the driver protocol, in both directions: `docs/drivers.md` describes them, this is their form in Rust.
//!
//! What a driver sends is checked here once, so that nothing behind this module sees a number that is none, a quaternion
//! that is no rotation, or an encoding without a meaning.

use std::fmt;

use handeye_core::geometry::arm::{JointKind, JointValues, MAX_JOINTS};
use handeye_core::geometry::camera::{Distortion, Intrinsics};
use handeye_core::geometry::frames::{Frame, Pose};
use serde::{Deserialize, Serialize};

/// The version of the protocol that is spoken here.
pub const PROTOCOL: u32 = 1;

/// How far the norm of a quaternion may be from 1: what single precision and six printed digits leave, with room.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Translations longer than this are not metres \[m\].
const LONGEST_TRANSLATION_M: f64 = 100.0;
/// Widest and highest image in pixels.
pub const MAX_IMAGE_SIDE: u32 = 16_384;

/// A rigid transform `dst_from_src`; the field that holds it names the frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseMessage {
    /// Origin of `src` in `dst`, metres.
    pub translation_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
}

impl PoseMessage {
    /// For the wire.
    pub fn of<Dst: Frame, Src: Frame>(pose: &Pose<Dst, Src>) -> Self {
        Self { translation_m: pose.translation().into(), rotation_xyzw: pose.xyzw() }
    }

    /// The pose between the frames that the field names.
    ///
    /// # Errors
    /// [`BadMessage::Pose`] for a quaternion that is no rotation, or a translation of more than 100 m.
    pub fn pose<Dst: Frame, Src: Frame>(&self, field: &'static str) -> Result<Pose<Dst, Src>, BadMessage> {
        let norm = self.rotation_xyzw.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > UNIT_TOLERANCE || !norm.is_finite() {
            return Err(BadMessage::Pose {
                field,
                why: format!("rotation_xyzw has the norm {norm:.4}, a unit quaternion x, y, z, w is needed"),
            });
        }
        let length_m = self.translation_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length_m > LONGEST_TRANSLATION_M || !length_m.is_finite() {
            return Err(BadMessage::Pose {
                field,
                why: format!("translation_m is {length_m:.0} m long, metres are needed and not millimetres"),
            });
        }
        Ok(Pose::from_translation_xyzw(self.translation_m, self.rotation_xyzw))
    }
}

/// What the workbench sends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToDriver {
    /// The first message; answered by the driver's `hello`.
    Hello {
        /// [`PROTOCOL`].
        protocol: u32,
        /// Version of the workbench.
        workbench: String,
    },
    /// Answered by `pong` at once; five times a second.
    Ping {
        /// Number of this ping.
        id: u64,
    },
    /// Answered by `image`, and by `depth` where that is wanted, as soon as there is an image newer than `after`.
    NextImage {
        /// Number of this request.
        id: u64,
        /// Stamp of the newest image that the workbench has; `None` for any.
        #[serde(default)]
        after: Option<f64>,
        /// Whether the depth image of the same instant is wanted too.
        #[serde(default)]
        depth: bool,
    },
    /// Allows or forbids motion; answered by `done` or `refused`.
    Arm {
        /// Number of this request.
        id: u64,
        /// Whether the driver may move the arm from now on.
        on: bool,
    },
    /// Answered by `accepted` and then `done` or `stopped`, or by `refused`.
    Move {
        /// Number of this request.
        id: u64,
        /// Where to, as joint values; one of the two is given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joints_rad: Option<JointValues>,
        /// Where to, as a pose of the tip.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        base_from_tip: Option<PoseMessage>,
        /// Share of the highest speed, over 0 and up to 1.
        speed: f64,
    },
    /// Brings the arm to rest; answered by `done` once it is.
    Stop {
        /// Number of this request.
        id: u64,
    },
    /// The last message: the driver brings the arm to rest and ends.
    Bye {},
}

impl ToDriver {
    /// The line, with its end.
    pub fn line(&self) -> String {
        // Structs of strings and finite numbers: JSON has a form for each.
        let mut line = serde_json::to_string(self).unwrap_or_default();
        line.push('\n');
        line
    }
}

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

/// A joint as the driver's `hello` has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointMessage {
    /// Its name.
    pub name: String,
    /// How it moves; revolute where absent.
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

/// Which chain the joints are, in the driver's `hello`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ArmMessage {
    /// An arm that is built in, by its name.
    Name(String),
    /// A URDF.
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
    /// Version of the protocol that it speaks.
    pub protocol: u32,
    /// What it is.
    pub name: String,
    /// Its version.
    #[serde(default)]
    pub version: String,
    /// What its stamps count: `monotonic`, `unix`, or any other word for people. They are seconds in each case.
    #[serde(default)]
    pub clock: String,
    /// What it can do.
    pub can: Vec<Ability>,
    /// The joints from the base up; with `joints` in `can`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<JointMessage>,
    /// Which chain the joints are, where known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmMessage>,
    /// The camera; with `image` in `can`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraMessage>,
    /// Depths that the sensor can measure, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_limits_m: Option<[f32; 2]>,
}

impl Hello {
    /// Whether the driver says that it can.
    pub fn can(&self, ability: Ability) -> bool {
        self.can.contains(&ability)
    }

    /// Whether it can move the arm in any way.
    pub fn can_move(&self) -> bool {
        self.can(Ability::MoveJoints) || self.can(Ability::MoveTip)
    }

    fn check(&self) -> Result<(), BadMessage> {
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

/// The robot at one instant, as the driver says it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StateMessage {
    /// On the driver's clock, seconds.
    pub stamp: f64,
    /// A value for each joint, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints_rad: Option<JointValues>,
    /// Where the flange is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_from_flange: Option<PoseMessage>,
    /// The tool that is set on the controller.
    #[serde(default, alias = "flange_from_tip", skip_serializing_if = "Option::is_none")]
    pub flange_from_tcp: Option<PoseMessage>,
    /// Where the TCP is.
    #[serde(default, alias = "base_from_tcp", skip_serializing_if = "Option::is_none")]
    pub base_from_tip: Option<PoseMessage>,
    /// Whether the controller moves the arm at this instant, where it says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<bool>,
}

/// How the bytes of an image are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImageEncoding {
    /// Three bytes a pixel: red, green, blue.
    Rgb8,
    /// Three bytes a pixel: blue, green, red.
    Bgr8,
    /// One byte a pixel.
    Mono8,
    /// A JPEG file.
    Jpeg,
    /// A PNG file.
    Png,
}

/// How the bytes of a depth image are to be read; row by row from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthEncoding {
    /// Unsigned 16 bits, little end first, millimetres; 0 where nothing was measured.
    U16Mm,
    /// Floats of 32 bits, little end first, metres; 0 or NaN where nothing was measured.
    F32M,
}

/// An image, without its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageMessage {
    /// Of the request that it answers.
    pub id: u64,
    /// Middle of the exposure on the driver's clock, seconds.
    pub stamp: f64,
    /// Half the interval that the instant lies in, seconds.
    #[serde(default)]
    pub stamp_uncertainty_s: f64,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// How the bytes are to be read.
    pub encoding: ImageEncoding,
    /// How many bytes follow.
    pub bytes: u64,
    /// The lens at this instant, where it changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<LensMessage>,
}

/// A depth image, without its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DepthMessage {
    /// Of the request that it answers.
    pub id: u64,
    /// On the driver's clock, seconds.
    pub stamp: f64,
    /// Width in pixels: that of the image.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// How the bytes are to be read.
    pub encoding: DepthEncoding,
    /// How many bytes follow.
    pub bytes: u64,
}

/// Answers a ping.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PongMessage {
    /// Of the ping.
    pub id: u64,
    /// The driver's clock while it answers, seconds.
    pub stamp: f64,
}

/// Answers a request by its number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnswerMessage {
    /// Of the request.
    pub id: u64,
    /// Why, for people; with `refused` and `stopped`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
}

/// How much a log line matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LogLevel {
    /// For the driver's author.
    Debug,
    /// Good to know.
    Info,
    /// Something does not work as it should.
    #[serde(alias = "warning")]
    Warn,
    /// Something does not work.
    Error,
}

/// A line for the log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogMessage {
    /// How much it matters.
    #[serde(default = "info")]
    pub level: LogLevel,
    /// What to show.
    pub text: String,
}

fn info() -> LogLevel {
    LogLevel::Info
}

/// What a driver sends. Bytes that follow a line are with whoever read them.
#[derive(Debug, Clone, PartialEq)]
pub enum FromDriver {
    /// Answers `hello`.
    Hello(Box<Hello>),
    /// Answers `ping`.
    Pong(PongMessage),
    /// Where the robot is; sent by itself.
    State(Box<StateMessage>),
    /// Answers `next_image`.
    Image(ImageMessage),
    /// Answers `next_image` with `depth`.
    Depth(DepthMessage),
    /// A motion begins.
    Accepted(AnswerMessage),
    /// What was asked for is done; after `move` and `stop` the arm is at rest.
    Done(AnswerMessage),
    /// A motion ended before its goal; the arm is at rest.
    Stopped(AnswerMessage),
    /// What was asked for is not begun.
    Refused(AnswerMessage),
    /// For the log.
    Log(LogMessage),
    /// The driver cannot go on and ends.
    Error(LogMessage),
    /// A type that this version does not know: ignored.
    Unknown(String),
}

/// What every message has.
#[derive(Debug, Deserialize)]
struct Header {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    bytes: u64,
}

impl FromDriver {
    /// Reads one line, with or without its end. Gives the message and the number of bytes that follow it.
    ///
    /// # Errors
    /// [`BadMessage`] says what is wrong with it.
    pub fn parse(line: &str) -> Result<(Self, u64), BadMessage> {
        // An array can be read as a struct too, and is none here.
        if !line.trim_start().starts_with('{') {
            return Err(if line.trim().is_empty() { BadMessage::Empty } else { BadMessage::Chatter });
        }
        let header: Header = serde_json::from_str(line).map_err(|error| not_a_message(line, &error))?;
        let kind = header.kind.as_str();
        let message = match kind {
            "hello" => Self::Hello(Box::new(body(kind, line)?)),
            "pong" => Self::Pong(body(kind, line)?),
            "state" => Self::State(Box::new(body(kind, line)?)),
            "image" => Self::Image(body(kind, line)?),
            "depth" => Self::Depth(body(kind, line)?),
            "accepted" => Self::Accepted(body(kind, line)?),
            "done" => Self::Done(body(kind, line)?),
            "stopped" => Self::Stopped(body(kind, line)?),
            "refused" => Self::Refused(body(kind, line)?),
            "log" => Self::Log(body(kind, line)?),
            "error" => Self::Error(body(kind, line)?),
            _ => Self::Unknown(header.kind),
        };
        message.check()?;
        let takes_bytes = matches!(message, Self::Image(_) | Self::Depth(_) | Self::Unknown(_));
        if header.bytes > 0 && !takes_bytes {
            return Err(BadMessage::value("bytes", "only image and depth are followed by bytes"));
        }
        Ok((message, header.bytes))
    }

    fn check(&self) -> Result<(), BadMessage> {
        match self {
            Self::Hello(hello) => hello.check(),
            Self::Image(image) => {
                check_size(image.width, image.height)?;
                if !(0.0..=10.0).contains(&image.stamp_uncertainty_s) {
                    let why = format!("{} is not between 0 and 10 s", image.stamp_uncertainty_s);
                    return Err(BadMessage::value("stamp_uncertainty_s", why));
                }
                if let Some(lens) = &image.intrinsics {
                    lens.intrinsics(image.width, image.height)?;
                }
                let pixels = u64::from(image.width) * u64::from(image.height);
                match image.encoding {
                    ImageEncoding::Rgb8 | ImageEncoding::Bgr8 => check_length(image.bytes, 3 * pixels),
                    ImageEncoding::Mono8 => check_length(image.bytes, pixels),
                    ImageEncoding::Jpeg | ImageEncoding::Png if image.bytes == 0 => {
                        Err(BadMessage::value("bytes", "an image file is not empty"))
                    }
                    ImageEncoding::Jpeg | ImageEncoding::Png => Ok(()),
                }
            }
            Self::Depth(depth) => {
                check_size(depth.width, depth.height)?;
                let pixels = u64::from(depth.width) * u64::from(depth.height);
                match depth.encoding {
                    DepthEncoding::U16Mm => check_length(depth.bytes, 2 * pixels),
                    DepthEncoding::F32M => check_length(depth.bytes, 4 * pixels),
                }
            }
            _ => Ok(()),
        }
    }
}

fn body<'a, T: Deserialize<'a>>(kind: &str, line: &'a str) -> Result<T, BadMessage> {
    serde_json::from_str(line).map_err(|error| BadMessage::Field { kind: kind.to_owned(), why: error.to_string() })
}

fn not_a_message(line: &str, error: &serde_json::Error) -> BadMessage {
    if error.is_data() {
        BadMessage::Field { kind: "message".to_owned(), why: error.to_string() }
    } else if line.contains("NaN") || line.contains("Infinity") {
        // What Python writes for numbers that are none.
        BadMessage::NotJson { why: format!("{error}: JSON has no NaN and no Infinity, leave the field out") }
    } else {
        BadMessage::NotJson { why: error.to_string() }
    }
}

fn check_size(width: u32, height: u32) -> Result<(), BadMessage> {
    let sides = 1..=MAX_IMAGE_SIDE;
    if sides.contains(&width) && sides.contains(&height) {
        return Ok(());
    }
    Err(BadMessage::value("width and height", format!("{width}×{height} is no size of an image")))
}

fn check_length(got: u64, need: u64) -> Result<(), BadMessage> {
    if got == need { Ok(()) } else { Err(BadMessage::Length { got, need }) }
}

/// What is wrong with a message of a driver. Whoever read it adds which line it was.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BadMessage {
    /// Nothing between two ends of lines.
    #[error("an empty line: each line is one message")]
    Empty,
    /// Text for people.
    #[error("not a message: standard output is for JSON messages alone, print to standard error")]
    Chatter,
    /// It begins like a message and is none.
    #[error("not JSON: {why}")]
    NotJson {
        /// What the parser says.
        why: String,
    },
    /// A field is missing or of another kind.
    #[error("{kind}: {why}")]
    Field {
        /// Type of the message.
        kind: String,
        /// What the parser says.
        why: String,
    },
    /// A field has a value that it cannot have.
    #[error("{field}: {why}")]
    Value {
        /// Which field.
        field: &'static str,
        /// What is wrong with it.
        why: String,
    },
    /// A transform is none.
    #[error("{field}: {why}")]
    Pose {
        /// Which field.
        field: &'static str,
        /// What is wrong with it.
        why: String,
    },
    /// The number of bytes does not go with size and encoding.
    #[error("bytes: {got}, where width, height and encoding make {need}")]
    Length {
        /// Said.
        got: u64,
        /// From size and encoding.
        need: u64,
    },
    /// Another version of the protocol.
    #[error("protocol: {got}, this workbench speaks {PROTOCOL}")]
    Protocol {
        /// What the driver speaks.
        got: u32,
    },
    /// An ability without what belongs to it.
    #[error("can: {ability} needs {needs}")]
    Needs {
        /// What the driver says that it can.
        ability: Ability,
        /// What is missing.
        needs: &'static str,
    },
}

impl BadMessage {
    pub(crate) fn value(field: &'static str, why: impl fmt::Display) -> Self {
        Self::Value { field, why: why.to_string() }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "message_tests.rs"]
mod tests;
