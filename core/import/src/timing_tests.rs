use nalgebra::Vector3;

use super::*;
use crate::{Source, Verdict, judge};
use handeye_estimate::handeye::Mode;
use handeye_geometry::targets::{Grid, TargetSpec};

const OFFSET_S: f64 = 0.0437;
/// As in timestamps of 2023.
const START_NS: i64 = 1_700_000_000_000_000_000;

fn arm(time_s: f64) -> Isometry3<f64> {
    let of = |axis: usize| -> f64 {
        (0..4).map(|k| 0.25 * ((0.5 + 0.37 * f64::from(k) + 0.13 * axis as f64) * time_s + axis as f64).sin()).sum()
    };
    Isometry3::new(Vector3::new(0.4 + 0.2 * of(0), 0.2 * of(1), 0.5 + 0.2 * of(2)), Vector3::new(of(3), of(4), of(5)))
}

/// A robot at 100 Hz and a camera at 15 Hz whose clock is behind, in hand or next to the robot.
fn recorded(mode: Mode, seconds: f64, moves: impl Fn(f64) -> Isometry3<f64>) -> (Recording, Sights) {
    let x = Isometry3::new(Vector3::new(0.03, -0.05, 0.08), Vector3::new(0.2, -0.3, 1.5));
    let y = Isometry3::new(Vector3::new(0.9, 0.1, 0.1), Vector3::new(1.0, 2.0, 0.5));
    let ns = |time_s: f64| START_NS + (time_s * 1e9).round() as i64;
    let times = |hertz: f64| (0..(seconds * hertz) as u32).map(move |k| f64::from(k) / hertz);
    let motion = Motion {
        name: "bag:tf:base->tool0".into(),
        role: Role::Robot,
        direction: Some(Known::by("the tree of frames", Direction::Forward)),
        poses: std::sync::Arc::new(times(100.0).map(|t| (ns(t), moves(t))).collect()),
    };
    let images: Vec<ImageFile> = times(15.0)
        .map(|t| ImageFile {
            path: format!("image_{}.png", ns(t)).into(),
            number: None,
            same_as: None,
            stamp_ns: Some(ns(t - OFFSET_S)),
        })
        .collect();
    let seen = times(15.0)
        .map(|t| match mode {
            Mode::EyeInHand => Some(x.inverse() * moves(t).inverse() * y),
            Mode::EyeToHand => Some(x.inverse() * moves(t) * y),
        })
        .collect();
    let target = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.02 });
    let sights = Sights { streams: vec![Some(Sight::of_poses(Some(&target), seen))], target: Some(target) };
    let stream = Stream { name: "/camera".into(), images, size: (640, 480), is_depth: false, points: None };
    (Recording { streams: vec![stream], motions: vec![motion], ..Recording::default() }, sights)
}

/// Taken at the stamps as they are, an arm at this speed would be some 10 mm off.
#[test]
fn images_of_a_moving_robot_get_the_poses_that_it_had_by_its_own_clock() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let (recording, mut sights) = recorded(mode, 20.0, arm);
        let settings = Settings::default();
        let timed = timed(&recording, &mut sights, &settings, &CancelToken::default()).expect("told").expect("stamps");
        let [clocks] = timed.clocks.as_slice() else { panic!("{:?}", timed.clocks) };
        assert!((clocks.offset.offset_s - OFFSET_S).abs() < 2e-4, "{clocks:?}");
        assert!(timed.streams[0].images.len() <= MOST_VIEWS && timed.streams[0].images.len() > 40);
        let judgement = judge(&timed, &sights, &settings, &CancelToken::default()).expect("hypotheses");
        let best = &judgement.hypotheses[0];
        assert_eq!((&judgement.verdict, best.mode), (&Verdict::Decided, mode));
        let Source::Stream(_) = best.source else { panic!("images were there") };
        for (sample, image) in best.pairing.image_of.iter().enumerate() {
            let image = &timed.streams[0].images[image.expect("every view has its image")];
            let truth = arm(seconds(image.stamp_ns.expect("a stamp"), START_NS) + OFFSET_S);
            let pose = *best.base_from_tip(&timed.tracks[best.robot].samples[sample]).expect("a pose").isometry();
            let off_m = (pose.translation.vector - truth.translation.vector).norm();
            assert!(off_m < 2e-4 && pose.rotation.angle_to(&truth.rotation) < 5e-4, "{sample}: {off_m}");
        }
    }
}

