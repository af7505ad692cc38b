//! Taught poses in a file that a person reads and edits.
//!
//! ```toml
//! format = "handeye-poses"
//! version = 1
//! start_joints_deg = [0.0, 45.0, -60.0, 0.0, 90.0, 0.0]
//!
//! [limits]
//! joint_velocity_deg_s = 310.0
//! joint_acceleration_deg_s2 = 100.0
//! joint_jerk_deg_s3 = 80.0
//! tip_velocity = 30.0      # m/s, and rad/s about any axis
//! tip_acceleration = 1.0   # m/s², and rad/s²
//! tip_jerk = 1.0           # m/s³, and rad/s³
//!
//! [[pose]]
//! name = "front"
//! base_from_tip = { translation_m = [0.1, 0.2, 0.3], rotation_xyzw = [0.0, 0.0, 0.0, 1.0] }
//!
//! [[pose]]
//! name = "side"
//! joints_deg = [0.0, 45.0, -60.0, 0.0, 90.0, 0.0]
//! ```
//!
//! `start_joints_deg` and `limits` may be left out. Angles in the file are degrees, in the program radians. Where an arm has
//! prismatic joints, `prismatic_joints = [1]` names them, counted from 1 at the base; their values are metres in both.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use handeye_arm::{JointKind, MAX_JOINTS};
use handeye_files::atomic_file;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_wording::Text;
use handeye_wording::one_line;
use handeye_wording::text;

/// Value of `format`.
pub const FORMAT: &str = "handeye-poses";
/// Value of `version`.
pub const VERSION: u32 = 1;

/// Largest deviation of a quaternion's length from 1, as in dataset folders.
const UNIT_TOLERANCE: f64 = 1e-3;
/// A length within this of 1 is 1 up to rounding, and the quaternion stays as it is.
const ROUNDING: f64 = 1e-12;

/// Taught poses, and how to move between them.
#[derive(Debug, Clone, PartialEq)]
pub struct TaughtPoses {
    /// Indices of the prismatic joints, counted from 0 at the base.
    pub prismatic: Vec<usize>,
    /// Start of the robot, joint values in radians, or metres for a prismatic joint.
    pub start_joints_rad: Option<Vec<f64>>,
    /// Speed limits.
    pub limits: Option<MotionLimits>,
    /// The poses in the order in which they are visited. Two may be equal.
    pub poses: Vec<TaughtPose>,
}

/// One taught pose, as sessions record it; the file has its own names, and degrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TaughtPose {
    /// Its name; no two poses have the same.
    pub name: String,
    /// The goal of the pose.
    pub goal: Goal,
    /// The cell that it was taught on; `None` where that is not known, as in sessions of versions that did not record
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<TaughtOn>,
}

impl TaughtPose {
    /// A pose whose cell is not known.
    pub fn new(name: impl Into<String>, goal: Goal) -> Self {
        Self { name: name.into(), goal, cell: None }
    }

    /// Whether its goal has another number of joint values.
    pub fn joints_differ(&self, count: usize) -> bool {
        matches!(&self.goal, Goal::Joints(joints) if joints.len() != count)
    }

    /// Whether it was taught on this cell.
    pub fn is_of(&self, cell: Option<&TaughtOn>) -> bool {
        match (&self.cell, cell) {
            (Some(taught_on), Some(cell)) => taught_on.is_same(cell),
            (None, None) => true,
            _ => false,
        }
    }
}

/// The cell that poses were taught on. Another arm, or the same one elsewhere, would move to an unchecked place, and the camera
/// might see another target from there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TaughtOn {
    /// Source of the arm, and with it of the base: a scene, an address or a driver.
    pub base: String,
    /// The joints from the base up.
    pub joints: Vec<TaughtJoint>,
    /// Position of the tip with all joints at 0, metres; `None` where the chain of joints is not known beforehand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_at_zero_m: Option<[f64; 3]>,
    /// The target.
    pub target: TargetSpec,
}

/// A joint of the arm that poses were taught on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TaughtJoint {
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Range, radians or metres; `None` for a cyclic joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
}

