//! Xacro: the fixed joint of [`super::urdf`] as a macro to be included in a robot description.

use super::input::NamedTransform;
use super::text::{Rotation, about_transform, compare_text, identifier};
use super::urdf::{compare_origin, joint_name, origin};
use super::{ExportError, ExportFile, ExportInput, Format, xml};
use handeye_wording::Text;

pub(super) struct Xacro;

fn macro_name(input: &ExportInput<'_>) -> String {
    format!("{}_camera", identifier(&input.names.calibration))
}

fn file_name(input: &ExportInput<'_>) -> String {
    format!("{}.urdf.xacro", input.names.calibration)
}

impl Format for Xacro {
    fn name(&self) -> &'static str {
        "xacro"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("macro with link and fixed joint of the camera, to include in a robot description (ROS)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let NamedTransform { parent, child, .. } = transform;
        let name = macro_name(input);
        let file = file_name(input);
        let text = format!(
            "<?xml version=\"1.0\"?>\n{}\n{}\n<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n  \
             <xacro:macro name=\"{name}\" params=\"parent:={parent}\">\n    <link name=\"{child}\"/>\n    \
             <joint name=\"{}\" type=\"fixed\">\n      <parent link=\"${{parent}}\"/>\n      \
             <child link=\"{child}\"/>\n      <origin {}/>\n    </joint>\n  </xacro:macro>\n</robot>\n",
            xml::comment(&about_transform(&transform, "Metres", Rotation::Rpy, input.result)),
            xml::comment(&format!("Use: <xacro:include filename=\"{file}\"/> <xacro:{name}/>")),
            joint_name(&transform),
            origin(&transform),
        );
        Ok(vec![ExportFile::new(file, text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let document = xml::parse(&file.text)?;
        let attribute = |element, name| xml::only(&document, element).and_then(|node| xml::attribute(node, name));
        compare_text("the macro's name", attribute("macro", "name")?, &macro_name(input))?;
        let parameters = format!("parent:={}", transform.parent);
        compare_text("the macro's parameters", attribute("macro", "params")?, &parameters)?;
        compare_text("the joint's type", attribute("joint", "type")?, "fixed")?;
        compare_text("the parent", attribute("parent", "link")?, "${parent}")?;
        compare_text("the child", attribute("child", "link")?, transform.child)?;
        compare_text("the link", attribute("link", "name")?, transform.child)?;
        compare_origin(xml::only(&document, "origin")?, &transform)
    }
}
