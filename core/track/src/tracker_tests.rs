use image::GrayImage;
use nalgebra::{Isometry3, UnitQuaternion, Vector2, Vector3};

use super::*;
use crate::MotionModel;
use crate::moving_board::{self, Cover, PERIOD_S, Watch, board_at, error, rms};
use handeye_estimate::handeye::HandEye;
use handeye_geometry::camera::CameraError;
use handeye_geometry::frames::Target;
use handeye_geometry::targets::Grid;
use handeye_geometry::testing::GRID;

fn still() -> Pose<Base, Target> {
    board_at(Vector3::zeros(), Vector3::zeros())
}

/// Round a circle of 6 cm at 0.1 m/s, rocking by 3°.
fn round(time_s: f64) -> Pose<Base, Target> {
    let (radius, phase) = (0.06, time_s * 0.1 / 0.06);
    let shift = Vector3::new(radius * phase.cos(), radius * phase.sin(), 0.01 * (0.7 * phase).sin());
    board_at(shift, Vector3::new(0.05 * phase.sin(), 0.05 * (1.3 * phase).cos(), 0.1 * phase.sin()))
}

fn corners_of(update: &Update) -> usize {
    match update.state {
        State::Tracking { corners, .. } => corners,
        _ => 0,
    }
}

fn estimate_of(update: &Update) -> Estimate {
    update.estimate.clone().expect("an estimate")
}

fn errors_over(images: usize, watch: &mut Watch, truth: impl Fn(f64) -> Pose<Base, Target>) -> (Vec<f64>, Vec<f64>) {
    let (mut shifts, mut turns) = (Vec::new(), Vec::new());
    for _ in 0..images {
        let now = truth(watch.time_s + PERIOD_S);
        let update = watch.see(Some(&now));
        assert!(corners_of(&update) > 0, "{:?} at {} s", update.state, update.time_s);
        let (shift, turn) = error(&estimate_of(&update).base_from_target, &now);
        shifts.push(shift);
        turns.push(turn.to_degrees());
    }
    (shifts, turns)
}

#[test]
fn a_board_that_moves_round_is_followed_to_a_millimetre_and_a_tenth_of_a_degree() {
    let mut watch = Watch::new();
    let (shifts, turns) = errors_over(60, &mut watch, round);
    println!(
        "round: {:.3} mm, {:.4}° RMS; worst {:.3} mm",
        rms(&shifts) * 1e3,
        rms(&turns),
        shifts.iter().copied().fold(0.0, f64::max) * 1e3
    );
    assert!(rms(&shifts) < 0.5e-3, "{} m", rms(&shifts));
    assert!(rms(&turns) < 0.1, "{}°", rms(&turns));
}

#[test]
fn the_velocity_of_a_board_that_moves_evenly_is_found() {
    let mut watch = Watch::new();
    let velocity = Vector3::new(0.08, -0.06, 0.02);
    let spin = Vector3::new(0.1, -0.05, 0.3);
    let start = still();
    let at = |time_s: f64| {
        let turn = UnitQuaternion::from_scaled_axis(spin * time_s);
        let middle = start.isometry() * moving_board::centre() + velocity * time_s;
        let rotation = turn * start.rotation();
        let origin = middle.coords - rotation * moving_board::centre().coords;
        Pose::<Base, Target>::from_isometry(Isometry3::from_parts(origin.into(), rotation))
    };
    let mut last = None;
    for _ in 0..20 {
        let now = at(watch.time_s + PERIOD_S);
        last = watch.see(Some(&now)).estimate;
    }
    let estimate = last.expect("an estimate");
    // The velocity of the origin, by small differences.
    let h = 1e-4;
    let of_origin = (at(watch.time_s + h).translation() - at(watch.time_s - h).translation()) / (2.0 * h);
    assert!((estimate.velocity_m_s - of_origin).norm() < 0.02, "{} {of_origin}", estimate.velocity_m_s);
    assert!((estimate.angular_velocity_rad_s - spin).norm() < 0.15, "{}", estimate.angular_velocity_rad_s);
    // A tenth of a second on, at the speed of 0.1 m/s.
    let later = watch.tracker.at(watch.time_s + 0.1).expect("soon");
    assert!(error(&later.base_from_target, &at(watch.time_s + 0.1)).0 < 2.5e-3);
    assert!(later.covariance.trace() > estimate.covariance.trace());
    assert!(watch.tracker.at(watch.time_s - 0.01).is_none());
}

