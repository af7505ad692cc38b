use handeye_capture::NO_IMAGES_S;
use handeye_capture::Wait;
use handeye_detect::VisionError;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::{AprilGrid, AprilTag, Charuco, Dictionary, Grid, IdOrder, TargetSpec};
use handeye_geometry::testing::looking_at_point;
use handeye_simulate::Scene;
use image::{Rgb, RgbImage};
use nalgebra::Vector2;

use super::VisionTask;
use super::bench::{Table, request};
use crate::capture::CaptureRequest;
use crate::capture::drawn::{BOARD, board};
use crate::model::{CaptureOptions, CaptureWait, RefusalKind};
use crate::text::Language;

fn watching(target: TargetSpec) -> Table {
    let mut table = Table::new();
    table.ask(VisionTask::SetTarget(target));
    table
}

#[test]
fn the_newest_image_is_searched_and_the_others_are_counted() {
    let mut table = watching(BOARD);
    table.ask(VisionTask::SetIntrinsics(Intrinsics::pinhole(480, 360, 400.0)));
    let image = board(0);
    for _ in 0..3 {
        table.put(&image);
    }
    assert!(table.turn());
    let (detection, _) = table.detections.take().expect("a detection");
    assert_eq!((detection.frame, detection.dropped, detection.problem), (3, 2, None));
    assert_eq!(detection.corners.expect("the board is there").len(), 70);
    assert!(detection.took_s > 0.0);
    // Squares of 15 mm that are 24 px wide at f = 400 px are 0.25 m away.
    let distance_m = detection.camera_from_target.expect("a pose").translation().z;
    assert!((distance_m - 0.25).abs() < 1e-3, "{distance_m} m");
    assert!(table.detections.take().is_none(), "one search only");
}

#[test]
fn a_board_of_every_kind_is_found_live_at_its_place() {
    let camera = Intrinsics::pinhole(640, 480, 581.0);
    let family = Dictionary::APRILTAG_36H11;
    let (square_m, marker_m, dictionary) = (0.022, 0.016, Dictionary::ARUCO_5X5_100);
    let grid = Grid { columns: 10, rows: 7, square_m: 0.015 };
    let (tag_m, spacing_m, ids) = (0.03, 0.009, IdOrder::BottomUp);
    for target in [
        BOARD,
        TargetSpec::Circles(grid),
        TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 11, square_m: 0.018 }),
        TargetSpec::Charuco(Charuco { columns: 6, rows: 8, square_m, marker_m, dictionary, layout: None }),
        TargetSpec::AprilGrid(AprilGrid {
            columns: 4,
            rows: 6,
            tag_m,
            spacing_m,
            first_id: 0,
            family,
            border_bits: None,
            ids,
        }),
        TargetSpec::AprilTag(AprilTag { tag_m: 0.1, id: 0, family, border_bits: Some(1) }),
    ] {
        let centre = target.centre();
        let middle = Vector2::new(8.0, -5.0);
        let camera_from_target = looking_at_point(&centre, &camera, 0.5, [0.4, 0.7, 0.1], middle);
        let grey = Scene::drawn(target, camera, camera_from_target).render(1);
        let image = RgbImage::from_fn(640, 480, |x, y| Rgb([grey.get_pixel(x, y)[0]; 3]));
        let mut table = watching(target);
        table.ask(VisionTask::SetIntrinsics(camera));
        table.put(&image);
        table.turn();
        let (detection, _) = table.detections.take().expect("a detection");
        // Some of a board's many small tags may be missed; three quarters are plenty for a pose.
        let count = detection.corners.expect("it is there").len();
        assert!(4 * count >= 3 * target.points().len(), "{target}: {count}");
        let found = detection.camera_from_target.expect("a pose");
        let off = (found.isometry() * centre - camera_from_target * centre).norm();
        // The depth of one view of a single tag, 115 px wide: 0.1 px are half a millimetre.
        assert!(off < 2e-3, "{target}: {off} m");
    }
}

#[test]
fn a_board_that_cannot_be_looked_for_is_a_state_and_not_the_end() {
    let impossible = TargetSpec::Circles(Grid { columns: 2, rows: 2, square_m: 0.01 });
    let mut table = watching(impossible);
    table.put(&board(0));
    assert!(table.turn());
    let (detection, _) = table.detections.take().expect("a detection");
    assert_eq!(detection.problem, Some(VisionError::TargetTooSmall { columns: 2, rows: 2 }));
    table.ask(VisionTask::Capture(request(1, 1)));
    let refused = table.feed(&board(0), 10).expect_err("nothing to measure");
    assert_eq!(refused.kind, RefusalKind::NoBoard);
    assert!(refused.why.in_language(Language::English).contains("at least 3 points"), "{refused:?}");
    table.ask(VisionTask::SetTarget(BOARD));
    table.put(&board(0));
    table.turn();
    assert!(table.detections.take().expect("it goes on").0.corners.is_some());
}

#[test]
fn what_a_capture_waits_for_is_told_when_it_changes() {
    let mut table = watching(BOARD);
    table.ask(VisionTask::Capture(request(7, 3)));
    let measured = table.feed(&board(1), 10).expect("a capture");
    assert_eq!((measured.number, measured.frames), (7, 3));
    assert_eq!(measured.corner_noise_px, Some(0.0), "three images, all the same");
    assert_eq!(measured.thumbnail.dimensions(), (160, 120));
    assert_eq!(*measured.rgb, board(1), "nothing is drawn on it");
    assert_eq!(measured.pose_name.as_deref(), Some("view"));
    let again = handeye_detect::observe_image(&measured.rgb, &BOARD, &CancelToken::default())
        .expect("searches")
        .expect("the board");
    assert_eq!(again.corners, measured.corners, "the kept image gives the same corners");
    let averaging = |done| (7, CaptureWait::Images(Wait::Averaging { done, of: 3 }));
    let reported = [
        (7, CaptureWait::Images(Wait::ForImage)),
        averaging(1),
        averaging(2),
        (7, CaptureWait::Measuring),
        (7, CaptureWait::Saving),
    ];
    assert_eq!(table.waits(), reported);
}

