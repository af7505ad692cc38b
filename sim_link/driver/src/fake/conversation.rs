//! One conversation of the fake driver: a thread reads, one reports states, one takes images, one moves.

use std::io::{BufRead, Read, Write};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use serde::Serialize;

use super::super::message::{
    Ability, AnswerMessage, DepthEncoding, DepthMessage, DisarmedMessage, ImageEncoding, ImageMessage, JointMessage,
    LogLevel, LogMessage, PongMessage, PoseMessage, StateMessage, ToDriver,
};
use super::super::motion::Goal;
use super::super::wire::MAX_LINE;
use super::{Fake, FakeError};
use handeye_coppeliasim::cell::{Arm, Frame, MotionTolerance};
use handeye_coppeliasim::{LinkError, MotionLimits};

/// Interval at which states are read: several times a pass.
const LOOK: Duration = Duration::from_millis(5);
/// A workbench that is silent for this long is gone.
const SILENCE: Duration = Duration::from_secs(1);
/// The highest speed of a joint \[rad/s\], its acceleration and its jerk; those of the tip \[m/s, rad/s\].
const JOINT: [f64; 3] = [1.5, 3.0, 15.0];
const TIP: [[f64; 4]; 3] = [[0.25, 0.25, 0.25, 0.8], [0.5, 0.5, 0.5, 1.6], [2.5, 2.5, 2.5, 8.0]];

/// A message of the driver for the wire.
#[derive(Serialize)]
struct Typed<'a, T> {
    #[serde(rename = "type")]
    kind: &'a str,
    #[serde(flatten)]
    message: &'a T,
}

/// A motion that was accepted.
#[derive(Debug, Clone)]
struct Motion {
    id: u64,
    goal: Goal,
    speed: f64,
    cancel: CancelToken,
}

/// A requested image.
#[derive(Debug, Clone, Copy)]
struct Wanted {
    id: u64,
    after: Option<f64>,
    depth: bool,
}

/// A request under way.
#[derive(Debug)]
struct Asked {
    heard: Instant,
    is_greeted: bool,
    is_armed: bool,
    has_ended: bool,
    wanted: Option<Wanted>,
    motion: Option<Motion>,
    /// Requests that are done once the arm is at rest.
    at_rest: Vec<u64>,
}

/// One conversation.
pub struct Conversation<'a, W> {
    fake: &'a Fake,
    output: Mutex<W>,
    asked: Mutex<Asked>,
    changed: Condvar,
}

impl<'a, W: Write + Send> Conversation<'a, W> {
    pub fn new(fake: &'a Fake, output: W) -> Self {
        let asked = Asked {
            heard: Instant::now(),
            is_greeted: false,
            is_armed: false,
            has_ended: false,
            wanted: None,
            motion: None,
            at_rest: Vec::new(),
        };
        Self { fake, output: Mutex::new(output), asked: Mutex::new(asked), changed: Condvar::new() }
    }

    /// Until the workbench leaves.
    pub fn run(&self, input: impl BufRead) -> Result<(), FakeError> {
        std::thread::scope(|scope| {
            let states = scope.spawn(|| self.ended_by(self.report()));
            let images = scope.spawn(|| self.ended_by(self.look()));
            let motions = scope.spawn(|| self.ended_by(self.go()));
            let heard = self.hear(input);
            self.end();
            let threads = [states, images, motions].map(|thread| thread.join().unwrap_or(Ok(())));
            threads.into_iter().fold(heard, Result::and)
        })
    }

