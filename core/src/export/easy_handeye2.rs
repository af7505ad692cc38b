//! `easy_handeye2` calibration (ROS 2): `message_to_yaml` in its `handeye_calibration.py`.
//!
//! Its publisher reads `~/.ros2/easy_handeye2/calibrations/<name>.calib` and broadcasts the transform from
//! `robot_effector_frame` (eye in hand) or `robot_base_frame` (eye on base) to `tracking_base_frame`.

use super::yaml::Yaml;
use super::{
    ExportError, ExportFile, ExportNames, Format, NamedTransform, compare_numbers, compare_text, entry, quoted,
    transform_comment,
};
use crate::handeye::Mode;
use crate::result::CalibrationResult;

pub(super) struct EasyHandeye2;

fn calibration_type(mode: Mode) -> &'static str {
    match mode {
        Mode::EyeToHand => "eye_on_base",
        Mode::EyeInHand => "eye_in_hand",
    }
}

impl Format for EasyHandeye2 {
    fn name(&self) -> &'static str {
        "easy_handeye2"
    }

    fn description(&self) -> &'static str {
        ".calib file for the publisher of easy_handeye2 (ROS 2)"
    }

    fn render(&self, result: &CalibrationResult, names: &ExportNames) -> Result<Vec<ExportFile>, ExportError> {
        let transform = NamedTransform::of(result, names)
            .ok_or(ExportError::NeedsHandEye { format: self.name(), alternative: "json or ros_camera_info" })?;
        let mut text = format!(
            "{}\nparameters:\n  name: {}\n  calibration_type: {}\n  robot_base_frame: {}\n  \
             robot_effector_frame: {}\n  tracking_base_frame: {}\n  tracking_marker_frame: {}\n  \
             freehand_robot_movement: true\n  move_group_namespace: /\n  move_group: manipulator\n\
             transform:\n  translation:\n",
            transform_comment(&transform, result),
            quoted(&names.calibration),
            calibration_type(transform.mode),
            quoted(&names.base_frame),
            quoted(&names.effector_frame),
            quoted(&names.camera_frame),
            quoted(&names.target_frame),
        );
        for (key, value) in ["x", "y", "z"].into_iter().zip(transform.estimate.translation_m) {
            text.push_str(&entry(4, key, value));
        }
        text.push_str("  rotation:\n");
        for (key, value) in ["x", "y", "z", "w"].into_iter().zip(transform.xyzw()) {
            text.push_str(&entry(4, key, value));
        }
        Ok(vec![ExportFile { name: format!("{}.calib", names.calibration), text }])
    }

    fn compare(&self, text: &str, result: &CalibrationResult, names: &ExportNames) -> Result<(), String> {
        let yaml = Yaml::parse(text)?;
        let transform = NamedTransform::of(result, names).ok_or("no hand-eye")?;
        let read = |group: &str, keys: &[&str]| {
            keys.iter().map(|key| yaml.number(&format!("transform.{group}.{key}"))).collect::<Result<Vec<_>, _>>()
        };
        compare_numbers("the translation", &read("translation", &["x", "y", "z"])?, &transform.estimate.translation_m)?;
        compare_numbers("the rotation", &read("rotation", &["x", "y", "z", "w"])?, &transform.xyzw())?;
        let texts = [
            ("name", names.calibration.as_str()),
            ("calibration_type", calibration_type(transform.mode)),
            ("robot_base_frame", &names.base_frame),
            ("robot_effector_frame", &names.effector_frame),
            ("tracking_base_frame", &names.camera_frame),
            ("tracking_marker_frame", &names.target_frame),
        ];
        texts
            .into_iter()
            .try_for_each(|(key, expected)| compare_text(key, yaml.text(&format!("parameters.{key}"))?, expected))
    }
}
