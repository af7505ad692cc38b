//! Tracking without a window: images in, poses out, and the arm on a thread of its own.

use std::path::Path;
use std::sync::Arc;
use std::thread::Builder;
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::{ArmKinematics, BoardMotion, FollowEnd};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median_high;
use handeye_images::gray_from_rgb;
use handeye_link::{ControlPort, MotionOutcome, Newest, PortError, Simulation, end_of_following};
use handeye_track::{Estimate, Image, Keep, State};
use serde_json::{Value, json};

use crate::late::Late;
use crate::open_cell::{OpenCell, port_failure};
use crate::towards_board::TowardsBoard;
use crate::{Failure, out, record};
use handeye_record::Recorder;
use handeye_workbench::model::{FollowRequest, FollowStatus, Step, Tracked};
use handeye_workbench::motion::correction::is_connected_arm;
use handeye_workbench::recording::{Entry, Recording as _};
use handeye_workbench::session::start::REFERENCE_POSES;
use handeye_workbench::text::Language;
use handeye_workbench::worker::{FollowLine, TrackedBy, TrackedImage, Tracking};

/// Pause between two looks at the clock of the cell.
const LOOK: Duration = Duration::from_millis(2);

/// Interval of lines of progress \[s\].
const PROGRESS_S: f64 = 2.0;

/// The speed of the move to where there is room, as in the window.
const SHARE_OF_SPEED: f64 = 0.25;

/// How long the board is searched for from the arm's position, before the arm goes to where it should be in view.
const LOOKED_FOR: Duration = Duration::from_secs(2);

/// What the arm does about the board.
#[derive(Debug, Clone, Copy)]
pub enum Task {
    /// Nothing.
    Watch,
    Follow(FollowRequest),
    /// It moves once, when the board has been seen for a while.
    Reach {
        /// To this corner.
        index: usize,
        /// This far off the board \[m\].
        stand_off_m: f64,
    },
}

/// Images before the arm reaches for a corner: the filter has settled by then.
const IMAGES_BEFORE_REACH: u64 = 15;

/// What to do.
pub struct Job<'a> {
    /// Where it is recorded.
    pub recorder: &'a Recorder,
    /// What is tracked, and the calibration used.
    pub by: TrackedBy,
    /// The same with corrected tip poses, for the arm of the calibration.
    pub corrected: Option<TrackedBy>,
    /// What the arm does.
    pub task: Task,
    /// How many images.
    pub frames: Option<u64>,
    /// The cell belongs to this program: how its board moves.
    pub own_cell: Option<BoardMotion>,
    /// Whether the move of the arm is only printed.
    pub dry_run: bool,
}

/// Where the results go, image by image.
pub struct Taken<'a> {
    /// The document.
    pub publish: &'a mut dyn FnMut(&Tracked) -> Result<(), Failure>,
    /// The summary of the work so far, also if it ends with an error.
    pub summary: &'a mut Summary,
}

/// The results.
#[derive(Debug, Default)]
pub struct Summary {
    /// Whether tip poses are corrected for the errors of the arm.
    is_corrected: bool,
    frames: u64,
    tracked: u64,
    took_s: f64,
    latencies_s: Vec<f64>,
    position: Squares,
    rotation: Squares,
    follow_distance: Squares,
    follow_angle: Squares,
    /// Images in which the arm did not go to its goal, because something was too close.
    kept_off: u64,
    follow_ended: Option<String>,
}

/// Root mean square of its inputs.
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

impl Job<'_> {
    /// With corrected tip poses if the arm of the calibration is the connected one.
    fn by_on(&self, cell: &mut OpenCell) -> Result<TrackedBy, Failure> {
        let Some(corrected) = &self.corrected else { return Ok(self.by.clone()) };
        let now = cell.robot_state()?;
        if corrected.arm.as_ref().is_some_and(|arm| is_connected_arm(arm, &now)) {
            tracing::info!("tip poses are corrected for the errors of the arm, and so is what it is sent");
            return Ok(corrected.clone());
        }
        tracing::warn!(
            "tip poses are taken as they are reported: by its joints the tip is not where the arm of the calibration has it, so this is \
             another arm, or another tool"
        );
        Ok(self.by.clone())
    }
}

