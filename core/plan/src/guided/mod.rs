//! Calibration that chooses its own poses: from one view of the board to the requested accuracy.
//!
//! # How
//! Before there is a first estimate the tip is turned a little about its own axes ([`fan`]). From then on every view is the
//! one of many possible ones that lowers the expected error of the tip over a box most for its travel ([`choose`]),
//! by the same information matrix as the estimate ([`ViewModel`]). A view is possible where the whole board is in the image
//! in spite of the uncertainty, so moves are small at first and grow as it shrinks.
//!
//! # When it ends
//! See [`Ending`]. The error is the one that the calibration promises ([`Calibration::promised`]): how near a tool arrives where
//! the arm is known, else that of a measured point. It counts at the upper 80 % limit of the noise levels: an end that waits for a
//! small estimate prefers estimates that happen to be small.
//!
//! # Degenerate cases
//! A session whose views do not determine an answer goes on with the fan. Where the arm or its joints are not known, its errors are
//! not part of the expected information of a view.

pub mod by_hand;
pub mod candidates;
pub mod choose;
pub mod design;
pub mod fan;
mod hold;
mod judged;
pub(crate) mod outlook;
mod start;
mod words;

pub use hold::Hold;
pub use judged::JudgedError;

use nalgebra::Point3;

use crate::Contact;
use candidates::ViewRange;
use choose::{ChooseOptions, Chooser, Plan, Proposal, Robot, with_board};
use design::{Design, Part, Weight};
use handeye_arm::JointValues;
use handeye_estimate::diagnose::{Calibration, Promise, Promised};
use handeye_estimate::handeye::joint::{ExpectedView, FIELD_VIEWS, Noise, Posture, ViewModel};
use handeye_estimate::reach_error::Reach;
use handeye_estimate::stated_uncertainty::StatedUncertainty;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_estimate::{Fit, Observations, ViewStatus};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;

/// Views from which on an end is possible: from this number on pose-dependent errors of the robot are tested for, and with
/// fewer the noise levels are hardly known.
pub const LEAST_VIEWS: usize = FIELD_VIEWS;
/// Gain of the best view \[fraction of the error\] below which more views are not worth their time.
pub(crate) const LEAST_GAIN: f64 = 0.03;
/// Captures that check the answer afterwards, where no number is given.
pub const CHECKS: usize = 3;
/// Part of the goal by which explanations that the answer does not account for may move it.
const SMALL_PART: f64 = 0.1;
/// Consecutive solutions whose error has to be below the goal.
const IN_A_ROW: usize = 2;
/// Probability that the noise levels are below the limit that the end is judged by.
const LEVEL_SURE: f64 = 0.8;
/// Largest turn of the tip from the nearest view so far, per view taken: a first estimate from small turns is not trusted
/// with large ones. From six views on there is no limit.
const TURN_PER_VIEW_RAD: f64 = 40.0 * std::f64::consts::PI / 180.0;
/// Number of views with that limit.
const CAREFUL_VIEWS: usize = 6;
/// Factor on that limit after each pose that a person skips.
const NEARER_PER_SKIP: f64 = 0.7;
/// And its least value: a smaller turn is hardly another view.
const LEAST_TURN_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Additional clearance around the board, metres, while there are fewer views than that: its place is uncertain.
const CAREFUL_ROOM_M: f64 = 0.03;
/// Largest motion of a joint to a pose of the fan, radians: more is another configuration, not a small turn.
const LARGEST_FAN_WAY_RAD: f64 = 0.8;
/// Poses in a row without a view after which it ends.
const MOST_FAILURES: usize = 5;
/// Poses of the fan that are tried before giving up.
const MOST_FAN: usize = 24;
/// Random views among which a check finds one that the arm reaches.
const CHECK_CANDIDATES: usize = 200;
/// Least noise levels that a plan assumes: far below those of any robot and any camera.
const LEAST_NOISE: Noise = Noise { corner_px: 2e-3, robot_m: 2e-6, robot_rad: 5e-6, ..Noise::EXACT };
/// The same while there are few views: they may not determine the levels at all.
const CAREFUL_NOISE: Noise = Noise { corner_px: 0.02, robot_m: 2e-5, robot_rad: 5e-5, ..Noise::EXACT };

