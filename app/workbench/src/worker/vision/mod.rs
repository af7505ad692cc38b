//! The vision thread: looks for the board in the newest image, and takes captures. It owns no connection; images
//! come to it from the camera worker through a [`Tap`].
//!
//! One image at a time: tasks first, then the capture, which costs no more than comparing the images of a scene at
//! rest, then the live search. So every request is taken up within one search, and a capture that waits continues
//! within one search, however long a search takes.

mod search;

use std::sync::Arc;
use std::time::Duration;

use crossbeam_channel::{Receiver, SendTimeoutError, Sender, TryRecvError, never, select};
use handeye_coppeliasim::CancelToken;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::targets::TargetSpec;
use handeye_images::gray_from_rgb;
use handeye_track::Image;
use image::GrayImage;

use search::Search;

use super::channels::{LatestSlot, Tap};
use super::link::Outlet;
use crate::capture::state::{CaptureRefused, CaptureWait, LiveDetection};
use crate::capture::{CaptureRequest, Measured, Sequence, refusal};
use crate::live::state::LiveFrame;
use crate::track::follow_line::FollowLine;
use crate::track::state::Tracked;
use crate::track::worker::{TrackedBy, TrackedImage, Tracking};
use crate::{capture, track};

/// How often the clock is checked while a capture waits for images that do not come.
const CLOCK_PERIOD: Duration = Duration::from_millis(100);

/// Requests to the vision thread.
#[derive(Debug, Clone)]
pub enum VisionTask {
    /// What to look for, from the next image on. A capture of another board is cancelled.
    SetTarget(TargetSpec),
    /// The camera, for the pose of the board in live images.
    SetIntrinsics(Intrinsics),
    /// Take a capture. One that is under way is cancelled.
    Capture(CaptureRequest),
    /// Give up the capture that is under way.
    CancelCapture,
    /// Track the board, instead of only finding it; `None` ends that. A capture has priority.
    Track(Option<Box<TrackedBy>>),
}

/// Where the newest sights of the board are put.
#[derive(Clone, Default)]
pub struct VisionSlots {
    /// For the window: corners and pose in the camera.
    pub detections: Arc<LatestSlot<LiveDetection>>,
    /// For the window: the board in the base.
    pub tracked: Arc<LatestSlot<Tracked>>,
    /// For the arm.
    pub follow: Arc<FollowLine>,
}

/// The application ends.
struct Ended;

/// The capture that is under way.
struct CaptureInProgress {
    sequence: Sequence,
    /// What was reported last.
    reported: Option<CaptureWait>,
}

/// The vision thread.
pub struct Vision {
    tap: Arc<Tap<LiveFrame>>,
    bell: Receiver<()>,
    tasks: Receiver<VisionTask>,
    sights: VisionSlots,
    measured: Sender<Measured>,
    outlet: Outlet,
    shutdown: CancelToken,
    search: Search,
    tracking: Option<Tracking>,
    capture: Option<CaptureInProgress>,
}

impl Vision {
    /// With everything that it takes from and gives to; closing `tasks` ends it.
    pub fn new(
        tap: Arc<Tap<LiveFrame>>,
        bell: Receiver<()>,
        tasks: Receiver<VisionTask>,
        sights: VisionSlots,
        measured: Sender<Measured>,
        outlet: Outlet,
        shutdown: CancelToken,
    ) -> Self {
        let search = Search::default();
        Self { tap, bell, tasks, sights, measured, outlet, shutdown, search, tracking: None, capture: None }
    }

    /// Works until the application ends.
    pub fn run(mut self) {
        while let Ok(()) = self.turn() {}
    }

    fn turn(&mut self) -> Result<(), Ended> {
        self.wait()?;
        self.take_up_tasks()?;
        if let Some((frame, dropped)) = self.tap.take() {
            self.look_at(&frame, dropped)?;
        }
        if let Some(capture) = &mut self.capture {
            capture.sequence.pass_time(self.outlet.now_s(), self.tap.heard_s());
            self.tell_progress();
        }
        Ok(())
    }

