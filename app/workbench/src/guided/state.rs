//! A guided sequence.

use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_estimate::Observations;
use handeye_geometry::progress::CancelToken;
use handeye_plan::guided::choose::{Proposal, Robot};
use handeye_plan::guided::{CHECKS, Ending, Guide, GuidedOptions, Known, Next, Why};

use crate::messages::state::Severity;
use crate::solve::state::Solved;
use crate::text::Text;
use handeye_wording::text;

/// How a guided sequence goes.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedProgress {
    /// What chooses the poses, and knows all it has proposed.
    pub guide: Guide,
    /// What the sequence waits for between two poses.
    pub waits: Waits,
    /// Why the pose that is under way was chosen.
    pub why: Option<Why>,
    /// The pose that is next, and those after it as far as it is planned.
    pub ahead: Vec<Proposal>,
    /// Poses that are expected to lead to the goal; `None` if unknown.
    pub views_left: Option<usize>,
    /// Where the arm was when the next pose was chosen; the path was checked from there.
    pub chosen_at: Option<JointValues>,
    /// Since when \[s\], and after how many poses, it has been under way without a pause.
    pub since: (f64, usize),
    /// How the choice ended; what follows checks the answer.
    pub ending: Option<Ending>,
    /// Captures so far that check it.
    pub checked: usize,
    /// Poses that were tried for checks.
    pub tried: usize,
    /// Consecutive moves that the robot did not begin.
    pub refused_moves: usize,
    /// It has ended and cannot be continued.
    pub is_over: bool,
}

/// What a guided sequence waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waits {
    /// Nothing: a pose is under way, or waits for the user to allow the move.
    Nothing,
    /// For the answer from all captures.
    Answer,
    /// For the next pose.
    Choice,
}

impl GuidedProgress {
    /// At the beginning.
    pub fn new(options: GuidedOptions, now_s: f64) -> Self {
        Self {
            guide: Guide::new(options),
            waits: Waits::Nothing,
            why: None,
            ahead: Vec::new(),
            views_left: None,
            chosen_at: None,
            since: (now_s, 0),
            ending: None,
            checked: 0,
            tried: 0,
            refused_moves: 0,
            is_over: false,
        }
    }
}

/// A requested choice.
#[derive(Debug, Clone)]
pub struct GuideRequest {
    /// What chooses.
    pub guide: Guide,
    /// What was observed.
    pub observations: Observations,
    /// The answer from it, where there is one.
    pub solved: Option<Arc<Solved>>,
    /// Since the beginning \[s\].
    pub elapsed_s: f64,
    /// How fast the arm is driven, of its highest speed.
    pub speed: f64,
    /// The number of the check, if a verification pose is requested.
    pub check: Option<usize>,
}

/// Compares the choice alone: observations are large, and two requests are only compared in tests.
impl PartialEq for GuideRequest {
    fn eq(&self, other: &Self) -> bool {
        self.guide == other.guide && self.check == other.check
    }
}

/// What was chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// What chose, with what it proposed.
    pub guide: Guide,
    /// What comes next.
    pub step: ChosenStep,
    /// See [`GuidedProgress::views_left`].
    pub views_left: Option<usize>,
    /// Where the arm was when it was chosen.
    pub chosen_at: JointValues,
}

/// What comes next.
#[derive(Debug, Clone, PartialEq)]
pub enum ChosenStep {
    /// A pose, or the end of the choice.
    Next(Box<Next>),
    /// A pose to check the answer at; `None` if none is in reach.
    Check(Option<Box<Proposal>>),
}

impl GuideRequest {
    /// Chooses, for an arm that is at rest. Takes some tenths of a second.
    pub(crate) fn choose(&self, robot: &Robot, cancel: &CancelToken) -> Choice {
        let mut guide = self.guide.clone();
        let calibration = self.solved.as_ref().map(|solved| &solved.calibration);
        let known =
            Known { observations: &self.observations, calibration, robot: Some(robot), elapsed_s: self.elapsed_s };
        let step = match self.check {
            Some(index) => ChosenStep::Check(guide.check_pose(&known, index, 0, cancel).map(Box::new)),
            None => ChosenStep::Next(Box::new(guide.next(&known, cancel))),
        };
        let views_left = match &step {
            ChosenStep::Next(next) => match &**next {
                Next::Go { plan, .. } => guide.views_left(&known, plan),
                Next::End(_) => None,
            },
            ChosenStep::Check(_) => None,
        };
        Choice { guide, step, views_left, chosen_at: robot.joints }
    }
}

/// What a choice was, or why there is none.
pub(crate) type ChoiceOutcome = Result<Box<Choice>, Text>;

/// The options for a guided capture, in addition to existing captures.
pub(crate) fn options(goal_m: f64, views: usize) -> GuidedOptions {
    let default = GuidedOptions::default();
    GuidedOptions { goal_m, most_views: default.most_views + views, ..default }
}

/// How it ended, after this many checks.
pub(crate) fn ended(ending: &Ending, checked: usize) -> (Severity, Text) {
    if checked < CHECKS {
        let reported = text!(
            "{ending}. It was checked at {checked} of {of} poses only: see why in the log, and verify where you can",
            ending = ending.text(),
            checked = checked,
            of = CHECKS
        );
        return (Severity::Warning, reported);
    }
    (if ending.is_success() { Severity::Info } else { Severity::Warning }, ending.text())
}
