//! Poses that a camera was given by its target, in the place of a robot's, and those of robots that look alike.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use nalgebra::{Isometry3, Vector3, Vector6};

use super::tests::{Written, in_hand, judged, numbers, observed, pose_of, row, save_image, sights};
use super::*;
use handeye_estimate::Observations;
use handeye_estimate::handeye::closed_form::{ClosedForm as _, ParkMartin};
use handeye_estimate::handeye::{Mode, PosePair};
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;

const VIEWS: usize = 12;

fn images(folder: &Path, name: &str) {
    for view in 0..VIEWS {
        save_image(&folder.join(format!("{name}{view:02}.png")), view);
    }
}

fn table(folder: &Path, name: &str, poses: &[Isometry3<f64>], written: Written) {
    let mut text = String::new();
    for pose in poses {
        let _ok = writeln!(text, "{}", row(&numbers(written, pose), ","));
    }
    fs::write(folder.join(name), text).expect("written");
}

/// The target in the camera, as the images show it.
fn seen(folder: &Path, session: &Observations) -> Vec<Isometry3<f64>> {
    let recording = open(folder).expect("images");
    let seen = sights(&recording, session).streams[0].as_ref().expect("the target is seen").seen.clone();
    seen.into_iter().map(|pose| pose.expect("in every image")).collect()
}

fn is_refused(judgement: &Judgement) -> bool {
    let reported =
        |h: &Hypothesis| h.contradictions.iter().any(|why| why.to_string().contains("the camera's own poses"));
    judgement.verdict == Verdict::Unexplained && reported(&judgement.hypotheses[0])
}

/// Another program counts from another corner or from the middle, lets y point up, and has another lens.
#[test]
fn the_cameras_own_poses_are_refused_in_both_directions_whoever_computed_them() {
    let session = observed(Mode::EyeInHand, VIEWS, 11);
    let folder = tempfile::tempdir().expect("a folder");
    images(folder.path(), "image");
    let seen = seen(folder.path(), &session);
    let extent = session.target.extent();
    let half_turn = Vector3::new(0.0, 0.0, std::f64::consts::PI);
    let upward = Isometry3::rotation(Vector3::new(std::f64::consts::PI, 0.0, 0.0));
    let of_target = [
        Isometry3::identity(),
        Isometry3::new(Vector3::new(extent.x, extent.y, 0.0), half_turn),
        Isometry3::new(Vector3::new(extent.x / 2.0, extent.y / 2.0, 0.0), upward.rotation.scaled_axis()),
    ];
    for (i, target_from_theirs) in of_target.iter().enumerate() {
        for of_camera in [Isometry3::identity(), upward] {
            // Their focal length is 2 % longer.
            let theirs = |pose: &Isometry3<f64>| {
                let mut pose = of_camera * pose * target_from_theirs;
                pose.translation.vector.z *= 1.02;
                pose
            };
            let poses: Vec<Isometry3<f64>> = seen.iter().map(theirs).collect();
            let inverse: Vec<Isometry3<f64>> = poses.iter().map(Isometry3::inverse).collect();
            for (written, of) in [(Written::Matrix, &inverse), (Written::VectorRadM, &poses), (Written::Xyzw, &inverse)]
            {
                table(folder.path(), "poses.txt", of, written);
                let (_, judgement) = judged(folder.path(), &session, &Settings::default());
                assert!(is_refused(&judgement), "{i} {written:?} {:#?}", judgement.hypotheses[0]);
            }
        }
    }
}

/// Poses of the camera where the target is anywhere in a world that the program made up: they know the noise of the corners.
#[test]
fn poses_of_the_camera_in_a_world_of_its_own_are_refused_by_the_noise_that_they_share() {
    let session = observed(Mode::EyeInHand, VIEWS, 12);
    let folder = tempfile::tempdir().expect("a folder");
    images(folder.path(), "image");
    let world = se3::exp(&Vector6::new(1.3, -0.4, 0.8, 0.5, -0.9, 0.3));
    let poses: Vec<Isometry3<f64>> = seen(folder.path(), &session).iter().map(|pose| world * pose.inverse()).collect();
    table(folder.path(), "poses.txt", &poses, Written::Xyzw);
    let (_, judgement) = judged(folder.path(), &session, &in_hand());
    assert!(is_refused(&judgement), "{:#?}", judgement.hypotheses[0]);
}

