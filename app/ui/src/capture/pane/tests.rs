use std::sync::Arc;

use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use handeye_estimate::diagnose::{Promise, Promised};
use handeye_plan::guided::{Ending, GuidedOptions};
use handeye_session::{CaptureId, CaptureRecord};

use super::columns::{Column, Sort, sorted};
use super::*;
use crate::testing::pane_harness::{PaneHarness, PaneState};
use handeye_workbench::command::Command;
use handeye_workbench::guided::state::{GuidedProgress, Waits};
use handeye_workbench::model::{CaptureRefused, Goal, RefusalKind, StopOutcome};
use handeye_workbench::testing::sample;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::{capture, motion, session, taught};

fn pane(model: Model) -> PaneHarness {
    PaneHarness::new(model, vec2(760.0, 420.0), |ui, state| {
        let PaneState { model, textures, outbox, .. } = state;
        poses_ui(ui, model, &mut textures.thumbnails, outbox);
    })
}

fn change(model: &mut Model, change: impl FnOnce(&mut Vec<CaptureRecord>)) {
    let mut document = (*model.session.document).clone();
    change(&mut document.captures);
    model.session.document = Arc::new(document);
}

/// The label of a row.
fn row(pane: &PaneHarness, id: u32) -> String {
    let part = format!("Capture {id} · pose {id}");
    let rows: Vec<_> = pane
        .harness
        .query_all_by_label_contains(&part)
        .filter_map(|node| node.accesskit_node().label())
        .filter(|label| label == &part || label.starts_with(&format!("{part},")))
        .collect();
    rows.first().cloned().unwrap_or_else(|| panic!("no row {id}"))
}

fn click_row(pane: &mut PaneHarness, id: u32, modifiers: Modifiers) -> Vec<Command> {
    pane.commands();
    let label = row(pane, id);
    pane.harness.get_by_label(&label).click_modifiers(modifiers);
    pane.steps();
    let sent = pane.commands();
    for command in &sent {
        if let Command::Session(session::Command::Select(ids)) = command {
            pane.model().selection = ids.clone();
        }
    }
    pane.steps();
    sent
}

#[test]
fn with_fingers_the_check_box_of_a_capture_is_in_its_row_and_as_large_as_a_finger() {
    let mut pane = pane(sample::solved());
    theme::for_fingers(&pane.harness.ctx, true);
    pane.steps();
    for id in 1..=3 {
        let row = pane.harness.get_by_label(&row(&pane, id)).rect();
        let check = pane.harness.get_by_label(&format!("Use capture {id}")).rect();
        assert!(row.contains_rect(check.shrink(0.5)), "{check} is not in {row}");
        assert!((check.center().y - row.center().y).abs() < 1.0, "{check} is not in the middle of {row}");
        assert!(check.width() >= theme::FINGER && check.height() >= theme::FINGER, "{check}");
    }
}

fn ids(numbers: &[u32]) -> Vec<CaptureId> {
    numbers.iter().map(|&number| CaptureId(number)).collect()
}

#[test]
fn an_empty_session_says_what_to_do_and_captures() {
    let mut pane = pane(sample::connected());
    assert!(pane.sees("No captures yet") && pane.sees("press Space"));
    assert_eq!(pane.click("Open a sample"), [Command::Session(session::Command::OpenSample)]);
    assert_eq!(pane.click("Capture"), [Command::Capture(capture::Command::Take(CapturePurpose::Calibrate))]);
    assert_eq!(
        pane.click("Capture for verification"),
        [Command::Capture(capture::Command::Take(CapturePurpose::Verify))]
    );
    pane.model().camera = handeye_workbench::model::LinkState::Failed { why: Text::verbatim("gone") };
    pane.steps();
    assert!(pane.click("Capture").is_empty(), "there is nothing to capture");
}

#[test]
fn rows_are_selected_by_clicks_and_keys() {
    let mut pane = pane(sample::solved());
    assert_eq!(click_row(&mut pane, 2, Modifiers::NONE), [Command::Session(session::Command::Select(ids(&[2])))]);
    assert_eq!(
        click_row(&mut pane, 4, Modifiers::SHIFT),
        [Command::Session(session::Command::Select(ids(&[2, 3, 4])))]
    );
    assert_eq!(click_row(&mut pane, 3, Modifiers::COMMAND), [Command::Session(session::Command::Select(ids(&[2, 4])))]);
    pane.harness.key_press(Key::ArrowDown);
    pane.steps();
    assert_eq!(pane.commands(), [Command::Session(session::Command::Select(ids(&[5])))]);
    pane.harness.key_press(Key::Delete);
    pane.steps();
    assert_eq!(pane.commands(), [Command::Session(session::Command::Delete(ids(&[2, 4])))]);
    pane.harness.key_press(Key::Space);
    pane.steps();
    assert!(pane.commands().is_empty(), "Space belongs to the window");
}