/// Tracks until there are enough images or it is cancelled. The arm is at rest when it returns. If following ends for another
/// reason, that is an error.
pub fn run(cell: &mut OpenCell, job: &Job<'_>, cancel: &CancelToken, taken: &mut Taken<'_>) -> Result<(), Failure> {
    if let Some(board) = &job.own_cell {
        prepare_own_cell(cell, board, cancel)?;
    }
    if job.recorder.is_on() {
        record::cell(job.recorder, &cell.facts);
        job.recorder.note(Entry::Step(Step::Track));
    }
    let line = Arc::new(FollowLine::default());
    // It lives until the arm is at rest: an arm that follows reads what is tracked.
    let by = job.by_on(cell)?;
    taken.summary.is_corrected = by.arm.is_some();
    let mut tracking = Tracking::new(by.clone(), Arc::clone(&line)).map_err(Failure::unusable)?;
    let mut watch = Watch { tracking: &mut tracking, job, line: &line, cancel, taken };
    match job.task {
        Task::Watch => watch.run(cell, &|| false).map(drop),
        Task::Reach { index, stand_off_m } => {
            let mut newest = watch.run(cell, &|| false)?;
            let looks_for_board = cell.is_simulated() && job.own_cell.is_none() && !job.dry_run;
            if newest.is_none() && looks_for_board && !cancel.is_cancelled() {
                look_for_board(cell, cancel, &mut |cell| {
                    newest = watch.run(cell, &|| false)?;
                    Ok(newest.is_some())
                })?;
            }
            reach(cell, job, &by, newest, (index, stand_off_m), cancel)
        }
        Task::Follow(request) => follow_board(cell, job, &mut watch, request),
    }
}

/// The arm on a thread and over connections of its own, while images are tracked here.
fn follow_board(
    cell: &mut OpenCell,
    job: &Job<'_>,
    watch: &mut Watch<'_, '_>,
    request: FollowRequest,
) -> Result<(), Failure> {
    let (end, line) = (CancelToken::default(), Arc::clone(watch.line));
    line.begin(request);
    let mut arm = cell.another(watch.cancel)?;
    arm.go_no_faster_than(SHARE_OF_SPEED);
    let looks_for_board = job.own_cell.is_none();
    let follower = Follower { cell: arm, request, line: Arc::clone(&line), end: end.clone(), looks_for_board };
    let arm_thread = Builder::new().name("follow".to_owned()).spawn(move || follower.run()).map_err(Failure::failed)?;
    let watched = watch.run(cell, &|| arm_thread.is_finished());
    end.cancel();
    let followed = arm_thread
        .join()
        .map_err(|_panic| Failure::failed(anyhow::anyhow!("the thread that moves the arm ended with a panic")))?;
    watched?;
    let end = followed?;
    let summary = &mut *watch.taken.summary;
    // If it ends at the very moment when enough images were followed, it has done what was requested.
    if watch.cancel.is_cancelled() || job.frames.is_some_and(|frames| summary.frames >= frames) {
        return Ok(());
    }
    let has_no_room = matches!(end, FollowEnd::JointLimit { .. } | FollowEnd::Singular);
    let hint = if has_no_room { " (--make-room)" } else { "" };
    let why = match end {
        FollowEnd::Released => line.take_ended().unwrap_or_else(|| end_of_following(&FollowEnd::Released)),
        end => end_of_following(&end),
    };
    let why = why.in_language(Language::English);
    let error = Failure::failed(anyhow::anyhow!("following ended by itself: {why}{hint}"));
    summary.follow_ended = Some(why);
    Err(error)
}

/// Makes the arm of the cell that this program started look at the board, and the board move.
fn prepare_own_cell(cell: &mut OpenCell, board: &BoardMotion, cancel: &CancelToken) -> Result<(), Failure> {
    cell.set_going(false).map_err(|error| port_failure(&error))?;
    // The reference poses are those of the UR5. Any other arm starts where its scene has it.
    if cell.kinematics().is_some_and(ArmKinematics::is_ur5) {
        look_at_board(cell, cancel)?;
    }
    cell.control.move_board(board).map_err(|error| port_failure(&error))
}

fn look_at_board(cell: &mut OpenCell, cancel: &CancelToken) -> Result<(), Failure> {
    let poses = TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES).map_err(Failure::failed)?;
    // Close to its column the arm has no room to follow.
    let from_column = |goal: &Goal| match goal {
        Goal::Tip(pose) => pose.translation().xy().norm(),
        Goal::Joints(_) => 0.0,
    };
    let goals = poses.poses.iter().map(|taught| &taught.goal);
    match goals.max_by(|a, b| from_column(a).total_cmp(&from_column(b))) {
        Some(first) => moved(&cell.move_to("a view of the board", first, cancel)).map(drop),
        None => Ok(()),
    }
}

