use egui::{Modifiers, Pos2, vec2};
use egui_kittest::kittest::Queryable as _;
use handeye_plan::surroundings::{KeepOutBox, KeepOutFile};

use super::*;
use crate::testing::pane_harness::PaneHarness;
use handeye_workbench::command::Command;
use handeye_workbench::model::{CellSource, ViewSettings};
use handeye_workbench::testing::sample;
use handeye_workbench::{keep_out, scene, session};

const VIEW: &str = "The cell in 3D";

fn pane(model: Model) -> PaneHarness {
    PaneHarness::new(model, vec2(640.0, 460.0), |ui, state| scene_ui(ui, &state.model, &mut state.outbox))
}

/// Drags from a point where nothing is drawn.
fn drag(pane: &mut PaneHarness, by: Vec2, button: PointerButton, modifiers: Modifiers) -> Vec<Command> {
    let from = pane.rect(VIEW).right_bottom() - vec2(40.0, 30.0);
    pane.commands();
    let event = |pos: Pos2, pressed| egui::Event::PointerButton { pos, button, pressed, modifiers };
    pane.harness.hover_at(from);
    pane.harness.step();
    pane.harness.event(egui::Event::ModifiersChanged(modifiers));
    pane.harness.event(event(from, true));
    pane.harness.step();
    pane.harness.event(egui::Event::PointerMoved(from + by));
    pane.harness.step();
    pane.harness.event(event(from + by, false));
    pane.steps();
    pane.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    pane.steps();
    pane.commands()
}

fn view(commands: &[Command]) -> SceneView {
    match commands {
        [Command::Scene(scene::Command::SetView(view))] => *view,
        other => panic!("{other:?}"),
    }
}

