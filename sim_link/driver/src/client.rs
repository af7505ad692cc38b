//! One driver, as the workbench uses it.

use std::io::Read;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use handeye_arm::Arm;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::progress::CancelToken;
use image::RgbImage;

use super::clock::{Offset, Timebase};
use super::error::{DriverError, Ending};
use super::images;
use super::link::Link;
use super::log::LogLine;
use super::message::{Ability, DepthMessage, Hello, ImageMessage, PROTOCOL, ToDriver};
use super::options::DriverOptions;
use super::placement::ChainPlacement;
use super::shared::{FrameRequest, Inner, QUEUE, Shared};
use super::spec::DriverSpec;
use super::states::{NoPose, Reading, RobotAt};
use super::threads;
use super::wire::{Excerpt, WireError, WireProblem};

/// A driver that is connected. Clones are the same one: the threads of robot, camera and motion have one each. The last
/// one that is dropped ends the driver and waits for its end, little more than [`DriverOptions::farewell`].
///
/// Every call has a time limit, and gives [`DriverError::Gone`] once the driver is: then start another.
#[derive(Debug, Clone)]
pub struct Driver {
    owner: Arc<Owner>,
}

#[derive(Debug)]
struct Owner {
    shared: Arc<Shared>,
    hello: Arc<Hello>,
    arm: Option<Arc<Arm>>,
    /// Held by the one caller that requests an image.
    camera_turn: Mutex<()>,
    watch: Option<JoinHandle<()>>,
}

/// The newest state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotNow {
    /// The state as the driver reported it, on its own clock.
    pub reading: Reading,
    /// How old it is \[s\]; `None` before the clocks are related.
    pub age_s: Option<f64>,
}

/// An image as the driver sent it.
#[derive(Debug, Clone, PartialEq)]
pub struct DriverImage {
    /// Colour, row 0 on top; a grey image has three equal channels.
    pub rgb: RgbImage,
    /// Depth of the same instant, where the driver has it.
    pub depth: Option<DepthImage>,
    /// The lens at this instant, or that of `hello`; `None` where the driver does not know it.
    pub intrinsics: Option<Intrinsics>,
    /// Middle of the exposure on the driver's clock \[s\].
    pub stamp_s: f64,
    /// Uncertainty of the timestamp as the driver reports it: the instant is within ± this \[s\].
    pub stamp_uncertainty_s: f64,
}

impl Driver {
    /// Starts the program, or connects, and waits for its `hello`.
    ///
    /// # Errors
    /// [`DriverError::Start`], [`DriverError::Connect`], and [`DriverError::Gone`] when there is no usable `hello`.
    pub fn start(spec: &DriverSpec, options: &DriverOptions, cancel: &CancelToken) -> Result<Self, DriverError> {
        let Link { output, input, errors, end } = Link::open(spec)?;
        let (queue, queued) = sync_channel(QUEUE);
        let shared = Arc::new(Shared::new(spec.to_string(), options.clone(), queue));
        let spawned = |name: &str, work: Box<dyn FnOnce() + Send>| {
            let started = std::thread::Builder::new().name(name.to_owned()).spawn(work);
            started.map_err(|error| DriverError::Start { command: spec.to_string(), why: error.to_string() })
        };
        // The watch first: it owns the process, and ends it whatever happens to the others.
        let watched = Arc::clone(&shared);
        let watch = spawned("driver-watch", Box::new(move || threads::watch(&watched, end)))?;
        let mut owner = Owner {
            shared: Arc::clone(&shared),
            hello: Arc::new(no_hello()),
            arm: None,
            camera_turn: Mutex::default(),
            watch: Some(watch),
        };
        let reading = Arc::clone(&shared);
        spawned("driver-read", Box::new(move || threads::read(&reading, output)))?;
        let writing = Arc::clone(&shared);
        spawned("driver-write", Box::new(move || threads::write(&writing, input, &queued)))?;
        let listening = Arc::clone(&shared);
        let errors = errors.unwrap_or_else(|| Box::new(std::io::empty()) as Box<dyn Read + Send>);
        spawned("driver-errors", Box::new(move || threads::collect_errors(&listening, errors)))?;

        shared.send(&ToDriver::Hello { protocol: PROTOCOL, workbench: env!("CARGO_PKG_VERSION").to_owned() })?;
        let Some((hello, arm)) = greeted(&shared, cancel)? else {
            let last_line = shared.lock().log.last_printed();
            let why = if cancel.is_cancelled() || options.halt.is_cancelled() {
                Ending::ClosedHere
            } else {
                Ending::NoHello { after: options.hello, last_line }
            };
            shared.finish(why.clone());
            return Err(shared.gone(why));
        };
        (owner.hello, owner.arm) = (hello, arm);
        Ok(Self { owner: Arc::new(owner) })
    }

