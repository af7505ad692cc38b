use std::sync::Arc;

use egui_kittest::kittest::Queryable as _;

use super::*;
use crate::testing::Silent;
use handeye_workbench::model::{CellSource, Pane, PoseSequence, Solved, StopOutcome};
use handeye_workbench::testing::sample;

/// With a sequence under way that has `done` of its ten poses.
fn sequence_runs(mut model: Model, purpose: CapturePurpose, done: usize) -> Model {
    model.sequence = Some(PoseSequence {
        names: (1..=10).map(|number| format!("pose {number}")).collect(),
        planned: None,
        purpose: Some(purpose),
        outcomes: vec![StopOutcome::Done; done],
        began_s: 90.0,
        guided: None,
    });
    model.sequence_runs = done < 10;
    model
}

/// The window while a sequence is under way, with the taught poses in front.
fn under_way(purpose: CapturePurpose) -> Silent {
    let mut silent = Silent::new(CellSource::default());
    silent.show(Pane::Taught);
    silent.show_model(sequence_runs(sample::captured(), purpose, 9));
    silent
}

fn is_in_front(silent: &mut Silent, pane: Pane) -> bool {
    silent.harness.state_mut().layout().is_in_front(pane)
}

#[test]
fn when_a_sequence_has_ended_and_the_answer_is_there_its_pane_comes_to_the_front() {
    for (purpose, pane) in [(CapturePurpose::Calibrate, Pane::Result), (CapturePurpose::Verify, Pane::Verify)] {
        let mut silent = under_way(purpose);
        assert!(is_in_front(&mut silent, Pane::Taught), "not before it has ended");
        silent.show_model(sequence_runs(sample::captured(), purpose, 10));
        assert!(is_in_front(&mut silent, Pane::Taught), "not before the answer is there");
        silent.show_model(sequence_runs(sample::solved(), purpose, 10));
        assert!(is_in_front(&mut silent, pane), "{pane:?}");
        assert!(is_in_front(&mut silent, Pane::Poses), "and nothing else moves");
        // Once.
        silent.click("Taught");
        silent.steps();
        assert!(is_in_front(&mut silent, Pane::Taught));
    }
}

#[test]
fn an_answer_without_the_last_captures_is_not_the_one_that_is_waited_for() {
    let mut silent = under_way(CapturePurpose::Calibrate);
    let mut model = sequence_runs(sample::solved(), CapturePurpose::Calibrate, 10);
    let mut early = Solved::clone(model.solve.current().expect("solved"));
    early.captures.pop();
    model.solve.solved = Some(Arc::new(early));
    silent.show_model(model);
    assert!(is_in_front(&mut silent, Pane::Taught));
}

#[test]
fn a_tab_that_was_chosen_since_the_sequence_began_stays_in_front() {
    let mut silent = under_way(CapturePurpose::Calibrate);
    silent.click("Jog");
    silent.show_model(sequence_runs(sample::solved(), CapturePurpose::Calibrate, 10));
    assert!(is_in_front(&mut silent, Pane::Jog));
    // Also by a key, and also if it is not the pane that would be covered.
    let mut silent = under_way(CapturePurpose::Calibrate);
    silent.press(egui::Modifiers::NONE, egui::Key::Num6);
    silent.show_model(sequence_runs(sample::solved(), CapturePurpose::Calibrate, 10));
    assert!(is_in_front(&mut silent, Pane::Export));
}

#[test]
fn a_field_that_is_typed_into_stays_in_front_and_nothing_comes_later() {
    let mut silent = under_way(CapturePurpose::Calibrate);
    silent.harness.get_by_label("Name of the new pose").focus();
    silent.steps();
    assert!(silent.harness.ctx.text_edit_focused());
    silent.show_model(sequence_runs(sample::solved(), CapturePurpose::Calibrate, 10));
    assert!(is_in_front(&mut silent, Pane::Taught));
    silent.harness.ctx.memory_mut(egui::Memory::stop_text_input);
    silent.steps();
    assert!(is_in_front(&mut silent, Pane::Taught), "the moment is over");
}

#[test]
fn a_sequence_that_was_stopped_shows_nothing() {
    let mut silent = under_way(CapturePurpose::Calibrate);
    let mut model = sequence_runs(sample::solved(), CapturePurpose::Calibrate, 9);
    model.sequence_runs = false;
    silent.show_model(model);
    assert!(is_in_front(&mut silent, Pane::Taught));
}

#[test]
fn while_a_button_of_the_pointer_is_down_it_waits_for_its_release() {
    let mut arrival = Arrival::default();
    let busy = |pointing| Busy { elsewhere: false, pointing };
    assert_eq!(arrival.look(&sequence_runs(sample::captured(), CapturePurpose::Calibrate, 9), busy(false)), None);
    let solved = sequence_runs(sample::solved(), CapturePurpose::Calibrate, 10);
    assert_eq!(arrival.look(&solved, busy(true)), None);
    assert_eq!(arrival.look(&solved, busy(false)), Some(Step::Solve));
    assert_eq!(arrival.look(&solved, busy(false)), None);
}
