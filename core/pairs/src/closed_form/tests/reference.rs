//! Agreement with OpenCV 4.14 (`calibrateHandEye`, `calibrateRobotWorldHandEye`) on real and rendered sessions.

use std::fs;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use serde::Deserialize;

use crate::closed_form::by_name;
use crate::{Mode, PosePair};
use handeye_geometry::frames::Pose;

/// Largest difference in metres and in elements of the rotation matrix. Arithmetic alone leaves 3e-13. The margin is for
/// OpenCV's `Rodrigues`, which takes turns below 1e-5 rad for zero: where a robot came back to a pose within that, as in
/// the KUKA session, its Park & Martin differs from the exact one by 4e-10.
const REFERENCE_TOLERANCE: f64 = 1e-9;

/// Names in the reference and ours.
const METHODS: [(&str, &str); 7] = [
    ("Tsai", "tsai_lenz"),
    ("Park", "park_martin"),
    ("Horaud", "horaud"),
    ("Andreff", "andreff"),
    ("Daniilidis", "daniilidis"),
    ("RW-Shah", "shah"),
    ("RW-Li", "li"),
];

#[derive(Deserialize)]
struct Session {
    mode: Mode,
    views: Vec<SessionView>,
    reference: std::collections::BTreeMap<String, [[f64; 4]; 4]>,
}

#[derive(Deserialize)]
struct SessionView {
    #[serde(rename = "base_T_gripper")]
    base_from_tip: [f64; 16],
    #[serde(rename = "cam_T_target")]
    camera_from_target: [f64; 16],
}

fn isometry(m: &[f64; 16]) -> Isometry3<f64> {
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    Isometry3::from_parts(
        Translation3::new(m[3], m[7], m[11]),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
    )
}

impl Session {
    fn pairs(&self) -> Vec<PosePair> {
        self.views
            .iter()
            .map(|view| PosePair {
                anchor_from_mount: self.mode.anchor_from_mount(&Pose::from_isometry(isometry(&view.base_from_tip))),
                camera_from_target: Pose::from_isometry(isometry(&view.camera_from_target)),
            })
            .collect()
    }
}

/// The recorded sessions with their names; none without the data sets.
fn sessions() -> Vec<(String, Session)> {
    let Some(folder) = handeye_geometry::testing::data_folder() else { return Vec::new() };
    let mut found: Vec<_> = fs::read_dir(&folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let text = fs::read_to_string(path.join("views.json")).ok()?;
            let name = path.file_name()?.to_string_lossy().into_owned();
            Some((name, serde_json::from_str(&text).expect("views.json has the agreed fields")))
        })
        .collect();
    found.sort_by(|(a, _), (b, _)| a.cmp(b));
    assert!(!found.is_empty(), "no session with views.json in {}", folder.display());
    found
}

#[test]
fn all_seven_methods_agree_with_opencv_on_every_recorded_session() {
    let mut failures = Vec::new();
    for (session_name, session) in sessions() {
        let pairs = session.pairs();
        for (reference_name, name) in METHODS {
            let reference = &session.reference[reference_name];
            let method = by_name(name).expect("all seven methods exist");
            let solution = match method.solve(&pairs) {
                Ok(solution) => solution.mount_from_camera.matrix(),
                Err(error) => {
                    failures.push(format!("{session_name} {name}: {error}"));
                    continue;
                }
            };
            let difference = (0..3)
                .flat_map(|row| (0..4).map(move |column| (row, column)))
                .map(|(row, column)| (solution[(row, column)] - reference[row][column]).abs())
                .fold(0.0, f64::max);
            println!("{session_name} {name}: {difference:.1e}");
            if difference.is_nan() || difference > REFERENCE_TOLERANCE {
                failures.push(format!("{session_name} {name}: differs by {difference:.1e}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