/// Options of a guided session.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedOptions {
    /// The 95 % error that is to be reached, metres, see [`Calibration::promised`].
    pub goal_m: f64,
    /// Views after which the session ends, whether or not the goal is reached.
    pub most_views: usize,
    /// Longest time, seconds.
    pub most_s: f64,
    /// Gain of the best view, as a fraction of the error, below which it ends: see [`LEAST_GAIN`].
    pub least_gain: f64,
    /// Views that are compared at every step.
    pub candidates: usize,
    /// Views that are planned ahead.
    pub ahead: usize,
    /// Duration of a capture after the arm has arrived, seconds.
    pub dwell_s: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Where the tool works: the goal holds for the worst point of it, and views are chosen by the mean square over it. Without
    /// one the place where the camera saw the board, and a cube as large as the board around it.
    pub tool_box: Option<TipBox>,
}

impl Default for GuidedOptions {
    fn default() -> Self {
        Self {
            goal_m: 3e-4,
            most_views: 40,
            most_s: f64::INFINITY,
            least_gain: LEAST_GAIN,
            candidates: 1000,
            ahead: 6,
            dwell_s: 1.5,
            seed: 1,
            tool_box: None,
        }
    }
}

/// What is known when the next pose is requested.
#[derive(Debug, Clone, Copy)]
pub struct Known<'a> {
    /// All views so far.
    pub observations: &'a Observations,
    /// Their calibration; `None` while they do not determine one.
    pub calibration: Option<&'a Calibration>,
    /// The arm; `None` where its chain is not known, and where it is not driven.
    pub robot: Option<&'a Robot>,
    /// Time since the beginning, seconds.
    pub elapsed_s: f64,
}

impl<'a> Known<'a> {
    fn fit(&self) -> Option<&'a Fit> {
        self.calibration.map(|calibration| &**calibration)
    }
}

/// The next step.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// Take the first of these views, then call again.
    Go {
        /// The views that are planned.
        plan: Plan,
        /// Why the first one is proposed.
        why: Why,
    },
    /// The session ends.
    End(Ending),
}

/// Why a pose is proposed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Why {
    /// A small turn about an axis of the tip, because the place of the camera is unknown.
    FirstTurns {
        /// Angle of the turn, radians.
        turn_rad: f64,
    },
    /// A tilt of the camera about the board by a rough answer, because the small turns do not determine the
    /// calibration.
    FirstTilts {
        /// The tilt, from the first view.
        turn_rad: f64,
    },
    /// Its effect on the error, metres, and the part that it lowers most.
    Gain {
        /// The 95 % error now: of a point by the noise alone, or of a tool by corrected commands.
        from_m: f64,
        /// The same with the new view.
        to_m: f64,
        /// See [`Proposal::part`].
        part: Part,
    },
}

/// Why it ends.
#[derive(Debug, Clone, PartialEq)]
pub enum Ending {
    /// The error is below the goal.
    GoalReached {
        /// The stated error.
        promised: Promised,
    },
    /// The best view would lower the error by less than [`GuidedOptions::least_gain`].
    LittleToGain {
        /// Fraction of the error.
        gain: f64,
    },
    /// More views lower the error no further, or there are as many as allowed, and the part that no view lowers is above the goal:
    /// the repeatability of the arm, and its errors where no commands are corrected.
    Repeatability {
        /// The stated error, with the part that no view lowers.
        promised: Promised,
    },
    /// The largest number of views is reached.
    MostViews,
    /// The longest time is reached.
    MostTime,
    /// By what is known the arm touches something at its present place: it cannot be moved away safely.
    StartBlocked {
        /// What it is too close to.
        by: Contact,
    },
    /// The board was not seen from any of the first turns, or they do not determine an answer.
    NoStart,
    /// This many poses in a row gave no view of the board.
    BoardLost {
        /// Number of poses.
        poses: usize,
    },
    /// There was an answer, and there is none now.
    AnswerLost,
    /// The best view would gain little, and the findings contradict the answer.
    Doubted,
    /// No view with any information can be reached.
    NothingInReach {
        /// Number of views that were compared.
        candidates: usize,
    },
}

