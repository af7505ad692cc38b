//! The reason why something failed has to be shown where the user who asked for it looks, and in the log.

use super::tests::{bench, choose, waits};
use super::*;
use crate::guided::state::Waits;
use crate::model::{CapturePurpose, CaptureRefused, MotionOutcome, Pane, PoseSequence, RefusalKind};
use crate::testing::sample;
use crate::text::{Language, Text};
use crate::worker::fake::FakeCell;
use crate::{capture, guided, motion, taught};
use handeye_estimate::diagnose::{Promise, Promised};
use handeye_plan::guided::Ending;

const MANUAL: &str = "The robot refuses: the pendant is in manual mode";

/// What is shown in a pane, which is in the log as well.
fn shown(app: &App, pane: Pane) -> String {
    app.model().messages.shown_in(pane).map_or_else(String::new, |message| message.text.in_language(Language::English))
}

fn moved(app: &mut App, outcome: MotionOutcome) {
    let id = app.cx.numbers.motion;
    app.absorb(motion::Event::Moved { id, outcome });
}

fn refuse(app: &mut App) {
    moved(app, MotionOutcome::Refused(Text::verbatim(MANUAL)));
}

#[test]
fn a_robot_that_does_not_make_the_first_move_of_guided_capture_says_why_and_not_what_to_do_with_the_board() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::connected());
    app.apply(guided::Command::CalibrateForMe);
    refuse(app);
    assert!(!app.model().sequence_runs);
    assert_eq!(shown(app, Pane::Poses), MANUAL);
}

#[test]
fn one_move_that_is_refused_is_a_pose_left_out_and_two_in_a_row_break_guided_capture_off_with_the_reason() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::solved());
    app.apply(guided::Command::CalibrateForMe);
    choose(app);
    refuse(app);
    let sequence = app.model().sequence.clone().expect("a sequence");
    assert!(app.model().sequence_runs && sequence.last_skipped() == Some(&Text::verbatim(MANUAL)), "{sequence:?}");
    choose(app);
    moved(app, MotionOutcome::Arrived);
    let number = app.cx.numbers.capture;
    let why = Text::verbatim("blurred");
    app.absorb(capture::Event::Refused {
        number,
        refused: CaptureRefused { kind: RefusalKind::Blurred, why, at_s: 3.0 },
    });
    choose(app);
    refuse(app);
    assert!(app.model().sequence_runs, "it has moved in between");
    choose(app);
    refuse(app);
    assert!(!app.model().sequence_runs);
    assert!(shown(app, Pane::Poses).ends_with(MANUAL), "{}", shown(app, Pane::Poses));
    app.apply(taught::Command::ContinueSequence);
    assert!(app.model().sequence_runs, "once the pendant is in automatic mode");
}

#[test]
fn a_sequence_that_is_broken_off_says_why_in_its_pane() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::solved());
    app.apply(taught::Command::VerifyAtPlanned);
    let id = app.cx.numbers.motion;
    app.absorb(taught::Event::Planned { id, views: Ok(vec![[0.1; 6].into(); 3]) });
    moved(app, MotionOutcome::Failed(Text::verbatim("The robot stopped: protective stop")));
    assert!(shown(app, Pane::Verify).ends_with("protective stop"), "{}", shown(app, Pane::Verify));

    app.apply(taught::Command::ContinueSequence);
    moved(app, MotionOutcome::Arrived);
    let number = app.cx.numbers.capture;
    let why = Text::verbatim("No images have come for 5 s");
    app.absorb(capture::Event::Refused {
        number,
        refused: CaptureRefused { kind: RefusalKind::NoImages, why, at_s: 3.0 },
    });
    assert!(!app.model().sequence_runs);
    assert!(shown(app, Pane::Verify).ends_with("No images have come for 5 s"), "{}", shown(app, Pane::Verify));
}

#[test]
fn poses_that_check_the_answer_are_gone_on_with_as_the_others_are() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::solved());
    app.apply(guided::Command::CalibrateForMe);
    let sequence = app.cx.model.sequence.as_mut().expect("a sequence");
    sequence.purpose = Some(CapturePurpose::Verify);
    let guided = sequence.guided.as_deref_mut().expect("guided");
    (guided.ending, guided.waits) = (
        Some(Ending::GoalReached { promised: Promised { error_m: 3e-4, least_m: 0.0, of: Promise::Point } }),
        Waits::Nothing,
    );
    app.apply(motion::Command::Stop);
    assert!(!app.model().sequence_runs);
    assert!(app.model().sequence.as_ref().is_some_and(PoseSequence::can_continue));
    app.apply(taught::Command::ContinueSequence);
    assert!(app.model().sequence_runs && matches!(waits(app), Some(Waits::Answer | Waits::Choice)));
    let guided = app.model().sequence.as_ref().and_then(|it| it.guided.as_deref()).expect("guided");
    assert!(guided.ending.is_some(), "with the checks, not with more poses for the fit");
}
