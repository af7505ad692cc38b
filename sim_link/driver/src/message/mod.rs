//! The messages of the driver protocol, in both directions: `docs/drivers.md` describes them, this is their form in Rust.
//!
//! What a driver sends is checked here once, so that no other module gets a number that is not finite, a quaternion that
//! is not a rotation, or an unknown encoding.

mod error;
mod hello;
mod images;
mod robot;

use handeye_arm::JointValues;
use serde::{Deserialize, Serialize};

pub use error::BadMessage;
pub use hello::{Ability, ArmMessage, CameraMessage, Hello, JointMessage, LensMessage};
pub use images::{DepthEncoding, DepthMessage, ImageEncoding, ImageMessage, MAX_IMAGE_SIDE};
pub use robot::{PoseMessage, StateMessage};

/// The version of the protocol of this program.
pub const PROTOCOL: u32 = 1;
/// Longest text of the parser that is shown, in characters.
const LONGEST_MESSAGE: usize = 300;

/// A message of the workbench.
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
        /// Whether the depth image of the same instant is requested too.
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
        /// Goal as joint values; one of the two is given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joints_rad: Option<JointValues>,
        /// Goal as a pose of the tip.
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
/// Answers a ping.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PongMessage {
    /// Id of the ping.
    pub id: u64,
    /// The driver's clock while it answers, seconds.
    pub stamp: f64,
}

/// Answers a request by its number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnswerMessage {
    /// Id of the request.
    pub id: u64,
    /// Why, for people; with `refused` and `stopped`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
}

/// The driver has disarmed itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DisarmedMessage {
    /// Why, for people.
    pub why: String,
}

/// Severity of a log line.
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
    /// Severity.
    #[serde(default = "info")]
    pub level: LogLevel,
    /// The text to show.
    pub text: String,
}

fn info() -> LogLevel {
    LogLevel::Info
}

/// Before `hello`: what the driver needs is being fetched or made, which takes long.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PreparingMessage {
    /// What is being done, for people.
    pub text: String,
}

/// What a driver sends. Bytes that follow a line are returned by the reader.
#[derive(Debug, Clone, PartialEq)]
pub enum FromDriver {
    /// Answers `hello`.
    Hello(Box<Hello>),
    /// Answers `ping`.
    Pong(PongMessage),
    /// State of the robot; sent without a request.
    State(Box<StateMessage>),
    /// Answers `next_image`.
    Image(ImageMessage),
    /// Answers `next_image` with `depth`.
    Depth(DepthMessage),
    /// A motion begins.
    Accepted(AnswerMessage),
    /// A request is done; after `move` and `stop` the arm is at rest.
    Done(AnswerMessage),
    /// A motion ended before its goal; the arm is at rest.
    Stopped(AnswerMessage),
    /// A request is refused and was not begun.
    Refused(AnswerMessage),
    /// The driver no longer moves the arm, by itself.
    Disarmed(DisarmedMessage),
    /// `hello` comes later.
    Preparing(PreparingMessage),
    /// A line for the log.
    Log(LogMessage),
    /// The driver cannot go on and ends.
    Error(LogMessage),
    /// A type that this version does not know: ignored.
    Unknown(String),
}

/// The fields of every message.
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
    /// [`BadMessage`] with what is wrong.
    pub fn parse(line: &str) -> Result<(Self, u64), BadMessage> {
        // An array can be read as a struct too, but is not valid here.
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
            "disarmed" => Self::Disarmed(body(kind, line)?),
            "preparing" => Self::Preparing(body(kind, line)?),
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
            Self::Image(image) => image.check(),
            Self::Depth(depth) => depth.check(),
            _ => Ok(()),
        }
    }
}

fn body<'a, T: Deserialize<'a>>(kind: &str, line: &'a str) -> Result<T, BadMessage> {
    serde_json::from_str(line).map_err(|error| BadMessage::Field { kind: kind.to_owned(), why: error_text(&error) })
}

/// The error of the parser, which may repeat the driver's text: on one line and truncated.
fn error_text(error: &serde_json::Error) -> String {
    let one_line = |c: char| if c.is_control() { ' ' } else { c };
    error.to_string().chars().map(one_line).take(LONGEST_MESSAGE).collect()
}

fn not_a_message(line: &str, error: &serde_json::Error) -> BadMessage {
    if error.is_data() {
        BadMessage::Field { kind: "message".to_owned(), why: error_text(error) }
    } else if line.contains("NaN") || line.contains("Infinity") {
        // Python's notation for numbers that are not finite.
        BadMessage::NotJson {
            why: format!("{}: JSON has no NaN and no Infinity, leave the field out", error_text(error)),
        }
    } else {
        BadMessage::NotJson { why: error_text(error) }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "message_tests.rs"]
mod tests;