/// A pose that was proposed, and its outcome.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// The pose of the tip.
    pub base_from_tip: Pose<Base, Tip>,
    /// The joint values there; `None` for an arm whose chain is not known.
    pub joints: Option<JointValues>,
    /// Why it was proposed.
    pub why: Why,
    /// The 95 % error after it, of the same kind as in [`Why::Gain`], metres; `None` until there is one.
    pub achieved_m: Option<f64>,
    /// Planned travel time of the arm, seconds.
    pub travel_s: f64,
    /// Number of views that were compared.
    pub candidates: usize,
    /// Its outcome.
    pub outcome: Outcome,
}

/// The outcome of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Not known yet.
    Pending,
    /// A view was captured.
    Captured,
    /// No view: no board, blurred, not reached.
    Failed,
    /// A person skipped it.
    Skipped,
}

impl Step {
    /// The gain that was achieved over the one promised, both as ratios of the error after and before it.
    pub fn achieved_over_promised(&self) -> Option<f64> {
        let (_, to_m) = self.why.errors_m()?;
        Some(self.achieved_m? / to_m)
    }
}

/// Chooses the poses of one calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    options: GuidedOptions,
    failed: Vec<Pose<Base, Tip>>,
    fan_tried: usize,
    tilts_tried: usize,
    below: usize,
    solved_views: usize,
    /// Range of views by the poses of the board when the first choice was made: those were chosen by a person, not by
    /// the guide.
    range: Option<ViewRange>,
    failures: usize,
    /// Views that a person skipped, minus one for each that was taken.
    skips: usize,
    steps: Vec<Step>,
    hold: Option<Hold>,
    judged: Option<JudgedError>,
    ended: Option<Ending>,
}

impl Guide {
    /// A guide without captures yet.
    pub fn new(options: GuidedOptions) -> Self {
        Self {
            options,
            failed: Vec::new(),
            fan_tried: 0,
            tilts_tried: 0,
            below: 0,
            solved_views: 0,
            range: None,
            failures: 0,
            skips: 0,
            steps: Vec::new(),
            hold: None,
            judged: None,
            ended: None,
        }
    }

    /// The options.
    pub fn options(&self) -> &GuidedOptions {
        &self.options
    }

    /// Where the tool works from now on, see [`GuidedOptions::tool_box`]: a box that is fixed in the base has another place in
    /// the camera with every answer.
    pub fn work_in(&mut self, tool_box: Option<TipBox>) {
        self.options.tool_box = tool_box;
    }

    /// Every pose that was proposed, and its outcome.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The error that the goal last referred to; `None` where none may be stated.
    pub fn judged(&self) -> Option<&JudgedError> {
        self.judged.as_ref()
    }

    /// Why it ended; `None` while it goes on.
    pub fn ended(&self) -> Option<&Ending> {
        self.ended.as_ref()
    }

