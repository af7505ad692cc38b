//! The state of a connection to a driver, and what each message does to it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use handeye_arm::Arm;

use super::chain;
use super::clock::ClockOffset;
use super::error::Ending;
use super::log::LogLines;
use super::message::{
    Ability, AnswerMessage, DepthMessage, DisarmedMessage, FromDriver, Hello, ImageMessage, LogLevel, LogMessage,
    PongMessage, PreparingMessage, StateMessage,
};
use super::placement::ChainWatch;
use super::states::{Reading, States};
use super::wire::WireProblem;

/// Unknown types of messages that are named in the log.
const MOST_UNKNOWN: usize = 32;

/// A stamp of a state or an image is not later than that of the next pong by more than this \[s\]: a possible step of a clock, and
/// the delay between threads of a driver.
const MOST_AHEAD_S: f64 = 1.0;

/// State of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Progress {
    /// On its way.
    Sent,
    /// Nobody waits for it any longer.
    Abandoned,
    /// The motion has begun.
    Accepted,
    Done,
    /// The motion ended elsewhere, and why.
    Stopped(String),
    /// It is not begun, and why.
    Refused(String),
}

/// How a driver ended once it was asked to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DriverExit {
    /// The process ended by itself.
    Ended {
        /// In the words of the system.
        status: String,
        /// Whether its exit status is 0.
        is_success: bool,
    },
    /// The process had to be killed.
    Killed,
    /// It closed its end of the connection.
    Closed,
    /// It did not close its end.
    LeftOpen,
}

/// A requested image, and its received parts.
#[derive(Debug)]
pub struct FrameRequest {
    pub id: u64,
    pub after: Option<f64>,
    pub depth_wanted: bool,
    pub image: Option<(ImageMessage, Vec<u8>)>,
    pub depth: Option<(DepthMessage, Vec<u8>)>,
    pub refused: Option<String>,
}

impl FrameRequest {
    /// Whether there is nothing more to wait for.
    pub fn is_answered(&self) -> bool {
        self.refused.is_some() || (self.image.is_some() && (self.depth.is_some() || !self.depth_wanted))
    }
}

/// Which outputs have been read to their end.
#[derive(Debug, Clone, Copy, Default)]
pub struct DrainedOutput {
    /// Standard output.
    pub output: bool,
    /// Standard error.
    pub errors: bool,
}

/// What a conformance run does differently from the workbench, to test the driver's reaction.
#[derive(Debug, Clone, Copy, Default)]
pub struct Trial {
    /// No pings are sent.
    pub is_quiet: bool,
    /// The connection is closed without `bye`.
    pub leaves_without_bye: bool,
}

/// The state of a connection.
#[derive(Debug, Default)]
pub struct Inner {
    pub hello: Option<Arc<Hello>>,
    pub arm: Option<Arc<Arm>>,
    /// Placement of the chain by the states.
    pub chain: ChainWatch,
    /// Number of `preparing` messages.
    pub preparations: u64,
    /// Why it is over.
    pub ending: Option<Ending>,
    pub read_up: DrainedOutput,
    pub clock: ClockOffset,
    /// Pings under way, with when they left.
    pub pings: VecDeque<(u64, f64)>,
    /// When the newest pong came, and its stamp.
    pub last_pong: Option<(f64, f64)>,
    /// Number of pongs.
    pub pongs: u64,
    /// Number of states.
    pub state_count: u64,
    /// When the last pong came, or the hello.
    pub last_heard_s: f64,
    pub states: States,
    /// The stamp of the newest image.
    pub newest_image: Option<f64>,
    pub frame: Option<FrameRequest>,
    pub requests: BTreeMap<u64, Progress>,
    pub last_id: u64,
    pub is_armed: bool,
    /// The request whose answer arms it: what is reported after that answer may take it back at once.
    pub arming: Option<u64>,
    /// Why it is no longer armed, where the driver has reported that.
    pub disarmed: Option<String>,
    pub is_moving: bool,
    pub log: LogLines,
    pub trial: Trial,
    /// How the driver ended once the connection was over.
    pub burial: Option<DriverExit>,
    unknown: BTreeSet<String>,
}

