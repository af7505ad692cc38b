//! Tracking without a window: images in, poses out, and the arm on a thread of its own.

use std::path::Path;
use std::sync::Arc;
use std::thread::Builder;
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::{
    Among, Arm, ArmKinematics, BoardMotion, CameraFeed, CellClient, CellPaths, FollowEnd, FollowLimits, FollowMoment,
    FollowWish as ArmWish, MotionTolerance, SettleOptions, Standing,
};
use handeye_coppeliasim::{ConnectionOptions, Endpoint, LinkError, Sim, SimulationState};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median_high;
use handeye_images::gray_from_rgb;
use handeye_track::{Estimate, Image, Keep, Setup, State};
use serde_json::{Value, json};

use crate::late::Late;
use crate::towards_board::TowardsBoard;
use crate::{Failure, record};
use handeye_link::limits;
use handeye_workbench::model::{FollowStatus, FollowWish, Step, Tracked};
use handeye_workbench::rerun_log::{Entry, Recorder};
use handeye_workbench::session::start::REFERENCE_POSES;
use handeye_workbench::text::Language;
use handeye_workbench::worker::{FollowLine, TrackedImage, Tracking, end_of_following};

/// Rest between two looks at the clock of the cell.
const LOOK: Duration = Duration::from_millis(2);

/// A line of progress every so often \[s\].
const PROGRESS_S: f64 = 2.0;

/// The speed of the way to where there is room, as a share of [`limits::SEQUENCE`]: as in the window.
const SHARE_OF_SPEED: f64 = 0.25;

/// How long the board is looked for from where the arm stands, before the arm goes to where it should be in view.
const LOOKED_FOR: Duration = Duration::from_secs(2);

/// What the arm does about the board.
#[derive(Debug, Clone, Copy)]
pub enum Task {
    /// Nothing.
    Watch,
    /// It follows.
    Follow(FollowWish),
    /// It moves once, when the board has been seen for a while.
    Reach {
        /// To this corner.
        index: usize,
        /// So far off the board \[m\].
        stand_off_m: f64,
    },
}

/// Images before the arm reaches for a corner: the filter has settled by then.
const IMAGES_BEFORE_REACH: u64 = 15;

/// What to do.
pub struct Job<'a> {
    /// Where it is recorded.
    pub recorder: &'a Recorder,
    /// What is tracked, and with what.
    pub setup: Setup,
    /// What the arm does.
    pub task: Task,
    /// How many images.
    pub frames: Option<u64>,
    /// The cell belongs to this program: how its board moves.
    pub own_cell: Option<BoardMotion>,
}

/// Where it goes, image by image.
pub struct Taken<'a> {
    /// The document.
    pub publish: &'a mut dyn FnMut(&Tracked) -> Result<(), Failure>,
    /// Of what was done, also where it ends with an error.
    pub summary: &'a mut Summary,
}

/// Connections to a cell.
pub struct Live {
    arm: Arm,
    feed: CameraFeed,
}

/// What came out of it.
#[derive(Debug, Default)]
pub struct Summary {
    frames: u64,
    tracked: u64,
    took_s: f64,
    latencies_s: Vec<f64>,
    position: Squares,
    rotation: Squares,
    follow_distance: Squares,
    follow_angle: Squares,
    /// Images in which the arm did not go as its goal asked, because something was too near.
    kept_off: u64,
    follow_ended: Option<String>,
}

/// Root mean square of what comes in.
#[derive(Debug, Default)]
struct Squares {
    sum: f64,
    count: u64,
}

impl Squares {
    fn add(&mut self, value: f64) {
        self.sum += value * value;
        self.count += 1;
    }

    fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).sqrt())
    }
}

impl Live {
    /// Connects to arm and camera, of a cell in this program or elsewhere.
    pub fn connect(endpoint: &Endpoint, paths: &CellPaths, is_own: bool) -> Result<Self, Failure> {
        let options = if is_own { ConnectionOptions::own_cell() } else { ConnectionOptions::default() };
        let cell = CellClient::connect(endpoint, &options, paths).map_err(Failure::failed)?;
        let (arm, feed) = cell.split();
        Ok(Self { arm, feed })
    }

