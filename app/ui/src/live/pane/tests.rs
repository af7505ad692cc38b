use std::sync::Arc;

use egui::{Modifiers, PointerButton, Pos2, Vec2, vec2};
use handeye_capture::Wait;
use handeye_estimate::verify::Predictor;
use handeye_geometry::depth::ColourMap;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_session::CaptureId;
use nalgebra::{Point3, Vector2};

use super::*;
use crate::live::place::Place;
use crate::testing::pane_harness::{PaneHarness, PaneState};
use handeye_workbench::command::Command;
use handeye_workbench::model::{
    CapturePurpose, CaptureRefused, CaptureUnderWay, CaptureWait, RefusalKind, Review, Solved, Step, Viewport,
};
use handeye_workbench::testing::sample;
use handeye_workbench::text::Text;
use handeye_workbench::worker::TrackedBy;
use handeye_workbench::{capture, live, session};

fn colour(model: Model) -> PaneHarness {
    PaneHarness::new(model, vec2(660.0, 580.0), |ui, state| {
        let PaneState { model, textures, outbox, pointed } = state;
        *pointed = colour_ui(ui, model, &textures.live, outbox);
    })
}

fn depth(model: Model) -> PaneHarness {
    PaneHarness::new(model, vec2(660.0, 580.0), |ui, state| {
        let PaneState { model, textures, outbox, pointed } = state;
        *pointed = depth_ui(ui, model, &textures.live, outbox);
    })
}

fn reviewed(id: u32) -> Model {
    let mut model = sample::solved();
    model.review = Some(Review { id: CaptureId(id), images: Some(Arc::new(sample::images())) });
    model
}

/// The newest viewport that was requested.
fn viewport(commands: &[Command]) -> Option<Viewport> {
    commands.iter().rev().find_map(|command| match command {
        Command::Live(live::Command::SetViewport(viewport)) => Some(*viewport),
        _ => None,
    })
}

#[test]
fn an_image_that_may_be_older_than_its_pose_says_by_how_much() {
    let mut pane = colour(sample::connected());
    pane.steps();
    assert!(!pane.sees("older than the pose"), "all of it is of one instant");
    let mut model = sample::connected();
    model.frame.as_mut().expect("a frame").info.image_age_s = 0.05;
    assert!(!colour(model.clone()).sees("older than the pose"), "the arm stands");
    model.frame.as_mut().expect("a frame").info.image_off_m = 0.01;
    assert!(colour(model.clone()).sees("Image up to 50 ms older than the pose"));
    let info = &mut model.frame.as_mut().expect("a frame").info;
    (info.image_age_s, info.image_off_m) = (1e-3, 0.25e-3);
    assert!(
        !colour(model).sees("older than the pose"),
        "less than the error that is good enough, at a quarter of a metre a second"
    );
}

#[test]
fn the_pixel_under_the_pointer_is_that_of_the_image_also_when_it_is_zoomed() {
    let mut pane = colour(sample::connected());
    for viewport in [Viewport::default(), Viewport { centre: [0.3, 0.6], zoom: 5.0 }] {
        pane.model().viewport = viewport;
        pane.steps();
        let place = Place::new(
            pane.rect("Colour image"),
            vec2(640.0, 480.0),
            // What is visible is the room itself when the image is larger.
            viewport,
        );
        let wanted = ImagePoint { column: 200, row: 300 };
        pane.harness.hover_at(place.screen(vec2(200.0, 300.0)));
        pane.steps();
        assert_eq!(pane.harness.state().pointed, Some(wanted), "{viewport:?}");
    }
}

#[test]
fn a_place_holds_what_is_under_the_pointer_and_leaves_no_room_empty() {
    let room = Rect::from_min_size(Pos2::new(10.0, 20.0), vec2(640.0, 480.0));
    let fit = Place::new(room, vec2(640.0, 480.0), Viewport::default());
    assert_eq!(fit.image, room);
    assert_eq!(fit.screen(Vec2::ZERO), room.min + Vec2::splat(0.5), "whole numbers are the middles of pixels");
    let corner = Place::new(room, vec2(640.0, 480.0), Viewport { centre: [0.0, 0.0], zoom: 4.0 });
    assert_eq!((corner.image.min, corner.visible), (room.min, room));
}