/// Whether two views are the same up to the rounding of points on the screen.
fn alike(a: SceneView, b: SceneView) -> bool {
    let centre = a.centre_m.iter().zip(b.centre_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let rest = [a.azimuth_rad - b.azimuth_rad, a.elevation_rad - b.elevation_rad, a.distance_m - b.distance_m];
    rest.iter().map(|difference| difference.abs()).fold(centre, f64::max) < 1e-5
}

#[test]
fn before_there_is_anything_the_pane_says_what_will_be_there() {
    let pane = pane(Model::new(CellSource::default(), ViewSettings::default()));
    assert!(pane.sees("Nothing to show in 3D yet"));
    assert!(pane.harness.query_by_label(VIEW).is_none());
}

#[test]
fn the_views_from_the_sides_and_the_one_of_everything_are_a_click_away() {
    let mut pane = pane(sample::solved());
    for (label, side) in [("Top", Side::Top), ("Front", Side::Front), ("Side", Side::Right)] {
        let expected = side.view(pane.model().scene);
        assert_eq!(pane.click(label), [Command::Scene(scene::Command::SetView(expected))]);
    }
    pane.model().scene.distance_m = 0.3;
    pane.steps();
    let whole = fitted_view(pane.model()).expect("there is an arm");
    assert_eq!(pane.click("Reset view"), [Command::Scene(scene::Command::SetView(whole))]);
}

#[test]
fn a_drag_turns_and_with_shift_or_another_button_it_shifts() {
    let mut pane = pane(sample::solved());
    let (now, by) = (pane.model().scene, vec2(-30.0, -20.0));
    let room = pane.rect(VIEW);
    let turned = view(&drag(&mut pane, by, PointerButton::Primary, Modifiers::NONE));
    assert!(alike(turned, eye::orbited(now, by)), "{turned:?}");
    for (button, modifiers) in [(PointerButton::Primary, Modifiers::SHIFT), (PointerButton::Secondary, Modifiers::NONE)]
    {
        let shifted = view(&drag(&mut pane, by, button, modifiers));
        assert!(alike(shifted, eye::panned(now, by, room)), "{shifted:?}");
    }
}

#[test]
fn the_wheel_zooms_and_a_double_click_shows_everything() {
    let mut pane = pane(sample::solved());
    let at = pane.rect(VIEW).right_bottom() - vec2(40.0, 30.0);
    pane.harness.hover_at(at);
    pane.steps();
    let wheel = egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: vec2(0.0, 50.0),
        phase: egui::TouchPhase::Move,
        modifiers: Modifiers::NONE,
    };
    pane.harness.event(wheel);
    pane.steps();
    let sent = pane.commands();
    let Some(Command::Scene(scene::Command::SetView(nearer))) = sent.last() else { panic!("{sent:?}") };
    assert!(nearer.distance_m < SceneView::default().distance_m);
    pane.model().scene = *nearer;
    // Until the wheel has come to rest.
    pane.harness.run_steps(40);
    pane.commands();
    let event = |pressed| egui::Event::PointerButton {
        pos: at,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    for pressed in [true, false, true, false] {
        pane.harness.event(event(pressed));
        pane.harness.step();
    }
    pane.steps();
    let whole = fitted_view(pane.model()).expect("there is an arm");
    assert_eq!(pane.commands().last(), Some(&Command::Scene(scene::Command::SetView(whole))));
}

#[test]
fn a_capture_is_selected_by_a_click_on_its_frustum() {
    let mut pane = pane(sample::solved());
    pane.model().scene.distance_m = 0.8;
    pane.model().scene.centre_m = [0.45, 0.05, 0.3];
    pane.steps();
    for row in 1..=3_u32 {
        let label = format!("Capture {row} · pose {row} in 3D");
        assert_eq!(pane.click(&label), [Command::Session(session::Command::Select(vec![CaptureId(row)]))]);
    }
}

#[test]
fn what_is_drawn_is_named_by_where_it_comes_from() {
    let legend = |pane: &PaneHarness, name: &str| pane.harness.query_by_label(name).is_some();
    let calibrated = pane(sample::solved());
    assert!(legend(&calibrated, "Camera") && legend(&calibrated, "Board, calibrated"));
    assert!(legend(&calibrated, "Captures in the fit") && legend(&calibrated, "Grid: 100 mm"));
    assert!(legend(&calibrated, "Board, true"), "the cell of the sample says where its board is");
    assert!(!legend(&calibrated, "Board, tracked") && !legend(&calibrated, "Path of the tip"));
    let tracked = pane(sample::tracking());
    assert!(legend(&tracked, "Board, tracked") && legend(&tracked, "Path of the tip"));
    let mut without = sample::connected();
    assert!(legend(&pane(without.clone()), "Camera, as the cell says"));
    without.cell.iter_mut().for_each(|cell| cell.truth = None);
    if let Some(frame) = &mut without.frame {
        frame.info.base_from_target_true = None;
    }
    let without = pane(without);
    assert!(!legend(&without, "Camera, as the cell says") && !legend(&without, "Board, true"));
}

#[test]
fn a_box_to_keep_out_of_is_drawn_on_the_ground_named_and_deleted() {
    let mut model = sample::connected();
    model.scene = Side::Top.view(model.scene);
    let mut pane = pane(model);
    pane.click("Keep-out boxes");
    pane.steps();
    pane.click("Draw a box");
    pane.steps();
    let from = pane.rect(VIEW).left_bottom() + vec2(60.0, -60.0);
    let to = from + vec2(80.0, -50.0);
    let room = pane.rect(VIEW);
    let eye = Eye::new(&pane.model().scene, Rect::from_min_max(room.min, room.max - vec2(268.0, 0.0)));
    let press = |pos, pressed| egui::Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    pane.commands();
    pane.harness.hover_at(from);
    pane.harness.step();
    pane.harness.event(press(from, true));
    pane.harness.step();
    pane.harness.event(egui::Event::PointerMoved(to));
    pane.harness.step();
    pane.harness.event(press(to, false));
    pane.steps();
    let commands = pane.commands();
    let [Command::KeepOut(keep_out::Command::Set(content))] = &commands[..] else {
        panic!("the view is not turned by it: {commands:?}")
    };
    let ends = [from, to].map(|at| eye.on_ground(at).expect("seen from above"));
    let drawn = &content.boxes[0];
    for axis in 0..2 {
        // Rounded to millimetres.
        assert!((drawn.size_m[axis] - (ends[1][axis] - ends[0][axis]).abs()).abs() < 1e-3, "{drawn:?} {ends:?}");
        assert!(
            (drawn.centre_m[axis] - f64::midpoint(ends[0][axis], ends[1][axis])).abs() < 1e-3,
            "{drawn:?} {ends:?}"
        );
    }
    assert!((drawn.size_m[2], drawn.centre_m[2]) == (0.2, 0.1), "it stands on the ground");

    let content = KeepOutFile::clone(content);
    pane.model().keep_out.set(content);
    pane.steps();
    assert!(pane.sees("Keep-out boxes: 1"));
    let deleted = pane.click("Delete box 1");
    assert_eq!(deleted, [Command::KeepOut(keep_out::Command::Set(Box::default()))]);
    let drags = drag(&mut pane, vec2(-30.0, 10.0), PointerButton::Secondary, Modifiers::NONE);
    assert!(matches!(drags[..], [Command::Scene(scene::Command::SetView(_))]), "one box is one drag: {drags:?}");
}

/// A file may contain more than a field shows.
#[test]
fn looking_at_the_boxes_of_a_file_changes_nothing_of_them() {
    let mut model = sample::connected();
    let odd = KeepOutBox {
        name: "post".to_owned(),
        centre_m: [0.123_456, 0.0, 0.0],
        size_m: [0.000_4, 9.5, 0.1],
        rotation_xyzw: None,
        yaw_deg: Some(270.0),
    };
    model.keep_out.set(KeepOutFile { boxes: vec![odd], ..KeepOutFile::default() });
    let mut pane = pane(model);
    pane.click("Keep-out boxes: 1");
    pane.steps();
    assert_eq!(pane.commands(), []);
    assert!(pane.harness.query_by_label("Yaw of box 1").is_some() && pane.sees("Add a box"));
}

#[test]
fn numbers_that_are_not_finite_are_not_drawn() {
    let mut model = sample::tracking();
    if let Some(robot) = &mut model.robot {
        robot.base_from_tip =
            handeye_geometry::frames::Pose::from_translation_xyzw([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
        robot.joints_rad[2] = f64::NAN;
    }
    model.scene.distance_m = 0.08;
    let pane = pane(model);
    assert!(pane.harness.query_by_label(VIEW).is_some());
    assert!(pane.harness.output().shapes.iter().all(|shape| !shape.shape.visual_bounding_rect().min.x.is_nan()));
}

#[test]
fn a_pane_of_the_smallest_size_keeps_its_controls() {
    let model = sample::solved();
    let small = PaneHarness::new(model, vec2(300.0, 150.0), |ui, state| scene_ui(ui, &state.model, &mut state.outbox));
    for label in ["Reset view", "Top", "Front", "Side"] {
        let rect = small.rect(label);
        assert!(rect.max.x <= 300.0 && rect.min.x >= 0.0, "{label}: {rect:?}");
    }
    assert!(small.harness.query_by_label("Grid: 100 mm").is_none(), "the legend would cover the cell");
}