#[test]
fn a_board_half_covered_is_followed_by_the_corners_that_are_seen() {
    let mut watch = Watch::new();
    watch.see(Some(&round(PERIOD_S)));
    watch.see(Some(&round(2.0 * PERIOD_S)));
    let (mut shifts, mut turns, mut corners) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..30 {
        let now = round(watch.time_s + PERIOD_S);
        // Everything to the right of the board's middle.
        let middle = watch.camera_from_target(&now) * moving_board::centre();
        let low = Vector2::new(watch.stage.camera.project(&middle).expect("in front").x, 0.0);
        watch.stage.covers = vec![Cover { low, high: Vector2::new(640.0, 480.0) }];
        let update = watch.see(Some(&now));
        assert!(update.seen.is_some(), "{:?}", update.state);
        corners.push(corners_of(&update));
        let (shift, turn) = error(&estimate_of(&update).base_from_target, &now);
        shifts.push(shift);
        turns.push(turn.to_degrees());
    }
    println!("half covered: {:.3} mm, {:.4}° RMS, corners {corners:?}", rms(&shifts) * 1e3, rms(&turns));
    assert!(corners.iter().all(|count| (8..=60).contains(count)), "{corners:?}");
    assert!(rms(&shifts) < 1e-3 && rms(&turns) < 0.2, "{} m {}°", rms(&shifts), rms(&turns));
}

#[test]
fn a_board_partly_out_of_the_image_is_followed() {
    let mut watch = Watch::new();
    let at = |time_s: f64| board_at(Vector3::new(0.1 + 0.09 * time_s, 0.02, 0.0), Vector3::zeros());
    let (mut fewest, mut shifts) = (usize::MAX, Vec::new());
    for _ in 0..55 {
        let now = at(watch.time_s + PERIOD_S);
        let update = watch.see(Some(&now));
        fewest = fewest.min(corners_of(&update));
        shifts.push(error(&estimate_of(&update).base_from_target, &now).0);
    }
    println!("leaving: {fewest} corners at the least, {:.3} mm RMS", rms(&shifts) * 1e3);
    assert!((8..40).contains(&fewest), "{fewest}");
    assert!(rms(&shifts) < 1e-3, "{}", rms(&shifts));
}

#[test]
fn a_board_that_is_gone_is_coasted_then_lost_then_found_without_a_jump_of_velocity() {
    let mut watch = Watch::new();
    assert_eq!(watch.see(None).state, State::Searching);
    for _ in 0..10 {
        let now = round(watch.time_s + PERIOD_S);
        watch.see(Some(&now));
    }
    let since_s = watch.time_s;
    let mut previous = estimate_of(&watch.tracker.last.clone().expect("an image"));
    while watch.time_s + PERIOD_S < since_s + MotionModel::default().coast_s {
        let update = watch.see(None);
        assert_eq!(update.state, State::Coasting { since_s });
        let estimate = estimate_of(&update);
        assert!(estimate.covariance.trace() > previous.covariance.trace());
        let step = (estimate.base_from_target.translation() - previous.base_from_target.translation()).norm();
        assert!(step < 0.15 * PERIOD_S, "a jump of {step} m");
        previous = estimate;
    }
    let update = watch.see(None);
    assert_eq!((update.state, update.estimate, update.seen), (State::Lost { since_s }, None, None));
    assert!(watch.tracker.at(watch.time_s).is_none());
    for _ in 0..5 {
        let now = round(watch.time_s + PERIOD_S);
        let estimate = estimate_of(&watch.see(Some(&now)));
        assert!(error(&estimate.base_from_target, &now).0 < 1e-3);
        assert!(estimate.velocity_m_s.norm() < 0.25, "{}", estimate.velocity_m_s);
    }
}

#[test]
fn one_wild_image_does_not_move_the_estimate() {
    let mut watch = Watch::new();
    errors_over(10, &mut watch, |_| still());
    // The same board elsewhere, for one image.
    let update = watch.see(Some(&board_at(Vector3::new(0.04, 0.03, 0.05), Vector3::new(0.2, 0.1, 0.4))));
    assert!(update.seen.is_some() && matches!(update.state, State::Coasting { .. }), "{:?}", update.state);
    let (shift, turn) = error(&estimate_of(&update).base_from_target, &still());
    assert!(shift < 1e-3 && turn < 0.01, "{shift} m, {turn} rad");
    let (shifts, _) = errors_over(3, &mut watch, |_| still());
    assert!(shifts.iter().all(|shift| *shift < 0.5e-3), "{shifts:?}");
}

