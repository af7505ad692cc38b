//! How far the calibration has come: what is done, what can be done now, and what is missing.

use handeye_estimate::GOOD_VIEWS;
use handeye_estimate::handeye::motion::MIN_VIEWS;
use handeye_session::Role;

use super::status::STALE_AFTER_S;
use crate::style::numbers;
use handeye_wording::text;
use handeye_workbench::model::{Model, Step};
use handeye_workbench::text::Text;

/// The state of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepState {
    /// There is nothing left to do.
    Done,
    /// It can be done.
    Now,
    /// Something has to come first.
    Blocked,
}

/// A step for the user.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StepStatus {
    /// Which one.
    pub step: Step,
    /// How it is doing.
    pub state: StepState,
    /// What is there, what is missing or what to do, in a few words.
    pub line: Text,
}

/// Everything that the steps depend on.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own, and any of them can be true")]
pub struct Facts {
    /// Robot and camera answer.
    pub connected: bool,
    /// A connection was there and is gone.
    pub lost: bool,
    /// An image has come.
    pub frame_seen: bool,
    /// The board is in the live image.
    pub board_in_view: bool,
    /// It was found in a capture.
    pub board_captured: bool,
    /// The captures are images alone, to calibrate the camera by itself.
    pub no_robot: bool,
    /// Captures that enter the fit.
    pub captures_in_use: usize,
    /// The solver is running.
    pub solving: bool,
    /// There is an answer for the present captures.
    pub solved: bool,
    /// Its expected error \[m\], 95 %.
    pub expected_error_m: Option<f64>,
    /// The arm visits poses by itself.
    pub sequence_runs: bool,
    /// Captures for verification.
    pub verifying: usize,
    /// They were compared with the answer.
    pub verified: bool,
    /// And their errors are larger than the answer states.
    pub contradicted: bool,
    /// Files of the present answer were written.
    pub exported: bool,
    /// The board is being tracked.
    pub tracking: bool,
    /// It is, but it is not visible.
    pub out_of_sight: bool,
}

impl Facts {
    /// The facts in the model. The only place where the steps read it.
    pub fn of(model: &Model) -> Self {
        let connected = model.control.is_connected() && model.camera.is_connected();
        let document = model.document();
        // Not for each image: a single blurred one is no evidence.
        let seen_now = model.board_seen_s.is_some_and(|seen_s| model.now_s - seen_s < STALE_AFTER_S);
        let captured = model.observed.values().flatten().any(|observed| observed.corners.is_some());
        let current = model.solve.current();
        let promised = current.and_then(|solved| solved.promised(model.view.goal.0));
        let expected_error_m = promised.map(|promised| promised.error_m);
        Self {
            connected,
            lost: !connected && model.frame.is_some(),
            frame_seen: model.frame.is_some(),
            board_in_view: connected && seen_now,
            board_captured: captured,
            no_robot: document.mode().is_none(),
            captures_in_use: document.in_use().count(),
            solving: model.solve.is_running(),
            solved: current.is_some(),
            expected_error_m,
            sequence_runs: model.sequence_runs,
            verifying: document.captures.iter().filter(|it| it.role == Role::Verification && !it.excluded).count(),
            verified: current.is_some_and(|solved| matches!(solved.verification, Some(Ok(_)))),
            contradicted: current
                .and_then(|solved| solved.verification_in_use()?.is_as_stated())
                .is_some_and(|is_as_stated| !is_as_stated),
            exported: model.export.is_present && current.is_some(),
            tracking: model.track.on,
            out_of_sight: model.track.newest.as_ref().is_some_and(|newest| newest.update.estimate.is_none()),
        }
    }
}

/// The steps in their order.
pub fn steps(model: &Model) -> [StepStatus; 7] {
    judged(&Facts::of(model))
}

/// The steps by the facts.
fn judged(facts: &Facts) -> [StepStatus; 7] {
    Step::ALL.map(|step| {
        let (state, line) = match step {
            Step::Connect => connect(facts),
            Step::Target => target(facts),
            Step::Capture => capture(facts),
            Step::Solve => solve(facts),
            Step::Verify => verify(facts),
            Step::Export => export(facts),
            Step::Track => track(facts),
        };
        StepStatus { step, state, line }
    })
}

/// The first step that can be done and is not done. The board does not have to be in view after the captures.
pub fn next(steps: &[StepStatus]) -> Option<Step> {
    let is_done = |step| steps.iter().any(|status| status.step == step && status.state == StepState::Done);
    let comes_next = |status: &&StepStatus| {
        status.state == StepState::Now && !(status.step == Step::Target && is_done(Step::Capture))
    };
    steps.iter().find(comes_next).map(|status| status.step)
}

fn connect(facts: &Facts) -> (StepState, Text) {
    match (facts.connected, facts.frame_seen) {
        (true, true) => (StepState::Done, text!("Robot and camera")),
        (true, false) => (StepState::Now, text!("No image yet")),
        (false, _) if facts.lost => (StepState::Now, text!("Connection lost")),
        (false, _) => (StepState::Now, text!("No connection")),
    }
}