fn misplaced(why: impl Into<String>) -> WireProblem {
    WireProblem::Conversation(why.into())
}

impl Inner {
    /// Takes in a message.
    ///
    /// # Errors
    /// [`WireProblem`] for a message in the wrong place.
    pub fn take(&mut self, message: FromDriver, bytes: Vec<u8>, arrived_s: f64) -> Result<(), WireProblem> {
        let is_early = self.hello.is_none();
        match message {
            FromDriver::Hello(hello) => self.take_hello(*hello, arrived_s),
            FromDriver::Preparing(PreparingMessage { text }) => {
                if self.preparations == 0 {
                    self.log.add(LogLevel::Info, false, &text);
                }
                self.preparations += 1;
                Ok(())
            }
            FromDriver::Log(LogMessage { level, text }) => {
                self.log.add(level, false, &text);
                Ok(())
            }
            FromDriver::Error(LogMessage { text, .. }) => {
                self.log.add(LogLevel::Error, false, &text);
                self.ending.get_or_insert(Ending::GaveUp(text));
                Ok(())
            }
            FromDriver::Unknown(kind) => {
                if self.unknown.len() < MOST_UNKNOWN && !self.unknown.contains(&kind) {
                    self.log.add(LogLevel::Debug, false, &format!("messages of type {kind} are not known and ignored"));
                    self.unknown.insert(kind);
                }
                Ok(())
            }
            _ if is_early => Err(misplaced("only hello, log and error come before hello")),
            FromDriver::Disarmed(DisarmedMessage { why }) => {
                self.is_armed = false;
                self.log.add(LogLevel::Warn, false, &format!("the arm may no longer be moved: {why}"));
                self.disarmed = Some(why);
                Ok(())
            }
            FromDriver::Pong(pong) => self.take_pong(pong, arrived_s),
            FromDriver::State(state) => self.take_state(&state),
            FromDriver::Image(image) => self.take_image(image, bytes),
            FromDriver::Depth(depth) => self.take_depth(depth, bytes),
            FromDriver::Accepted(answer) => self.take_answer(answer, |_| Progress::Accepted),
            FromDriver::Done(answer) => {
                if self.arming == Some(answer.id) {
                    (self.is_armed, self.disarmed, self.arming) = (true, None, None);
                }
                self.take_answer(answer, |_| Progress::Done)
            }
            FromDriver::Stopped(answer) => self.take_answer(answer, Progress::Stopped),
            FromDriver::Refused(answer) => match &mut self.frame {
                Some(frame) if frame.id == answer.id => {
                    frame.refused = Some(answer.why);
                    Ok(())
                }
                _ => self.take_answer(answer, Progress::Refused),
            },
        }
    }

    fn take_hello(&mut self, hello: Hello, arrived_s: f64) -> Result<(), WireProblem> {
        if self.hello.is_some() {
            return Err(misplaced("a second hello"));
        }
        let wrong = |why| misplaced(format!("arm: {why}"));
        let arm = chain::arm_of(&hello).map_err(wrong)?;
        self.chain = ChainWatch::new(&hello, arm.as_ref()).map_err(wrong)?;
        self.arm = arm.map(|arm| Arc::new(self.chain.placed(arm)));
        self.hello = Some(Arc::new(hello));
        self.last_heard_s = arrived_s;
        Ok(())
    }

    fn take_pong(&mut self, pong: PongMessage, arrived_s: f64) -> Result<(), WireProblem> {
        let sent = self.pings.iter().position(|(id, _)| *id == pong.id);
        let Some(position) = sent else {
            return Err(misplaced(format!("id {} is of no ping that waits for an answer", pong.id)));
        };
        let newest = [self.states.newest().map(|reading| reading.stamp_s), self.newest_image];
        for (kind, stamp) in ["state", "image"].into_iter().zip(newest) {
            // What came before the pong was stamped before it.
            if let Some(ahead_s) = stamp.map(|stamp| stamp - pong.stamp).filter(|ahead_s| *ahead_s > MOST_AHEAD_S) {
                return Err(misplaced(format!(
                    "the newest {kind} is stamped {ahead_s:.1} s later than this pong, which came after it: all stamps of a driver are \
                     of one clock"
                )));
            }
        }
        let (_, left_s) = self.pings[position];
        self.pings.remove(position);
        self.clock.add(left_s, arrived_s, pong.stamp);
        self.last_pong = Some((arrived_s, pong.stamp));
        self.pongs += 1;
        self.last_heard_s = arrived_s;
        Ok(())
    }