#[test]
fn a_board_that_is_moved_suddenly_is_found_again_within_three_images() {
    // Also by whole squares, where the pattern looks the same except for its ends.
    let turned = still().rotation() * Vector3::new(2.0 * GRID.square_m, 0.0, 0.0);
    let by_squares = Isometry3::translation(turned.x, turned.y, turned.z) * still().isometry();
    for there in [board_at(Vector3::new(-0.05, 0.03, 0.0), Vector3::zeros()), Pose::from_isometry(by_squares)] {
        let mut watch = Watch::new();
        errors_over(10, &mut watch, |_| still());
        let states: Vec<State> = (0..3).map(|_| watch.see(Some(&there)).state).collect();
        assert!(
            matches!(states[..], [State::Coasting { .. }, State::Coasting { .. }, State::Tracking { .. }]),
            "{states:?}"
        );
        let (shifts, _) = errors_over(5, &mut watch, |_| there);
        assert!(rms(&shifts) < 0.5e-3, "{shifts:?}");
        let velocity = watch.tracker.at(watch.time_s).expect("an estimate").velocity_m_s;
        assert!(velocity.norm() < 0.02, "{velocity}");
    }
}

#[test]
fn a_camera_beside_the_robot_follows_the_board_whatever_the_tip_does() {
    let mut setup = moving_board::setup();
    let base_from_camera = moving_board::base_from_tip() * moving_board::tip_from_camera();
    setup.calibrated.hand_eye = HandEye::EyeToHand { base_from_camera, tip_from_target: Pose::identity() };
    let mut watch = Watch::with(setup);
    for i in 0..10 {
        watch.base_from_tip = Pose::from_isometry(Isometry3::translation(0.1 * f64::from(i), 0.3, 0.2));
        let now = round(watch.time_s + PERIOD_S);
        let estimate = estimate_of(&watch.see(Some(&now)));
        assert!(error(&estimate.base_from_target, &now).0 < 1e-3);
    }
}

#[test]
fn a_board_that_stands_stands_while_the_camera_moves() {
    let mut watch = Watch::new();
    for i in 0..15 {
        let t = f64::from(i) * PERIOD_S;
        let step = Isometry3::new(Vector3::new(0.15 * t, 0.05 * t, 0.0), Vector3::new(0.0, 0.1 * t, 0.3 * t));
        watch.base_from_tip = Pose::from_isometry(moving_board::base_from_tip().isometry() * step);
        let update = watch.see(Some(&still()));
        assert_eq!(corners_of(&update), 70);
        assert!(error(&estimate_of(&update).base_from_target, &still()).0 < 0.5e-3);
    }
    assert!(estimate_of(&watch.see(Some(&still()))).velocity_m_s.norm() < 0.02);
}

#[test]
fn depths_and_corners_agree_on_where_the_board_is() {
    let mut watch = Watch::new();
    watch.stage.depth_noise_m = 0.5e-3;
    let in_camera = watch.camera_from_target(&still());
    let grey = watch.stage.image(Some(&in_camera), 5);
    let depth = watch.stage.depth(&in_camera, 6);
    let by_depth = watch.show(&grey, Some(&depth)).by_depth.expect("depths");
    let (shift, turn) = error(&by_depth.base_from_target, &still());
    assert!(shift < 0.5e-3 && turn < 0.5_f64.to_radians(), "{shift} m, {turn} rad");
    // Outliers are those beyond four standard deviations by the median. Of seventy healthy depths, each of one to four pixels,
    // that loses one in about every tenth drawing, and more than two in fewer than one of a thousand.
    assert!(by_depth.corners >= 68 && by_depth.rms_m < 1e-3, "{by_depth:?}");
    let first = by_depth.first_corner_in_base.expect("a depth");
    assert!((first.coords - still().translation()).norm() < 2.5e-3, "{first}");
}

#[test]
fn images_of_another_size_and_poses_that_are_no_numbers_are_refused() {
    let mut tracker = Tracker::new(moving_board::setup()).expect("a good set-up");
    let grey = GrayImage::new(320, 240);
    let good =
        Image { time_s: 1.0, grey: &grey, depth: None, far_plane_m: 3.5, base_from_tip: moving_board::base_from_tip() };
    let error = tracker.see(&good).expect_err("refused");
    assert!(matches!(error, TrackError::OtherSize { what: "image", width: 320, camera_width: 640, .. }), "{error}");
    let grey = GrayImage::new(640, 480);
    let good = Image { grey: &grey, ..good };
    assert_eq!(tracker.see(&good).expect("an image").state, State::Searching);
    let nowhere = Pose::from_isometry(Isometry3::translation(f64::NAN, 0.0, 0.0));
    let error = tracker.see(&Image { base_from_tip: nowhere, ..good }).expect_err("refused");
    assert_eq!(
        error.to_string(),
        "the robot pose of the image at 1 s is not finite: read it again with the next image"
    );
    assert!(matches!(tracker.see(&Image { time_s: f64::NAN, ..good }), Err(TrackError::BadTime { .. })));
    let depth = handeye_geometry::depth::DepthImage::new(1, 1, vec![1.0]).expect("one");
    let error = tracker.see(&Image { depth: Some(&depth), ..good }).expect_err("refused");
    assert!(matches!(error, TrackError::OtherSize { what: "depth image", .. }), "{error}");
}

