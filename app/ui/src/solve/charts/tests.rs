use egui::vec2;
use handeye_estimate::handeye::joint::prediction::{ErrorCurve, ErrorPoint};
use handeye_session::CaptureId;

use super::*;
use crate::testing::pane_harness::{PaneHarness, PaneState};
use handeye_workbench::command::Command;
use handeye_workbench::testing::sample;
use handeye_workbench::{session, solve};

fn pane(model: Model) -> PaneHarness {
    PaneHarness::new(model, vec2(640.0, 400.0), |ui, state| {
        let PaneState { model, outbox, .. } = state;
        charts_ui(ui, model, outbox);
    })
}

/// The residuals of the fit, the largest last.
fn residuals(model: &Model) -> Vec<(f64, CaptureId)> {
    let table = rows::table(&egui::Context::default(), model);
    let mut all: Vec<_> =
        table.rows.iter().filter(|row| !row.verifies()).map(|row| (row.rms_px.expect("solved"), row.id)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

#[test]
fn what_is_above_the_line_is_excluded_and_nothing_else() {
    let mut model = sample::solved();
    let all = residuals(&model);
    let (line_px, above) = (all[7].0, [all[8].1, all[9].1]);
    model.outlier_line_px = Some(line_px);
    let mut pane = pane(model);
    let [Command::Session(session::Command::SetExcluded { ids, excluded: true })] =
        &pane.click("Exclude 2 above the line")[..]
    else {
        panic!("another command")
    };
    assert_eq!(ids.len(), 2);
    assert!(above.iter().all(|id| ids.contains(id)));
}

#[test]
fn the_line_is_switched_on_above_good_residuals_and_dragged() {
    let model = sample::solved();
    let all = residuals(&model);
    let mut pane = pane(model);
    let sent = pane.click("Outlier line");
    let [Command::Solve(solve::Command::SetOutlierLine(Some(line_px)))] = sent[..] else { panic!("{sent:?}") };
    assert!(line_px > all[9].0, "nothing of a good session is above the first line");
    pane.model().outlier_line_px = Some(line_px);
    pane.steps();
    let line = pane.rect("Outlier line [px]");
    pane.harness.drag_at(line.center());
    pane.harness.step();
    pane.harness.hover_at(line.center() + vec2(0.0, 60.0));
    pane.steps();
    let lower = pane.commands().into_iter().rev().find_map(|command| match command {
        Command::Solve(solve::Command::SetOutlierLine(Some(line_px))) => Some(line_px),
        _ => None,
    });
    assert!(lower.is_some_and(|lower| lower > 0.0 && lower < line_px), "{lower:?}");
    pane.harness.drop_at(line.center());
    pane.steps();
    assert_eq!(pane.click("Outlier line"), [Command::Solve(solve::Command::SetOutlierLine(None))]);
}

#[test]
fn a_click_on_a_bar_selects_its_capture() {
    let mut pane = pane(sample::solved());
    let plot = pane.rect("RMS residual [px]");
    // 12 bars that are not at their widest share the width.
    let pitch = (plot.width() / 12.0).min(46.0);
    let at = plot.left_bottom() + vec2(pitch * 4.5, -4.0);
    pane.harness.hover_at(at);
    // Tooltips appear after half a second.
    pane.harness.run_steps(60);
    assert!(pane.sees("Capture 5 · pose 5"));
    pane.harness.drag_at(at);
    pane.harness.drop_at(at);
    pane.steps();
    assert_eq!(pane.commands(), [Command::Session(session::Command::Select(vec![CaptureId(5)]))]);
}

#[test]
fn the_bar_of_a_capture_that_was_set_aside_says_so() {
    let mut pane = pane(sample::with_an_outlier());
    let plot = pane.rect("RMS residual [px]");
    let pitch = (plot.width() / 12.0).min(46.0);
    pane.harness.hover_at(plot.left_bottom() + vec2(pitch * 2.5, -4.0));
    // Tooltips appear after half a second.
    pane.harness.run_steps(60);
    assert!(pane.sees("Capture 3 · pose 3") && pane.sees("outlier"));
}

#[test]
fn the_expected_error_says_what_the_goal_takes() {
    let point = |views, mm: f64| ErrorPoint { views, tip_error_95_m: Some(mm * 1e-3) };
    let curve = ErrorCurve { gathered: vec![point(3, 2.0), point(10, 1.0)], further: vec![point(20, 0.7)] };
    let now = curve.now().expect("known");
    let say = |goal_mm| accuracy::verdict(&curve, now, Some(goal_mm)).in_language(Language::English);
    assert_eq!(say(1.5), "1.00 mm (95 %) with 10 poses: the goal of 1.50 mm is reached");
    // Half the error takes four times the poses.
    assert_eq!(say(0.5), "1.00 mm (95 %) with 10 poses: about 30 more like these reach the goal of 0.50 mm");
    assert_eq!(say(0.0), "1.00 mm (95 %) with 10 poses");
    let by_noise = accuracy::verdict(&curve, now, None).in_language(Language::English);
    assert!(by_noise.starts_with("1.00 mm (95 %) with 10 poses by the noise alone"), "{by_noise}");
}

#[test]
fn every_chart_is_there_with_its_units_and_before_a_calibration_says_when_it_comes() {
    let mut pane = pane(sample::solved());
    for (tab, label) in [
        ("Influence", "Influence [mm]"),
        ("Expected error", "Expected error by number of poses"),
        ("Coverage", "Coverage of the image"),
    ] {
        pane.click(tab);
        assert!(pane.sees(label), "{label}");
    }
    assert!(pane.sees("% of the cells"));
    *pane.model() = sample::captured();
    pane.click("Residuals");
    assert!(pane.sees("Residuals appear with the first calibration"));
    *pane.model() = sample::connected();
    pane.steps();
    assert!(pane.sees("Nothing to draw yet"));
}
