//! URDF: a fixed joint from the mount to the camera.
//!
//! `rpy` are turns about fixed axes x, y, z: R = Rz(yaw) · Ry(pitch) · Rx(roll). The file is a robot of two links, so
//! that every URDF parser reads it; link and joint of the camera are what goes into the robot's own description.
//! Source: URDF XML specification (`origin`); REP 103 for the optical frame.

use nalgebra::{Isometry3, Translation3};
use roxmltree::Node;

use super::input::NamedTransform;
use super::text::{Rotation, about_transform, compare_isometry, compare_text, spaced};
use super::{ExportError, ExportFile, ExportInput, Format, rotation, xml};
use handeye_wording::Text;

pub(super) struct Urdf;

pub(super) fn joint_name(transform: &NamedTransform<'_>) -> String {
    format!("{}_to_{}", transform.parent, transform.child)
}

/// `xyz="…" rpy="…"`.
pub(super) fn origin(transform: &NamedTransform<'_>) -> String {
    format!("xyz=\"{}\" rpy=\"{}\"", spaced(&transform.translation()), spaced(&transform.rpy()))
}

/// Compares the `xyz` and `rpy` of an element as a URDF parser takes them.
pub(super) fn compare_origin(node: Node<'_, '_>, transform: &NamedTransform<'_>) -> Result<(), String> {
    let [x, y, z] = xml::numbers(node, "xyz")?;
    let rotation = rotation::from_rpy(xml::numbers(node, "rpy")?);
    let got = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
    compare_isometry("the origin", &got, &transform.isometry)
}

impl Format for Urdf {
    fn name(&self) -> &'static str {
        "urdf"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("link and fixed joint of the camera for a robot description (ROS, Isaac, simulators)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let NamedTransform { parent, child, .. } = transform;
        let text = format!(
            "<?xml version=\"1.0\"?>\n{}\n{}\n<robot name=\"{}\">\n  <link name=\"{parent}\"/>\n  \
             <link name=\"{child}\"/>\n  <joint name=\"{}\" type=\"fixed\">\n    <parent link=\"{parent}\"/>\n    \
             <child link=\"{child}\"/>\n    <origin {}/>\n  </joint>\n</robot>\n",
            xml::comment(&about_transform(&transform, "Metres", Rotation::Rpy, input.result)),
            xml::comment(&format!("Take the link {child} and the joint over into the description that has {parent}.")),
            input.names.calibration,
            joint_name(&transform),
            origin(&transform),
        );
        Ok(vec![ExportFile::new(format!("{}.urdf", input.names.calibration), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let document = xml::parse(&file.text)?;
        let attribute = |element, name| xml::only(&document, element).and_then(|node| xml::attribute(node, name));
        compare_text("the joint's type", attribute("joint", "type")?, "fixed")?;
        compare_text("the joint's name", attribute("joint", "name")?, &joint_name(&transform))?;
        compare_text("the parent", attribute("parent", "link")?, transform.parent)?;
        compare_text("the child", attribute("child", "link")?, transform.child)?;
        compare_origin(xml::only(&document, "origin")?, &transform)
    }
}