#[test]
fn an_image_without_the_board_or_with_a_blurred_one_is_refused_with_the_reason() {
    let mut table = watching(BOARD);
    table.ask(VisionTask::Capture(request(1, 1)));
    let empty = RgbImage::from_pixel(320, 240, Rgb([120, 130, 140]));
    let refused = table.feed(&empty, 10).expect_err("no board");
    assert_eq!(refused.kind, RefusalKind::NoBoard);
    assert!(refused.why.in_language(Language::English).contains("10×7"), "{refused:?}");
    // A box of 13 px has σ = 3.7 px, which is 0.156 of a square.
    table.ask(VisionTask::Capture(request(2, 1)));
    let refused = table.feed(&board(6), 10).expect_err("blurred");
    assert_eq!(refused.kind, RefusalKind::Blurred);
    assert!(refused.why.in_language(Language::English).contains("squares 24 px"), "{refused:?}");
    table.ask(VisionTask::Capture(request(3, 1)));
    assert!(table.feed(&board(3), 10).is_ok(), "σ = 2 px is good enough");
}

#[test]
fn a_pose_that_was_captured_before_is_named() {
    let mut table = watching(BOARD);
    let near = Pose::from_translation_xyzw([0.0031, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
    table.ask(VisionTask::Capture(CaptureRequest { others: vec![(12, near)], ..request(1, 1) }));
    let refused = table.feed(&board(0), 10).expect_err("too similar");
    assert_eq!(refused.kind, RefusalKind::TooSimilar);
    let words = refused.why.in_language(Language::English);
    assert!(words.contains("Capture 12 was taken only 3.1 mm and 0.0°"), "{words}");
}

#[test]
fn a_capture_that_is_cancelled_replaced_or_without_a_board_says_so() {
    let mut table = Table::new();
    table.ask(VisionTask::Capture(request(1, 1)));
    assert_eq!(table.refused().expect("no target").kind, RefusalKind::NoBoard);
    table.ask(VisionTask::SetTarget(BOARD));
    for (number, end) in [
        (2, VisionTask::CancelCapture),
        (3, VisionTask::Capture(request(9, 1))),
        (4, VisionTask::SetTarget(TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.02 }))),
    ] {
        table.ask(VisionTask::Capture(request(number, 1)));
        table.events.try_iter().for_each(drop);
        table.put(&board(0));
        table.turn();
        table.ask(end);
        assert_eq!(table.refused().expect("a reason").kind, RefusalKind::Cancelled, "capture {number}");
    }
    table.ask(VisionTask::CancelCapture);
    assert!(table.refused().is_none(), "there is none to cancel");
}

#[test]
fn a_request_to_cancel_is_taken_up_before_the_measurement_is_handed_over() {
    let mut table = watching(BOARD);
    table.ask(VisionTask::Capture(request(1, 1)));
    for _ in 0..3 {
        table.put(&board(0));
        table.turn();
    }
    // The image that completes it and the request come together.
    table.put(&board(0));
    table.tasks.as_ref().expect("open").send(VisionTask::CancelCapture).expect("room");
    table.turn();
    assert!(table.measured.try_recv().is_err());
    assert_eq!(table.refused().expect("cancelled").kind, RefusalKind::Cancelled);
}

#[test]
fn no_images_and_a_simulation_that_rests_are_told_apart() {
    for (camera_answers, kind, words) in
        [(false, RefusalKind::NoImages, "No images"), (true, RefusalKind::Paused, "simulation is paused")]
    {
        let mut table = watching(BOARD);
        table.ask(VisionTask::Capture(request(1, 1)));
        table.put(&board(0));
        table.turn();
        let now_s = {
            let mut now_s = table.now_s.lock().expect("no panic");
            *now_s += NO_IMAGES_S + 0.1;
            *now_s
        };
        if camera_answers {
            table.tap.heard(now_s);
        }
        table.turn();
        let refused = table.refused().expect("it gives up");
        assert_eq!((refused.kind, refused.at_s), (kind, now_s));
        assert!(refused.why.in_language(Language::English).contains(words), "{refused:?}");
    }
}

#[test]
fn images_that_never_come_to_rest_are_refused_after_the_limit() {
    let mut table = watching(BOARD);
    let options = CaptureOptions { settle_limit_s: 1.0, ..CaptureOptions::default() };
    table.ask(VisionTask::Capture(CaptureRequest { options, ..request(1, 1) }));
    // The lower half is now dark, now light: not the whole image, so it is no flicker.
    let plain = board(0);
    let other = {
        let mut other = plain.clone();
        for v in 300..360 {
            for u in 0..480 {
                other.put_pixel(u, v, Rgb([90, 90, 90]));
            }
        }
        other
    };
    for i in 0..40 {
        table.put(if i % 2 == 0 { &other } else { &plain });
        table.turn();
    }
    let refused = table.refused().expect("it gives up");
    assert_eq!(refused.kind, RefusalKind::NotSettled);
    assert!(refused.why.in_language(Language::English).contains("image still changes after 1 s"), "{refused:?}");
}

#[test]
fn it_ends_with_the_application() {
    let mut table = watching(BOARD);
    table.shutdown.cancel();
    table.put(&board(0));
    assert!(!table.turn());
    let mut table = watching(BOARD);
    table.tasks = None;
    assert!(!table.turn());
}
