//! `easy_handeye2` calibration (ROS 2): `message_to_yaml` in its `handeye_calibration.py`.
//!
//! Its publisher reads `~/.ros2/easy_handeye2/calibrations/<name>.calib` and broadcasts the transform from
//! `robot_effector_frame` (eye in hand) or `robot_base_frame` (eye on base) to `tracking_base_frame`.

use super::text::{Rotation, about_transform, entries, quoted};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_estimate::handeye::Mode;
use handeye_wording::Text;

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

    fn description(&self) -> Text {
        handeye_wording::text!(".calib file for the publisher of easy_handeye2 (ROS 2)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let names = input.names;
        let text = format!(
            "# {}\nparameters:\n  name: {}\n  calibration_type: {}\n  robot_base_frame: {}\n  \
             robot_effector_frame: {}\n  tracking_base_frame: {}\n  tracking_marker_frame: {}\n  \
             freehand_robot_movement: true\n  move_group_namespace: /\n  move_group: manipulator\n\
             transform:\n  translation:\n{}  rotation:\n{}",
            about_transform(&transform, "Metres", Rotation::Quaternion, input.result),
            quoted(&names.calibration),
            calibration_type(transform.mode),
            quoted(&names.base_frame),
            quoted(&names.effector_frame),
            quoted(transform.child),
            quoted(&names.target_frame),
            entries(4, &["x", "y", "z"], &transform.translation()),
            entries(4, &["x", "y", "z", "w"], &transform.xyzw()),
        );
        Ok(vec![ExportFile::new(format!("{}.calib", names.calibration), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let names = input.names;
        let [x, y, z] = transform.translation().map(Leaf::Number);
        let [qx, qy, qz, qw] = transform.xyzw().map(Leaf::Number);
        Yaml::parse(&file.text)?.compare(&[
            ("parameters.name", Leaf::text(&names.calibration)),
            ("parameters.calibration_type", Leaf::text(calibration_type(transform.mode))),
            ("parameters.robot_base_frame", Leaf::text(&names.base_frame)),
            ("parameters.robot_effector_frame", Leaf::text(&names.effector_frame)),
            ("parameters.tracking_base_frame", Leaf::text(transform.child)),
            ("parameters.tracking_marker_frame", Leaf::text(&names.target_frame)),
            ("parameters.freehand_robot_movement", Leaf::Flag(true)),
            ("parameters.move_group_namespace", Leaf::text("/")),
            ("parameters.move_group", Leaf::text("manipulator")),
            ("transform.translation.x", x),
            ("transform.translation.y", y),
            ("transform.translation.z", z),
            ("transform.rotation.x", qx),
            ("transform.rotation.y", qy),
            ("transform.rotation.z", qz),
            ("transform.rotation.w", qw),
        ])
    }
}
