//! The `.launch` file of MoveIt Calibration (ROS 1): `saveCameraPoseBtnClicked` in its `handeye_control_widget.cpp`.
//!
//! MoveIt prints Eigen's `eulerAngles(0, 1, 2)`, which are R = Rx · Ry · Rz, into its comment; in a URDF they are
//! another rotation. The comment here has URDF's rpy.

use roxmltree::Node;

use super::input::NamedTransform;
use super::text::{Rotation, about_transform, compare_numbers, compare_text, parse_exactly, spaced};
use super::urdf::{compare_origin, origin};
use super::{ExportError, ExportFile, ExportInput, Format, xml};
use handeye_wording::Text;

pub(super) struct MoveitLaunch;

impl Format for MoveitLaunch {
    fn name(&self) -> &'static str {
        "moveit_launch"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("launch file that publishes the hand-eye on tf, as MoveIt Calibration writes it (ROS 1)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let about = about_transform(&transform, "Metres", Rotation::QuaternionAndRpy, input.result);
        let NamedTransform { parent, child, .. } = transform;
        let text = format!(
            "<launch>\n  {}\n  {}\n  <node pkg=\"tf2_ros\" type=\"static_transform_publisher\" \
             name=\"camera_link_broadcaster\"\n      args=\"{}   {} {parent} {child}\" />\n</launch>\n",
            xml::comment(&about),
            xml::comment(&origin(&transform)),
            spaced(&transform.translation()),
            spaced(&transform.xyzw()),
        );
        Ok(vec![ExportFile::new(format!("{}.launch", input.names.calibration), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let document = xml::parse(&file.text)?;
        let mut comments = document.descendants().filter(Node::is_comment).filter_map(|comment| comment.text());
        let origin = comments.find(|text| text.contains("xyz=\"")).ok_or("no comment with xyz and rpy")?;
        compare_origin(xml::parse(&format!("<origin {origin}/>"))?.root_element(), &transform)?;
        let node = xml::only(&document, "node")?;
        compare_text("pkg", xml::attribute(node, "pkg")?, "tf2_ros")?;
        compare_text("type", xml::attribute(node, "type")?, "static_transform_publisher")?;
        let words: Vec<&str> = xml::attribute(node, "args")?.split_whitespace().collect();
        let [numbers @ .., parent, child] = words.as_slice() else { return Err("args has no frames".into()) };
        let got = parse_exactly::<7>("args", &numbers.join(" "))?;
        compare_numbers("the translation in args", &got[..3], &transform.translation())?;
        compare_numbers("the quaternion in args", &got[3..], &transform.xyzw())?;
        compare_text("the parent", parent, transform.parent)?;
        compare_text("the child", child, transform.child)
    }
}