    /// Tracks until there are images enough or it is cancelled. The arm is at rest when it returns. Following that ends
    /// for another reason is an error.
    pub fn run(mut self, job: &Job<'_>, cancel: &CancelToken, taken: &mut Taken<'_>) -> Result<(), Failure> {
        if let Some(board) = &job.own_cell {
            self.prepare_own_cell(board, cancel)?;
        }
        if job.recorder.is_on() {
            let truth = self.arm.ground_truth().map_err(Failure::failed)?;
            record::cell(job.recorder, &mut self.arm, &truth).map_err(Failure::failed)?;
            job.recorder.note(Entry::Step(Step::Track));
        }
        let line = Arc::new(FollowLine::default());
        // It lives until the arm stands: an arm that follows looks at what is tracked.
        let mut tracking = Tracking::new(job.setup.clone(), Arc::clone(&line)).map_err(Failure::unusable)?;
        let tracking = &mut tracking;
        let Self { mut arm, mut feed } = self;
        let wish = match job.task {
            Task::Watch => {
                return Self::watch(&mut feed, tracking, job, &line, cancel, &|| false, taken).map(drop);
            }
            Task::Reach { index, stand_off_m } => {
                let mut newest = Self::watch(&mut feed, tracking, job, &line, cancel, &|| false, taken)?;
                if newest.is_none() && job.own_cell.is_none() && !cancel.is_cancelled() {
                    look_for_board(&mut arm, cancel, &mut || {
                        newest = Self::watch(&mut feed, tracking, job, &line, cancel, &|| false, taken)?;
                        Ok(newest.is_some())
                    })?;
                }
                return reach(&mut arm, job, newest, index, stand_off_m, cancel);
            }
            Task::Follow(wish) => wish,
        };
        let end = CancelToken::default();
        line.begin(wish);
        let kinematics = arm.kinematics().map_err(Failure::failed)?.map_err(Failure::failed)?;
        let looks_for_board = job.own_cell.is_none();
        let follower = Follower { arm, kinematics, wish, line: Arc::clone(&line), end: end.clone(), looks_for_board };
        let arm_thread =
            Builder::new().name("follow".to_owned()).spawn(move || follower.run()).map_err(Failure::failed)?;
        let watched = Self::watch(&mut feed, tracking, job, &line, cancel, &|| arm_thread.is_finished(), taken);
        end.cancel();
        let followed = arm_thread
            .join()
            .map_err(|_panic| Failure::failed(anyhow::anyhow!("the thread that moves the arm ended with a panic")))?;
        watched?;
        let end = followed?;
        // What ends in the very moment in which it was followed enough has done what it was asked to.
        if cancel.is_cancelled() || job.frames.is_some_and(|frames| taken.summary.frames >= frames) {
            return Ok(());
        }
        let has_no_room = matches!(end, FollowEnd::JointLimit { .. } | FollowEnd::Singular);
        let hint = if has_no_room { " (--make-room)" } else { "" };
        let why = match end {
            FollowEnd::Released => line.take_ended().unwrap_or_else(|| end_of_following(&FollowEnd::Released)),
            end => end_of_following(&end),
        };
        let why = why.say(Language::English);
        let error = Failure::failed(anyhow::anyhow!("following ended by itself: {why}{hint}"));
        taken.summary.follow_ended = Some(why);
        Err(error)
    }

    /// Has the arm of the cell that this program started look at the board, and the board move.
    fn prepare_own_cell(&mut self, board: &BoardMotion, cancel: &CancelToken) -> Result<(), Failure> {
        self.arm.sim().start_simulation().map_err(Failure::failed)?;
        // The reference poses are those of the UR5. Any other arm begins where its scene has it.
        if self.arm.kinematics().map_err(Failure::failed)?.is_ok_and(|arm| arm.is_ur5()) {
            self.look_at_board(cancel)?;
        }
        self.arm.move_board(board).map_err(Failure::failed)
    }

