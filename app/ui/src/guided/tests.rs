use std::sync::Arc;

use handeye_dataset::taught_poses::TaughtPose;
use handeye_estimate::diagnose::{Promise, Promised};
use handeye_plan::guided::design::Part;
use handeye_plan::guided::{Ending, GuidedOptions, Why};

use super::section::{begin_ui, progress_ui};
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::guided::state::{GuidedProgress, Waits};
use handeye_workbench::model::{
    self, ArmDoubt, BoxState, CapturePurpose, CellFacts, CellSource, Jog, LinkState, Model, Motion, MotionGoal, Moves,
    PendingMove, PoseSequence, StopOutcome, WorkBox,
};
use handeye_workbench::taught::update::reference_poses;
use handeye_workbench::testing::sample;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::{guided, taught};

const BUTTON: &str = "Calibrate for me";
const FOREIGN: ArmDoubt = ArmDoubt::Foreign { distance_m: 0.074, angle_rad: 0.1 };

fn pane(model: Model) -> Driven {
    Driven::new(
        |ui, model, outbox| {
            begin_ui(ui, model, None, 30.0, outbox);
            if let Some(sequence) = &model.sequence {
                progress_ui(ui, model, sequence, outbox);
            }
        },
        model,
    )
}

/// A cell with a known arm and the board in view.
fn ready() -> Model {
    let mut model = sample::solved();
    model.board_seen_s = Some(model.now_s);
    model
}

fn under_way(waits: Waits, ending: Option<Ending>) -> Model {
    let mut model = ready();
    let guided = GuidedProgress {
        waits,
        ending,
        why: Some(Why::Gain { from_m: 8e-4, to_m: 5e-4, part: Part::Rotation }),
        ..GuidedProgress::new(GuidedOptions::default(), 90.0)
    };
    model.sequence = Some(PoseSequence {
        names: vec!["G1".to_owned(), "G2".to_owned()],
        planned: Some(vec![[0.0; 6].into(); 2]),
        purpose: Some(CapturePurpose::Calibrate),
        outcomes: vec![StopOutcome::Done],
        began_s: 90.0,
        guided: Some(Box::new(guided)),
    });
    model.sequence_runs = true;
    model
}

#[test]
fn it_is_offered_where_it_can_begin() {
    let mut pane = pane(ready());
    assert_eq!(pane.click(BUTTON), [Command::Guided(guided::Command::CalibrateForMe)]);
    let is_blocked = |change: fn(&mut Model)| {
        let mut model = ready();
        change(&mut model);
        assert!(!self::pane(model).is_enabled(BUTTON));
    };
    is_blocked(|model| model.cell.iter_mut().for_each(|cell| cell.arm = None));
    is_blocked(|model| model.motion = Motion::Jogging(Jog::Joint { index: 0, forward: true }));
    is_blocked(|model| model.planning = true);
    let mut unseen = sample::connected();
    unseen.board_seen_s = None;
    assert!(!self::pane(unseen).is_enabled(BUTTON), "there is no board to begin with");
}

#[test]
fn where_the_board_is_not_in_view_the_way_there_is_offered() {
    let unseen = || {
        let mut model = sample::connected();
        let cell = model.taught_on(model.document().meta.target);
        let poses = reference_poses().into_iter().map(|pose| TaughtPose { cell: cell.clone(), ..pose });
        Arc::make_mut(&mut model.session.document).taught = poses.collect();
        model.board_seen_s = None;
        model
    };
    assert_eq!(pane(unseen()).click("Go to P1"), [Command::Taught(taught::Command::GoTo("P1".to_owned()))]);
    let is_offered = |change: fn(&mut Model)| {
        let mut model = unseen();
        change(&mut model);
        pane(model).sees("Go to P1")
    };
    assert!(!is_offered(|model| model.board_seen_s = Some(model.now_s)), "it is in view");
    assert!(!is_offered(|model| model.motion = Motion::Jogging(Jog::Joint { index: 0, forward: true })));
    assert!(!is_offered(|model| model.planning = true));
    assert!(!is_offered(|model| Arc::make_mut(&mut model.session.document).taught.clear()), "there is no such pose");
}

#[test]
fn behind_a_driver_it_is_offered_where_the_chain_of_joints_is_named_and_can_begin_where_that_is_known() {
    let behind = |change: fn(&mut CellFacts)| {
        let mut model = ready();
        let cell = model.cell.as_mut().expect("connected");
        cell.moves = Moves::OnceArmed { joints: true, tip: true };
        change(cell);
        self::pane(model)
    };
    assert_eq!(behind(|_| ()).click(BUTTON), [Command::Guided(guided::Command::CalibrateForMe)]);
    let mut read_only = ready();
    read_only.cell.iter_mut().for_each(|cell| cell.moves = Moves::OnceArmed { joints: true, tip: true });
    read_only.robot.iter_mut().for_each(|robot| robot.is_armed = false);
    assert!(!self::pane(read_only).is_enabled(BUTTON), "nobody has allowed it to move");
    let open = behind(|cell| (cell.arm, cell.arm_doubt) = (None, Some(ArmDoubt::Open)));
    assert!(!open.is_enabled(BUTTON) && open.nothing_is_cut_off());
    assert!(!behind(|cell| (cell.arm, cell.arm_doubt) = (None, Some(FOREIGN))).is_enabled(BUTTON));
    assert!(!behind(|cell| cell.arm = None).sees(BUTTON), "no chain is named");
    assert!(!behind(|cell| cell.moves = Moves::OnceArmed { joints: false, tip: true }).sees(BUTTON));
    assert!(!behind(|cell| cell.moves = Moves::Never).sees(BUTTON));
}