/// Whether the arm has arrived, and was not stopped before.
fn moved(outcome: &Result<MotionOutcome, PortError>) -> Result<bool, Failure> {
    match outcome {
        Ok(MotionOutcome::Arrived) => Ok(true),
        Ok(MotionOutcome::Stopped) => Ok(false),
        Ok(outcome) => {
            let why = outcome.why().map_or_else(String::new, |why| why.in_language(Language::English));
            Err(Failure::failed(anyhow::anyhow!("{why}")))
        }
        Err(error) => Err(port_failure(error)),
    }
}

/// Images in, poses out.
struct Watch<'a, 't> {
    tracking: &'a mut Tracking,
    job: &'a Job<'a>,
    line: &'a Arc<FollowLine>,
    cancel: &'a CancelToken,
    taken: &'a mut Taken<'t>,
}

impl Watch<'_, '_> {
    /// Until there are enough images, the arm is at rest or it is cancelled; returns the newest estimate.
    fn run(&mut self, cell: &mut OpenCell, arm_stands: &dyn Fn() -> bool) -> Result<Option<Estimate>, Failure> {
        let Self { tracking, job, line, cancel, taken: Taken { publish, summary } } = self;
        let frames = match job.task {
            // Counted for each place where the board is searched for.
            Task::Reach { .. } => Some(summary.frames + job.frames.unwrap_or(IMAGES_BEFORE_REACH)),
            Task::Watch | Task::Follow(_) => job.frames,
        };
        let mut newest = None;
        let depth_limits_m = cell.camera.depth_limits_m();
        let began = Instant::now();
        let (mut pause, mut late) = (Pause::default(), Late::default());
        let (mut seen_s, mut has_pose) = (None, true);
        let mut next_line_s = PROGRESS_S;
        while !cancel.is_cancelled() && !arm_stands() && frames.is_none_or(|frames| summary.frames < frames) {
            let raw = match cell.camera.newest(seen_s).map_err(|error| port_failure(&error))? {
                Newest::Frame(raw) => *raw,
                Newest::Same => {
                    pause.look(cell.control.as_mut()).map_err(|error| port_failure(&error))?;
                    std::thread::sleep(LOOK);
                    continue;
                }
                Newest::Awaited => {
                    late.waits(Instant::now()).map_err(|error| port_failure(&error))?;
                    continue;
                }
            };
            pause.is_over();
            late.came();
            let received_s = began.elapsed().as_secs_f64();
            seen_s = Some(raw.sim_time_s);
            let Some(base_from_tip) = raw.base_from_tip else {
                if std::mem::replace(&mut has_pose, false) {
                    let why = raw.no_pose.map_or_else(String::new, |why| why.in_language(Language::English));
                    tracing::warn!("an image is left out, because it is not known where the robot was: {why}");
                }
                continue;
            };
            has_pose = true;
            let base_from_tip = tracking.by().base_from_tip(base_from_tip, &raw.joints_rad).ok_or_else(no_joints)?;
            let sight = TrackedImage {
                number: summary.frames + 1,
                received_s,
                image: Image {
                    time_s: raw.sim_time_s,
                    grey: &gray_from_rgb(&raw.rgb),
                    depth: raw.depth.as_ref(),
                    far_plane_m: depth_limits_m[1],
                    base_from_tip,
                },
                base_from_target_true: raw.base_from_target_true,
            };
            let tracked = tracking.see(&sight, &|| began.elapsed().as_secs_f64()).map_err(Failure::failed)?;
            let took_s = began.elapsed().as_secs_f64();
            newest.clone_from(&tracked.update.estimate);
            summary.add(&tracked, line.take_status().as_ref(), took_s);
            publish(&tracked)?;
            if job.recorder.is_on() {
                // There is no clock of a window here.
                let received_s = raw.sim_time_s;
                record::image(job.recorder, record::live_frame(raw, depth_limits_m, summary.frames, received_s));
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

/// How long time has to be paused before the reason is queried: more than an image takes on a slow machine.
const STANDS_STILL: Duration = Duration::from_secs(1);

/// A simulation whose time is paused: reported once, and waited for.
#[derive(Default)]
struct Pause {
    since: Option<Instant>,
    is_reported: bool,
}

impl Pause {
    fn look(&mut self, control: &mut dyn ControlPort) -> Result<(), PortError> {
        let since = *self.since.get_or_insert_with(Instant::now);
        if self.is_reported || since.elapsed() < STANDS_STILL {
            return Ok(());
        }
        self.is_reported = true;
        let Some(state) = control.state()? else { return Ok(()) };
        match state.simulation {
            Simulation::Running => {
                tracing::warn!(
                    "the simulated time does not advance, perhaps because another client holds it: waiting for it"
                );
            }
            Simulation::Paused => tracing::warn!("the simulation is paused: waiting until it is continued"),
            Simulation::Stopped => tracing::warn!("the simulation is stopped: waiting until it is started"),
        }
        Ok(())
    }

    fn is_over(&mut self) {
        if self.is_reported {
            tracing::info!("the simulation goes on");
        }
        *self = Self::default();
    }
}

/// The arm that follows, on a thread of its own.
struct Follower {
    cell: OpenCell,
    request: FollowRequest,
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

/// Makes a simulated arm that does not see the board go to where it should be in view, on paths that are known to be free,
/// until it `is_seen`.
fn look_for_board(
    cell: &mut OpenCell,
    cancel: &CancelToken,
    is_seen: &mut dyn FnMut(&mut OpenCell) -> Result<bool, Failure>,
) -> Result<(), Failure> {
    for TowardsBoard { name, goal } in TowardsBoard::all(cell)? {
        tracing::info!("the board is not in view here: the arm goes to {name}");
        match cell.move_to(name, &goal, cancel) {
            Ok(MotionOutcome::Refused(why) | MotionOutcome::Unreached(why)) => {
                tracing::warn!("the arm does not go to {name}: {}", why.in_language(Language::English));
                continue;
            }
            outcome if !moved(&outcome)? => return Ok(()),
            _ => {}
        }
        if is_seen(cell)? {
            break;
        }
    }
    Ok(())
}

impl Follower {
    /// Follows until it is cancelled or following ends; the arm is at rest then.
    fn run(mut self) -> Result<FollowEnd, Failure> {
        // Nothing to follow before the board has been seen.
        is_seen_within(&self.line, &self.end, Some(LOOKED_FOR));
        while !self.line.is_seen() && !self.end.is_cancelled() && !self.is_running()? {
            is_seen_within(&self.line, &self.end, Some(LOOKED_FOR));
        }
        let Self { mut cell, request, line, end, looks_for_board } = self;
        if !line.is_seen() && looks_for_board && !end.is_cancelled() {
            look_for_board(&mut cell, &end, &mut |_| Ok(is_seen_within(&line, &end, Some(LOOKED_FOR))))?;
        }
        is_seen_within(&line, &end, None);
        match cell.follow(&line, request, &end)? {
            Ok(end) => Ok(end),
            // Following ends at its first pass.
            Err(MotionOutcome::Stopped) => Ok(FollowEnd::Released),
            Err(outcome) => {
                let why = outcome.why().map_or_else(String::new, |why| why.in_language(Language::English));
                Err(Failure::failed(anyhow::anyhow!("{why}")))
            }
        }
    }

    fn is_running(&mut self) -> Result<bool, Failure> {
        Ok(self.cell.robot_state()?.simulation == Simulation::Running)
    }
}

/// Moves the tip once to a corner according to the newest estimate, or prints where that is.
fn reach(
    cell: &mut OpenCell,
    job: &Job<'_>,
    by: &TrackedBy,
    newest: Option<Estimate>,
    (index, stand_off_m): (usize, f64),
    cancel: &CancelToken,
) -> Result<(), Failure> {
    let estimate = newest.ok_or_else(|| {
        Failure::failed(anyhow::anyhow!("the board is not seen: move the arm or the board until the camera sees it"))
    })?;
    let now = cell.robot_state()?;
    let here = by.base_from_tip(now.base_from_tip, &now.joints_rad);
    let base_from_tip_orientation = here.ok_or_else(no_joints)?.rotation();
    let keep = Keep::Corner { index, stand_off_m, base_from_tip_orientation };
    let goal = keep.tip_goal(&estimate, &by.setup.calibrated, &by.setup.target).ok_or_else(|| {
        Failure::unusable(anyhow::anyhow!(
            "only a camera on the tip can lead it to the board; this one stands beside the robot"
        ))
    })?;
    let command = by.arm.as_ref().map(|arm| arm.command(&goal.base_from_tip, &now.joints_rad)).transpose();
    let command = command.map_err(Failure::failed)?;
    let goal = Goal::Tip(command.map_or(goal.base_from_tip, |command| command.base_from_tip));
    if job.dry_run {
        out::line(format_args!("to corner {index}: {}", cell.described(&goal)))?;
        return out::line("nothing was moved");
    }
    moved(&cell.move_to(&format!("corner {index}"), &goal, cancel)).map(drop)
}

fn no_joints() -> Failure {
    Failure::failed(anyhow::anyhow!(
        "the joints are not those of the arm whose errors are corrected: give --as-reported, or calibrate with this robot"
    ))
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

    /// As JSON.
    pub fn json(&self) -> Value {
        json!({
            "frames": self.frames,
            "tracked": self.tracked,
            "tip_poses": if self.is_corrected { "corrected" } else { "reported" },
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

    /// As text.
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