    fn lock(&self) -> MutexGuard<'_, Asked> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self) {
        let mut asked = self.lock();
        asked.has_ended = true;
        if let Some(motion) = &asked.motion {
            motion.cancel.cancel();
        }
        self.changed.notify_all();
    }

    /// A thread that cannot go on ends the conversation.
    fn ended_by(&self, result: Result<(), FakeError>) -> Result<(), FakeError> {
        if let Err(error) = &result {
            if !matches!(error, FakeError::Output(_)) {
                let message = LogMessage { level: LogLevel::Error, text: error.to_string() };
                let _unheard = self.send("error", &message, &[]).is_err();
            }
            self.end();
        }
        result
    }

    fn send(&self, kind: &str, message: &impl Serialize, bytes: &[&[u8]]) -> Result<(), FakeError> {
        let invalid = |error| FakeError::Output(std::io::Error::other(error));
        let mut line = serde_json::to_vec(&Typed { kind, message }).map_err(invalid)?;
        line.push(b'\n');
        let mut output = self.output.lock().unwrap_or_else(PoisonError::into_inner);
        let mut write = || {
            output.write_all(&line)?;
            bytes.iter().try_for_each(|bytes| output.write_all(bytes))?;
            output.flush()
        };
        write().map_err(FakeError::Output)
    }

    fn answer(&self, kind: &str, id: u64, why: &str) -> Result<(), FakeError> {
        self.send(kind, &AnswerMessage { id, why: why.to_owned() }, &[])
    }

    fn stamps(&self) -> MutexGuard<'a, super::Stamps> {
        self.fake.stamps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn can(&self, ability: Ability) -> bool {
        self.fake.hello.can(ability)
    }

    fn hear(&self, mut input: impl BufRead) -> Result<(), FakeError> {
        let mut line = Vec::new();
        loop {
            line.clear();
            let limit = MAX_LINE as u64;
            let read = input.by_ref().take(limit).read_until(b'\n', &mut line);
            if !matches!(read, Ok(1..)) || self.lock().has_ended {
                return Ok(());
            }
            self.lock().heard = Instant::now();
            // Messages of a later version are ignored.
            let Ok(message) = serde_json::from_slice::<ToDriver>(&line) else { continue };
            if message == (ToDriver::Bye {}) {
                return Ok(());
            }
            self.obey(&message)?;
        }
    }

    fn obey(&self, message: &ToDriver) -> Result<(), FakeError> {
        match *message {
            ToDriver::Hello { .. } => {
                self.send("hello", &self.fake.hello, &[])?;
                self.lock().is_greeted = true;
                self.changed.notify_all();
                Ok(())
            }
            ToDriver::Ping { id } => {
                let stamp = self.stamps().now_s();
                self.send("pong", &PongMessage { id, stamp }, &[])
            }
            ToDriver::NextImage { id, .. } if !self.can(Ability::Image) => {
                self.answer("refused", id, "there is no camera")
            }
            ToDriver::NextImage { id, after, depth } => {
                self.lock().wanted = Some(Wanted { id, after, depth });
                self.changed.notify_all();
                Ok(())
            }
            ToDriver::Arm { id, on: true } => {
                self.lock().is_armed = self.can(Ability::MoveJoints);
                self.answer("done", id, "")
            }
            ToDriver::Arm { id, on: false } => {
                self.lock().is_armed = false;
                self.rest(id)
            }
            ToDriver::Stop { id } => self.rest(id),
            ToDriver::Move { id, ref joints_rad, ref base_from_tip, speed } => {
                let tip = base_from_tip.map(|pose| pose.pose("base_from_tip").map(Goal::Tip)).transpose();
                match tip {
                    Ok(tip) => self.begin(id, joints_rad.map(Goal::Joints).or(tip), speed),
                    Err(bad) => self.answer("refused", id, &bad.to_string()),
                }
            }
            ToDriver::Bye {} => Ok(()),
        }
    }

    /// Brakes; `done` comes once the arm is at rest.
    fn rest(&self, id: u64) -> Result<(), FakeError> {
        {
            let mut asked = self.lock();
            if let Some(motion) = &asked.motion {
                motion.cancel.cancel();
                asked.at_rest.push(id);
                return Ok(());
            }
        }
        self.answer("done", id, "")
    }

    fn begin(&self, id: u64, goal: Option<Goal>, speed: f64) -> Result<(), FakeError> {
        let mut asked = self.lock();
        let why = match goal {
            _ if !asked.is_armed => "it is read-only until it is armed",
            _ if asked.motion.is_some() => "the arm moves already",
            None => "a motion needs joints_rad or base_from_tip",
            Some(_) if !(speed > 0.0 && speed <= 1.0) => "the speed is not over 0 and up to 1",
            Some(Goal::Joints(joints)) if !self.is_in_range(&joints) => "a joint would leave its range",
            Some(goal) => {
                asked.motion = Some(Motion { id, goal, speed, cancel: CancelToken::default() });
                // While it is locked: the thread that moves must not be done before it has begun.
                let accepted = self.answer("accepted", id, "");
                self.changed.notify_all();
                return accepted;
            }
        };
        drop(asked);
        self.answer("refused", id, why)
    }

    fn is_in_range(&self, values: &[f64]) -> bool {
        let joints = &self.fake.hello.joints;
        let is_within = |(joint, &value): (&JointMessage, &f64)| {
            joint.min.is_none_or(|min| value >= min) && joint.max.is_none_or(|max| value <= max)
        };
        joints.len() == values.len() && joints.iter().zip(values).all(is_within)
    }

    /// Waits for a request; `None` at the end of the conversation.
    fn next<T>(&self, mut find: impl FnMut(&mut Asked) -> Option<T>) -> Option<T> {
        let mut asked = self.lock();
        loop {
            if asked.has_ended {
                return None;
            }
            if let Some(found) = find(&mut asked) {
                return Some(found);
            }
            asked = self.changed.wait(asked).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// States, and what the workbench's silence means.
    fn report(&self) -> Result<(), FakeError> {
        let mut camera = self.fake.camera()?;
        let mut last_s = f64::NEG_INFINITY;
        if self.next(|asked| asked.is_greeted.then_some(())).is_none() {
            return Ok(());
        }
        loop {
            let mut was_armed = false;
            let moving = {
                let mut asked = self.lock();
                if asked.has_ended {
                    return Ok(());
                }
                if asked.heard.elapsed() > SILENCE {
                    was_armed = std::mem::take(&mut asked.is_armed);
                    if let Some(motion) = &asked.motion {
                        motion.cancel.cancel();
                    }
                }
                asked.motion.is_some()
            };
            if was_armed {
                let why = "nothing was heard of the workbench for a second".to_owned();
                self.send("disarmed", &DisarmedMessage { why }, &[])?;
            }
            // A cell that was stopped shows nothing.
            if let Some(shown) = camera.shown()?.filter(|shown| shown.sim_time_s != last_s) {
                last_s = shown.sim_time_s;
                let stamp = {
                    let mut stamps = self.stamps();
                    stamps.see(shown.sim_time_s);
                    stamps.next(shown.sim_time_s)
                };
                if self.can(Ability::State) {
                    let flange = self.fake.flange_from_tip.map(|flange_from_tip| {
                        let tip = shown.base_from_tip.isometry();
                        PoseMessage::of(&Pose::<Base, Tip>::from_isometry(tip * flange_from_tip.inverse()))
                    });
                    let state = StateMessage {
                        stamp,
                        joints_rad: Some(shown.joints),
                        base_from_flange: flange,
                        flange_from_tcp: None,
                        base_from_tip: Some(PoseMessage::of(&shown.base_from_tip)),
                        moving: Some(moving),
                    };
                    self.send("state", &state, &[])?;
                }
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Images, one for each request.
    fn look(&self) -> Result<(), FakeError> {
        let mut camera = self.fake.camera()?;
        while let Some(wanted) = self.next(|asked| asked.wanted.take()) {
            loop {
                let newest_s = camera.sim().get_simulation_time()?;
                let is_new = wanted.after.is_none_or(|after| self.stamps().stamp(newest_s) > after);
                // A frame that is not complete is late; the one that waits for it has a time limit.
                let grabbed = match is_new.then(|| camera.grab()) {
                    None | Some(Err(LinkError::MixedInstants { .. })) => None,
                    Some(grabbed) => Some(grabbed?),
                };
                if let Some(frame) = grabbed {
                    let stamp = self.stamps().stamp(frame.sim_time_s);
                    // The mapping of simulated time may have moved meanwhile.
                    if wanted.after.is_none_or(|after| stamp > after) {
                        self.send_frame(wanted, stamp, &frame)?;
                        break;
                    }
                }
                if self.lock().has_ended {
                    return Ok(());
                }
                std::thread::sleep(LOOK);
            }
        }
        Ok(())
    }

    fn send_frame(&self, wanted: Wanted, stamp: f64, frame: &Frame) -> Result<(), FakeError> {
        let Wanted { id, depth, .. } = wanted;
        if depth {
            let bytes: Vec<u8> = frame.depth.metres.iter().flat_map(|metres| metres.to_le_bytes()).collect();
            let message = DepthMessage {
                id,
                stamp,
                width: frame.depth.width,
                height: frame.depth.height,
                encoding: DepthEncoding::F32M,
                bytes: bytes.len() as u64,
            };
            self.send("depth", &message, &[&bytes])?;
        }
        let message = ImageMessage {
            id,
            stamp,
            stamp_uncertainty_s: 0.0,
            width: frame.rgb.width(),
            height: frame.rgb.height(),
            encoding: ImageEncoding::Rgb8,
            bytes: frame.rgb.as_raw().len() as u64,
            intrinsics: None,
        };
        self.send("image", &message, &[frame.rgb.as_raw()])
    }

    /// Motions, one at a time.
    fn go(&self) -> Result<(), FakeError> {
        let mut arm = self.fake.arm()?;
        while let Some(motion) = self.next(|asked| asked.motion.clone()) {
            let driven = drive(&mut arm, &motion);
            let (kind, why) = match &driven {
                Ok(()) => ("done", String::new()),
                Err(LinkError::Cancelled { .. }) => ("stopped", "it was stopped on its way".to_owned()),
                Err(error) => ("stopped", error.to_string()),
            };
            let at_rest = {
                let mut asked = self.lock();
                asked.motion = None;
                std::mem::take(&mut asked.at_rest)
            };
            self.answer(kind, motion.id, &why)?;
            for id in at_rest {
                self.answer("done", id, "")?;
            }
            let is_lost =
                |error: &LinkError| error.is_connection_loss() && !matches!(error, LinkError::Cancelled { .. });
            if let Err(error) = driven
                && is_lost(&error)
            {
                return Err(error.into());
            }
        }
        Ok(())
    }
}

fn drive(arm: &mut Arm, Motion { goal, speed, cancel, .. }: &Motion) -> Result<(), LinkError> {
    match goal {
        Goal::Joints(joints) => {
            let [velocity, acceleration, jerk] = JOINT;
            let limits = MotionLimits::uniform(joints.len(), velocity * speed, acceleration, jerk);
            arm.move_to_joints(joints, &limits, cancel)
        }
        Goal::Tip(pose) => {
            let [velocity, acceleration, jerk] = TIP;
            let limits = MotionLimits {
                velocity: velocity.map(|v| v * speed).to_vec(),
                acceleration: acceleration.to_vec(),
                jerk: jerk.to_vec(),
            };
            arm.move_to_pose(pose, &limits, &MotionTolerance::default(), cancel)
        }
    }
}