    /// Its command or address.
    pub(crate) fn name(&self) -> &str {
        &self.owner.shared.driver
    }

    /// The driver's `hello`.
    pub fn hello(&self) -> &Hello {
        &self.owner.hello
    }

    /// The chain of its joints, where the driver names it.
    pub fn chain(&self) -> Option<&Arm> {
        self.owner.arm.as_deref()
    }

    /// Place of that chain and its tool, as far as its states show.
    pub fn chain_placement(&self) -> ChainPlacement {
        self.owner.shared.lock().chain.placement().clone()
    }

    /// The clock that its stamps are related to.
    pub(crate) fn timebase(&self) -> Timebase {
        self.owner.shared.options.timebase
    }

    /// Whether the driver is still connected.
    ///
    /// # Errors
    /// [`DriverError::Gone`] with how it ended.
    pub fn check(&self) -> Result<(), DriverError> {
        let ending = self.owner.shared.lock().ending.clone();
        ending.map_or(Ok(()), |why| Err(self.owner.shared.gone(why)))
    }

    /// How its clock relates to ours now; `None` before the first pong.
    pub fn clock(&self) -> Option<Offset> {
        let shared = &self.owner.shared;
        let now_s = shared.now_s();
        shared.lock().clock.at(now_s)
    }

    /// The newest state; `None` before the first.
    ///
    /// # Errors
    /// [`DriverError::Gone`], [`DriverError::Cannot`].
    pub fn state(&self) -> Result<Option<RobotNow>, DriverError> {
        self.check()?;
        self.require(Ability::State)?;
        let shared = &self.owner.shared;
        let now_s = shared.now_s();
        let inner = shared.lock();
        let offset = inner.clock.at(now_s);
        Ok(inner.states.newest().map(|&reading| RobotNow {
            reading,
            age_s: offset.map(|offset| (now_s - offset.offset_s - reading.stamp_s).max(0.0)),
        }))
    }

    /// Waits for the first state.
    ///
    /// # Errors
    /// As [`Self::state`]; [`DriverError::NoAnswer`] when none comes.
    pub fn first_state(&self, patience: Duration, cancel: &CancelToken) -> Result<RobotNow, DriverError> {
        self.require(Ability::State)?;
        let shared = &self.owner.shared;
        shared.wait(patience, Some(cancel), |inner| inner.states.newest().map(|_| ()))?;
        self.state()?.ok_or_else(|| self.no_answer("with a state", patience))
    }

    /// The robot at an instant of the driver's own clock; waits, at most for `patience`, for a state after it.
    ///
    /// # Errors
    /// [`DriverError::Gone`]; why there is no pose is the inner error.
    pub(crate) fn robot_at(&self, stamp_s: f64, patience: Duration) -> Result<Result<RobotAt, NoPose>, DriverError> {
        if !self.hello().can(Ability::State) {
            return Ok(Err(NoPose::NoRobot));
        }
        let shared = &self.owner.shared;
        let found = shared.wait(patience, None, |inner| {
            let found = inner.states.at(stamp_s);
            (!matches!(found, Err(NoPose::TooNew { .. } | NoPose::NoState))).then_some(found)
        })?;
        Ok(found.unwrap_or_else(|| shared.lock().states.at(stamp_s)))
    }

    /// An image whose stamp is greater than `after`, with its depth where the driver can. `None` when none has come within
    /// this time, or when `cancel` is raised: a later call goes on waiting for the same one.
    ///
    /// # Errors
    /// [`DriverError::Gone`], also when the bytes are not an image; [`DriverError::Cannot`], [`DriverError::Refused`].
    pub fn image(
        &self,
        after: Option<f64>,
        patience: Duration,
        cancel: &CancelToken,
    ) -> Result<Option<DriverImage>, DriverError> {
        self.require(Ability::Image)?;
        let _turn = self.owner.camera_turn.lock().unwrap_or_else(PoisonError::into_inner);
        let shared = &self.owner.shared;
        let until = Instant::now() + patience;
        loop {
            self.ask_for_image(after)?;
            let left = until.saturating_duration_since(Instant::now());
            let answered = |inner: &mut Inner| inner.frame.take_if(|frame| frame.is_answered());
            let Some(frame) = shared.wait(left, Some(cancel), answered)? else { return Ok(None) };
            if let Some(why) = frame.refused {
                return Err(DriverError::Refused { driver: self.name().to_owned(), what: "an image", why });
            }
            // The request may be one of an earlier call, which had seen less.
            let Some((image, bytes)) = frame.image.filter(|(image, _)| after.is_none_or(|after| image.stamp > after))
            else {
                continue;
            };
            return self.decoded(&image, bytes, frame.depth).map(Some);
        }
    }