fn target(facts: &Facts) -> (StepState, Text) {
    match (facts.board_in_view, facts.connected && facts.frame_seen, facts.board_captured) {
        (true, ..) => (StepState::Done, text!("Board in view")),
        // A sequence may leave it during its motions.
        (false, true, true) if !facts.sequence_runs => (StepState::Now, text!("Board out of view")),
        (false, _, true) => (StepState::Done, text!("Board in the captures")),
        (false, true, false) => (StepState::Now, text!("Board not seen yet")),
        (false, false, false) => (StepState::Blocked, text!("Needs an image")),
    }
}

fn capture(facts: &Facts) -> (StepState, Text) {
    let Facts { captures_in_use: count, .. } = *facts;
    if facts.no_robot {
        let state = if count >= MIN_VIEWS { StepState::Done } else { StepState::Blocked };
        return (state, text!("{count} {count|image|images}", count = count));
    }
    if count >= GOOD_VIEWS {
        (StepState::Done, text!("{count} poses", count = count))
    } else if count > 0 || facts.board_in_view || facts.board_captured {
        (StepState::Now, text!("{count} of {wanted} poses", count = count, wanted = GOOD_VIEWS))
    } else {
        (StepState::Blocked, text!("Needs the board"))
    }
}

fn solve(facts: &Facts) -> (StepState, Text) {
    if facts.captures_in_use < MIN_VIEWS && facts.no_robot {
        return (StepState::Blocked, text!("Needs {count} images", count = MIN_VIEWS));
    }
    if facts.captures_in_use < MIN_VIEWS {
        return (StepState::Blocked, text!("Needs {count} poses", count = MIN_VIEWS));
    }
    match (facts.solving, facts.solved, facts.expected_error_m) {
        (true, ..) => (StepState::Now, text!("Working…")),
        (false, false, _) => (StepState::Now, text!("Ready to solve")),
        (false, true, Some(error_m)) => {
            (StepState::Done, text!("±{error} mm (95 %)", error = numbers::error_mm(error_m)))
        }
        (false, true, None) => (StepState::Done, text!("Solved")),
    }
}

fn verify(facts: &Facts) -> (StepState, Text) {
    match (facts.solved, facts.verified, facts.verifying) {
        _ if facts.no_robot => (StepState::Blocked, text!("Needs robot poses")),
        (false, ..) => (StepState::Blocked, text!("Needs a calibration")),
        // What fails is never ticked.
        (true, true, _) if facts.contradicted => (StepState::Now, text!("Errors larger than stated")),
        (true, true, count) => (StepState::Done, text!("{count} {count|capture|captures}", count = count)),
        (true, false, _) => (StepState::Now, text!("Not verified yet")),
    }
}

fn export(facts: &Facts) -> (StepState, Text) {
    match (facts.solved, facts.exported) {
        (false, _) => (StepState::Blocked, text!("Needs a calibration")),
        (true, false) => (StepState::Now, text!("Choose formats")),
        (true, true) => (StepState::Done, text!("Files written")),
    }
}