#[test]
fn set_ups_that_cannot_be_worked_with_are_refused() {
    let refused = |change: &dyn Fn(&mut Setup)| {
        let mut setup = moving_board::setup();
        change(&mut setup);
        Tracker::new(setup).map(|_| ()).expect_err("refused")
    };
    let error = refused(&|s| s.calibrated.intrinsics.fx = 0.0);
    assert!(
        matches!(error, TrackError::Intrinsics { source: CameraError::BadParameter { name: "fx", .. } }),
        "{error}"
    );
    let nowhere = Pose::from_isometry(Isometry3::translation(f64::INFINITY, 0.0, 0.0));
    let hand_eye = HandEye::EyeInHand { tip_from_camera: nowhere, base_from_target: Pose::identity() };
    assert_eq!(refused(&|s| s.calibrated.hand_eye = hand_eye), TrackError::NoHandEye);
    let board = |columns, square_m| TargetSpec::Chessboard(Grid { columns, rows: 7, square_m });
    assert_eq!(refused(&|s| s.target = board(2, 0.01)), TrackError::TargetTooSmall { columns: 2, rows: 7 });
    assert_eq!(refused(&|s| s.target = board(5, 0.0)), TrackError::BadSquare { square_m: 0.0 });
    let error = refused(&|s| s.motion.coast_s = -1.0);
    assert_eq!(error, TrackError::BadMotion { name: "time to coast", value: -1.0 });
}

#[test]
fn a_step_back_in_time_starts_anew_and_an_image_shown_twice_counts_once() {
    let mut watch = Watch::new();
    errors_over(3, &mut watch, |_| still());
    let first = watch.tracker.last.clone();
    watch.time_s -= PERIOD_S;
    assert_eq!(Some(watch.see(None)), first);
    watch.time_s = -1.0;
    assert_eq!(watch.see(None).state, State::Searching);
}

#[test]
fn a_sharp_image_of_exact_coverage_is_followed() {
    use handeye_geometry::camera::Intrinsics;
    use handeye_simulate::Scene;
    let mut setup = moving_board::setup();
    setup.calibrated.intrinsics = Intrinsics::pinhole(640, 480, 581.0);
    let mut watch = Watch::with(setup);
    for blur_px in [0.0, 0.7] {
        watch.tracker.reset();
        for i in 0..5 {
            let now = board_at(Vector3::new(0.003 * f64::from(i), 0.0, 0.0), Vector3::zeros());
            let in_camera = watch.camera_from_target(&now);
            let mut scene = Scene::new(watch.tracker.setup().calibrated.intrinsics, GRID, in_camera);
            (scene.blur_px, scene.noise) = (blur_px, 1.0);
            let update = watch.show(&scene.render(i as u64), None);
            let (shift, turn) = error(&estimate_of(&update).base_from_target, &now);
            println!(
                "blur {blur_px}: {:.3} mm {:.4}° rms {:.4} px",
                shift * 1e3,
                turn.to_degrees(),
                update.seen.as_ref().map_or(0.0, |s| s.rms_px)
            );
            assert_eq!(corners_of(&update), 70);
            assert!(shift < 0.3e-3 && turn.to_degrees() < 0.1, "{shift} m {turn} rad");
        }
    }
}