    fn look_at_board(&mut self, cancel: &CancelToken) -> Result<(), Failure> {
        let poses = TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES).map_err(Failure::failed)?;
        let goals = poses.poses.iter().filter_map(|taught| match &taught.goal {
            Goal::Tip(goal) => Some(goal),
            Goal::Joints(_) => None,
        });
        // Close to its column the arm has no room to follow.
        let from_column = |goal: &Pose<Base, Tip>| goal.translation().xy().norm();
        if let Some(first) = goals.max_by(|a, b| from_column(a).total_cmp(&from_column(b))) {
            let limits = limits::of_tip(&limits::SEQUENCE, 1.0);
            self.arm
                .move_to_pose(first, &limits, &MotionTolerance::default(), cancel)
                .and_then(|()| self.arm.settle(&SettleOptions::default(), cancel).map(|_| ()))
                .map_err(Failure::failed)?;
        }
        Ok(())
    }

    fn watch(
        feed: &mut CameraFeed,
        tracking: &mut Tracking,
        job: &Job<'_>,
        line: &FollowLine,
        cancel: &CancelToken,
        arm_stands: &dyn Fn() -> bool,
        taken: &mut Taken<'_>,
    ) -> Result<Option<Estimate>, Failure> {
        let Taken { publish, summary } = taken;
        let frames = match job.task {
            // Of each place where the board is looked for.
            Task::Reach { .. } => Some(summary.frames + job.frames.unwrap_or(IMAGES_BEFORE_REACH)),
            Task::Watch | Task::Follow(_) => job.frames,
        };
        let mut newest = None;
        let far_plane_m = feed.info().depth_optics.far_m as f32;
        let began = Instant::now();
        let (mut pause, mut late) = (Pause::default(), Late::default());
        let mut seen_s = f64::NEG_INFINITY;
        let mut next_line_s = PROGRESS_S;
        while !cancel.is_cancelled() && !arm_stands() && frames.is_none_or(|frames| summary.frames < frames) {
            let now_s = feed.sim().get_simulation_time().map_err(Failure::failed)?;
            if now_s == seen_s {
                pause.look(feed.sim()).map_err(Failure::failed)?;
                std::thread::sleep(LOOK);
                continue;
            }
            pause.is_over();
            let Some(frame) = late.grabbed(feed.grab(), Instant::now()).map_err(Failure::failed)? else { continue };
            let received_s = began.elapsed().as_secs_f64();
            seen_s = frame.sim_time_s;
            let sight = TrackedImage {
                number: summary.frames + 1,
                received_s,
                image: Image {
                    time_s: frame.sim_time_s,
                    grey: &gray_from_rgb(&frame.rgb),
                    depth: Some(&frame.depth),
                    far_plane_m,
                    base_from_tip: frame.base_from_tip,
                },
                base_from_target_true: frame.base_from_target_true,
            };
            let tracked = tracking.see(&sight, &|| began.elapsed().as_secs_f64()).map_err(Failure::failed)?;
            let took_s = began.elapsed().as_secs_f64();
            newest.clone_from(&tracked.update.estimate);
            summary.add(&tracked, line.take_status().as_ref(), took_s);
            publish(&tracked)?;
            if job.recorder.is_on() {
                record::image(job.recorder, feed.info(), summary.frames, frame);
                job.recorder.note(Entry::Tracked(Arc::new(tracked.clone())));
            }
            if took_s > next_line_s {
                next_line_s = took_s + PROGRESS_S;
                tracing::info!("{}", progress(&tracked));
            }
        }
        Ok(newest)
    }
}

/// How long time has to stand still before it is asked why: more than an image takes on a slow machine.
const STANDS_STILL: Duration = Duration::from_secs(1);

