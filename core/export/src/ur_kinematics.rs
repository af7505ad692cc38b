//! The `kinematics:` file of Universal Robots' ROS driver and description, which has a place for the calibration of one arm.
//!
//! `ur_description` puts a link behind each joint by `xyz` and `rpy` (fixed axes, as URDF) and turns about z. Its first link,
//! `base_link_inertia`, is `base_link` turned by half a turn, as is `base`, the base of the controller: poses of the controller are
//! those of `tool0` in `base`, which is the product of the six. The last link, `wrist_3_link`, is `tool0`.
//!
//! Source: `config/*/default_kinematics.yaml` and `urdf/ur_macro.xacro` of ur_description; the robot's factory calibration in the
//! same layout is what ur_calibration writes.

use std::fmt::Write as _;

use nalgebra::Isometry3;

use super::corrected::{CorrectedChain, about_arm, joint_origins};
use super::text::{entries, spaced};
use super::ur_frames::{UrFrames, forward};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format, TOLERANCE, rotation};
use handeye_arm::Arm;
use handeye_wording::Text;

pub(super) struct UrKinematics;

/// Links behind the joints, in order.
const LINKS: [&str; 6] = ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"];
const KEYS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// Joint values at which the file is multiplied out again.
const COMPARED_AT: [[f64; 6]; 2] = [[0.4, -1.1, 1.6, -2.0, -1.4, 0.9], [-2.3, 0.5, -1.2, 0.8, 2.1, -3.0]];

/// Contents of the file, and its context.
struct Kinematics {
    corrected: Arm,
    base_from_robot: Isometry3<f64>,
    /// Numbers of each link.
    links: Vec<[f64; 6]>,
    tool0_from_tip: Isometry3<f64>,
}

impl Kinematics {
    fn of(input: &ExportInput<'_>) -> Result<Self, ExportError> {
        let format = UrKinematics.name();
        let CorrectedChain { nominal, corrected } = CorrectedChain::of(input, format)?;
        let UrFrames { base_from_robot, axis_from_own } =
            UrFrames::of(&nominal).map_err(|problem| ExportError::OtherArm { format, problem })?;
        let robot_from_first = base_from_robot.inverse() * corrected.base_from_first;
        let origins = joint_origins(&corrected, &robot_from_first, &axis_from_own);
        let carried_from_own = corrected.joints().iter().zip(&axis_from_own).next_back();
        let carried_from_own = carried_from_own.map(|(joint, own)| joint.joint_from_axis() * own);
        let own_from_carried = carried_from_own.unwrap_or_else(Isometry3::identity).inverse();
        let tool0_from_tip = own_from_carried * corrected.last_from_flange() * corrected.flange_from_tip;
        Ok(Self { base_from_robot, links: origins.iter().map(six).collect(), tool0_from_tip, corrected })
    }

    fn hash(&self) -> String {
        hash(&self.links)
    }
}

/// `x y z roll pitch yaw`.
fn six(isometry: &Isometry3<f64>) -> [f64; 6] {
    let [x, y, z]: [f64; 3] = isometry.translation.vector.into();
    let [roll, pitch, yaw] = rotation::rpy(&isometry.rotation);
    [x + 0.0, y + 0.0, z + 0.0, roll, pitch, yaw]
}

/// Digits that another calibration of the arm does not have: FNV-1a of the numbers.
fn hash(links: &[[f64; 6]]) -> String {
    let bytes = links.iter().flatten().flat_map(|value| value.to_bits().to_le_bytes());
    let digest = bytes
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("calib_{digest}")
}

impl Format for UrKinematics {
    fn name(&self) -> &'static str {
        "ur_kinematics"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("kinematics of the corrected arm for Universal Robots' ROS driver (ur_description)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let kinematics = Kinematics::of(input)?;
        let words = "rpy: radians about fixed x, y, z (URDF), R = Rz(yaw) * Ry(pitch) * Rx(roll)";
        let mut text = format!(
            "# {}\n# base and tool0 are those of ur_description, base_link_inertia to wrist_3_link. Around them, x y z roll pitch yaw:\n\
             # base in the base of reported poses: {}\n# TCP of reported poses in tool0: {}\n# The driver compares hash with that of \
             the robot's factory calibration, says that they differ, and goes on.\nkinematics:\n",
            about_arm(input, ["base", "tool0"], words),
            spaced(&six(&kinematics.base_from_robot)),
            spaced(&six(&kinematics.tool0_from_tip)),
        );
        for (link, numbers) in LINKS.iter().zip(&kinematics.links) {
            let _infallible = write!(text, "  {link}:\n{}", entries(4, &KEYS, numbers));
        }
        let _infallible = writeln!(text, "  hash: {}", kinematics.hash());
        Ok(vec![ExportFile::new(format!("{}_kinematics.yaml", input.names.calibration), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let kinematics = Kinematics::of(input).map_err(|e| e.to_string())?;
        let yaml = Yaml::parse(&file.text)?;
        let path = |link: &str, key: &str| format!("kinematics.{link}.{key}");
        let mut expected = vec![("kinematics.hash".to_owned(), Leaf::text(kinematics.hash()))];
        for (link, numbers) in LINKS.iter().zip(&kinematics.links) {
            expected.extend(KEYS.iter().zip(numbers).map(|(key, value)| (path(link, key), Leaf::Number(*value))));
        }
        yaml.compare(&expected)?;
        let frame = |link: &&str| -> Result<Isometry3<f64>, String> {
            let number = |key: &str| yaml.number(&path(link, key));
            let turn = rotation::from_rpy([number("roll")?, number("pitch")?, number("yaw")?]);
            Ok(Isometry3::from_parts([number("x")?, number("y")?, number("z")?].into(), turn))
        };
        let frames = LINKS.iter().map(frame).collect::<Result<Vec<_>, String>>()?;
        for joints in COMPARED_AT {
            let read = kinematics.base_from_robot * forward(&frames, &joints) * kinematics.tool0_from_tip;
            let own = kinematics.corrected.forward(&joints).map_err(|e| e.to_string())?;
            let off = (read.to_homogeneous() - own.isometry().to_homogeneous()).amax();
            if off > TOLERANCE {
                return Err(format!("at {joints:?} the product is {off:e} off the corrected arm"));
            }
        }
        Ok(())
    }
}