#[test]
fn the_wheel_zooms_at_the_pointer_and_a_double_click_fits() {
    let mut pane = colour(sample::connected());
    let rect = pane.rect("Colour image");
    let at = rect.min + rect.size() * vec2(0.25, 0.75);
    pane.harness.hover_at(at);
    pane.steps();
    pane.harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: vec2(0.0, 200.0),
        phase: egui::TouchPhase::Move,
        modifiers: Modifiers::NONE,
    });
    let before = Place::new(rect, vec2(640.0, 480.0), Viewport::default());
    // Each command is applied as the application would, until the wheel has come to rest.
    for _ in 0..40 {
        pane.harness.step();
        if let Some(next) = viewport(&pane.commands()) {
            pane.model().viewport = next;
        }
    }
    let zoomed = pane.model().viewport;
    assert!(zoomed.zoom > 1.5, "{zoomed:?}");
    let after = Place::new(pane_room(&pane), vec2(640.0, 480.0), zoomed);
    let part = |place: &Place| (at - place.image.min) / place.image.size();
    // The room is larger than the fitted image in one direction; there it is held at the edge.
    assert!((part(&before) - part(&after)).abs().min_elem() < 2e-3, "{:?} {:?}", part(&before), part(&after));

    for pressed in [true, false, true, false] {
        pane.harness.event(egui::Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        pane.harness.step();
    }
    assert_eq!(viewport(&pane.commands()), Some(Viewport::default()));
}

/// The room that an image has in the pane.
fn pane_room(pane: &PaneHarness) -> Rect {
    pane.rect("Colour image")
}

#[test]
fn a_drag_moves_a_zoomed_image_with_the_pointer() {
    let mut model = sample::connected();
    model.viewport = Viewport { centre: [0.5, 0.5], zoom: 4.0 };
    let mut pane = colour(model);
    let room = pane.rect("Colour image");
    let drag = |pane: &mut PaneHarness, button| {
        let event = |pos, pressed| egui::Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE };
        pane.harness.hover_at(room.center());
        pane.steps();
        pane.commands();
        pane.harness.event(event(room.center(), true));
        pane.harness.step();
        pane.harness.hover_at(room.center() + vec2(30.0, -20.0));
        pane.harness.step();
        let sent = viewport(&pane.commands());
        pane.harness.event(event(room.center(), false));
        pane.steps();
        pane.commands();
        sent
    };
    for button in [PointerButton::Middle, PointerButton::Secondary, PointerButton::Primary] {
        let now = pane.model().viewport;
        let next = drag(&mut pane, button).expect("it moves");
        let before = Place::new(room, vec2(640.0, 480.0), now);
        let after = Place::new(room, vec2(640.0, 480.0), next);
        let moved = after.image.min - before.image.min;
        assert!((moved - vec2(30.0, -20.0)).length() < 0.1, "{button:?}: {moved:?}");
    }
    pane.model().viewport = Viewport::default();
    pane.steps();
    assert_eq!(drag(&mut pane, PointerButton::Primary), None, "all of the image is there already");
}

#[test]
fn recorded_images_of_another_session_are_not_taken_for_those_of_the_same_number() {
    let mut pane = colour(reviewed(3));
    let uploads = pane.harness.state().textures.live.uploads();
    pane.steps();
    assert_eq!(pane.harness.state().textures.live.uploads(), uploads);
    pane.model().review = Some(Review { id: CaptureId(3), images: Some(Arc::new(sample::images())) });
    pane.steps();
    assert_eq!(pane.harness.state().textures.live.uploads(), uploads + 1);
}

#[test]
fn a_board_that_is_not_found_is_said_so_on_the_live_image() {
    let mut model = sample::connected();
    if let Some(seen) = &mut model.detection {
        seen.corners = None;
    }
    let mut pane = colour(model);
    assert!(pane.sees("Board not found"));
    pane.model().review = Some(Review { id: CaptureId(3), images: Some(Arc::new(sample::images())) });
    pane.steps();
    assert!(!pane.sees("Board not found"));
}