#[test]
fn corners_that_are_hidden_stay_unseen_where_edges_are_hard() {
    use handeye_geometry::camera::Intrinsics;
    use handeye_simulate::Scene;
    let mut setup = moving_board::setup();
    setup.calibrated.intrinsics = Intrinsics::pinhole(640, 480, 581.0);
    let mut watch = Watch::with(setup);
    let mut covered_by_sides = 0;
    for i in 0..8 {
        let now = board_at(Vector3::new(0.003 * f64::from(i), 0.001 * f64::from(i), 0.0), Vector3::new(0.1, 0.2, 0.3));
        let in_camera = watch.camera_from_target(&now);
        let camera = watch.tracker.setup().calibrated.intrinsics;
        let mut scene = Scene::new(camera, GRID, in_camera);
        (scene.blur_px, scene.noise) = (0.0, 0.0);
        let mut image = scene.render(0);
        let levels = image.pixels().map(|pixel| pixel.0[0]);
        let (dark, light) = levels.fold((255, 0), |(dark, light): (u8, u8), level| (dark.min(level), light.max(level)));
        let middle = dark / 2 + light / 2;
        // A pixel is mostly dark where its centre is.
        image.pixels_mut().for_each(|pixel| pixel.0[0] = if pixel.0[0] < middle { dark } else { light });
        let is_covered = i >= 4;
        let back = in_camera.inverse();
        for (u, v, pixel) in image.enumerate_pixels_mut().filter(|_| is_covered) {
            let ray = back * *camera.unproject(&Vector2::new(f64::from(u), f64::from(v))).expect("in the image");
            let column = (back.translation.vector - ray * (back.translation.z / ray.z)).x / GRID.square_m;
            if column > 7.5 {
                pixel.0[0] = middle;
            }
        }
        let update = watch.show(&image, None);
        let seen = update.seen.as_ref().expect("in sight");
        let by_sides = seen.corners.iter().all(|corner| corner.covariance_px2.is_some());
        assert!(by_sides || is_covered, "image {i} is taken for a soft one");
        covered_by_sides += usize::from(by_sides && is_covered);
        let beyond = seen.corners.iter().filter(|corner| corner.index % GRID.columns > 7).count();
        assert!(
            seen.corners.len() > 40 && (beyond > 0) != is_covered,
            "{} corners, {beyond} beyond",
            seen.corners.len()
        );
    }
    assert!(covered_by_sides > 0, "no covered image was measured by its sides");
}

mod slow {
    use super::*;

    #[test]
    fn the_covariance_of_one_image_is_that_of_its_errors() {
        // Squared errors normalised by the covariance, of 6 degrees of freedom each: in 99.9 of 100 cases the mean of n
        // lies within 6 (1 ± 3.29 √(2 / 6n)); corners are a little correlated by the grey levels' steps, hence 10 % more.
        let mut total = 0.0;
        let count = 60;
        let mut watch = Watch::new();
        for i in 0..count {
            let t = f64::from(i);
            let now = board_at(
                Vector3::new(0.05 * (1.7 * t).sin(), 0.04 * (2.3 * t).cos(), 0.05 * t.sin()),
                Vector3::new(0.3 * (0.9 * t).sin(), 0.3 * (1.1 * t).cos(), t),
            );
            watch.tracker.reset();
            let seen = watch.see(Some(&now)).seen.expect("seen");
            let off = handeye_geometry::se3::log((seen.base_from_target.inverse() * now).isometry());
            total += off.dot(&seen.covariance.cholesky().expect("positive").solve(&off));
        }
        let mean = total / f64::from(count) / 6.0;
        let bound = 3.29 * (2.0 / (6.0 * f64::from(count))).sqrt() + 0.1;
        println!("covariance of one image: {mean:.3} of what is expected, bound ±{bound:.3}");
        assert!((mean - 1.0).abs() < bound, "{mean}");
    }

    #[test]
    fn the_covariance_of_the_estimate_is_that_of_its_errors_for_boards_that_stand_or_move_evenly() {
        for velocity in [Vector3::zeros(), Vector3::new(0.08, 0.06, 0.0)] {
            let (mut total, mut count) = (0.0, 0.0);
            let mut watch = Watch::new();
            for run in 0..5 {
                watch.tracker.reset();
                let from_s = watch.time_s;
                for image in 0..10 {
                    let t = watch.time_s + PERIOD_S - from_s;
                    let shift = velocity * t + Vector3::new(-0.03, -0.02, 0.01 * f64::from(run));
                    let now = board_at(shift, Vector3::new(0.0, 0.0, f64::from(run)));
                    let estimate = estimate_of(&watch.see(Some(&now)));
                    // Every third: the errors of neighbours belong together.
                    if image % 3 == 2 {
                        let off = handeye_geometry::se3::log((estimate.base_from_target.inverse() * now).isometry());
                        total += off.dot(&estimate.covariance.cholesky().expect("positive").solve(&off));
                        count += 6.0;
                    }
                }
            }
            let mean = total / count;
            println!("covariance of the estimate at {:.1} m/s: {mean:.3} of what is expected", velocity.norm());
            // A board that moves more evenly than the model assumes is known better than stated, and not worse.
            assert!(mean < 1.0 + 3.29 * (2.0 / count).sqrt() + 0.1 && mean > 0.4, "{mean}");
        }
    }
}