/// A simulation whose time stands still: said once, and waited for.
#[derive(Default)]
struct Pause {
    since: Option<Instant>,
    is_said: bool,
}

impl Pause {
    fn look(&mut self, sim: &mut Sim) -> Result<(), LinkError> {
        let since = *self.since.get_or_insert_with(Instant::now);
        if self.is_said || since.elapsed() < STANDS_STILL {
            return Ok(());
        }
        self.is_said = true;
        match sim.get_simulation_state()? {
            SimulationState::Running => {
                tracing::warn!(
                    "the simulated time does not advance, perhaps because another client holds it: waiting for it"
                );
            }
            SimulationState::Paused => tracing::warn!("the simulation is paused: waiting until it is continued"),
            SimulationState::Stopped => tracing::warn!("the simulation is stopped: waiting until it is started"),
        }
        Ok(())
    }

    fn is_over(&mut self) {
        if self.is_said {
            tracing::info!("the simulation goes on");
        }
        *self = Self::default();
    }
}

/// The arm that follows, on a thread of its own.
struct Follower {
    arm: Arm,
    kinematics: ArmKinematics,
    wish: FollowWish,
    line: Arc<FollowLine>,
    end: CancelToken,
    /// Whether the arm goes to where the board should be in view.
    looks_for_board: bool,
}

/// Whether the board is seen, after waiting for it; without a limit until it is seen or following is cancelled.
fn is_seen_within(line: &FollowLine, end: &CancelToken, limit: Option<Duration>) -> bool {
    let began = Instant::now();
    while !line.is_seen() && !end.is_cancelled() && limit.is_none_or(|limit| began.elapsed() < limit) {
        std::thread::sleep(LOOK);
    }
    line.is_seen()
}

/// Has a simulated arm that does not see the board go to where it should be in view, on ways that are known to be free, until
/// it `is_seen`.
fn look_for_board(
    arm: &mut Arm,
    cancel: &CancelToken,
    is_seen: &mut dyn FnMut() -> Result<bool, Failure>,
) -> Result<(), Failure> {
    let Ok(kinematics) = arm.kinematics().map_err(Failure::failed)? else { return Ok(()) };
    let around = arm.surroundings(&kinematics).map_err(Failure::failed)?.all();
    let truth = arm.ground_truth().map_err(Failure::failed)?;
    let places = TowardsBoard::all(arm, &kinematics, &truth, &around)?;
    arm.keep_clear(Some(kinematics.among(around, None)));
    for TowardsBoard { name, joints } in places {
        tracing::info!("the board is not in view here: the arm goes to {name}");
        let limits = limits::of_joints(&limits::SEQUENCE, SHARE_OF_SPEED, arm.info().joint_kinds());
        match arm.move_to_joints(&joints, &limits, cancel) {
            Err(error @ (LinkError::Unreached { .. } | LinkError::InTheWay { .. })) => {
                tracing::warn!("the arm does not go to {name}: {error}");
                continue;
            }
            Err(LinkError::Cancelled { .. }) => return Ok(()),
            moved => moved.map_err(Failure::failed)?,
        }
        if is_seen()? {
            break;
        }
    }
    Ok(())
}

impl Follower {
    /// Follows until it is cancelled or following ends by itself; the arm is at rest then.
    fn run(mut self) -> Result<FollowEnd, Failure> {
        // Nothing to follow before the board has been seen.
        is_seen_within(&self.line, &self.end, Some(LOOKED_FOR));
        while !self.line.is_seen() && !self.end.is_cancelled() && !self.is_running()? {
            is_seen_within(&self.line, &self.end, Some(LOOKED_FOR));
        }
        if !self.line.is_seen() && self.looks_for_board && !self.end.is_cancelled() {
            let (line, end) = (Arc::clone(&self.line), self.end.clone());
            look_for_board(&mut self.arm, &end, &mut || Ok(is_seen_within(&line, &end, Some(LOOKED_FOR))))?;
        }
        is_seen_within(&self.line, &self.end, None);
        let standing = self.arm.surroundings(&self.kinematics).map_err(Failure::failed)?;
        let among = self.kinematics.among(standing.around.clone(), None);
        self.arm.keep_clear(Some(among.clone()));
        if self.wish == FollowWish::KeepViewWithRoom && !self.end.is_cancelled() {
            self.make_room(&standing, &among)?;
        }
        let Self { mut arm, kinematics, line, end, .. } = self;
        let mut wanted = |moment: &FollowMoment| if end.is_cancelled() { ArmWish::End } else { line.wish(moment) };
        arm.follow(&kinematics, &FollowLimits::default(), &mut wanted).map_err(Failure::failed)
    }