#[test]
fn what_one_camera_of_a_folder_was_given_is_no_robot_for_the_other() {
    let session = observed(Mode::EyeInHand, VIEWS, 13);
    let folder = tempfile::tempdir().expect("a folder");
    images(folder.path(), "left");
    let left = seen(folder.path(), &session);
    images(folder.path(), "right");
    let inverse: Vec<Isometry3<f64>> = left.iter().map(Isometry3::inverse).collect();
    table(folder.path(), "poses.txt", &inverse, Written::Matrix);
    let right_from_left = se3::exp(&Vector6::new(-0.12, 0.002, 0.004, 0.01, -0.05, 0.003));
    let recording = open(folder.path()).expect("a recording");
    assert_eq!(recording.streams.len(), 2);
    let noisy = |(i, pose): (usize, &Isometry3<f64>)| {
        let noise = 3e-4 * ((i * 7 % 5) as f64 - 2.0);
        Some(right_from_left * pose * se3::exp(&Vector6::new(noise, -noise, noise, noise, noise, -noise)))
    };
    let mut of = sights(&recording, &session);
    let right = recording.streams.iter().position(|stream| stream.name.contains("right")).expect("there");
    of.streams[right] = Some(Sight::of_poses(Some(&session.target), left.iter().enumerate().map(noisy).collect()));
    let judgement = judge(&recording, &of, &Settings::default(), &CancelToken::default()).expect("hypotheses");
    assert!(is_refused(&judgement), "{:#?}", judgement.hypotheses[0]);
    let of_right = judgement.hypotheses.iter().find(|h| h.source == Source::Stream(right)).expect("it was tried");
    assert!(of_right.fit.as_ref().expect("a fit").relative < 0.01 && !of_right.explains(), "{of_right:#?}");
}

/// A TCP that was calibrated to the camera, a base that was taught on the target: each is a usual setup of an arm.
#[test]
fn a_robot_with_its_tcp_in_the_camera_or_its_base_on_the_target_is_a_robot() {
    let session = observed(Mode::EyeInHand, VIEWS, 14);
    let folder = tempfile::tempdir().expect("a folder");
    images(folder.path(), "image");
    let poses: Vec<Isometry3<f64>> = (0..VIEWS).map(|view| pose_of(&session, view)).collect();
    table(folder.path(), "poses.txt", &poses, Written::Xyzw);
    // True places of camera and target, by the recording itself.
    let (_, plain) = judged(folder.path(), &session, &in_hand());
    assert_eq!(plain.verdict, Verdict::Decided);
    let pairs: Vec<_> = seen(folder.path(), &session)
        .iter()
        .zip(&poses)
        .map(|(seen, pose)| PosePair {
            anchor_from_mount: Pose::from_isometry(*pose),
            camera_from_target: Pose::from_isometry(*seen),
        })
        .collect();
    let truth = ParkMartin.solve(&pairs).expect("solved");
    let (tip_from_camera, base_from_target) = (truth.mount_from_camera.isometry(), truth.anchor_from_target.isometry());
    for near in [Vector6::zeros(), Vector6::new(0.002, -0.001, 0.0015, 0.005, -0.003, 0.004)] {
        let tcp: Vec<Isometry3<f64>> = poses.iter().map(|pose| pose * tip_from_camera * se3::exp(&near)).collect();
        let base: Vec<Isometry3<f64>> =
            poses.iter().map(|pose| se3::exp(&near) * base_from_target.inverse() * pose).collect();
        for of in [&tcp, &base] {
            table(folder.path(), "poses.txt", of, Written::Xyzw);
            let (_, judgement) = judged(folder.path(), &session, &in_hand());
            assert_eq!(judgement.verdict, Verdict::Decided, "{near} {:#?}", judgement.hypotheses[0]);
        }
    }
}
