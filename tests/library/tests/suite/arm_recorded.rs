//! The errors of a real arm from images alone, compared with the factory's own calibration, which its controller uses.

use handeye_arm::ArmKind;
use handeye_detect::detect;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::handeye::closed_form::{ClosedForm as _, Shah};
use handeye_estimate::handeye::{Mode, PosePair};
use handeye_estimate::placement::{JointView, place_checked};
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView, fit};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corners;
use handeye_geometry::testing::data_folder;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

const VIEWS: usize = 24;

struct Recorded {
    joints_rad: Vec<f64>,
    /// As reported by the controller.
    flange: Pose<Base, Tip>,
    corners: Option<Corners>,
}

/// RMS distance \[mm\] and angle \[°\] between poses from some kinematics and those of the controller, with any base and tip.
fn apart(poses: &[Pose<Base, Tip>], recorded: &[Recorded]) -> (f64, f64) {
    let pairs: Vec<PosePair> = poses
        .iter()
        .zip(recorded)
        .map(|(pose, recorded)| PosePair {
            anchor_from_mount: recorded.flange.relabel(),
            camera_from_target: pose.inverse().relabel(),
        })
        .collect();
    let found = Shah.solve(&pairs).expect("turns about all axes");
    let (base, tip) = (*found.anchor_from_target.isometry(), found.mount_from_camera.isometry().inverse());
    let off = |(pose, recorded): (&Pose<Base, Tip>, &Recorded)| {
        Pose::<Base, Tip>::from_isometry(base * pose.isometry() * tip).distance_to(&recorded.flange)
    };
    let all: Vec<(f64, f64)> = poses.iter().zip(recorded).map(off).collect();
    let rms = |of: fn(&(f64, f64)) -> f64| (all.iter().map(|it| of(it).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
    (rms(|it| it.0) * 1e3, rms(|it| it.1).to_degrees())
}

/// The controller knows where the tip really is within some tenths of a millimetre; the estimate gets joint values only.
#[test]
fn images_and_joint_values_find_what_the_factory_measured() {
    let Some(data) = data_folder() else { return };
    let folder = data.join("importers/json_per_pose_rgbd/Hand-Eye-Data");
    let target: TargetSpec = serde_json::from_value(serde_json::json!({
        "kind": "charuco", "columns": 4, "rows": 6, "square_m": 0.033, "marker_m": 0.02, "dictionary": "6x6_250"
    }))
    .expect("a target");
    let recorded: Vec<Recorded> = (0..VIEWS)
        .into_par_iter()
        .map(|i| {
            let text = std::fs::read_to_string(folder.join(format!("{i}.json"))).expect("a view");
            let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            let numbers = |key: &str| -> Vec<f64> { serde_json::from_value(json[key].clone()).expect("six numbers") };
            let flange = numbers("pose_flange");
            let image = image::open(folder.join(format!("{i}.jpg"))).expect("an image").to_luma8();
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(&flange[3..]));
            Recorded {
                joints_rad: numbers("joints"),
                flange: Pose::from_isometry(Isometry3::from_parts(
                    Translation3::new(flange[0], flange[1], flange[2]),
                    turn,
                )),
                corners: detect(&image, &target).expect("it runs"),
            }
        })
        .collect();
    let arm = ArmKind::Ur5e.arm();
    let nominal: Vec<Pose<Base, Tip>> =
        recorded.iter().map(|view| arm.forward(&view.joints_rad).expect("six joints")).collect();
    let believed = apart(&nominal, &recorded);
    println!("nominal: {:.3} mm, {:.3}°", believed.0, believed.1);
    let of_joints: Vec<JointView<'_>> = nominal
        .iter()
        .zip(&recorded)
        .map(|(pose, view)| JointView { base_from_tip: *pose, joints_rad: &view.joints_rad })
        .collect();
    let (placement, frames) = place_checked(&arm, &of_joints).expect("its own poses");
    // All views, and without a tenth of them each.
    for left_out in std::iter::once(None).chain((0..10).map(Some)) {
        let views = recorded.iter().enumerate().map(|(i, view)| ObservedView {
            tip_from_joints: frames[i].clone(),
            in_fit: left_out.is_none_or(|left_out| i % 10 != left_out),
            ..ObservedView::new(i.to_string(), Some(nominal[i]), view.corners.clone())
        });
        let observations = Observations {
            mode: Some(Mode::EyeInHand),
            target,
            image_size: (1920, 1080),
            camera: CameraKnowledge::NOTHING,
            views: views.collect(),
        };
        let found = fit(&observations, Method::Joint, &CancelToken::default()).expect("solves");
        let fit = found.joint.as_ref().and_then(|joint| joint.arm.as_ref()).expect("the joints are known");
        let corrected = CorrectedArm::new(placement.arm.clone(), fit).expect("six joints");
        let actual: Vec<_> =
            recorded.iter().map(|view| corrected.actual(&view.joints_rad).expect("six joints")).collect();
        let (mm, deg) = apart(&actual, &recorded);
        println!(
            "without the tenth {left_out:?}: {mm:.3} mm, {deg:.3}°, held out {:?} px, size {:?}",
            fit.heldout_px,
            fit.shape()
        );
        assert!(mm < believed.0 && deg < believed.1, "{left_out:?}: {mm} mm, {deg}°");
        assert!(!fit.contradicted, "{left_out:?}");
        if left_out.is_none() {
            assert!(mm <= 0.30 && deg <= 0.12, "{mm} mm, {deg}°");
        }
    }
}