    /// The pose proposed last gave no view: it is not proposed again, nor its neighbourhood.
    pub fn failed(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.outcome = Outcome::Failed;
            self.failed.push(step.base_from_tip);
        }
        self.failures += 1;
    }

    /// A person skips the pose proposed last: it is not proposed again, nor its neighbourhood, and does not count as a
    /// loss of the board. The next ones are nearer to where the arm has been.
    pub fn skipped(&mut self) {
        self.skips += 1;
        if let Some(step) = self.steps.last_mut() {
            step.outcome = Outcome::Skipped;
            self.failed.push(step.base_from_tip);
        }
    }

    /// The pose proposed last gave a view.
    pub fn captured(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.outcome = Outcome::Captured;
        }
        self.failures = 0;
        // The reason why a person skipped the others still holds.
        self.skips = self.skips.saturating_sub(1);
    }

    /// What to do next. Long work polls `cancel`; cancelled it returns an end or a shorter plan, which are meaningless.
    pub fn next(&mut self, known: &Known<'_>, cancel: &CancelToken) -> Next {
        let used = used_views(known.observations, known.fit());
        let (goal_m, tool_box) = (self.options.goal_m, self.options.tool_box.as_ref());
        self.judged = known.calibration.and_then(|it| JudgedError::of(it, goal_m, tool_box));
        let achieved = self.lowered(known);
        if let Some(step) = self.steps.last_mut().filter(|step| step.outcome == Outcome::Captured) {
            step.achieved_m = achieved.map(|achieved| achieved.now_m);
            let last = known.observations.views.len().wrapping_sub(1);
            if known.calibration.is_some_and(|it| it.views.get(last).is_some_and(|v| v.status == ViewStatus::Outlier)) {
                // It has no information, and would be proposed again.
                self.failed.push(step.base_from_tip);
            }
        }
        self.hold = self.hold_of(known, used.len());
        let next = self.found(known, &used, cancel);
        if cancel.is_cancelled() {
            return next;
        }
        match &next {
            Next::End(ending) => self.ended = Some(ending.clone()),
            Next::Go { plan, why } => self.steps.extend(plan.proposals.first().map(|first| Step {
                base_from_tip: first.base_from_tip,
                joints: first.joints,
                why: *why,
                achieved_m: None,
                travel_s: first.travel_s,
                candidates: plan.candidates,
                outcome: Outcome::Pending,
            })),
        }
        next
    }

    fn found(&mut self, known: &Known<'_>, used: &[UsedView], cancel: &CancelToken) -> Next {
        if let Some(ending) = self.ending(known, used.len()) {
            return Next::End(ending);
        }
        if self.failures >= MOST_FAILURES && self.range.is_some() {
            return Next::End(Ending::BoardLost { poses: self.failures });
        }
        let contact = |robot: &Robot| robot.arm.contact(&robot.joints, &robot.around, robot.clearance_m);
        if let (0..=1, Some(by)) = (used.len(), known.robot.and_then(contact)) {
            return Next::End(Ending::StartBlocked { by });
        }
        let Some(model) = self.model(known) else { return self.without_answer(known, cancel) };
        let least = if used.len() < CAREFUL_VIEWS { &CAREFUL_NOISE } else { &LEAST_NOISE };
        let noise = at_least(model.noise(), least);
        let model = model.with_noise(noise);
        if self.range.is_none() && known.calibration.is_none_or(|it| camera_unsure_m(it) > CAREFUL_ROOM_M) {
            return self.first_poses(known, cancel);
        }
        match self.plan(known, &model, used, cancel) {
            None => self.without_answer(known, cancel),
            Some((plan, lowered)) if plan.candidates > 0 => self.worthwhile(known, plan, lowered, used.len()),
            // The uncertainty is so large that no view is surely in the image: more of the first poses.
            Some(_) => self.first_poses(known, cancel),
        }
    }

    /// The first turns are only for the time before there is an answer: later the arm is elsewhere, and they are not
    /// small moves.
    fn without_answer(&mut self, known: &Known<'_>, cancel: &CancelToken) -> Next {
        if self.range.is_some() { Next::End(Ending::AnswerLost) } else { self.first_poses(known, cancel) }
    }

    /// The error that the goal refers to, where views are chosen by it: where commands can be corrected.
    fn by_arm(&self, known: &Known<'_>) -> Option<&JudgedError> {
        let is_corrected = known.calibration?.reach_errors()?.corrected_95_m.is_some();
        self.judged.as_ref().filter(|judged| judged.promised.of != Promise::Point && is_corrected)
    }

    /// The model by which views are chosen.
    fn model(&self, known: &Known<'_>) -> Option<ViewModel> {
        let (calibration, target) = (known.calibration?, &known.observations.target);
        let by_arm = self.by_arm(known).and_then(|_| ViewModel::of_arm(calibration, target));
        by_arm.or_else(|| ViewModel::new(calibration, target))
    }

    /// The 95 % error that is expected with this part left of what views lower, see [`Proposal::error_ratio`], metres, after
    /// [`Self::next`], and its kind: for a point it is that by the noise alone.
    pub fn expected_m(&self, known: &Known<'_>, ratio: f64) -> Option<(f64, Promise)> {
        let of = self.by_arm(known).map_or(Promise::Point, |judged| judged.promised.of);
        Some((self.lowered(known)?.with_m(ratio), of))
    }

    /// The error that views lower.
    fn lowered(&self, known: &Known<'_>) -> Option<Lowered> {
        if let Some(judged) = self.by_arm(known) {
            return Some(Lowered { now_m: judged.promised.error_m, least_m: judged.promised.least_m });
        }
        let now_m = modelled_error_m(known.calibration?, self.options.tool_box.as_ref())?;
        Some(Lowered { now_m, least_m: 0.0 })
    }

    /// The plan from an estimate, and what it lowers; `None` where the views so far do not determine an answer.
    fn plan(
        &mut self,
        known: &Known<'_>,
        model: &ViewModel,
        used: &[UsedView],
        cancel: &CancelToken,
    ) -> Option<(Plan, Lowered)> {
        let lowered = self.lowered(known)?;
        let ground = self.ground(known, model, used, cancel)?;
        self.range = Some(ground.range);
        let options = ChooseOptions {
            candidates: self.options.candidates,
            ahead: self.options.ahead.min(self.options.most_views.saturating_sub(used.len())).max(1),
            seed: self
                .options
                .seed
                .wrapping_add(known.observations.views.len() as u64)
                .wrapping_add(977 * self.failed.len() as u64),
            dwell_s: self.options.dwell_s,
            failed: &self.failed,
            turn_rad: if used.len() < CAREFUL_VIEWS {
                (TURN_PER_VIEW_RAD * used.len() as f64).min(turn_after(self.skips))
            } else {
                turn_after(self.skips)
            },
            doubt_factor: self.doubt_factor(),
        };
        let chooser = ground.chooser(model, &known.observations.target);
        Some((chooser.plan(&ground.design, &options), lowered))
    }

    /// A pose that was not designed, to check the answer at: a random view that the arm reaches. `index` counts the
    /// checks, `skips` those that a person skipped. `None` where there is no answer, or no such view.
    pub fn check_pose(&self, known: &Known<'_>, index: usize, skips: usize, cancel: &CancelToken) -> Option<Proposal> {
        let target = &known.observations.target;
        let model = self.model(known)?;
        let model = model.clone().with_noise(at_least(model.noise(), &LEAST_NOISE));
        let used = used_views(known.observations, known.fit());
        let ground = self.ground(known, &model, &used, cancel)?;
        let options = ChooseOptions {
            candidates: CHECK_CANDIDATES,
            ahead: 1,
            // Apart from the seeds of the plans.
            seed: self.options.seed.wrapping_add(1_000_003 * (index as u64 + 1)),
            dwell_s: self.options.dwell_s,
            failed: &self.failed,
            turn_rad: turn_after(skips),
            doubt_factor: 1.0,
        };
        ground.chooser(&model, target).at_random(&ground.design, &options)
    }

    /// The basis of a choice; `None` where the views so far do not determine an answer.
    fn ground<'c>(
        &self,
        known: &Known<'c>,
        model: &ViewModel,
        used: &[UsedView],
        cancel: &'c CancelToken,
    ) -> Option<Ground<'c>> {
        let calibration = known.calibration?;
        let (joint, reach) = (calibration.joint.as_ref()?, calibration.reach());
        let target = &known.observations.target;
        let views = expected_views(model, used);
        let tool_box = self.options.tool_box.as_ref();
        let of_reach = known.calibration.filter(|_| model.has_arm()).and_then(|it| it.reach_weight(tool_box));
        let weight: Weight = match (of_reach, tool_box) {
            (Some(of_reach), _) => Weight::of_reach(model.hand_eye_and_arm(), of_reach),
            (None, None) => design::weight_about(&joint.reference_point, target).into(),
            (None, Some(tool_box)) => design::weight_over(&tool_box.corners_and_middle()).into(),
        };
        let design = Design::new(model.prior(), &views, weight)?;
        let distances = used
            .iter()
            .map(|view| (model.camera_from_target(&view.posture).isometry() * target.centre()).coords.norm());
        let range = self.range.or_else(|| ViewRange::about(distances))?;
        let taken = used.iter().map(|view| view.posture.base_from_tip).collect();
        let room_m = if used.len() < CAREFUL_VIEWS { CAREFUL_ROOM_M } else { 0.0 };
        let robot = known.robot.map(|robot| with_board(robot, model.hand_eye(), known.observations, room_m));
        Some(Ground { design, reach, range, robot, taken, cancel })
    }

    /// The board was expected to be in the image of failed poses: the estimate is worse than stated.
    fn doubt_factor(&self) -> f64 {
        1.0 + self.failures as f64
    }

    /// Whether no finding contradicts the answer. An explanation that it does not account for, and that moves it by a small part
    /// of the goal, does not have to be resolved for this goal.
    fn is_sound(&self, calibration: Option<&Calibration>) -> bool {
        let Some(calibration) = calibration else { return false };
        match calibration.stated_uncertainty() {
            StatedUncertainty::AsModelled => true,
            StatedUncertainty::Nothing => false,
            claim @ StatedUncertainty::Moved(_) => {
                let moved_m = worst(calibration, self.options.tool_box.as_ref(), |point| Some(claim.moved_m(point)));
                moved_m.is_some_and(|moved_m| moved_m <= SMALL_PART * self.options.goal_m)
            }
        }
    }

    fn worthwhile(&self, known: &Known<'_>, plan: Plan, lowered: Lowered, views: usize) -> Next {
        let Some(first) = plan.proposals.first() else {
            let reached = self.reached_after_all(known, views);
            return Next::End(reached.unwrap_or(Ending::NothingInReach { candidates: plan.candidates }));
        };
        let limit = self.repeatability();
        let gain = 1.0 - lowered.with_m(plan.best_ratio) / lowered.now_m;
        // Where no view leads to the goal the decrease of the whole error has to be worth a view.
        let worth = if limit.is_some() { gain } else { 1.0 - plan.best_ratio };
        if views >= LEAST_VIEWS && worth < self.options.least_gain {
            let reached = self.reached_after_all(known, views).or(limit);
            let ending = reached.unwrap_or(Ending::LittleToGain { gain });
            return Next::End(if self.is_sound(known.calibration) { ending } else { Ending::Doubted });
        }
        let why = Why::Gain { from_m: lowered.now_m, to_m: lowered.with_m(first.error_ratio), part: first.part };
        Next::Go { plan, why }
    }

    /// For an end with another reason than a small error: the session did not wait for a small estimate, so the error is as
    /// likely too small as too large.
    fn reached_after_all(&self, known: &Known<'_>, views: usize) -> Option<Ending> {
        let promised = self.judged.map(|judged| judged.promised)?;
        let is_below = views >= LEAST_VIEWS && promised.error_m <= self.options.goal_m;
        (is_below && self.is_sound(known.calibration)).then_some(Ending::GoalReached { promised })
    }

    /// The end where the part that no view lowers is above the goal.
    fn repeatability(&self) -> Option<Ending> {
        let promised = self.judged?.promised;
        (promised.least_m > self.options.goal_m).then_some(Ending::Repeatability { promised })
    }

    fn ending(&mut self, known: &Known<'_>, views: usize) -> Option<Ending> {
        if known.calibration.is_some() && views >= LEAST_VIEWS && views != self.solved_views {
            self.solved_views = views;
            let below = self.judged.filter(|error| error.at_upper_levels_m <= self.options.goal_m);
            let below = below.filter(|_| self.is_sound(known.calibration));
            self.below = if below.is_some() { self.below + 1 } else { 0 };
            if let Some(error) = below.filter(|_| self.below >= IN_A_ROW) {
                return Some(Ending::GoalReached { promised: error.promised });
            }
        }
        let reached = || self.reached_after_all(known, views).or_else(|| self.repeatability());
        let in_fit = known.observations.views.iter().filter(|view| view.in_fit && view.corners.is_some()).count();
        if in_fit >= self.options.most_views {
            return Some(reached().unwrap_or(Ending::MostViews));
        }
        let is_over = known.elapsed_s >= self.options.most_s;
        is_over.then(|| reached().unwrap_or(Ending::MostTime))
    }
}

