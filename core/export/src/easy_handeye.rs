//! `easy_handeye` calibration (ROS 1): `to_dict` in its `handeye_calibration.py`.
//!
//! Its publisher reads `~/.ros/easy_handeye/<namespace>.yaml`, where the last part of the namespace is the name of the
//! calibration and the mode, and broadcasts from `robot_effector_frame` (eye on hand) or `robot_base_frame` (eye on
//! base) to `tracking_base_frame`. The parameters become arguments of a constructor: no other key is allowed.

use super::text::{Rotation, about_transform, entries, quoted};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_estimate::handeye::Mode;
use handeye_wording::Text;

pub(super) struct EasyHandeye;

/// Last part of the namespace, by which the launch files of the package find the file.
fn namespace(input: &ExportInput<'_>, mode: Mode) -> String {
    let suffix = match mode {
        Mode::EyeInHand => "eye_on_hand",
        Mode::EyeToHand => "eye_on_base",
    };
    format!("{}_{suffix}", input.names.calibration)
}

impl Format for EasyHandeye {
    fn name(&self) -> &'static str {
        "easy_handeye"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("YAML file for the publisher of easy_handeye (ROS 1)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let names = input.names;
        let namespace = namespace(input, transform.mode);
        let [x, y, z] = transform.translation();
        let [qx, qy, qz, qw] = transform.xyzw();
        let text = format!(
            "# {}\nparameters:\n  eye_on_hand: {}\n  freehand_robot_movement: true\n  move_group: manipulator\n  \
             move_group_namespace: /\n  namespace: /{namespace}/\n  robot_base_frame: {}\n  robot_effector_frame: {}\n  \
             tracking_base_frame: {}\n  tracking_marker_frame: {}\ntransformation:\n{}",
            about_transform(&transform, "Metres", Rotation::Quaternion, input.result),
            transform.mode == Mode::EyeInHand,
            quoted(&names.base_frame),
            quoted(&names.effector_frame),
            quoted(transform.child),
            quoted(&names.target_frame),
            entries(2, &["qw", "qx", "qy", "qz", "x", "y", "z"], &[qw, qx, qy, qz, x, y, z]),
        );
        Ok(vec![ExportFile::new(format!("{namespace}.yaml"), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let names = input.names;
        let [x, y, z] = transform.translation().map(Leaf::Number);
        let [qx, qy, qz, qw] = transform.xyzw().map(Leaf::Number);
        Yaml::parse(&file.text)?.compare(&[
            ("parameters.eye_on_hand", Leaf::Flag(transform.mode == Mode::EyeInHand)),
            ("parameters.freehand_robot_movement", Leaf::Flag(true)),
            ("parameters.move_group", Leaf::text("manipulator")),
            ("parameters.move_group_namespace", Leaf::text("/")),
            ("parameters.namespace", Leaf::text(format!("/{}/", namespace(input, transform.mode)))),
            ("parameters.robot_base_frame", Leaf::text(&names.base_frame)),
            ("parameters.robot_effector_frame", Leaf::text(&names.effector_frame)),
            ("parameters.tracking_base_frame", Leaf::text(transform.child)),
            ("parameters.tracking_marker_frame", Leaf::text(&names.target_frame)),
            ("transformation.qw", qw),
            ("transformation.qx", qx),
            ("transformation.qy", qy),
            ("transformation.qz", qz),
            ("transformation.x", x),
            ("transformation.y", y),
            ("transformation.z", z),
        ])
    }
}