    fn ask_for_image(&self, after: Option<f64>) -> Result<(), DriverError> {
        let depth = self.hello().can(Ability::Depth);
        let id = {
            let mut inner = self.owner.shared.lock();
            if inner.frame.is_some() {
                return Ok(());
            }
            inner.last_id += 1;
            let id = inner.last_id;
            inner.frame =
                Some(FrameRequest { id, after, depth_wanted: depth, image: None, depth: None, refused: None });
            id
        };
        self.owner.shared.send(&ToDriver::NextImage { id, after, depth })
    }

    fn decoded(
        &self,
        image: &ImageMessage,
        bytes: Vec<u8>,
        depth: Option<(DepthMessage, Vec<u8>)>,
    ) -> Result<DriverImage, DriverError> {
        let broken = |why: String| {
            let problem = WireProblem::Conversation(why);
            let excerpt = Excerpt::of(format!("the image with stamp {}", image.stamp).as_bytes());
            let why = Ending::Broken(WireError { number: image.id, excerpt, problem });
            self.owner.shared.finish(why.clone());
            self.owner.shared.gone(why)
        };
        let rgb = images::image(image, bytes).map_err(broken)?;
        let depth = depth.map(|(depth, bytes)| images::depth(&depth, &bytes)).transpose().map_err(broken)?;
        let lens = image.intrinsics.or(self.hello().camera.and_then(|camera| camera.intrinsics));
        Ok(DriverImage {
            rgb,
            depth,
            // Was checked when the message came.
            intrinsics: lens.and_then(|lens| lens.intrinsics(image.width, image.height).ok()),
            stamp_s: image.stamp,
            stamp_uncertainty_s: image.stamp_uncertainty_s,
        })
    }

    /// Ends it, even if others still hold it, and waits until it has ended.
    pub(crate) fn close(&self) {
        let shared = &self.owner.shared;
        shared.finish(Ending::ClosedHere);
        // It is killed after the farewell; the second is for the system.
        shared.wait_for_burial(shared.options.farewell + Duration::from_secs(1));
    }

    /// Log lines of the driver since the last call.
    pub fn take_log(&self) -> Vec<LogLine> {
        self.owner.shared.lock().log.take()
    }

    pub(super) fn shared(&self) -> &Arc<Shared> {
        &self.owner.shared
    }

    pub(super) fn require(&self, ability: Ability) -> Result<(), DriverError> {
        if self.hello().can(ability) {
            return Ok(());
        }
        Err(DriverError::Cannot { driver: self.name().to_owned(), ability })
    }

    pub(super) fn no_answer(&self, what: &'static str, after: Duration) -> DriverError {
        DriverError::NoAnswer { driver: self.name().to_owned(), what, after }
    }

    pub(super) fn end(&self, why: Ending) -> DriverError {
        self.owner.shared.finish(why.clone());
        self.owner.shared.gone(why)
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.shared.finish(Ending::ClosedHere);
        if let Some(watch) = self.watch.take()
            && watch.join().is_err()
        {
            tracing::error!(driver = %self.shared.driver, "the thread that watches the driver had failed");
        }
    }
}

/// The driver's `hello`, and the chain of its joints; `None` when it has not come in time, or the driver is not to be started any
/// more.
#[expect(clippy::type_complexity, reason = "hello and chain")]
fn greeted(shared: &Shared, cancel: &CancelToken) -> Result<Option<(Arc<Hello>, Option<Arc<Arm>>)>, DriverError> {
    let options = &shared.options;
    let prepared_until = Instant::now() + options.preparation;
    loop {
        let before = shared.lock().preparations;
        let greeted = shared.wait(options.hello, Some(cancel), |inner| {
            let hello = inner.hello.clone().map(|hello| Some((hello, inner.arm.clone())));
            hello.or_else(|| options.halt.is_cancelled().then_some(None))
        })?;
        let is_prepared = shared.lock().preparations > before && Instant::now() < prepared_until;
        if greeted.is_some() || cancel.is_cancelled() || !is_prepared {
            return Ok(greeted.flatten());
        }
    }
}

/// Placeholder where none has come yet.
fn no_hello() -> Hello {
    Hello {
        protocol: PROTOCOL,
        name: String::new(),
        version: String::new(),
        clock: String::new(),
        can: Vec::new(),
        joints: Vec::new(),
        arm: None,
        base_from_arm: None,
        camera: None,
        depth_limits_m: None,
    }
}
