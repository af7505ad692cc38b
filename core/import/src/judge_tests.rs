//! How hypotheses are judged: recordings that seem explained but are not, and correct ones that seem contradicted.

use std::cell::Cell;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Duration;

use nalgebra::Isometry3;

use super::tests::{Written, in_hand, judged, numbers, observed, pose_of, row, save_image, sights, table_folder};
use super::*;
use handeye_estimate::Observations;
use handeye_estimate::handeye::Mode;
use handeye_files::bounds::Bounds;
use handeye_files::budget::{Budget, Limits, Spent};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_wording::Text;

const VIEWS: usize = 14;

fn table(folder: &Path, name: &str, poses: impl Iterator<Item = Isometry3<f64>>, written: Written) {
    let mut text = String::new();
    for pose in poses {
        let _ok = writeln!(text, "{}", row(&numbers(written, &pose), ","));
    }
    fs::write(folder.join(name), text).expect("written");
}

fn images(folder: &Path, views: usize) {
    for view in 0..views {
        save_image(&folder.join(format!("image{view:02}.png")), view);
    }
}

/// `calibrateCamera` gives a pose of the target for every image, and many users save those next to the images.
#[test]
fn poses_of_the_target_in_the_camera_are_no_poses_of_a_robot() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let session = observed(mode, VIEWS, 1);
        let folder = tempfile::tempdir().expect("a folder");
        images(folder.path(), VIEWS);
        let every: Vec<usize> = (0..VIEWS).collect();
        let recording = Recording { root: folder.path().to_owned(), ..open(folder.path()).expect("images") };
        let seen = sights(&recording, &session).streams[0].as_ref().expect("the target is seen").seen.clone();
        let poses = every.iter().map(|view| seen[*view].expect("in every image"));
        table(folder.path(), "extrinsics.txt", poses, Written::VectorRadM);
        let (_, judgement) = judged(folder.path(), &session, &Settings::default());
        let best = &judgement.hypotheses[0];
        assert_eq!(judgement.verdict, Verdict::Unexplained, "{best:#?}");
        assert!(best.contradictions.iter().any(|why| why.to_string().contains("target in the camera")), "{best:#?}");
    }
}

/// A row that was typed wrong: its image fits the pose of a neighbour better, which has its own image all the same.
#[test]
fn one_wrong_row_is_left_out_and_says_nothing_against_the_others() {
    let session = observed(Mode::EyeInHand, VIEWS, 2);
    let folder = tempfile::tempdir().expect("a folder");
    images(folder.path(), VIEWS);
    let wrong = |view: usize| {
        let mut pose = pose_of(&session, view);
        if view == 3 {
            pose.translation.vector.z += 0.7;
        }
        pose
    };
    table(folder.path(), "poses.txt", (0..VIEWS).map(wrong), Written::RpyDegMm);
    let (_, judgement) = judged(folder.path(), &session, &in_hand());
    assert_eq!(judgement.verdict, Verdict::Decided, "{:#?}", judgement.hypotheses[0]);
    let disagreeing = &judgement.hypotheses[0].fit.as_ref().expect("a fit").disagreeing;
    assert_eq!(disagreeing.iter().map(|(sample, _)| *sample).collect::<Vec<_>>(), [3]);
}

#[test]
fn two_images_that_were_exchanged_are_still_a_contradiction() {
    let session = observed(Mode::EyeInHand, VIEWS, 2);
    let folder = tempfile::tempdir().expect("a folder");
    images(folder.path(), VIEWS);
    let exchanged =
        |view: usize| pose_of(&session, [(3, 9), (9, 3)].iter().find(|it| it.0 == view).map_or(view, |it| it.1));
    table(folder.path(), "poses.txt", (0..VIEWS).map(exchanged), Written::RpyDegMm);
    let (_, judgement) = judged(folder.path(), &session, &in_hand());
    assert_ne!(judgement.verdict, Verdict::Decided);
    let by_order = judgement.hypotheses.iter().find(|h| !h.pairing.is_by_content).expect("it is listed");
    assert!(by_order.contradictions.iter().any(|why| why.to_string().contains("fits the pose of")), "{by_order:#?}");
}

#[test]
fn the_same_poses_in_two_files_are_one_hypothesis_that_names_both() {
    let session = observed(Mode::EyeInHand, VIEWS, 3);
    let folder = table_folder(&session, Written::RpyDegMm);
    let rounded = |view: usize| {
        let pose = pose_of(&session, view);
        let at = pose.translation.vector.map(|v| (v * 1e5).round() / 1e5);
        Isometry3::from_parts(at.into(), pose.rotation)
    };
    table(folder.path(), "copy.txt", (0..VIEWS).map(rounded), Written::Xyzw);
    let (_, judgement) = judged(folder.path(), &session, &in_hand());
    let best = &judgement.hypotheses[0];
    assert_eq!(judgement.verdict, Verdict::Decided, "{best:#?}");
    assert_eq!(best.same_as.iter().filter(|name| name.contains(".txt")).count(), 1, "{:?}", best.same_as);

    // Other poses in another file are another hypothesis.
    let other = |view: usize| {
        let mut pose = pose_of(&session, view);
        pose.translation.vector.x += 0.002 * (view % 3) as f64;
        pose
    };
    table(folder.path(), "copy.txt", (0..VIEWS).map(other), Written::Xyzw);
    let (recording, judgement) = judged(folder.path(), &session, &in_hand());
    let names = |h: &Hypothesis| recording.tracks[h.robot].name.clone();
    assert!(judgement.hypotheses.iter().any(|h| names(h) != names(&judgement.hypotheses[0])));
}