#[test]
fn overlays_and_depth_colours_are_switched_by_their_names() {
    let mut pane = colour(sample::solved());
    let overlays = pane.model().view.overlays;
    let sent = pane.click("Coverage");
    assert_eq!(
        sent,
        [Command::Live(live::Command::SetOverlays(handeye_workbench::model::Overlays { coverage: true, ..overlays }))]
    );
    let sent = pane.click("Corners");
    assert_eq!(
        sent,
        [Command::Live(live::Command::SetOverlays(handeye_workbench::model::Overlays { corners: false, ..overlays }))]
    );
    assert!(pane.sees("Residuals × "), "how many times longer than they are is stated on the image");
    let mut pane = depth(sample::connected());
    assert_eq!(pane.click("Viridis"), [Command::Live(live::Command::SetDepthColours(ColourMap::Viridis))]);
    assert_eq!(
        pane.click("Full range"),
        [Command::Live(live::Command::SetDepthScale(handeye_workbench::model::DepthScale::Full))]
    );
    assert!(pane.sees("Depth colours from 0.30 m to 0.50 m"));
}

#[test]
fn the_readout_names_the_point_in_camera_and_in_base() {
    let mut model = sample::solved();
    let point = ImagePoint { column: 200, row: 300 };
    model.cursor = Some(point);
    let intrinsics = model.intrinsics().expect("calibrated");
    let depth_m = 0.3 + 0.2 * 200.0_f32 / 640.0;
    let in_camera = readout::in_camera(&model, point, depth_m).expect("a camera");
    assert!((in_camera.z - f64::from(depth_m)).abs() < 1e-9, "depth is along the axis");
    let px = intrinsics.project(&in_camera).expect("in front");
    assert!((px - Vector2::new(200.0, 300.0)).norm() < 1e-6);
    let frame = model.frame.as_ref().expect("live");
    let in_base = model
        .calibrated()
        .expect("calibrated")
        .base_from_camera(&frame.info.base_from_tip.expect("the robot is known"))
        .isometry()
        * in_camera;
    let words = |at: &Point3<f64>| at.coords.map(|metres| crate::style::numbers::fixed(metres * 1e3, 1, 0));
    let words = |at: &Point3<f64>| words(at).as_slice().join(" ");
    let pane = colour(model);
    assert!(pane.sees(&format!("Camera [mm] {}", words(&in_camera))));
    assert!(pane.sees(&format!("Base [mm] {}", words(&in_base))));
    assert!(pane.sees(&format!("Depth {depth_m:.3} m")) && pane.sees("Pixel 200, 300"));
}

#[test]
fn without_a_calibration_there_is_no_made_up_place_in_the_base() {
    let mut model = sample::connected();
    model.cursor = Some(ImagePoint { column: 10, row: 10 });
    assert!(colour(model).sees("Base [mm] –"));
}

#[test]
fn a_recorded_image_says_so_and_leads_back() {
    let mut pane = colour(reviewed(3));
    assert!(pane.sees("Capture 3 · pose 3, recorded · residual 0.0"));
    assert!(!pane.sees("fps"), "a recorded image has no frame rate");
    assert_eq!(pane.click("Back to live"), [Command::Session(session::Command::BackToLive)]);
    let mut pane = colour(reviewed(sample::FITTED + 1));
    assert!(pane.sees("prediction error"), "the verification fits nothing");
    pane.model().review = Some(Review { id: CaptureId(3), images: None });
    pane.steps();
    assert!(pane.sees("Reading the images of this capture…"));
    assert_eq!(pane.click("Back to live"), [Command::Session(session::Command::BackToLive)]);
}

