//! Captures of a built-in cell over sockets, against the truth that it publishes.

use std::time::Instant;

use crossbeam_channel::bounded;
use handeye_capture::{Scatter, Wait};
use handeye_cell::scene::Scene;
use handeye_coppeliasim::{CancelToken, MotionLimits};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};

use crate::capture;
use crate::capture::state::{CaptureWait, RefusalKind};
use crate::command::Event;
use crate::worker::vision::VisionTask;
use crate::worker::vision::bench::{CellBench, request};

/// Views of the board as joint angles.
fn views() -> Vec<[f64; 6]> {
    let text = include_str!("../../../../../../assets/poses/realistic20.toml");
    let taught = TaughtPoses::parse(std::path::Path::new("realistic20"), text).expect("poses");
    let joints = |goal: &Goal| match goal {
        Goal::Joints(joints) => joints.as_slice().try_into().expect("six joints"),
        Goal::Tip(_) => panic!("joint angles"),
    };
    taught.poses.iter().map(|pose| joints(&pose.goal)).collect()
}

/// 100°/s, 200°/s², 400°/s³: a motion of a second or two.
fn brisk() -> MotionLimits {
    MotionLimits::uniform(6, 1.75, 3.5, 7.0)
}

/// A robot that returns exactly, so that the pose that it reports is the truth.
fn exact_robot(mut scene: Scene) -> Scene {
    scene.robot.repeatability_mm = 0.0;
    scene.robot.repeatability_deg = 0.0;
    scene
}

/// Captures requested right after a move command and all the while that the arm is moving.
fn captured_around_moves(scene: Scene, bound_px: f64) {
    let mut bench = CellBench::start(exact_robot(scene), true);
    let views = views();
    bench.client.arm().move_to_joints(&views[0], &brisk(), &CancelToken::default()).expect("it gets there");
    let mut number = 0;
    for view in [views[2], views[5], views[0]] {
        let mut mover = bench.connect();
        let (commanded, begun) = bounded(0);
        let motion = std::thread::spawn(move || {
            commanded.send(()).expect("the test waits");
            mover.arm().move_to_joints(&view, &brisk(), &CancelToken::default()).expect("it gets there");
        });
        begun.recv().expect("the thread lives");
        let mut last = None;
        while last.is_none_or(|arrived: bool| !arrived) {
            let arrived = motion.is_finished();
            number += 1;
            let measured = bench.capture(request(number, 1)).expect("the board is in view at both ends");
            let worst_px = bench.worst_px(&measured);
            println!("capture {number}: {worst_px:.3} px, settled in {:.2} s, arrived {arrived}", measured.settled_s);
            assert!(worst_px < bound_px, "capture {number} is {worst_px} px off: {measured:?}");
            last = Some(arrived);
        }
        motion.join().expect("the motion ends well");
    }
    let moved = bench.events.iter().filter(|event| {
        matches!(event, Event::Capture(capture::Event::Waits { wait: CaptureWait::Images(Wait::RobotMoves), .. }))
    });
    assert!(moved.count() >= 3, "captures were asked for in motion");
}

#[test]
fn a_capture_around_a_motion_never_shows_the_arm_in_motion() {
    captured_around_moves(Scene::reference().expect("a scene"), 0.3);
}

#[test]
fn nor_does_one_in_noisy_images() {
    captured_around_moves(Scene::realistic().expect("a scene"), 0.3);
}

/// Noise of a grey level when the mean of images with a noise per channel is rounded to whole levels, and its grey
/// once more: luma weighs the channels by 0.299, 0.587 and 0.114, and rounding is uniform over one level.
fn grey_noise(per_channel: f64, images: f64) -> f64 {
    let rounding = 1.0 / 12.0;
    let luma = 0.299_f64.powi(2) + 0.587_f64.powi(2) + 0.114_f64.powi(2);
    ((per_channel.powi(2) / images + rounding) * luma + rounding).sqrt()
}

