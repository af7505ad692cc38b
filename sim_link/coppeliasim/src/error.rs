//! What can go wrong between the workbench and a cell.

use std::time::Duration;

use handeye_arm::JointQuantity;

use super::cell::CellPart;
use super::convert::ConvertError;
use super::endpoint::{BadEndpoint, Endpoint};
use super::sim::SimulationState;
use handeye_wire::{MAX_MESSAGE_BYTES, MAX_REPLY_BYTES, WireError};
use handeye_wording::Text;
use handeye_wording::text;

/// Why a call, or a task made of calls, has no result. Each message states what to do next.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum LinkError {
    /// The address cannot be used.
    #[error(transparent)]
    BadEndpoint(#[from] BadEndpoint),
    /// The operating system or the socket library refused.
    #[error("no socket to {endpoint}: {reason}; check the address and the number of open files of this process")]
    Socket {
        /// The address.
        endpoint: String,
        /// The error of the library.
        reason: String,
    },
    /// Nothing that speaks ZeroMQ accepted a connection.
    #[error(
        "{call}: nothing answers at {endpoint} (waited {after:.1?}); start CoppeliaSim or the built-in cell, check that \
         the ZMQ remote API add-on is enabled and which port its status bar shows (usually 23000)"
    )]
    Unreachable {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// The address.
        endpoint: Endpoint,
        /// How long it waited.
        after: Duration,
    },
    /// The server accepted the connection but did not answer in time.
    #[error(
        "{call}: no answer for {after:.1?}; the simulator may be busy or show a dialog: look at its window, then try \
         again"
    )]
    Timeout {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// How long it waited.
        after: Duration,
    },
    /// The server answers, but no pass of the simulation begins although it runs.
    #[error(
        "the simulation has stood still for {after:.1?}: another client holds it, in stepping mode without a step or by a \
         lock; let that client go on or end it, then try again"
    )]
    Held {
        /// How long it waited.
        after: Duration,
    },
    /// The connection was lost while the call was under way; whether it had an effect is not known.
    #[error("{call}: the server went away during the call; start it again if it has stopped, then connect again")]
    Disconnected {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
    },
    /// The cell in this process did not answer in time.
    #[error("{call}: the built-in cell has not answered for {after:.1?}: this computer has too much to do; try again")]
    OwnCellSilent {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// How long it waited.
        after: Duration,
    },
    /// The cell in this process has ended before the program did.
    #[error(
        "{call}: the built-in cell has ended by a defect of this program: report it, with the lines above, and try again"
    )]
    OwnCellEnded {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
    },
    /// The caller cancelled.
    #[error("{call}: cancelled")]
    Cancelled {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
    },
    /// The server answered with an error.
    #[error("{call} failed in the simulator: {reported}", reported = without_place(message))]
    Remote {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// The server's text, verbatim.
        message: String,
    },
    /// The reply is not a message.
    #[error("{call}: the reply cannot be read: {source}; {advice}", advice = advice_on_bytes(*has_spoken))]
    Malformed {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// What is wrong with it.
        source: WireError,
        /// The server has sent messages that can be read.
        has_spoken: bool,
    },
    /// The reply is longer than anything that is read.
    #[error(
        "{call}: the reply {length}, over the limit of {limit} MiB; ask for less, for images by a lower resolution of the \
         sensor",
        length = length(bytes.as_ref()),
        limit = MAX_MESSAGE_BYTES >> 20
    )]
    ReplyTooLarge {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// Its length; `None` when it was too long to be read to its end.
        bytes: Option<usize>,
    },
    /// The reply is a message, but not one that the call can have.
    #[error("{call}: expected {expected}, got {got}; check that the simulator is CoppeliaSim 4.7 or newer")]
    UnexpectedReply {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// What was expected.
        expected: String,
        /// What was received.
        got: String,
    },
    /// The reply has the right shape but an invalid value.
    #[error("{call}: {source}; check the object in the scene")]
    BadValue {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// What is wrong with it.
        source: ConvertError,
    },
    /// The server is older than everything that is supported.
    #[error("this is CoppeliaSim {version}, and 4.7 or newer is needed: update CoppeliaSim", version = too_old(*version))]
    TooOld {
        /// Its version, 40600 is 4.6.0; `None` for a server with the protocol that ended with 4.5.
        version: Option<i64>,
    },
    /// The server lacks the call.
    #[error("{call} is not available on this server: it needs {needs}")]
    Unsupported {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// The server that has the call.
        needs: &'static str,
    },
    /// The scene lacks an object.
    #[error(
        "the scene has no {path} ({what}){listed}: open the cell's scene, or say where this one has it by the object path \"{key}\"",
        what = part.what(),
        listed = listed(*part, there),
        key = part.key()
    )]
    NoSuchObject {
        /// The requested path.
        path: String,
        /// The part of the cell that was looked for at that path.
        part: CellPart,
        /// Paths of objects of that kind that the scene has.
        there: Vec<String>,
    },
    /// An arm with more joints than are driven.
    #[error(
        "{count} joints carry the tip and at most {most} are driven; set the object path \"arm\" to the object that its first \
         joint hangs on",
        most = handeye_arm::MAX_JOINTS
    )]
    TooManyJoints {
        /// Joints between base and tip.
        count: usize,
    },
    /// A joint without an axis.
    #[error(
        "joint {joint} of the arm, counted from its base, is spherical: revolute and prismatic joints are driven; replace \
         it in the scene by three revolute ones"
    )]
    SphericalJoint {
        /// Counted from 1 at the base.
        joint: usize,
    },
    /// The server answers, but what a task waits for does not come.
    #[error(
        "{task}: waited {after:.1?} for {awaited} without success; look at the simulator, and start the simulation again if its \
         time does not go on"
    )]
    WaitedTooLong {
        /// The requested task.
        task: &'static str,
        /// What it waited for.
        awaited: String,
        /// How long, in real time.
        after: Duration,
    },
    /// The simulation does not run, so nothing would move and no image would be new.
    #[error("{task}: the simulation is {state}", state = standing(*state))]
    NotRunning {
        /// The requested task.
        task: &'static str,
        /// Paused or stopped.
        state: SimulationState,
    },
    /// A joint cannot go there; the simulator would clamp it without a word.
    #[error("joint {joint} cannot go to {goal:.2}: its range is {min:.1} to {max:.1}")]
    JointOutOfRange {
        /// Which joint, counted from 1 at the base.
        joint: usize,
        /// Its goal.
        goal: JointQuantity,
        /// Lower end of its range.
        min: JointQuantity,
        /// Upper end of its range.
        max: JointQuantity,
    },
    /// A goal for another number of joints.
    #[error("{got} joint values for an arm of {need} joints: the goal was taught for another arm")]
    JointCount {
        /// Values given.
        got: usize,
        /// Joints of the arm.
        need: usize,
    },
    /// A goal or a limit of a motion is not usable.
    #[error("{what} of a motion must be {expected}, got {value}")]
    BadMotion {
        /// Which quantity.
        what: &'static str,
        /// What it must be.
        expected: &'static str,
        /// The number that was given.
        value: f64,
    },
    /// The simulator gave the motion up.
    #[error(
        "{call}: the simulator stopped the motion with code {code}; check the limits of velocity, acceleration, jerk"
    )]
    MotionFailed {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
        /// Result of the motion generator.
        code: i64,
    },
    /// The server has no record of this client, or of a motion that it was taking step by step.
    #[error(
        "{call}: the server has forgotten this client, as it does with one that was silent for too long, for example \
         because its computer slept; an arm that it was moving stands where it was: move again"
    )]
    Forgotten {
        /// The call of the remote API, for example `sim.getObject`.
        call: String,
    },
    /// Somebody else stopped the motion, and the arm is at rest.
    #[error("{task}: the motion was stopped on its way, perhaps by another client; move again when it is clear")]
    MotionStopped {
        /// The requested task.
        task: &'static str,
    },
    /// A joint is not where a motion has put it.
    #[error(
        "joint {joint} stands at {at:.3} instead of {goal:.3}: another client or a script of the scene moves or \
         holds it; end that, or start the simulation again"
    )]
    JointElsewhere {
        /// Which joint, counted from 1 at the base.
        joint: usize,
        /// Its position.
        at: JointQuantity,
        /// Its goal.
        goal: JointQuantity,
    },
    /// The arm would come nearer to something on its way than it may; nothing was moved.
    #[error("nothing was moved: {contact}")]
    InTheWay {
        /// The contact that the motion would cause.
        contact: handeye_plan::Contact,
    },
    /// No motion fits the limits.
    #[error("no motion fits these limits of velocity, acceleration and jerk: {reason}")]
    NoProfile {
        /// What is wrong with them.
        reason: String,
    },
    /// The motion ended elsewhere; inverse kinematics failing is not an error for the simulator.
    #[error(
        "the tip stopped {distance_mm:.2} mm and {angle_deg:.2}° from its goal, which may be out of reach: choose \
         another pose, or go there joint by joint"
    )]
    Unreached {
        /// From the goal.
        distance_mm: f64,
        /// From the goal.
        angle_deg: f64,
    },
    /// The arm did not come to rest.
    #[error("the arm still moves by {rate:.3}/s after {after_s:.2} s of simulation; wait longer or check the scene")]
    NotSettled {
        /// Simulated time waited.
        after_s: f64,
        /// Speed of the fastest joint, per second.
        rate: JointQuantity,
    },
    /// Image and pose could not be had for one and the same instant.
    #[error(
        "another client moved the arm while a frame was read, {attempts} times in a row; end what it does, or try again \
         when it is done"
    )]
    MixedInstants {
        /// Number of attempts.
        attempts: u32,
    },
    /// The ground truth that the cell publishes cannot be read.
    #[error("the cell publishes a ground truth that cannot be read: {reason}")]
    BadTruth {
        /// What is wrong with it.
        reason: String,
    },
}