    fn is_running(&mut self) -> Result<bool, Failure> {
        let state = self.arm.sim().get_simulation_state().map_err(Failure::failed)?;
        Ok(state == SimulationState::Running)
    }

    /// Moves to the nearest place from which the arm can go along with the board, where it cannot from here.
    fn make_room(&mut self, standing: &Standing, among: &Among) -> Result<(), Failure> {
        let Some(board) = self.line.board_in_view() else { return Ok(()) };
        let joints = self.arm.joint_values().map_err(Failure::failed)?;
        let limits = FollowLimits::default();
        let place = self.kinematics.where_to_follow(&limits, &board, &joints, &standing.all(), Some(among));
        let Some(place) = place.map_err(Failure::failed)? else { return Ok(()) };
        tracing::info!(
            "here the arm has no room to follow the board: it moves to the nearest place where it has, and keeps the \
             view from there"
        );
        let limits = limits::of_joints(&limits::SEQUENCE, SHARE_OF_SPEED, self.arm.info().joint_kinds());
        match self.arm.move_to_joints(&place.joints, &limits, &self.end) {
            // Following ends at its first pass.
            Err(LinkError::Cancelled { .. }) => {}
            moved => moved.map_err(Failure::failed)?,
        }
        self.line.begin_elsewhere(self.wish);
        Ok(())
    }
}

/// Moves the tip once to where a corner is by the newest estimate.
fn reach(
    arm: &mut Arm,
    job: &Job<'_>,
    newest: Option<Estimate>,
    index: usize,
    stand_off_m: f64,
    cancel: &CancelToken,
) -> Result<(), Failure> {
    let estimate = newest.ok_or_else(|| {
        Failure::failed(anyhow::anyhow!("the board is not seen: move the arm or the board until the camera sees it"))
    })?;
    let base_from_tip_orientation = arm.base_from_tip().map_err(Failure::failed)?.rotation();
    let keep = Keep::Corner { index, stand_off_m, base_from_tip_orientation };
    let goal = keep.tip_goal(&estimate, &job.setup.calibrated, &job.setup.target).ok_or_else(|| {
        Failure::unusable(anyhow::anyhow!(
            "only a camera on the tip can lead it to the board; this one stands beside the robot"
        ))
    })?;
    let kinematics = arm.kinematics().map_err(Failure::failed)?;
    if let Ok(kinematics) = &kinematics {
        let joints = arm.joint_values().map_err(Failure::failed)?;
        kinematics.reach(&goal.base_from_tip, &joints).map_err(Failure::failed)?;
    }
    let limits = limits::of_tip(&limits::SEQUENCE, 1.0);
    arm.move_to_pose(&goal.base_from_tip, &limits, &MotionTolerance::default(), cancel).map_err(Failure::failed)
}

fn progress(tracked: &Tracked) -> String {
    let state = match tracked.update.state {
        State::Searching => "searching for the board".to_owned(),
        State::Tracking { corners, of } => format!("{corners} of {of} corners"),
        State::Coasting { since_s } => format!("not seen for {since_s:.2} s"),
        State::Lost { since_s } => format!("lost for {since_s:.2} s"),
    };
    let place = tracked.update.estimate.as_ref().map_or_else(String::new, |estimate| {
        let at = estimate.base_from_target.translation() * 1e3;
        format!(", at {:.2} {:.2} {:.2} mm", at.x, at.y, at.z)
    });
    // There is no rate before the second image.
    let rate = if tracked.rate_hz > 0.0 { format!(", {:.1} images/s", tracked.rate_hz) } else { String::new() };
    format!("{:.2} s: {state}{place}{rate}", tracked.update.time_s)
}