/// A board that is stated to be a seventh larger than it is leaves a few per cent of its distance, which a poor recording does,
/// too.
#[test]
fn a_target_of_another_size_than_the_robot_has_seen_is_named_with_its_size() {
    let reported = |session: &Observations, factor: f64| {
        let TargetSpec::Chessboard(grid) = session.target else { panic!("a chessboard") };
        let target = TargetSpec::Chessboard(Grid { square_m: grid.square_m * factor, ..grid });
        Observations { target, ..session.clone() }
    };
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let session = observed(mode, VIEWS, 4);
        let folder = table_folder(&session, Written::RpyRadM);
        let settings = Settings { mode: Some(mode), ..Settings::default() };
        let (_, judgement) = judged(folder.path(), &reported(&session, 1.15), &settings);
        let best = &judgement.hypotheses[0];
        let fit = best.fit.as_ref().expect("a fit");
        assert!(fit.relative < 0.05 && fit.median_rad < 0.05, "by its error alone it would be taken: {fit:?}");
        assert_eq!(judgement.verdict, Verdict::Unexplained);
        let why: Vec<String> = best.contradictions.iter().map(Text::to_string).collect();
        let named = why.iter().find_map(|why| why.strip_prefix("a target ")?.split(' ').next());
        let scale: f64 = named.expect("its size").parse().expect("a number");
        assert!((scale * 1.15 - 1.0).abs() < 0.01, "{scale}");
        // A print with a scale error of two per cent is left to the calibration.
        let (_, judgement) = judged(folder.path(), &reported(&session, 1.02), &settings);
        assert_eq!(judgement.verdict, Verdict::Decided, "{:#?}", judgement.hypotheses[0]);
    }
}

#[test]
fn without_a_view_to_solve_with_the_reason_is_said_instead_of_a_list() {
    let session = observed(Mode::EyeInHand, VIEWS, 5);
    let folder = table_folder(&session, Written::Xyzw);
    let recording = open(folder.path()).expect("a recording");
    let mut sights = sights(&recording, &session);
    if let Some(sight) = &mut sights.streams[0] {
        sight.seen.iter_mut().skip(2).for_each(|seen| *seen = None);
    }
    let why = judge(&recording, &sights, &Settings::default(), &CancelToken::default());
    assert!(matches!(why, Err(ImportError::NoViews { .. })), "{why:?}");
}

/// No data distinguish the place of the camera from the direction of the poses: where only that is open, it is a question
/// instead of a list.
#[test]
fn a_recording_that_is_clear_but_for_the_place_of_the_camera_says_so() {
    let session = observed(Mode::EyeInHand, VIEWS, 6);
    let folder = table_folder(&session, Written::RpyDegMm);
    let (_, judgement) = judged(folder.path(), &session, &Settings::default());
    assert_eq!(judgement.verdict, Verdict::Ambiguous(2), "{:#?}", judgement.hypotheses);
    assert!(judgement.is_open_in_mode_alone());
    let (_, judgement) = judged(folder.path(), &session, &in_hand());
    assert!(judgement.verdict == Verdict::Decided && !judgement.is_open_in_mode_alone());
    assert_eq!((judgement.untried, judgement.sources_untried), (0, 0), "a recording is tried wholly");
}

/// A folder of many series under neutral names: with all conventions of each there are more hypotheses than can be tried in
/// reasonable time.
#[test]
fn of_more_hypotheses_than_can_be_tried_the_likeliest_are_and_the_rest_is_counted() {
    let session = observed(Mode::EyeInHand, VIEWS, 7);
    let folder = tempfile::tempdir().expect("a folder");
    let series = 40;
    for number in 0..series {
        let moved = |view: usize| {
            let mut pose = pose_of(&session, (view * (number + 1) + number) % VIEWS);
            pose.translation.vector.x += 0.01 * number as f64;
            pose
        };
        let name = format!("series_{}.txt", ["a", "b", "c", "d"][number % 4].repeat(number + 1));
        table(folder.path(), &name, (0..VIEWS).map(moved), Written::RpyRadM);
    }
    let recording = open(folder.path()).expect("a recording");
    assert!(recording.tracks.len() >= series, "{}", recording.tracks.len());
    let all = recording.tracks.len() * (recording.tracks.len() - 1);
    let judgement = judge(&recording, &Sights::default(), &Settings::default(), &CancelToken::default());
    let judgement = judgement.expect("judged");
    assert!(judgement.tried <= 50_000, "{}", judgement.tried);
    assert!(judgement.sources_untried > 0 && judgement.sources_untried < all, "{}", judgement.sources_untried);
    assert!(judgement.untried > 0);
}