impl LinkError {
    /// Whether the conversation itself broke, so that nothing is known about the server's state: worth a new try or a
    /// reconnection, in contrast to a refusal.
    pub fn is_connection_loss(&self) -> bool {
        matches!(
            self,
            Self::Unreachable { .. }
                | Self::Timeout { .. }
                | Self::Disconnected { .. }
                | Self::OwnCellSilent { .. }
                | Self::OwnCellEnded { .. }
                | Self::Cancelled { .. }
                | Self::Malformed { .. }
                | Self::Socket { .. }
        )
    }

    /// Whether the server reported that the scene has no such object.
    pub(crate) fn is_missing_object(&self) -> bool {
        matches!(self, Self::Remote { message, .. } if message.to_lowercase().contains(super::protocol::NO_SUCH_OBJECT))
    }

    /// The same error, or [`Self::Forgotten`] when it is a server's answer to a step of a motion that it does not
    /// know.
    pub(super) fn of_motion_step(self) -> Self {
        match self {
            // Servers name the object that they keep a motion in.
            Self::Remote { call, message } if message.to_ascii_lowercase().contains("ruckig") => {
                tracing::debug!(call, message, "a motion was forgotten");
                Self::Forgotten { call }
            }
            other => other,
        }
    }

    /// Whether the server reported that it has no such function.
    pub(crate) fn is_unknown_function(&self) -> bool {
        matches!(self, Self::Remote { message, .. } if message.contains(super::protocol::UNKNOWN_FUNCTION))
    }
}