/// An error that views lower, metres.
#[derive(Debug, Clone, Copy)]
struct Lowered {
    now_m: f64,
    /// The value below which no view lowers it.
    least_m: f64,
}

impl Lowered {
    /// The error with this fraction left of the part that views lower.
    fn with_m(&self, ratio: f64) -> f64 {
        let least = self.least_m.min(self.now_m).powi(2);
        (least + (self.now_m.powi(2) - least) * ratio * ratio).sqrt()
    }
}

/// The basis of a choice.
struct Ground<'c> {
    design: Design,
    reach: Option<&'c Reach>,
    range: ViewRange,
    robot: Option<Robot>,
    taken: Vec<Pose<Base, Tip>>,
    cancel: &'c CancelToken,
}

impl Ground<'_> {
    fn chooser<'a>(&'a self, model: &'a ViewModel, target: &'a TargetSpec) -> Chooser<'a> {
        Chooser {
            model,
            target,
            range: &self.range,
            robot: self.robot.as_ref(),
            reach: self.reach,
            taken: &self.taken,
            cancel: self.cancel,
        }
    }
}

/// Largest turn of the tip from the nearest view so far, after this many more poses skipped than taken, radians: where the
/// arm has been it can go again.
fn turn_after(skips: usize) -> f64 {
    (std::f64::consts::PI * NEARER_PER_SKIP.powf(skips as f64)).max(LEAST_TURN_RAD)
}