#[test]
fn a_capture_is_taken_out_and_in_by_its_box_and_by_the_buttons() {
    let mut pane = pane(sample::solved());
    let out =
        |numbers: &[u32], excluded| Command::Session(session::Command::SetExcluded { ids: ids(numbers), excluded });
    assert_eq!(pane.click("Use capture 3"), [out(&[3], true)]);
    change(pane.model(), |captures| captures[2].excluded = true);
    pane.steps();
    assert_eq!(pane.click("Use capture 3"), [out(&[3], false)]);
    pane.model().selection = ids(&[1, 3]);
    pane.steps();
    assert_eq!(pane.click("Exclude 2"), [out(&[1, 3], true)]);
    assert_eq!(pane.click("Delete 2"), [Command::Session(session::Command::Delete(ids(&[1, 3])))]);
    pane.model().selection = ids(&[3]);
    pane.steps();
    assert_eq!(pane.click("Include 1"), [out(&[3], false)]);
}

#[test]
fn the_menu_of_a_row_goes_there_and_changes_what_it_is_for() {
    let mut pane = pane(sample::solved());
    let mut choose = |item: &str| {
        let label = row(&pane, 2);
        pane.harness.get_by_label(&label).click_secondary();
        pane.steps();
        pane.click(item)
    };
    assert_eq!(choose("Go there again"), [Command::Motion(motion::Command::GoToCapture(CaptureId(2)))]);
    let purpose = CapturePurpose::Verify;
    assert_eq!(
        choose("Use for verification"),
        [Command::Session(session::Command::SetPurpose { ids: ids(&[2]), purpose })]
    );
    assert_eq!(choose("Delete"), [Command::Session(session::Command::Delete(ids(&[2])))]);
}

#[test]
fn remarks_say_what_is_wrong_with_a_capture() {
    let mut model = sample::solved();
    change(&mut model, |captures| captures[0].excluded = true);
    model.observed.insert(CaptureId(2), None);
    let seen = model.observed(CaptureId(3)).expect("seen").clone();
    model.observed.insert(CaptureId(3), Some(Arc::new(handeye_workbench::model::Observed { corners: None, ..seen })));
    model.observed.remove(&CaptureId(4));
    model.outlier_line_px = Some(0.0);
    let mut pane = pane(model);
    for words in ["1: Excluded", "2: Not readable, Above the line", "3: No board", "4: Looking…", "5: Above the line"]
    {
        assert!(pane.sees(words), "{words}");
    }
    // The robot of the sample is where the first capture was taken.
    let why = Text::verbatim("too similar");
    pane.model().refused = Some(CaptureRefused { kind: RefusalKind::TooSimilar, why, at_s: 0.0 });
    pane.steps();
    assert!(pane.sees("No capture: too similar"));
    assert!(pane.sees("1: Robot is here, Excluded"));
    assert!(!pane.sees("2: Robot is here"));
}

#[test]
fn a_capture_that_was_set_aside_says_so_with_how_far_it_is_off_and_what_to_do() {
    let model = sample::with_an_outlier();
    let table = rows::table(&egui::Context::default(), &model);
    let rejected = table.row(sample::OUTLIER).expect("a row");
    let flags = flags::flags(rejected, flags::Circumstances::default(), Language::English);
    let why = &flags.first().expect("a remark").why;
    assert!(why.contains("12.30 mm and 1.500°") && why.contains("keep all views"), "{why}");
    let first = sorted(&table.rows, Sort { column: Column::Flags, descending: false })[0];
    assert_eq!(table.rows[first].id, sample::OUTLIER, "it is worth looking at before all others");
    let mut pane = pane(model);
    assert!(pane.sees("3: Outlier") && !pane.sees("4: Outlier"));
    assert!(pane.sees("9 in the fit · 1 outlier · 2 for verification"));
    assert!(pane.sees("Capture 3 · pose 3, outlier, 18.000 px"));
    change(pane.model(), |captures| captures[2].excluded = true);
    pane.steps();
    assert!(pane.sees("3: Excluded") && !pane.sees("outlier"), "who took it out by hand knows");
}

#[test]
fn corners_that_were_set_aside_are_counted() {
    let mut model = sample::solved();
    let mut solved = handeye_workbench::model::Solved::clone(model.solve.current().expect("solved"));
    solved.calibration.views[1].rejected_corners = vec![4, 5, 6];
    model.solve.solved = Some(Arc::new(solved));
    let table = rows::table(&egui::Context::default(), &model);
    let flags = flags::flags(&table.rows[1], flags::Circumstances::default(), Language::English);
    assert!(flags.iter().any(|flag| flag.name == "Outlier corners" && flag.why.contains("without: 3.")), "{flags:?}");
}