fn track(facts: &Facts) -> (StepState, Text) {
    match (facts.solved, facts.connected, facts.tracking) {
        _ if facts.no_robot => (StepState::Blocked, text!("Needs robot poses")),
        (false, ..) => (StepState::Blocked, text!("Needs a calibration")),
        (true, false, _) => (StepState::Blocked, text!("Needs a connection")),
        (true, true, false) => (StepState::Now, text!("Follow the board")),
        (true, true, true) if facts.out_of_sight => (StepState::Now, text!("Board out of sight")),
        (true, true, true) => (StepState::Done, text!("Tracking")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::text::Language;

    fn reported(facts: &Facts) -> Vec<(StepState, String)> {
        judged(facts).into_iter().map(|status| (status.state, status.line.in_language(Language::English))).collect()
    }

    #[test]
    fn at_first_only_connecting_can_be_done_and_every_other_step_says_what_it_needs() {
        let steps = reported(&Facts::default());
        assert_eq!(steps[0], (StepState::Now, "No connection".to_owned()));
        for (state, line) in &steps[1..] {
            assert_eq!(*state, StepState::Blocked);
            assert!(line.starts_with("Needs "), "{line}");
        }
    }

    #[test]
    fn captures_are_counted_towards_what_is_wanted() {
        let mut facts = Facts { connected: true, frame_seen: true, board_in_view: true, ..Facts::default() };
        facts.captures_in_use = 7;
        assert_eq!(reported(&facts)[2], (StepState::Now, "7 of 10 poses".to_owned()));
        assert_eq!(reported(&facts)[3].0, StepState::Now, "three poses are enough to solve");
        facts.captures_in_use = 10;
        assert_eq!(reported(&facts)[2], (StepState::Done, "10 poses".to_owned()));
    }

    #[test]
    fn a_board_that_is_out_of_view_on_the_way_to_a_pose_is_nothing_to_do() {
        let facts = Facts { connected: true, frame_seen: true, board_captured: true, ..Facts::default() };
        assert_eq!(reported(&facts)[1], (StepState::Now, "Board out of view".to_owned()));
        assert_eq!(reported(&Facts { sequence_runs: true, ..facts })[1].0, StepState::Done);
    }

    #[test]
    fn captures_on_the_disk_can_be_solved_without_a_connection() {
        let facts = Facts { captures_in_use: 12, board_in_view: true, ..Facts::default() };
        assert_eq!(reported(&facts)[0].0, StepState::Now);
        assert_eq!(reported(&facts)[3].0, StepState::Now);
    }

    /// From images alone there is a camera to export, but no robot to verify or to track with.
    #[test]
    fn without_a_robot_the_export_comes_after_the_answer() {
        let facts = Facts { captures_in_use: 12, no_robot: true, solved: true, ..Facts::default() };
        let steps = reported(&facts);
        assert_eq!(steps[2], (StepState::Done, "12 images".to_owned()));
        let needs_robot = (StepState::Blocked, "Needs robot poses".to_owned());
        assert_eq!([&steps[4], &steps[6]], [&needs_robot, &needs_robot]);
        assert_eq!(steps[5].0, StepState::Now);
        let few = reported(&Facts { captures_in_use: 2, solved: false, ..facts });
        assert_eq!(few[2], (StepState::Blocked, "2 images".to_owned()));
        assert_eq!(few[3], (StepState::Blocked, "Needs 3 images".to_owned()));
    }

    #[test]
    fn an_answer_is_told_by_its_expected_error_and_opens_the_steps_after_it() {
        let mut facts = Facts { captures_in_use: 10, board_in_view: true, solved: true, ..Facts::default() };
        facts.expected_error_m = Some(0.000_42);
        assert_eq!(reported(&facts)[3], (StepState::Done, "±0.42 mm (95 %)".to_owned()));
        assert_eq!((reported(&facts)[4].0, reported(&facts)[5].0), (StepState::Now, StepState::Now));
        facts.solving = true;
        assert_eq!(reported(&facts)[3].0, StepState::Now, "an answer that is being replaced is not done");
    }

    #[test]
    fn a_verification_that_fails_is_not_ticked() {
        let facts = Facts { captures_in_use: 10, solved: true, verifying: 4, verified: true, ..Facts::default() };
        assert_eq!(reported(&facts)[4], (StepState::Done, "4 captures".to_owned()));
        let failed = reported(&Facts { contradicted: true, ..facts });
        assert_eq!(failed[4], (StepState::Now, "Errors larger than stated".to_owned()));
    }

    #[test]
    fn tracking_needs_a_calibration_and_a_connection_and_a_board_that_is_lost_is_to_be_found() {
        let mut facts = Facts { captures_in_use: 10, board_in_view: true, ..Facts::default() };
        assert_eq!(reported(&facts)[6], (StepState::Blocked, "Needs a calibration".to_owned()));
        facts.solved = true;
        assert_eq!(reported(&facts)[6], (StepState::Blocked, "Needs a connection".to_owned()));
        facts.connected = true;
        assert_eq!(reported(&facts)[6], (StepState::Now, "Follow the board".to_owned()));
        facts.tracking = true;
        assert_eq!(reported(&facts)[6], (StepState::Done, "Tracking".to_owned()));
        facts.out_of_sight = true;
        assert_eq!(reported(&facts)[6], (StepState::Now, "Board out of sight".to_owned()));
    }

    #[test]
    fn a_broken_connection_is_no_longer_done() {
        let facts = Facts { lost: true, frame_seen: true, board_in_view: true, ..Facts::default() };
        assert_eq!(reported(&facts)[0], (StepState::Now, "Connection lost".to_owned()));
    }

    #[test]
    fn a_board_that_left_the_view_is_not_ticked_and_called_for_only_while_captures_are_missing() {
        let mut facts = Facts { connected: true, frame_seen: true, board_captured: true, ..Facts::default() };
        facts.captures_in_use = 4;
        assert_eq!(reported(&facts)[1], (StepState::Now, "Board out of view".to_owned()));
        assert_eq!(next(&judged(&facts)), Some(Step::Target));
        facts.captures_in_use = 10;
        assert_eq!(next(&judged(&facts)), Some(Step::Solve));
        facts.connected = false;
        assert_eq!(reported(&facts)[1], (StepState::Done, "Board in the captures".to_owned()));
    }

    #[test]
    fn the_next_step_is_the_first_that_can_be_done() {
        let facts = Facts { connected: true, frame_seen: true, ..Facts::default() };
        assert_eq!(next(&judged(&facts)), Some(Step::Target));
    }
}