#[test]
fn clocks_that_are_far_apart_need_to_be_told_roughly() {
    let (mut recording, mut sights) = recorded(Mode::EyeInHand, 20.0, arm);
    for image in &mut recording.streams[0].images {
        image.stamp_ns = image.stamp_ns.map(|stamp| stamp - 3_600_000_000_000);
    }
    let none = Settings::default();
    let why = timed(&recording, &mut sights, &none, &CancelToken::default()).expect_err("an hour").to_string();
    assert!(why.contains("/camera") && why.contains("too little time in common"), "{why}");
    let mut roughly = Settings::default();
    roughly.set("clock_offset=3599.5").expect("a number");
    let timed = timed(&recording, &mut sights, &roughly, &CancelToken::default()).expect("told").expect("stamps");
    let offset_s = timed.clocks[0].offset.offset_s;
    assert!((offset_s - 3600.0 - OFFSET_S).abs() < 2e-4, "{offset_s}");
}

#[test]
fn a_motion_that_tells_no_time_is_refused() {
    let even = |time_s: f64| Isometry3::new(Vector3::new(0.4, 0.0, 0.5), Vector3::new(0.0, 0.0, 0.2 * time_s));
    let (recording, mut sights) = recorded(Mode::EyeInHand, 20.0, even);
    let refused = timed(&recording, &mut sights, &Settings::default(), &CancelToken::default());
    assert!(matches!(refused, Err(ImportError::Clocks { .. })), "{refused:?}");
}

/// It turned evenly, which does not determine an offset, and was at rest five times.
#[test]
fn where_the_motion_tells_no_time_the_images_at_rest_are_kept() {
    let even = |time_s: f64| Isometry3::new(Vector3::new(0.4, 0.0, 0.5), Vector3::new(0.0, 0.0, 0.2 * time_s));
    let (mut recording, mut sights) = recorded(Mode::EyeInHand, 20.0, even);
    let rests = [20, 70, 120, 180, 240];
    let sample = |index: usize| {
        let stamp_ns = recording.streams[0].images[index].stamp_ns.expect("a stamp");
        let (t, q) = {
            let pose = arm(seconds(stamp_ns, START_NS));
            (pose.translation.vector, pose.rotation.coords)
        };
        Sample {
            image: Some(recording.streams[0].images[index].shown()),
            number: None,
            place: Arc::new(text!("{name} at {seconds} s", name = "bag", seconds = index)),
            numbers: Numbers::Quaternion([t.x, t.y, t.z, q.x, q.y, q.z, q.w]),
            joints: Vec::new(),
        }
    };
    let samples: Vec<Sample> = rests.map(sample).into();
    recording.at_rest =
        vec![tree::track("bag:tf:base->tool0".into(), "robot", Stated::default(), samples).expect("five")];
    let out = timed(&recording, &mut sights, &Settings::default(), &CancelToken::default());
    let out = out.expect("rests are there").expect("stamps");
    assert!(out.clocks.is_empty() && out.tracks.len() == 1 && out.warnings.len() == 1, "{:?}", out.warnings);
    assert!(out.warnings[0].to_string().contains("5 images at which the robot stood"), "{:?}", out.warnings);
    let names: Vec<String> = out.streams[0].images.iter().map(ImageFile::shown).collect();
    assert_eq!(names, rests.map(|index| recording.streams[0].images[index].shown()));
    assert_eq!(sights.streams[0].as_ref().expect("seen").seen.len(), rests.len());
    // Two are not enough.
    recording.at_rest[0].samples.truncate(2);
    let (_, mut sights) = recorded(Mode::EyeInHand, 20.0, even);
    let refused = timed(&recording, &mut sights, &Settings::default(), &CancelToken::default());
    assert!(matches!(refused, Err(ImportError::Clocks { .. })), "{refused:?}");
}
