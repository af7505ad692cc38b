//! Result YAML of ROS-Industrial's `industrial_calibration` (and `robot_cal_tools`): `ExtrinsicHandEyeResult` in
//! `optimizations/src/extrinsic_hand_eye.cpp`, transforms by `core/serialization.h`.
//!
//! Camera mount and target mount are tip and base, or base and tip, as here mount and anchor are. The `_rpy` and `_pos`
//! keys are deprecated there and still written. A cost per observation is half the mean square of a pixel coordinate's
//! residual; the cost before the fit is not known and is NaN.

use nalgebra::{Isometry3, Translation3};

use super::input::NamedTransform;
use super::text::{Rotation, about_transform, compare_isometry, entries, number};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format, rotation};
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Anchor, Pose, Target};
use handeye_wording::Text;

pub(super) struct IndustrialCalibration;

const TRANSFORM: [&str; 7] = ["x", "y", "z", "qw", "qx", "qy", "qz"];
const AXES: [&str; 3] = ["x", "y", "z"];

/// Both transforms, target first, as the file has them.
fn transforms<'a>(input: &ExportInput<'a>) -> Result<[(&'static str, NamedTransform<'a>); 2], ExportError> {
    let format = IndustrialCalibration.name();
    let camera = input.optical(format)?;
    let estimate = input.result.target.as_ref().ok_or(ExportError::NeedsTarget { format })?;
    let anchor_from_target =
        Pose::<Anchor, Target>::from_translation_xyzw(estimate.translation_m, estimate.rotation_xyzw);
    let parent = match camera.mode {
        Mode::EyeInHand => &input.names.base_frame,
        Mode::EyeToHand => &input.names.effector_frame,
    };
    let child = &input.names.target_frame;
    let target = NamedTransform { mode: camera.mode, parent, child, isometry: *anchor_from_target.isometry() };
    Ok([("target_mount_to_target", target), ("camera_mount_to_camera", camera)])
}

fn seven(transform: &NamedTransform<'_>) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (transform.translation(), transform.xyzw());
    [x, y, z, qw, qx, qy, qz]
}

/// Half the mean square over coordinates; the residual of a result is over corners, of two coordinates each.
fn final_cost(input: &ExportInput<'_>) -> f64 {
    input.result.quality.rms_px.map_or(f64::NAN, |rms_px| rms_px * rms_px / 4.0)
}

impl Format for IndustrialCalibration {
    fn name(&self) -> &'static str {
        "industrial_calibration"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("result YAML of industrial_calibration with hand-eye and target (ROS-Industrial)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let [target, camera] = transforms(input)?;
        let cost = final_cost(input);
        let cost = if cost.is_nan() { ".nan".to_owned() } else { number(cost) };
        let about = format!(
            "# {}\n# T_{}_{} likewise. Costs are half the mean square residual of a pixel coordinate; \
             .nan is one that is not known.\nconverged: true\ninitial_cost_per_obs: .nan\nfinal_cost_per_obs: {cost}\n",
            about_transform(&camera.1, "Metres", Rotation::QuaternionAndRpy, input.result),
            target.1.parent,
            target.1.child,
        );
        let both = [&target, &camera];
        let transforms = both.map(|(key, t)| format!("{key}:\n{}", entries(2, &TRANSFORM, &seven(t))));
        let angles = both.map(|(key, t)| format!("{key}_rpy:\n{}", entries(2, &AXES, &t.rpy())));
        let positions = both.map(|(key, t)| format!("{key}_pos:\n{}", entries(2, &AXES, &t.translation())));
        let text = [about, transforms.concat(), angles.concat(), positions.concat()].concat();
        Ok(vec![ExportFile::new("industrial_calibration.yaml", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let yaml = Yaml::parse(&file.text)?;
        let mut expected: Vec<(String, Leaf)> = vec![
            ("converged".into(), Leaf::Flag(true)),
            ("initial_cost_per_obs".into(), Leaf::Number(f64::NAN)),
            ("final_cost_per_obs".into(), Leaf::Number(final_cost(input))),
        ];
        for (key, transform) in transforms(input).map_err(|e| e.to_string())? {
            for (name, value) in TRANSFORM.into_iter().zip(seven(&transform)) {
                expected.push((format!("{key}.{name}"), Leaf::Number(value)));
            }
            for (name, value) in AXES.into_iter().zip(transform.translation()) {
                expected.push((format!("{key}_pos.{name}"), Leaf::Number(value)));
            }
            let [roll, pitch, yaw] = AXES.map(|name| yaml.number(&format!("{key}_rpy.{name}")));
            let translation = Translation3::from(transform.translation());
            let got = Isometry3::from_parts(translation, rotation::from_rpy([roll?, pitch?, yaw?]));
            compare_isometry(&format!("{key}_rpy"), &got, &transform.isometry)?;
            for (name, value) in AXES.into_iter().zip(transform.rpy()) {
                expected.push((format!("{key}_rpy.{name}"), Leaf::Number(value)));
            }
        }
        yaml.compare(&expected)
    }
}
