//! `handeye calibrate` on the reference data sets, real and rendered, as run by a user.

use std::fmt::Write as _;
use std::process::Command;

use handeye_geometry::testing::data_folder;
use handeye_result::{CalibrationResult, ViewRecordStatus};
use handeye_tests::handeye_binary;

/// What is known about a set: hand-eye translation \[mm\] with the limit of its error, and focal length \[px\].
struct Truth {
    translation_mm: [f64; 3],
    limit_mm: f64,
    focal_px: f64,
}

#[test]
fn every_set_is_calibrated_with_every_board_found() {
    let Some(data) = data_folder() else { return };
    let caliban = Truth { translation_mm: [100.0, -200.0, 0.0], limit_mm: 0.1, focal_px: 1400.0 };
    let synthetic = Truth { translation_mm: [0.0; 3], limit_mm: 0.1, focal_px: 1080.0 };
    let sets = [
        ("caliban_no_curv", 20, Some(caliban)),
        ("rwhe_cs_synthetic_3", 30, Some(synthetic)),
        ("rwhe_kuka_1_eye_in_hand", 30, None),
        ("visp_franka_eye_in_hand", 8, None),
        ("rct_circles_eye_in_hand", 15, None),
    ];
    for (name, images, truth) in sets {
        let output = Command::new(handeye_binary())
            .args(["calibrate", "--quiet", "--json", "-"])
            .arg(data.join(name))
            .output()
            .expect("the binary is built");
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let result = CalibrationResult::from_json(&String::from_utf8_lossy(&output.stdout)).expect("JSON");
        let found = result.views.iter().filter(|v| v.status != ViewRecordStatus::NoTarget).count();
        assert_eq!((found, result.views.len()), (images, images), "{name}");
        let t = result.hand_eye.as_ref().expect("hand-eye").translation_m.map(|v| v * 1e3);
        let camera = result.intrinsics.as_ref().expect("a camera");
        let q = &result.quality;
        println!(
            "{name}: {found} of {images}, t {t:.2?} mm, fx {:.2} fy {:.2} cx {:.2} cy {:.2}, rms {:.3} px, held out {:.2} px, \
             expected error {:.3} mm, robot {:.3} mm {:.4}°",
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            q.rms_px.expect("known"),
            q.heldout_rms_px.expect("known"),
            q.tip_error_95_mm.expect("known"),
            q.robot_sigma_mm.expect("known"),
            q.robot_sigma_deg.expect("known"),
        );
        if let Some(truth) = truth {
            let off = (0..3).map(|i| (t[i] - truth.translation_mm[i]).powi(2)).sum::<f64>().sqrt();
            assert!(off < truth.limit_mm, "{name}: {off} mm");
            let focal = [camera.fx, camera.fy].map(|f| (f - truth.focal_px).abs());
            assert!(focal[0] < 0.3 && focal[1] < 0.3, "{name}: {} {}", camera.fx, camera.fy);
        }
    }
}

/// A pose table with rotation matrices.
fn pose_table(poses: &[Vec<f64>]) -> String {
    let mut text = String::from("image,x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33\n");
    for (i, m) in poses.iter().enumerate() {
        let cells = [3, 7, 11, 0, 1, 2, 4, 5, 6, 8, 9, 10].map(|k| m[k].to_string());
        writeln!(text, "{i}.png,{}", cells.join(",")).expect("a string takes any text");
    }
    text
}

#[test]
fn fifty_recorded_pose_pairs_give_the_published_place_of_the_camera() {
    let Some(data) = data_folder() else { return };
    let text = std::fs::read_to_string(data.join("moveit_pose_samples/pose_samples.json")).expect("readable");
    let pairs: Vec<[Vec<Vec<f64>>; 2]> = serde_json::from_str(&text).expect("pairs of matrices");
    let side = |k: usize| -> Vec<Vec<f64>> { pairs.iter().map(|pair| pair[k].concat()).collect() };
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("poses.csv", &pose_table(&side(0)));
    write("target_poses.csv", &pose_table(&side(1)));
    write(
        "dataset.toml",
        r#"
mode = "eye_to_hand"
[target]
kind = "chessboard"
columns = 4
rows = 3
square_m = 0.02
poses = "target_poses.csv"
[robot]
poses = "poses.csv"
length_unit = "m"
rotation = "matrix"
pose = "base_from_tip"
"#,
    );
    let output = Command::new(handeye_binary())
        .args(["calibrate", "--quiet", "--json", "-"])
        .arg(folder.path())
        .output()
        .expect("the binary is built");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result = CalibrationResult::from_json(&String::from_utf8_lossy(&output.stdout)).expect("JSON");
    let hand_eye = result.hand_eye.expect("hand-eye");
    assert_eq!((hand_eye.parent_frame.as_str(), hand_eye.child_frame.as_str()), ("base", "camera"));
    let t = hand_eye.translation_m;
    println!("base_from_camera {t:.4?} m");
    // Published to three digits, within one percent.
    for (found, published) in t.into_iter().zip([0.659, -0.249, 0.830_f64]) {
        assert!((found - published).abs() < 0.01 * published.abs(), "{t:?}");
    }
}