#[test]
fn averaging_sixteen_images_lowers_corner_noise_as_far_as_whole_levels_allow() {
    const CAPTURES: u64 = 7;
    const JITTER_PX: f64 = 1.2e-3;
    for noise_grey in [1.8, 8.0] {
        let mut scene = Scene::realistic().expect("a scene");
        scene.image.noise_grey = noise_grey;
        let mut bench = CellBench::start(scene, false);
        bench.client.arm().move_to_joints(&views()[0], &brisk(), &CancelToken::default()).expect("it gets there");
        let (mut single, mut averaged, mut stated) = (Scatter::default(), Scatter::default(), Vec::new());
        for number in 0..CAPTURES {
            let one = bench.capture(request(2 * number, 1)).expect("a capture");
            assert_eq!(one.corner_noise_px, None);
            single.add(&one.corners);
            let sixteen = bench.capture(request(2 * number + 1, 16)).expect("a capture");
            assert_eq!(sixteen.frames, 16);
            averaged.add(&sixteen.corners);
            stated.push(sixteen.corner_noise_px.expect("sixteen images"));
        }
        let (single, averaged) = (single.sigma_px().expect("seven"), averaged.sigma_px().expect("seven"));
        // 2.7 at 1.8 levels, where rounding is half of what is left; 3.9 at 8 levels, near the √16 of the noise alone.
        let (ratio, expected) = (single / averaged, grey_noise(noise_grey, 1.0) / grey_noise(noise_grey, 16.0));
        println!(
            "noise {noise_grey}: one image {single:.4} px, sixteen {averaged:.4} px, ratio {ratio:.2} of \
             {expected:.2}; stated {stated:.4?}"
        );
        // The detector places its windows again in every image and sums in single precision, which jitters by a thousandth
        // of a pixel or so. Each scatter has 840 degrees of freedom, 2.4 % of its own.
        let left = (single / expected).hypot(JITTER_PX);
        assert!(averaged < 1.1 * left && ratio < 1.1 * expected, "{averaged} px instead of {left} px");
        for sigma in stated {
            assert!((sigma / single - 1.0).abs() < 0.3, "stated {sigma} px, true {single} px");
        }
    }
}

#[test]
fn every_live_image_is_judged_and_a_paused_simulation_is_named() {
    let mut bench = CellBench::start(Scene::reference().expect("a scene"), true);
    bench.client.arm().move_to_joints(&views()[0], &brisk(), &CancelToken::default()).expect("it gets there");
    bench.live(10);
    let mut waits_ms = Vec::new();
    for number in 1..=5 {
        let asked = Instant::now();
        bench.capture(request(number, 1)).expect("a capture");
        waits_ms.push(asked.elapsed().as_secs_f64() * 1e3);
    }
    let hits: Vec<_> = bench.live(20);
    assert!(hits.iter().all(|detection| detection.camera_from_target.is_some()));
    let ms = |detections: &[crate::capture::state::LiveDetection]| {
        let mut all: Vec<f64> = detections.iter().map(|detection| detection.took_s * 1e3).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let hit_ms = ms(&hits);
    // A board of another size is a miss in every image.
    let other = handeye_geometry::targets::Grid { columns: 13, rows: 9, square_m: 0.015 };
    bench
        .workers
        .ask_vision(VisionTask::SetTarget(handeye_geometry::targets::TargetSpec::Chessboard(other)))
        .expect("takes");
    let misses: Vec<_> = bench.live(25).split_off(5);
    assert!(misses.iter().all(|detection| detection.corners.is_none() && detection.problem.is_none()));
    println!("live hit {hit_ms:.1} ms, miss {:.1} ms; from request to capture {waits_ms:.0?} ms", ms(&misses));

    bench.client.arm().sim().pause_simulation().expect("it pauses");
    let refused = bench.capture(request(9, 1)).expect_err("time stands still");
    assert_eq!(refused.kind, RefusalKind::Paused, "{refused:?}");
}