/// Error of the camera's position on its mount, 95 %, metres.
fn camera_unsure_m(calibration: &Calibration) -> f64 {
    calibration.modelled_error_95_at(&Point3::origin()).unwrap_or(f64::INFINITY)
}

/// The error by the noise alone at the place where the goal is judged, metres.
fn modelled_error_m(calibration: &Calibration, tool_box: Option<&TipBox>) -> Option<f64> {
    worst(calibration, tool_box, |point| calibration.modelled_error_95_at(point))
}

/// The largest value over the corners of a box, where errors are largest, or that where the camera saw the board.
fn worst(
    calibration: &Calibration,
    tool_box: Option<&TipBox>,
    error_m: impl Fn(&Point3<f64>) -> Option<f64>,
) -> Option<f64> {
    match tool_box {
        None => error_m(&calibration.joint.as_ref()?.reference_point),
        Some(tool_box) => {
            let errors: Option<Vec<f64>> = tool_box.corners_and_middle().iter().map(error_m).collect();
            errors?.into_iter().reduce(f64::max)
        }
    }
}

/// A view that is in the fit.
struct UsedView {
    posture: Posture,
    /// The indices of the corners found in it.
    corners: Vec<usize>,
}

/// The views that are in the fit.
fn used_views(observations: &Observations, fit: Option<&Fit>) -> Vec<UsedView> {
    let is_used =
        |index: usize| fit.is_none_or(|fit| fit.views.get(index).is_some_and(|view| view.status == ViewStatus::Used));
    let of_view = |(index, view): (usize, &handeye_estimate::ObservedView)| {
        let corners = view.corners.as_ref().filter(|_| view.in_fit && is_used(index))?;
        let posture = Posture { base_from_tip: view.base_from_tip?, tip_from_joints: view.tip_from_joints.clone() };
        Some(UsedView { posture, corners: corners.iter().map(|corner| corner.index).collect() })
    };
    observations.views.iter().enumerate().filter_map(of_view).collect()
}

/// The information of views that were taken, by a model.
fn expected_views(model: &ViewModel, used: &[UsedView]) -> Vec<ExpectedView> {
    used.iter().filter_map(|view| model.expected(&view.posture, &view.corners)).collect()
}

fn at_least(noise: &Noise, least: &Noise) -> Noise {
    Noise {
        corner_px: noise.corner_px.max(least.corner_px),
        robot_m: noise.robot_m.max(least.robot_m),
        robot_rad: noise.robot_rad.max(least.robot_rad),
        ..*noise
    }
}

#[cfg(test)]
mod tests;
