//! `geometry_msgs/TransformStamped` as YAML: what `ros2 topic echo` prints and `ros2 topic pub` and scripts read.
//!
//! The stamp is zero, as that of a static transform may be.

use super::text::{Rotation, about_transform, entries, quoted};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_wording::Text;

pub(super) struct RosTf;

impl Format for RosTf {
    fn name(&self) -> &'static str {
        "ros_tf"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("geometry_msgs/TransformStamped as YAML (ROS 2)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let text = format!(
            "# {}\nheader:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: {}\nchild_frame_id: {}\n\
             transform:\n  translation:\n{}  rotation:\n{}",
            about_transform(&transform, "Metres", Rotation::Quaternion, input.result),
            quoted(transform.parent),
            quoted(transform.child),
            entries(4, &["x", "y", "z"], &transform.translation()),
            entries(4, &["x", "y", "z", "w"], &transform.xyzw()),
        );
        Ok(vec![ExportFile::new("transform_stamped.yaml", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let [x, y, z] = transform.translation().map(Leaf::Number);
        let [qx, qy, qz, qw] = transform.xyzw().map(Leaf::Number);
        Yaml::parse(&file.text)?.compare(&[
            ("header.stamp.sec", Leaf::Number(0.0)),
            ("header.stamp.nanosec", Leaf::Number(0.0)),
            ("header.frame_id", Leaf::text(transform.parent)),
            ("child_frame_id", Leaf::text(transform.child)),
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