/// Ends of a joint that differ by less are the same \[rad, m\], and tips \[m\]: a simulator computes them again for every
/// connection.
const SAME_RANGE: f64 = 1e-6;
const SAME_TIP_M: f64 = 1e-3;

impl TaughtOn {
    /// Whether both are the same cell: the same arm at the same base before the same target.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let near = |a: &[f64], b: &[f64], most: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most);
        let both = |a: Option<&[f64]>, b: Option<&[f64]>, most: f64| match (a, b) {
            (Some(a), Some(b)) => near(a, b, most),
            (a, b) => a.is_none() && b.is_none(),
        };
        let is_same_joint = |(a, b): (&TaughtJoint, &TaughtJoint)| {
            a.kind == b.kind && both(a.range.as_ref().map(|it| &it[..]), b.range.as_ref().map(|it| &it[..]), SAME_RANGE)
        };
        let tip = |it: &Self| it.tip_at_zero_m;
        self.base == other.base
            && self.target == other.target
            && self.joints.len() == other.joints.len()
            && self.joints.iter().zip(&other.joints).all(is_same_joint)
            && both(tip(self).as_ref().map(|it| &it[..]), tip(other).as_ref().map(|it| &it[..]), SAME_TIP_M)
    }
}

/// Goal of a taught pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// A pose of the tip.
    #[serde(rename = "base_from_tip", with = "crate::pose_record")]
    Tip(Pose<Base, Tip>),
    /// Joint values in radians, or metres of a prismatic joint.
    #[serde(rename = "joints_rad")]
    Joints(Vec<f64>),
}

/// Limits of motion. Joint limits are radians and hold for every joint that turns; one that shifts has those of the tip. Tip
/// limits are metres and radians alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// rad/s.
    pub joint_velocity: f64,
    /// rad/s².
    pub joint_acceleration: f64,
    /// rad/s³.
    pub joint_jerk: f64,
    /// m/s and rad/s.
    pub tip_velocity: f64,
    /// m/s² and rad/s².
    pub tip_acceleration: f64,
    /// m/s³ and rad/s³.
    pub tip_jerk: f64,
}

/// An error of a pose file, in one line: `FILE, row N, pose "NAME": what`.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[error("{place}: {problem}", place = place(file, *row, pose.as_deref()))]
#[non_exhaustive]
pub struct PosesError {
    /// The file of poses.
    pub file: PathBuf,
    /// Line as an editor counts it, from 1.
    pub row: Option<usize>,
    /// The pose, quoted, where the defect is in one.
    pub pose: Option<String>,
    /// The error.
    pub problem: PosesProblem,
}

fn place(file: &Path, row: Option<usize>, pose: Option<&str>) -> Text {
    let file = file.display();
    match (row, pose) {
        (None, None) => text!("{file}", file = file),
        (Some(row), None) => text!("{file}, row {row}", file = file, row = row),
        (None, Some(pose)) => text!("{file}, pose {pose}", file = file, pose = pose),
        (Some(row), Some(pose)) => text!("{file}, row {row}, pose {pose}", file = file, row = row, pose = pose),
    }
}