    fn take_state(&mut self, state: &StateMessage) -> Result<(), WireProblem> {
        let joints = self.can(Ability::Joints).map_or(0, |hello| hello.joints.len());
        if self.can(Ability::State).is_none() {
            return Err(misplaced("a state without `state` in `can`"));
        }
        let reading = Reading::of(state, joints, self.arm.as_deref())?;
        self.states.add(reading)?;
        self.chain.take(state, &reading);
        self.state_count += 1;
        Ok(())
    }

    fn can(&self, ability: Ability) -> Option<&Hello> {
        self.hello.as_deref().filter(|hello| hello.can(ability))
    }

    fn take_image(&mut self, image: ImageMessage, bytes: Vec<u8>) -> Result<(), WireProblem> {
        self.check_size(image.width, image.height)?;
        let frame = self.frame.as_mut().filter(|frame| frame.id == image.id && frame.image.is_none());
        let Some(frame) = frame else { return Err(misplaced(format!("id {} asks for no image", image.id))) };
        if frame.after.is_some_and(|after| image.stamp <= after) {
            return Err(misplaced(format!("stamp {} is not after {}", image.stamp, frame.after.unwrap_or_default())));
        }
        self.newest_image = Some(image.stamp);
        frame.image = Some((image, bytes));
        Ok(())
    }

    fn take_depth(&mut self, depth: DepthMessage, bytes: Vec<u8>) -> Result<(), WireProblem> {
        self.check_size(depth.width, depth.height)?;
        let frame = self.frame.as_mut();
        let frame = frame.filter(|frame| frame.id == depth.id && frame.depth_wanted && frame.depth.is_none());
        let Some(frame) = frame else { return Err(misplaced(format!("id {} asks for no depth", depth.id))) };
        frame.depth = Some((depth, bytes));
        Ok(())
    }

    fn check_size(&self, width: u32, height: u32) -> Result<(), WireProblem> {
        match self.hello.as_ref().and_then(|hello| hello.camera) {
            Some(camera) if (camera.width, camera.height) == (width, height) => Ok(()),
            Some(camera) => {
                let reported = format!("{}×{}", camera.width, camera.height);
                Err(misplaced(format!("it is {width}×{height} and the camera of hello {reported}")))
            }
            None => Err(misplaced("an image without `camera` in hello")),
        }
    }

    fn take_answer(
        &mut self,
        AnswerMessage { id, why }: AnswerMessage,
        progress: impl FnOnce(String) -> Progress,
    ) -> Result<(), WireProblem> {
        match self.requests.get_mut(&id) {
            None => Err(misplaced(format!("id {id} is of no request that waits for an answer"))),
            Some(Progress::Abandoned) => {
                let progress = progress(why);
                if progress != Progress::Accepted {
                    self.requests.remove(&id);
                }
                Ok(())
            }
            Some(slot) => {
                *slot = progress(why);
                Ok(())
            }
        }
    }

    /// When the last pong or the hello came; `None` before the hello.
    pub fn heard_s(&self) -> Option<f64> {
        self.hello.as_ref().map(|_| self.last_heard_s)
    }

    /// Takes a finished request out; `None` while it is under way.
    pub fn finished(&mut self, id: u64) -> Option<Progress> {
        match self.requests.get(&id) {
            None => Some(Progress::Abandoned),
            Some(Progress::Done | Progress::Stopped(_) | Progress::Refused(_)) => self.requests.remove(&id),
            Some(Progress::Sent | Progress::Accepted | Progress::Abandoned) => None,
        }
    }

    /// Nobody waits for this one any longer.
    pub fn abandon(&mut self, id: u64) {
        if let Some(slot) = self.requests.get_mut(&id) {
            *slot = Progress::Abandoned;
        }
    }
}