#[test]
fn a_click_picks_a_point_in_the_step_that_verifies_and_only_in_the_live_image() {
    let at = |pane: &PaneHarness| pane.rect("Colour image").min + Vec2::new(100.0, 50.0);
    let click = |pane: &mut PaneHarness| {
        let place = Place::new(pane.rect("Colour image"), vec2(640.0, 480.0), Viewport::default());
        let at = at(pane);
        pane.harness.hover_at(at);
        pane.steps();
        for pressed in [true, false] {
            pane.harness.event(egui::Event::PointerButton {
                pos: at,
                button: PointerButton::Primary,
                pressed,
                modifiers: Modifiers::NONE,
            });
        }
        pane.steps();
        (pane.commands(), (at - place.image.min) / place.points_per_px())
    };
    let mut model = sample::solved();
    let (sent, _) = click(&mut colour(model.clone()));
    assert!(sent.is_empty(), "{sent:?}");
    model.step = Step::Verify;
    let (sent, px) = click(&mut colour(model));
    assert_eq!(sent, [Command::Live(live::Command::Pick(Some(ImagePoint { column: px.x as u32, row: px.y as u32 })))]);
    let mut model = reviewed(1);
    model.step = Step::Verify;
    assert!(click(&mut colour(model)).0.is_empty());
}

#[test]
fn a_capture_says_what_it_waits_for_and_a_refusal_goes_away() {
    let mut model = sample::connected();
    let wait = CaptureWait::Images(Wait::RobotMoves);
    model.capture = Some(CaptureUnderWay { number: 1, purpose: CapturePurpose::Calibrate, wait, since_s: 99.0 });
    let mut pane = colour(model);
    assert!(pane.sees("Capturing… waiting for the robot to stand still"));
    assert_eq!(pane.click("Cancel"), [Command::Capture(capture::Command::Cancel)]);
    pane.model().capture = None;
    let why = Text::verbatim("the board is not in view");
    pane.model().refused = Some(CaptureRefused { kind: RefusalKind::NoBoard, why, at_s: 99.0 });
    pane.steps();
    assert!(pane.sees("No capture: the board is not in view"));
    pane.model().now_s = 120.0;
    pane.steps();
    assert!(!pane.sees("No capture"));
}

#[test]
fn an_older_sight_of_the_board_is_fainter_but_never_gone() {
    assert_eq!(overlays::strength(0), 1.0);
    assert!(overlays::strength(1) < 1.0 && overlays::strength(2) < overlays::strength(1));
    assert!(overlays::strength(u64::MAX) > 0.2);
}

#[test]
fn the_board_is_predicted_where_its_corners_are_seen() {
    let model = sample::solved();
    let calibrated: &Predictor = model.calibrated().expect("calibrated");
    let frame = model.frame.as_ref().expect("live");
    let room = Rect::from_min_size(Pos2::ZERO, vec2(640.0, 480.0));
    let place = Place::new(room, vec2(640.0, 480.0), Viewport::default());
    let projector = crate::live::project::Projector {
        intrinsics: &calibrated.intrinsics,
        camera_from_target: calibrated.camera_from_target(&frame.info.base_from_tip.expect("the robot is known")),
        place: &place,
    };
    let target = model.document().meta.target;
    for corner in model.detection.as_ref().and_then(|seen| seen.corners.as_ref()).expect("seen") {
        let at = projector.point(&target.point(corner.index)).expect("in the image");
        // The sample has no robot noise and corner noise of 0.05 px.
        let seen = place.screen(vec2(corner.px.x as f32, corner.px.y as f32));
        assert!(at.distance(seen) < 1.0, "{at:?} {seen:?}");
    }
    let behind = crate::live::project::Projector {
        camera_from_target: Pose::from_translation_xyzw([0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0]),
        ..projector
    };
    assert_eq!(behind.point(&Point3::origin()), None);
    assert!(behind.line(&Point3::origin(), &Point3::new(0.1, 0.0, 0.0)).is_empty());
}

/// The corners of the live image compared with where a pose predicts them: RMS \[px\].
fn apart_px(model: &Model, camera_from_target: &Pose<Camera, Target>) -> f64 {
    let (intrinsics, target) = (model.intrinsics().expect("a camera"), model.document().meta.target);
    let corners = model.detection.as_ref().and_then(|seen| seen.corners.clone()).expect("seen");
    let squares = corners.iter().map(|corner| {
        let point = camera_from_target.isometry() * target.point(corner.index);
        (intrinsics.project(&point).expect("in front") - corner.px).norm_squared()
    });
    (squares.sum::<f64>() / corners.len() as f64).sqrt()
}