/// A Lua error message without the line of the server's code that raised it, as in `lua/motion.lua:17: missing field`
/// or `939: in sim.getObject: …`. That line does not help the user.
fn without_place(message: &str) -> &str {
    let Some((place, what)) = message.split_once(": ") else { return message };
    let line = place.rsplit(':').next().unwrap_or(place);
    let is_line = !line.is_empty() && line.bytes().all(|byte| byte.is_ascii_digit());
    if is_line { what } else { message }
}

/// The objects of that kind in the scene.
fn listed(part: CellPart, there: &[String]) -> Text {
    if there.is_empty() {
        return Text::default();
    }
    text!("; its {kind} are {there}", kind = part.kind().1, there = there.join(", "))
}

/// The version of a server that is too old.
fn too_old(version: Option<i64>) -> Text {
    match version {
        Some(version) => Text::verbatim(version_name(version)),
        None => text!("4.5 or older"),
    }
}

/// A version as text: 41000 is 4.10.0.
pub fn version_name(version: i64) -> String {
    format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
}

fn standing(state: SimulationState) -> Text {
    match state {
        SimulationState::Paused => text!("paused; continue it first"),
        SimulationState::Stopped | SimulationState::Running => text!("stopped; start it first"),
    }
}

fn advice_on_bytes(has_spoken: bool) -> Text {
    if has_spoken {
        text!(
            "the server has broken it off: CoppeliaSim's remote API does so with some maps; try again, and if it comes back \
             report the call to the maker of the server"
        )
    } else {
        text!("is this the port of the ZMQ remote API (usually 23000)?")
    }
}

fn length(bytes: Option<&usize>) -> Text {
    match bytes {
        Some(bytes) => text!("has {bytes} bytes", bytes = bytes),
        None => text!("has more than {limit} MiB, or breaks the rules of ZeroMQ", limit = MAX_REPLY_BYTES >> 20),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_said_without_the_line_of_the_servers_code_and_recognized_with_and_without_it() {
        let reported = |message: &str| {
            let error = LinkError::Remote { call: "sim.f".to_owned(), message: message.to_owned() };
            (error.to_string(), error.is_missing_object())
        };
        let missing = "in sim.getObject: Object does not exist. (on argument 1)";
        for place in
            ["", "939: ", "/opt/sim/lua/motion.lua:17: ", "C:\\sim\\lua\\motion.lua:17: ", "[string \"x\"]:354: "]
        {
            assert_eq!(
                reported(&format!("{place}{missing}")),
                (format!("sim.f failed in the simulator: {missing}"), true)
            );
        }
        for whole in ["joint 3: out of range", "17", "", ": x"] {
            assert_eq!(reported(whole), (format!("sim.f failed in the simulator: {whole}"), false));
        }
    }
}
