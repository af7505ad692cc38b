//! `handeye calibrate` on the reference data sets, real and rendered, as a user runs it.

use std::process::Command;

use handeye_core::result::{CalibrationResult, ViewStatus};
use handeye_tests::{handeye_binary, reference_data};

/// What is known of a set: hand-eye translation [mm] with the limit of its error, and focal length [px].
struct Truth {
    translation_mm: [f64; 3],
    limit_mm: f64,
    focal_px: f64,
}

#[test]
fn every_set_is_calibrated_with_every_board_found() {
    let Some(data) = reference_data("reference data sets") else { return };
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
        let found = result.views.iter().filter(|v| v.status == ViewStatus::Used).count();
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