#[test]
fn sorting_puts_the_largest_first_and_rows_without_a_number_last() {
    let model = sample::solved();
    let table = rows::table(&egui::Context::default(), &model);
    let order = sorted(&table.rows, Sort { column: Column::Influence, descending: true });
    let influence: Vec<Option<f64>> = order.iter().map(|&index| table.rows[index].influence_mm).collect();
    let known = influence.iter().take_while(|value| value.is_some()).count();
    assert_eq!(known, sample::FITTED as usize);
    assert!(influence[..known].is_sorted_by(|a, b| a >= b));
    let mut pane = pane(model);
    pane.click("Sort by Influence");
    let first = table.rows[order[0]].id.0;
    let second = table.rows[order[1]].id.0;
    let top = |id: u32| pane.rect(&row(&pane, id)).top();
    assert!(top(first) < top(second));
}

/// The pane in a tile of the smallest window, and in a large one.
#[test]
fn remarks_are_in_view_however_narrow_the_pane_is_and_what_has_no_room_is_under_the_pointer() {
    for (width, height, rows, hides) in [(379.0, 246.0, 3, true), (260.0, 320.0, 3, true), (900.0, 420.0, 5, false)] {
        let mut model = sample::solved();
        change(&mut model, |captures| captures[0].excluded = true);
        // With a goal that is reached there are no buttons for more captures.
        model.view.goal = Goal(1e-3);
        let mut pane = PaneHarness::new(model, vec2(width, height), |ui, state| {
            let PaneState { model, textures, outbox, .. } = state;
            poses_ui(ui, model, &mut textures.thumbnails, outbox);
        });
        let remark = pane.rect("1: Excluded");
        assert!(remark.max.x <= width, "{width}: {remark:?}");
        let seen = (1..=rows).filter(|&id| pane.rect(&row(&pane, id)).max.y <= height).count();
        assert_eq!(seen, rows as usize, "{width}");
        pane.harness.hover_at(pane.rect(&row(&pane, 2)).left_center() + vec2(20.0, 0.0));
        pane.harness.run_steps(60);
        assert_eq!(pane.sees("Influence: 0."), hides, "{width}");
    }
}

#[test]
fn a_thousand_captures_cost_what_can_be_seen_of_them() {
    let mut model = sample::solved();
    let first = model.document().captures[0].clone();
    let seen = model.observed(CaptureId(1)).cloned();
    change(&mut model, |captures| {
        *captures = (1..=1000)
            .map(|n| CaptureRecord { id: CaptureId(n), image: format!("images/{n:04}.png"), ..first.clone() })
            .collect();
    });
    for n in 1..=1000 {
        model.observed.insert(CaptureId(n), seen.clone().map(Arc::new));
    }
    let mut pane = pane(model);
    let uploads = pane.harness.state().textures.thumbnails.uploads();
    assert!((5..20).contains(&uploads), "{uploads} thumbnails for the rows that are seen");
    pane.harness.run_steps(5);
    assert_eq!(pane.harness.state().textures.thumbnails.uploads(), uploads, "each once");
    let drawn = pane.harness.query_all_by_label_contains("Use capture").count();
    assert!((5..20).contains(&drawn), "{drawn} rows");
}

#[test]
fn guided_capture_that_was_broken_off_between_two_poses_or_at_a_check_is_continued() {
    let guided = |ending| {
        let mut model = sample::solved();
        let guided =
            GuidedProgress { ending, waits: Waits::Nothing, ..GuidedProgress::new(GuidedOptions::default(), 90.0) };
        let purpose = if guided.ending.is_some() { CapturePurpose::Verify } else { CapturePurpose::Calibrate };
        model.sequence = Some(PoseSequence {
            names: vec!["G1".to_owned()],
            planned: Some(vec![[0.0; 6].into()]),
            purpose: Some(purpose),
            outcomes: vec![StopOutcome::Done],
            began_s: 90.0,
            guided: Some(Box::new(guided)),
        });
        model
    };
    for ending in
        [None, Some(Ending::GoalReached { promised: Promised { error_m: 3e-4, least_m: 0.0, of: Promise::Point } })]
    {
        let mut pane = pane(guided(ending));
        assert_eq!(pane.click("Continue the sequence"), [Command::Taught(taught::Command::ContinueSequence)]);
    }
    let mut over =
        guided(Some(Ending::GoalReached { promised: Promised { error_m: 3e-4, least_m: 0.0, of: Promise::Point } }));
    over.sequence.as_mut().and_then(|it| it.guided.as_deref_mut()).expect("guided").is_over = true;
    assert!(!pane(over).sees("Continue the sequence"), "there is nothing to go on with");
}
