//! URDF of the corrected arm: links, joints with their limits, and a fixed joint to the tip.
//!
//! Errors of the joints are in the origins, so that joint values are those of the controller and every URDF parser gets the true
//! arm, except for its deflection under gravity: URDF has no place for that. Source: URDF XML specification (`origin`, `axis`,
//! `limit`).

use std::fmt::Write as _;

use nalgebra::Isometry3;
use roxmltree::Node;

use super::corrected::{CorrectedChain, about_arm, joint_names, unique};
use super::text::{compare_isometry, compare_numbers, compare_text, spaced};
use super::{ExportError, ExportFile, ExportInput, Format, rotation, xml};
use handeye_arm::{Arm, Joint};
use handeye_wording::Text;

pub(super) struct ArmUrdf;

/// Stands for a limit that is not known: URDF wants a number, and takes 0 for an arm that cannot move.
const UNKNOWN: f64 = 1e6;

struct FileJoint<'a> {
    name: String,
    parent: &'a str,
    child: &'a str,
    origin: Isometry3<f64>,
    /// The joint of the arm; the last one, to the tip, is fixed.
    moving: Option<&'a Joint>,
}

impl FileJoint<'_> {
    fn kind(&self) -> &'static str {
        let is_endless = |joint: &Joint| joint.range.min.is_infinite() && joint.range.max.is_infinite();
        match self.moving {
            None => "fixed",
            Some(joint) if is_endless(joint) => "continuous",
            Some(_) => "revolute",
        }
    }

    /// Attributes of `limit` with their numbers, in order.
    fn limit(&self, joint: &Joint) -> Vec<(&'static str, f64)> {
        let stated = |value: f64| value.clamp(-UNKNOWN, UNKNOWN);
        let rest = [("effort", UNKNOWN), ("velocity", stated(joint.range.speed))];
        let ends = [("lower", stated(joint.range.min)), ("upper", stated(joint.range.max))];
        if self.kind() == "revolute" { ends.into_iter().chain(rest).collect() } else { rest.to_vec() }
    }

    fn write(&self, text: &mut String) {
        let Self { name, parent, child, origin, .. } = self;
        let _infallible = write!(
            text,
            "  <joint name=\"{name}\" type=\"{}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    \
             <origin xyz=\"{}\" rpy=\"{}\"/>\n",
            self.kind(),
            spaced(&xyz(origin)),
            spaced(&rotation::rpy(&origin.rotation)),
        );
        if let Some(joint) = self.moving {
            let of = |(name, value): (&str, f64)| format!("{name}=\"{}\"", spaced(&[value]));
            let limit: Vec<String> = self.limit(joint).into_iter().map(of).collect();
            let (axis, limit) = (spaced(&axis(joint)), limit.join(" "));
            let _infallible = write!(text, "    <axis xyz=\"{axis}\"/>\n    <limit {limit}/>\n");
        }
        text.push_str("  </joint>\n");
    }

    fn compare(&self, node: Node<'_, '_>) -> Result<(), String> {
        let of = |element: &str| {
            let mut found = node.children().filter(|child| child.has_tag_name(element));
            found.next().ok_or_else(|| format!("no {element} in the joint {}", self.name))
        };
        compare_text("a joint's name", xml::attribute(node, "name")?, &self.name)?;
        compare_text("a joint's type", xml::attribute(node, "type")?, self.kind())?;
        compare_text("a parent", xml::attribute(of("parent")?, "link")?, self.parent)?;
        compare_text("a child", xml::attribute(of("child")?, "link")?, self.child)?;
        let origin = of("origin")?;
        let turn = rotation::from_rpy(xml::numbers(origin, "rpy")?);
        let got = Isometry3::from_parts(xml::numbers::<3>(origin, "xyz")?.into(), turn);
        compare_isometry("an origin", &got, &self.origin)?;
        let Some(joint) = self.moving else { return Ok(()) };
        compare_numbers("an axis", &xml::numbers::<3>(of("axis")?, "xyz")?, &axis(joint))?;
        let limit = of("limit")?;
        for (name, value) in self.limit(joint) {
            compare_numbers(name, &xml::numbers::<1>(limit, name)?, &[value])?;
        }
        Ok(())
    }
}

fn xyz(origin: &Isometry3<f64>) -> [f64; 3] {
    origin.translation.vector.map(|v| v + 0.0).into()
}

fn axis(joint: &Joint) -> [f64; 3] {
    joint.axis.into_inner().map(|v| v + 0.0).into()
}

/// Links from the base to the tip.
fn links(arm: &Arm, input: &ExportInput<'_>) -> Vec<String> {
    let (base, tip) = (&input.names.base_frame, &input.names.effector_frame);
    let between = unique((1..=arm.joint_count()).map(|joint| format!("link_{joint}")), &[base, tip]);
    std::iter::once(base.clone()).chain(between).chain([tip.clone()]).collect()
}

fn joints<'a>(arm: &'a Arm, links: &'a [String]) -> Vec<FileJoint<'a>> {
    let names = joint_names(arm.joints());
    let to_tip = unique(std::iter::once("to_tip".to_owned()), &names.iter().map(String::as_str).collect::<Vec<_>>());
    let first = std::iter::once(arm.base_from_first).chain(std::iter::repeat(Isometry3::identity()));
    let moving = arm.joints().iter().zip(first).map(|(joint, first)| (first * joint.previous_from_joint, Some(joint)));
    let fixed = (arm.last_from_flange() * arm.flange_from_tip, None);
    let named = moving.chain([fixed]).zip(names.into_iter().chain(to_tip));
    named
        .zip(links.windows(2))
        .map(|(((origin, moving), name), ends)| FileJoint { name, parent: &ends[0], child: &ends[1], origin, moving })
        .collect()
}

impl Format for ArmUrdf {
    fn name(&self) -> &'static str {
        "arm_urdf"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("the corrected arm as a robot description: links and joints (ROS, Isaac, simulators)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let arm = CorrectedChain::of(input, self.name())?.corrected;
        let links = links(&arm, input);
        let rotation = "rpy: radians about fixed x, y, z (URDF), R = Rz(yaw) * Ry(pitch) * Rx(roll)";
        let mut text = format!(
            "<?xml version=\"1.0\"?>\n{}\n{}\n<robot name=\"{}\">\n",
            xml::comment(&about_arm(input, [&input.names.base_frame, &input.names.effector_frame], rotation)),
            xml::comment("Errors of the joints are in the origins. A limit of 1000000 is one that is not known."),
            input.names.calibration,
        );
        for link in &links {
            let _infallible = writeln!(text, "  <link name=\"{link}\"/>");
        }
        for joint in joints(&arm, &links) {
            joint.write(&mut text);
        }
        text.push_str("</robot>\n");
        Ok(vec![ExportFile::new(format!("{}_arm.urdf", input.names.calibration), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let arm = CorrectedChain::of(input, self.name()).map_err(|e| e.to_string())?.corrected;
        let links = links(&arm, input);
        let document = xml::parse(&file.text)?;
        let all =
            |element: &'static str| document.root_element().children().filter(move |node| node.has_tag_name(element));
        let found: Vec<&str> = all("link").map(|link| xml::attribute(link, "name")).collect::<Result<_, _>>()?;
        if found != links {
            return Err(format!("the links are {found:?}, not {links:?}"));
        }
        let expected = joints(&arm, &links);
        let found: Vec<_> = all("joint").collect();
        if found.len() != expected.len() {
            return Err(format!("there are {} joints, not {}", found.len(), expected.len()));
        }
        expected.iter().zip(found).try_for_each(|(joint, node)| joint.compare(node))
    }
}