/// A defect of a pose file.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum PosesProblem {
    /// The file system does not give it.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The file system does not take it.
    #[error("cannot be written: {0}")]
    Unwritable(String),
    /// Not TOML, or an unknown or missing key.
    #[error("{0}")]
    Toml(String),
    /// Another document.
    #[error("format is {0:?}: a file of taught poses has format = {FORMAT:?}")]
    Format(String),
    /// A layout that is not known here.
    #[error("version is {0}, this program reads version {VERSION}: use a newer handeye")]
    Version(i64),
    /// No poses at all.
    #[error("has no [[pose]]")]
    Empty,
    /// Two poses of one name.
    #[error("an earlier pose has the same name: names tell poses apart in reports")]
    SameName,
    /// A pose without a goal, or with two.
    #[error("needs either base_from_tip or joints_deg")]
    Goal,
    /// A number that is not finite.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// A quaternion that is not a unit quaternion.
    #[error("rotation_xyzw has length {0:.6}, which is more than {UNIT_TOLERANCE} from 1")]
    NotUnit(f64),
    /// Another number of joints than elsewhere in the file.
    #[error("has {got} joint angles, others in this file have {need}")]
    JointCount {
        /// Angles here.
        got: usize,
        /// Angles elsewhere.
        need: usize,
    },
    /// A joint that no arm has.
    #[error("prismatic_joints counts joints from 1 at the base to at most {MAX_JOINTS}")]
    Prismatic,
    /// A limit that stops every motion.
    #[error("{0} must be a positive number")]
    Limit(&'static str),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    format: Spanned<String>,
    version: Spanned<i64>,
    #[serde(default)]
    prismatic_joints: Option<Spanned<Vec<usize>>>,
    start_joints_deg: Option<Spanned<Vec<f64>>>,
    limits: Option<Spanned<RawLimits>>,
    #[serde(default, rename = "pose")]
    poses: Vec<Spanned<RawPose>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLimits {
    joint_velocity_deg_s: f64,
    joint_acceleration_deg_s2: f64,
    joint_jerk_deg_s3: f64,
    tip_velocity: f64,
    tip_acceleration: f64,
    tip_jerk: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPose {
    name: String,
    base_from_tip: Option<RawTransform>,
    joints_deg: Option<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTransform {
    translation_m: [f64; 3],
    rotation_xyzw: [f64; 4],
}

/// Place of an error, and its pose, before the file is known.
struct Defect {
    row: Option<usize>,
    pose: Option<String>,
    problem: PosesProblem,
}

impl TaughtPoses {
    /// Reads a file of taught poses.
    ///
    /// # Errors
    /// [`PosesError`] names the file, the row and the pose.
    pub fn read(file: &Path) -> Result<Self, PosesError> {
        let unreadable = |e: &dyn std::fmt::Display| PosesError {
            file: file.to_path_buf(),
            row: None,
            pose: None,
            problem: PosesProblem::Unreadable(one_line(e)),
        };
        let text = fs::read_to_string(file).map_err(|e| unreadable(&e))?;
        Self::parse(file, &text)
    }

    /// Reads the text of a file of taught poses; `file` is for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, PosesError> {
        parse(text.strip_prefix('\u{feff}').unwrap_or(text)).map_err(|Defect { row, pose, problem }| PosesError {
            file: file.to_path_buf(),
            row,
            pose: pose.map(|name| format!("{:?}", name.chars().take(40).collect::<String>())),
            problem,
        })
    }

    /// The file as text, with every digit that a number has; what is written here, [`Self::parse`] reads again.
    pub(crate) fn to_toml(&self) -> String {
        let mut text = format!(
            "# Taught poses: metres, degrees, quaternions x y z w.\nformat = \"{FORMAT}\"\nversion = {VERSION}\n"
        );
        let mut line = |content: String| {
            text.push_str(&content);
            text.push('\n');
        };
        if !self.prismatic.is_empty() {
            let counted: Vec<usize> = self.prismatic.iter().map(|joint| joint + 1).collect();
            line(format!("prismatic_joints = {counted:?} # their values are metres"));
        }
        let degrees = |joints: &[f64]| degrees(joints, &self.prismatic);
        if let Some(joints) = &self.start_joints_rad {
            line(format!("start_joints_deg = {:?}", degrees(joints)));
        }
        if let Some(limits) = &self.limits {
            line(limits_table(limits));
        }
        for pose in &self.poses {
            let name = toml::Value::String(pose.name.clone());
            line(format!("\n[[pose]]\nname = {name}"));
            match &pose.goal {
                Goal::Tip(base_from_tip) => {
                    let t: [f64; 3] = base_from_tip.translation().into();
                    let q = base_from_tip.xyzw();
                    line(format!("base_from_tip = {{ translation_m = {t:?}, rotation_xyzw = {q:?} }}"));
                }
                Goal::Joints(joints) => line(format!("joints_deg = {:?}", degrees(joints))),
            }
        }
        text
    }

    /// Writes a file of taught poses, as a whole or not at all.
    ///
    /// # Errors
    /// [`PosesError`] when the disk does not take it, or when the poses could not be read again.
    pub fn write(&self, file: &Path) -> Result<(), PosesError> {
        let text = self.to_toml();
        Self::parse(file, &text)?;
        atomic_file::write(file, text.as_bytes()).map_err(|e| PosesError {
            file: file.to_path_buf(),
            row: None,
            pose: None,
            problem: PosesProblem::Unwritable(one_line(&e)),
        })
    }
}

/// Degrees, or metres of a prismatic joint.
fn degrees(joints: &[f64], prismatic: &[usize]) -> Vec<f64> {
    let shown = |(i, value): (usize, &f64)| if prismatic.contains(&i) { *value } else { value.to_degrees() };
    joints.iter().enumerate().map(shown).collect()
}

fn limits_table(limits: &MotionLimits) -> String {
    let MotionLimits { joint_velocity, joint_acceleration, joint_jerk, tip_velocity, tip_acceleration, tip_jerk } =
        limits;
    let mut text = String::from("\n[limits]");
    let rows = [
        ("joint_velocity_deg_s", joint_velocity.to_degrees(), ""),
        ("joint_acceleration_deg_s2", joint_acceleration.to_degrees(), ""),
        ("joint_jerk_deg_s3", joint_jerk.to_degrees(), ""),
        ("tip_velocity", *tip_velocity, " # m/s and rad/s"),
        ("tip_acceleration", *tip_acceleration, " # m/s² and rad/s²"),
        ("tip_jerk", *tip_jerk, " # m/s³ and rad/s³"),
    ];
    for (key, value, unit) in rows {
        // Writing to a string cannot fail.
        let _ok = write!(text, "\n{key} = {value:?}{unit}").is_ok();
    }
    text
}

fn parse(text: &str) -> Result<TaughtPoses, Defect> {
    let row_of = |offset: usize| Some(1 + text.bytes().take(offset).filter(|&b| b == b'\n').count());
    let raw: RawFile = toml::from_str(text).map_err(|e| Defect {
        row: e.span().and_then(|span| row_of(span.start)),
        pose: None,
        problem: PosesProblem::Toml(one_line(&e.message())),
    })?;
    let at = |span: std::ops::Range<usize>, problem| Defect { row: row_of(span.start), pose: None, problem };
    if raw.format.get_ref() != FORMAT {
        let format = raw.format.get_ref().chars().take(40).collect();
        return Err(at(raw.format.span(), PosesProblem::Format(format)));
    }
    if *raw.version.get_ref() != i64::from(VERSION) {
        return Err(at(raw.version.span(), PosesProblem::Version(*raw.version.get_ref())));
    }
    if raw.poses.is_empty() {
        return Err(Defect { row: None, pose: None, problem: PosesProblem::Empty });
    }
    let mut joints = JointReader { prismatic: prismatic(raw.prismatic_joints.as_ref(), at)?, count: None };
    let start_joints_rad = match &raw.start_joints_deg {
        Some(given) => Some(joints.read("start_joints_deg", given.get_ref()).map_err(|p| at(given.span(), p))?),
        None => None,
    };
    let limits = match &raw.limits {
        Some(limits) => Some(motion_limits(limits.get_ref()).map_err(|p| at(limits.span(), p))?),
        None => None,
    };
    let mut poses: Vec<TaughtPose> = Vec::with_capacity(raw.poses.len());
    for pose in &raw.poses {
        let name = pose.get_ref().name.clone();
        let goal = if poses.iter().any(|p| p.name == name) {
            Err(PosesProblem::SameName)
        } else {
            goal(pose.get_ref(), &mut joints)
        };
        let goal = goal.map_err(|problem| Defect { pose: Some(name.clone()), ..at(pose.span(), problem) })?;
        poses.push(TaughtPose::new(name, goal));
    }
    Ok(TaughtPoses { prismatic: joints.prismatic, start_joints_rad, limits, poses })
}

fn goal(raw: &RawPose, reader: &mut JointReader) -> Result<Goal, PosesProblem> {
    match (&raw.base_from_tip, &raw.joints_deg) {
        (Some(transform), None) => tip_pose(transform).map(Goal::Tip),
        (None, Some(joints)) => reader.read("joints_deg", joints).map(Goal::Joints),
        _ => Err(PosesProblem::Goal),
    }
}

fn tip_pose(raw: &RawTransform) -> Result<Pose<Base, Tip>, PosesProblem> {
    if !raw.translation_m.iter().all(|v| v.is_finite()) {
        return Err(PosesProblem::NotFinite("translation_m"));
    }
    if !raw.rotation_xyzw.iter().all(|v| v.is_finite()) {
        return Err(PosesProblem::NotFinite("rotation_xyzw"));
    }
    let [x, y, z, w] = raw.rotation_xyzw;
    let q = Quaternion::new(w, x, y, z);
    let off = (q.norm() - 1.0).abs();
    if off > UNIT_TOLERANCE {
        return Err(PosesProblem::NotUnit(q.norm()));
    }
    let rotation = if off < ROUNDING { UnitQuaternion::new_unchecked(q) } else { UnitQuaternion::from_quaternion(q) };
    Ok(Pose::from_isometry(Isometry3::from_parts(Translation3::from(raw.translation_m), rotation)))
}

/// Joint values of one arm.
struct JointReader {
    prismatic: Vec<usize>,
    /// Number of the first joint values.
    count: Option<usize>,
}

impl JointReader {
    fn read(&mut self, key: &'static str, given: &[f64]) -> Result<Vec<f64>, PosesProblem> {
        if !given.iter().all(|v| v.is_finite()) {
            return Err(PosesProblem::NotFinite(key));
        }
        let need = *self.count.get_or_insert(given.len());
        if given.len() != need || given.is_empty() {
            return Err(PosesProblem::JointCount { got: given.len(), need: need.max(1) });
        }
        let si = |(i, value): (usize, &f64)| if self.prismatic.contains(&i) { *value } else { value.to_radians() };
        Ok(given.iter().enumerate().map(si).collect())
    }
}

/// The joints that are named, counted from 0.
fn prismatic(
    named: Option<&Spanned<Vec<usize>>>,
    at: impl Fn(std::ops::Range<usize>, PosesProblem) -> Defect,
) -> Result<Vec<usize>, Defect> {
    let Some(named) = named else { return Ok(Vec::new()) };
    if !named.get_ref().iter().all(|joint| (1..=MAX_JOINTS).contains(joint)) {
        return Err(at(named.span(), PosesProblem::Prismatic));
    }
    Ok(named.get_ref().iter().map(|joint| joint - 1).collect())
}

fn motion_limits(raw: &RawLimits) -> Result<MotionLimits, PosesProblem> {
    let limits = [
        ("joint_velocity_deg_s", raw.joint_velocity_deg_s),
        ("joint_acceleration_deg_s2", raw.joint_acceleration_deg_s2),
        ("joint_jerk_deg_s3", raw.joint_jerk_deg_s3),
        ("tip_velocity", raw.tip_velocity),
        ("tip_acceleration", raw.tip_acceleration),
        ("tip_jerk", raw.tip_jerk),
    ];
    if let Some((key, _)) = limits.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        return Err(PosesProblem::Limit(key));
    }
    Ok(MotionLimits {
        joint_velocity: raw.joint_velocity_deg_s.to_radians(),
        joint_acceleration: raw.joint_acceleration_deg_s2.to_radians(),
        joint_jerk: raw.joint_jerk_deg_s3.to_radians(),
        tip_velocity: raw.tip_velocity,
        tip_acceleration: raw.tip_acceleration,
        tip_jerk: raw.tip_jerk,
    })
}

#[cfg(test)]
#[path = "taught_poses_tests.rs"]
mod tests;