#[test]
fn what_is_under_way_and_why_stands_in_the_pane() {
    let pane = self::pane(under_way(Waits::Nothing, None));
    assert!(pane.sees("Pose 2: moving there, then a capture"));
    assert!(pane.sees("Lowers the expected error from 0.800 to 0.500 mm, mostly in the rotation of the camera"));
    assert!(pane.sees("goal 0.300 mm"), "the goal that it began with");
    assert!(self::pane(under_way(Waits::Choice, None)).sees("Choosing pose 2"));
    let mut refused = under_way(Waits::Choice, None);
    let why = StopOutcome::Skipped(Text::verbatim("the pendant is in manual mode"));
    refused.sequence.as_mut().expect("one").outcomes = vec![why];
    assert!(self::pane(refused).sees("The pose before was left out: the pendant is in manual mode"));
    let checking = under_way(
        Waits::Nothing,
        Some(Ending::GoalReached { promised: Promised { error_m: 3e-4, least_m: 0.0, of: Promise::Point } }),
    );
    assert!(self::pane(checking).sees("Check 1 of 3"));
}

/// The goal is judged over the box that was chosen for the expected error, so that error is shown next to it.
#[test]
fn the_error_over_a_box_that_was_chosen_stands_beside_the_goal() {
    let mut model = under_way(Waits::Nothing, None);
    let chosen = Some(WorkBox { from_m: [0.3, 0.0, 0.0], to_m: [0.5, 0.2, 0.1] });
    let judged = model::judge_box(chosen, model.solve.current().expect("solved"), model.document());
    model.tip_box = BoxState { chosen, judged };
    let worst_mm = judged.expect("judged").1.worst_m * 1e3;
    let reported = format!("Expected error over the box {worst_mm:.3} mm (95 %), goal 0.300 mm");
    assert!(pane(model.clone()).sees(&reported));
    model.tip_box.chosen = None;
    assert!(!pane(model).sees("over the box"));
}

#[test]
fn how_it_ended_is_said_in_the_language_of_the_window_and_it_can_begin_again() {
    let mut model = under_way(
        Waits::Nothing,
        Some(Ending::GoalReached { promised: Promised { error_m: 3e-4, least_m: 0.0, of: Promise::Point } }),
    );
    model.sequence_runs = false;
    let ended = pane(model.clone());
    assert!(ended.sees("The goal is reached: the expected error is 0.300 mm"));
    assert!(ended.is_enabled(BUTTON) && ended.nothing_is_cut_off());
    model.view.language = Language::Chinese;
    let chinese = pane(model);
    assert!(chinese.sees("已达到目标：预期误差为 0.300 mm") && chinese.sees("自动标定"));
}

fn guided(model: &mut Model) -> &mut GuidedProgress {
    model.sequence.as_mut().and_then(|sequence| sequence.guided.as_deref_mut()).expect("a guided sequence")
}

#[test]
fn a_person_lets_the_arm_move_or_has_another_pose_chosen() {
    let mut model = under_way(Waits::Nothing, None);
    let what = Text::verbatim("pose G2");
    model.asked = Some(PendingMove { goal: MotionGoal::Joints([0.0; 6].into()), what });
    model.source = CellSource::Address("tcp://10.0.0.2:23000".to_owned());
    let mut waiting = pane(model.clone());
    assert!(waiting.sees("Pose 2 waits for you"));
    assert_eq!(waiting.click("Move there"), [Command::Taught(taught::Command::ConfirmMove)]);
    assert_eq!(waiting.click("Skip this pose"), [Command::Taught(taught::Command::SkipMove)]);
    assert_eq!(
        waiting.click("Confirm each move"),
        [Command::Taught(taught::Command::SetConfirmMoves(false))],
        "on behind an address"
    );
    assert!(waiting.nothing_is_cut_off());
    let mut read_only = model.clone();
    read_only.cell.iter_mut().for_each(|cell| cell.moves = Moves::OnceArmed { joints: true, tip: true });
    read_only.robot.iter_mut().for_each(|robot| robot.is_armed = false);
    assert!(!pane(read_only).is_enabled("Move there"), "not before somebody lets it");
    let mut lost = model.clone();
    lost.mover = LinkState::Failed { why: Text::verbatim("gone") };
    assert!(!pane(lost).is_enabled("Move there"), "not without a connection");
    model.motion = Motion::Jogging(Jog::Joint { index: 0, forward: true });
    assert!(!pane(model).is_enabled("Move there"), "not while it moves");
    let running = pane(under_way(Waits::Nothing, None));
    assert!(!running.sees("Move there"), "the built-in cell goes on by itself");
}

#[test]
fn what_is_left_is_said_in_poses_and_by_the_pace_in_seconds() {
    let mut model = under_way(Waits::Nothing, None);
    guided(&mut model).views_left = Some(4);
    assert!(pane(model.clone()).sees("about 4 more poses"));
    let now_s = model.now_s;
    guided(&mut model).since = (now_s - 20.0, 0);
    model.sequence.as_mut().expect("one").outcomes = vec![StopOutcome::Done; 4];
    // Five seconds a pose, four poses and three checks.
    assert!(pane(model).sees("about 4 more poses, 40 s with the checks"));
}