    /// Until there is something to do.
    fn wait(&mut self) -> Result<(), Ended> {
        let clock = if self.capture.is_some() { crossbeam_channel::after(CLOCK_PERIOD) } else { never() };
        let task = select! {
            recv(self.tasks) -> task => Some(task.map_err(|_closed| Ended)?),
            // The tap is shared with the camera worker and lives as long as this thread, so the bell does too.
            recv(self.bell) -> _ => None,
            recv(clock) -> _ => None,
        };
        task.map_or(Ok(()), |task| self.take_up(task))
    }

    fn take_up_tasks(&mut self) -> Result<(), Ended> {
        loop {
            if self.shutdown.is_cancelled() {
                return Err(Ended);
            }
            match self.tasks.try_recv() {
                Ok(task) => self.take_up(task)?,
                Err(TryRecvError::Empty) => return Ok(()),
                Err(TryRecvError::Disconnected) => return Err(Ended),
            }
        }
    }

    fn take_up(&mut self, task: VisionTask) -> Result<(), Ended> {
        match task {
            VisionTask::SetTarget(target) => {
                if self.search.target.replace(target).is_some_and(|before| before != target) {
                    self.refuse(refusal::other_target());
                }
            }
            VisionTask::SetIntrinsics(intrinsics) => self.search.intrinsics = Some(intrinsics),
            VisionTask::Capture(request) => {
                self.refuse(refusal::another_capture());
                match self.search.target {
                    Some(target) => {
                        let sequence = Sequence::new(request, target, self.outlet.now_s());
                        self.capture = Some(CaptureInProgress { sequence, reported: None });
                        self.tell_progress();
                    }
                    None => self.report_refusal(request.number, refusal::no_target()),
                }
            }
            VisionTask::CancelCapture => self.refuse(refusal::cancelled()),
            VisionTask::Track(by) => self.track(by),
        }
        if self.shutdown.is_cancelled() { Err(Ended) } else { Ok(()) }
    }

    fn look_at(&mut self, frame: &LiveFrame, dropped: u64) -> Result<(), Ended> {
        let grey = gray_from_rgb(&frame.images.rgb);
        let complete = self.capture.as_mut().is_some_and(|capture| capture.sequence.see(frame, &grey));
        self.tell_progress();
        if self.capture.is_none() && self.tracking.is_some() {
            self.track_in(frame, &grey, dropped);
            return Ok(());
        }
        let Some(detection) = self.search.live(frame, &grey, dropped, &self.shutdown) else { return Ok(()) };
        if let (Some(capture), Some(corners)) = (&mut self.capture, &detection.corners) {
            capture.sequence.saw_board(frame.info.number, corners);
        }
        self.sights.detections.put(detection);
        (self.outlet.waker)();
        if complete {
            self.take_up_tasks()?;
            self.measure()?;
        }
        Ok(())
    }

    fn track(&mut self, by: Option<Box<TrackedBy>>) {
        // The previous tracker signs off from the arm first.
        self.tracking = None;
        let Some(by) = by else { return };
        match Tracking::new(*by, Arc::clone(&self.sights.follow)) {
            Ok(tracking) => self.tracking = Some(tracking),
            Err(error) => self.outlet.report(track::Event::Failed { why: error.into() }),
        }
    }