/// Results of calibrations have matrices, too: the covariance has six rows of six numbers, and several results repeat the same
/// two.
#[test]
fn printed_results_are_no_recording() {
    let session = observed(Mode::EyeInHand, VIEWS, 8);
    let folder = tempfile::tempdir().expect("a folder");
    let covariance = |scale: f64| {
        let row = |i: usize| {
            let numbers: Vec<String> = (0..6).map(|j| format!("{:e}", scale / (1.0 + i as f64 + j as f64))).collect();
            format!("[{}]", numbers.join(", "))
        };
        (0..6).map(row).collect::<Vec<_>>().join(", ")
    };
    let result = |name: &str, scale: f64| {
        format!("{name}:\n  pose: [1, 2, 3, 0, 0, 0, 1]\n  covariance: [{}]\n", covariance(scale))
    };
    let text = result("robot", 1e-6) + &result("target", 2e-6);
    fs::write(folder.path().join("config.yaml"), text).expect("written");
    let recording = open(folder.path()).expect("a recording");
    assert!(recording.tracks.is_empty(), "{:?}", recording.beliefs);

    let two = |name: &str, view: usize| {
        let poses = [0, 1, 0, 1, 1].map(|i| pose_of(&session, view + i));
        table(folder.path(), name, poses.into_iter(), Written::Xyzw);
    };
    two("robot.txt", 0);
    two("target.txt", 2);
    let recording = open(folder.path()).expect("a recording");
    assert_eq!(recording.tracks.len(), 2, "{:?}", recording.beliefs);
    let why = judge(&recording, &Sights::default(), &Settings::default(), &CancelToken::default()).expect_err("none");
    assert!(why.to_string().contains("not 3 different poses"), "{why}");
}

/// A folder that was opened for a browser, and a person who waits.
#[test]
fn what_leads_out_of_the_folder_is_not_read_and_reading_ends_in_time() {
    let session = observed(Mode::EyeInHand, VIEWS, 9);
    let folder = table_folder(&session, Written::RpyDegMm);
    let elsewhere = tempfile::tempdir().expect("a folder");
    fs::rename(folder.path().join("poses.txt"), elsewhere.path().join("poses.txt")).expect("moved");
    std::os::unix::fs::symlink(elsewhere.path().join("poses.txt"), folder.path().join("poses.txt")).expect("linked");
    fs::write(elsewhere.path().join("robot.urdf"), "<robot name='private'/>").expect("written");
    let cancel = CancelToken::default();
    let budget = || Budget::new(Limits::default(), &|| Duration::ZERO, &cancel);
    let recording = open_within(folder.path(), &Bounds::within(folder.path()), &budget()).expect("a recording");
    assert!(recording.tracks.is_empty() && recording.warnings.iter().any(|why| why.to_string().contains("leads out")));
    let urdf = elsewhere.path().join("robot.urdf").display().to_string();
    let why = with_arm(&recording, &urdf).expect_err("outside").to_string();
    assert!(why.contains("there is no such URDF file"), "{why}");
    let recording = open_within(folder.path(), &Bounds::ANYWHERE, &budget()).expect("a recording");
    assert!(!recording.tracks.is_empty(), "a person may");

    let looks = Cell::new(0);
    let elapsed = || {
        looks.set(looks.get() + 1);
        Duration::from_secs(looks.get())
    };
    let late = Budget::new(Limits::default(), &elapsed, &cancel);
    let why = open_within(folder.path(), &Bounds::ANYWHERE, &late).expect_err("late").to_string();
    assert!(why.contains("longer than 20 s") && why.contains("--time"), "{why}");
    assert!(looks.get() < 30);
    cancel.cancel();
    let why = open_within(folder.path(), &Bounds::ANYWHERE, &budget());
    assert!(matches!(why, Err(ImportError::Stopped { why: Spent::Cancelled, .. })), "{why:?}");
}

/// Tables and texts that are made to take forever to read: with these lengths, quadratic time takes hours.
#[test]
fn files_that_are_written_to_take_for_ever_are_read_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let put = |name: &str, text: String| fs::write(folder.path().join(name), text).expect("written");
    put("rows.csv", "1,2,3,4,5,6\n".repeat(1_000_000));
    put("brackets.txt", "[".repeat(4_000_000));
    put("programs.txt", "p[".repeat(1_000_000));
    put("targets.src", "robtarget [[".repeat(500_000));
    put("names.txt", (0..300_000).map(|i| format!("n{i} 1 2 3 ")).collect::<Vec<_>>().concat());
    put("parts.json", format!("[{}[1]]", "[[1,2,3],[1,2,3],[1,2,4]],".repeat(20_000)));
    put("fields.json", {
        let fields: Vec<String> = (0..20_000).map(|i| format!("\"tvec_{i}\":[1,2,3],\"rvec_{i}\":[1,2,{i}]")).collect();
        format!("{{{}}}", fields.join(","))
    });
    let recording = open(folder.path()).expect("a recording");
    let is_reported = |why: &String| why.contains("rows.csv") && why.contains("lines");
    assert!(recording.warnings.iter().map(Text::to_string).any(|why| is_reported(&why)));
}