impl Summary {
    fn add(&mut self, tracked: &Tracked, follow: Option<&FollowStatus>, took_s: f64) {
        self.frames += 1;
        self.took_s = took_s;
        self.tracked += u64::from(matches!(tracked.update.state, State::Tracking { .. }));
        self.latencies_s.push(tracked.latency_s);
        if let Some(error) = tracked.error {
            self.position.add(error.position_m);
            self.rotation.add(error.rotation_rad);
        }
        if let Some(&FollowStatus::Following { distance_m, angle_rad, is_kept_off }) = follow {
            self.follow_distance.add(distance_m);
            self.follow_angle.add(angle_rad);
            self.kept_off += u64::from(is_kept_off);
        }
    }

    fn latency_s(&self) -> Option<f64> {
        median_high(self.latencies_s.iter().copied())
    }

    /// Images per second; `None` without two moments to count between.
    fn rate_hz(&self) -> Option<f64> {
        (self.frames > 0 && self.took_s > 0.0).then(|| self.frames as f64 / self.took_s)
    }

    /// Whether there is nothing to sum up.
    pub fn is_empty(&self) -> bool {
        self.frames == 0
    }

    /// For programs.
    pub fn json(&self) -> Value {
        json!({
            "frames": self.frames,
            "tracked": self.tracked,
            "rate_hz": self.rate_hz(),
            "latency_median_ms": self.latency_s().map(|s| s * 1e3),
            "position_rms_mm": self.position.rms().map(|m| m * 1e3),
            "rotation_rms_deg": self.rotation.rms().map(f64::to_degrees),
            "follow_distance_rms_mm": self.follow_distance.rms().map(|m| m * 1e3),
            "follow_angle_rms_deg": self.follow_angle.rms().map(f64::to_degrees),
            "follow_kept_off": self.kept_off,
            "follow_ended": self.follow_ended,
        })
    }

    /// For people.
    pub fn text(&self) -> String {
        if self.is_empty() {
            return "no image came: nothing was tracked\n".to_owned();
        }
        let rate = self.rate_hz().map_or_else(String::new, |hz| format!(", {hz:.1} images/s"));
        let latency_ms = self.latency_s().unwrap_or_default() * 1e3;
        let (tracked, frames) = (self.tracked, self.frames);
        let mut lines = vec![format!(
            "tracked in {tracked} of {frames} images{rate}, {latency_ms:.1} ms from image to pose (median)"
        )];
        if let (Some(m), Some(rad)) = (self.position.rms(), self.rotation.rms()) {
            let deg = rad.to_degrees();
            let mm = m * 1e3;
            lines.push(format!("against the cell's truth: {mm:.3} mm and {deg:.4}° RMS at the middle of the board"));
        }
        if let (Some(m), Some(rad)) = (self.follow_distance.rms(), self.follow_angle.rms()) {
            let deg = rad.to_degrees();
            let mm = m * 1e3;
            lines.push(format!("the tip from its goal: {mm:.2} mm and {deg:.3}° RMS, including the approach"));
            if self.kept_off > 0 {
                lines.push(format!("in {} of these images the arm kept clear of an obstacle", self.kept_off));
            }
        }
        lines.join("\n") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_images_there_is_no_rate() {
        let none = Summary::default();
        assert!(!none.text().contains("images/s"), "{}", none.text());
        assert!(none.json()["rate_hz"].is_null(), "{:#}", none.json());
        let some = Summary { frames: 20, took_s: 2.0, ..Summary::default() };
        assert!(some.text().contains("10.0 images/s"), "{}", some.text());
    }
}