    fn track_in(&mut self, frame: &LiveFrame, grey: &GrayImage, dropped: u64) {
        let Some(tracking) = &mut self.tracking else { return };
        let info = &frame.info;
        // A board without a pose of the robot has no place in the base.
        let Some(reported) = info.base_from_tip else { return };
        let Some(base_from_tip) = tracking.by().base_from_tip(reported, &info.joints_rad) else { return };
        let began_s = self.outlet.now_s();
        let sight = TrackedImage {
            number: info.number,
            received_s: info.received_s,
            image: Image {
                time_s: info.sim_time_s,
                grey,
                depth: frame.images.depth.as_ref().map(|depth| &depth.metres),
                far_plane_m: info.far_plane_m,
                base_from_tip,
            },
            base_from_target_true: info.base_from_target_true,
        };
        match tracking.see(&sight, &|| self.outlet.now_s()) {
            Ok(tracked) => {
                let seen = tracked.update.seen.as_ref();
                self.sights.detections.put(LiveDetection {
                    frame: info.number,
                    corners: seen.map(|seen| seen.corners.clone()),
                    camera_from_target: seen.map(|seen| seen.camera_from_target),
                    base_from_tip: info.base_from_tip,
                    joints_rad: info.joints_rad,
                    took_s: self.outlet.now_s() - began_s,
                    problem: None,
                    dropped,
                });
                self.sights.tracked.put(tracked);
                (self.outlet.waker)();
            }
            Err(error) => {
                self.tracking = None;
                self.outlet.report(track::Event::Failed { why: error.into() });
            }
        }
    }

    /// Measures the average of a capture, unless it was cancelled meanwhile.
    fn measure(&mut self) -> Result<(), Ended> {
        let complete = self.capture.as_ref().filter(|capture| capture.sequence.is_complete());
        let Some(number) = complete.map(|capture| capture.sequence.number()) else { return Ok(()) };
        self.report(CaptureWait::Measuring);
        let measured = self.capture.as_ref().and_then(|capture| capture.sequence.measure(&self.shutdown));
        // The search for dots or markers may have taken seconds: requests made meanwhile come first.
        self.take_up_tasks()?;
        if self.capture.as_ref().is_none_or(|capture| capture.sequence.number() != number) {
            return Ok(());
        }
        match measured {
            None => Ok(()),
            Some(Err(why)) => {
                self.refuse(why);
                Ok(())
            }
            Some(Ok(measured)) => {
                self.report(CaptureWait::Saving);
                self.capture = None;
                self.hand_over(measured)
            }
        }
    }

    /// Waits for the thread that writes captures if that one is behind.
    fn hand_over(&mut self, mut measured: Measured) -> Result<(), Ended> {
        loop {
            match self.measured.send_timeout(measured, CLOCK_PERIOD) {
                Ok(()) => {
                    (self.outlet.waker)();
                    return Ok(());
                }
                Err(SendTimeoutError::Disconnected(_)) => return Err(Ended),
                Err(SendTimeoutError::Timeout(_)) if self.shutdown.is_cancelled() => return Err(Ended),
                Err(SendTimeoutError::Timeout(back)) => measured = back,
            }
        }
    }

    /// Reports what the capture waits for, or that there is none, if that has changed.
    fn tell_progress(&mut self) {
        match self.capture.as_ref().map(|capture| capture.sequence.state()) {
            Some(Ok(wait)) => self.report(wait),
            Some(Err(why)) => self.refuse(why),
            None => {}
        }
    }

    fn report(&mut self, wait: CaptureWait) {
        if let Some(capture) = self.capture.as_mut().filter(|capture| capture.reported != Some(wait)) {
            capture.reported = Some(wait);
            let number = capture.sequence.number();
            self.outlet.report(capture::Event::Waits { number, wait });
        }
    }

    /// Ends the capture that is under way, if there is one.
    fn refuse(&mut self, why: refusal::Why) {
        if let Some(capture) = self.capture.take() {
            self.report_refusal(capture.sequence.number(), why);
        }
    }

    fn report_refusal(&self, number: u64, (kind, why): refusal::Why) {
        let refused = CaptureRefused { kind, why, at_s: self.outlet.now_s() };
        self.outlet.report(capture::Event::Refused { number, refused });
    }
}

#[cfg(test)]
mod bench;
#[cfg(test)]
mod slow {
    mod accuracy;
}
#[cfg(test)]
mod tests;