#[test]
fn residuals_of_the_live_image_are_those_of_the_board_that_the_calibration_found() {
    let mut model = sample::solved();
    let corners = model.detection.as_ref().and_then(|seen| seen.corners.clone()).expect("seen");
    let largest = |model: &Model| {
        let residuals = overlays::live_residuals(model, &corners);
        assert_eq!(residuals.len(), corners.len());
        residuals.iter().map(|(_, residual_px)| residual_px.norm()).fold(0.0, f64::max)
    };
    assert!(largest(&model) < 1.0, "{} px", largest(&model));
    // A board of twice the size is not the one in the image.
    let mut solved = Solved::clone(model.solve.solved.as_ref().expect("solved"));
    solved.calibrated.as_mut().expect("calibrated").shape.scale = 2.0;
    model.solve.solved = Some(Arc::new(solved));
    assert!(largest(&model) > 20.0, "{} px", largest(&model));
}

#[test]
fn while_the_board_is_tracked_prediction_and_residuals_are_those_of_the_tracked_board() {
    let mut model = sample::tracking();
    // The board has gone 30 mm from where the calibration found it, and the image shows it there.
    let frame = model.frame.as_ref().expect("live").clone();
    let calibrated = model.calibrated().expect("calibrated").clone();
    let textures = LiveTextures::default();
    let at = |model: &Model| Some(overlays::expected(model, &Shown::of(model, &textures).expect("live"))?.1);
    let of_calibration = calibrated.camera_from_target(&frame.info.base_from_tip.expect("the robot is known"));
    assert!(apart_px(&model, &of_calibration) > 20.0, "the calibrated board is elsewhere");
    // Estimate and image are off by 0.2 mm and 0.07 px.
    assert!(apart_px(&model, &at(&model).expect("tracked")) < 1.0);
    assert!(apart_px(&model, &overlays::live_chain(&model).expect("seen")) < 1.0);

    // With corrected tip poses its place in the base is off by as much as the tip, and in the image it is unchanged.
    let mut corrected = model.clone();
    let arm = sample::corrected_arm();
    let tip = arm.actual(&frame.info.joints_rad).expect("six joints");
    let reported = frame.info.base_from_tip.expect("the robot is known");
    let mut newest = handeye_workbench::model::Tracked::clone(model.track.newest.as_ref().expect("tracked"));
    if let Some(estimate) = &mut newest.update.estimate {
        let board = tip.isometry() * reported.isometry().inverse() * estimate.base_from_target.isometry();
        estimate.base_from_target = Pose::from_isometry(board);
    }
    corrected.track.newest = Some(Arc::new(newest));
    assert!(apart_px(&corrected, &at(&corrected).expect("tracked")) > 1.0, "by the reported tip it is elsewhere");
    let by = model.track.by.as_ref().expect("tracked");
    let by = TrackedBy { arm: Some(Arc::new(arm)), ..TrackedBy::clone(by) };
    corrected.track.by = Some(Arc::new(by));
    assert!(apart_px(&corrected, &at(&corrected).expect("tracked")) < 1.0);

    // Out of sight there is nothing to compare with, and the calibrated board is not drawn in its place.
    let mut lost = model.clone();
    let mut newest = handeye_workbench::model::Tracked::clone(lost.track.newest.as_ref().expect("tracked"));
    (newest.update.estimate, newest.update.seen) = (None, None);
    lost.track.newest = Some(Arc::new(newest));
    lost.detection.iter_mut().for_each(|it| (it.corners, it.camera_from_target) = (None, None));
    assert!(at(&lost).is_none() && overlays::live_chain(&lost).is_none());
    assert!(!colour(lost).sees("Residuals ×"));

    model.track.on = false;
    assert_eq!(at(&model), Some(of_calibration), "and without tracking they are of the calibration again");
    model.review = Some(Review { id: CaptureId(3), images: Some(Arc::new(sample::images())) });
    model.track.on = true;
    let record = model.document().capture(CaptureId(3)).and_then(|it| it.base_from_tip).expect("there");
    assert_eq!(at(&model), Some(calibrated.camera_from_target(&record)), "a recorded image belongs to its own time");
}
