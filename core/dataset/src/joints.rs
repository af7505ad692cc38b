//! Joint angles of a data set: their columns, the arm they belong to, and what they are good for.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::Entry;
use super::error::DatasetProblem;
use crate::text::TextFile;
use crate::value::{AngleUnit, Spanning, bad};
use handeye_arm::urdf::Urdf;
use handeye_arm::{Arm, ArmKind, ArmModel, MAX_JOINTS};
use handeye_estimate::placement::{self, JointView, Placement, PlacementError, TipFromJoints};

/// The columns of joint angles, after those of the rotation.
pub(super) const COLUMNS: [&str; MAX_JOINTS] =
    ["q1", "q2", "q3", "q4", "q5", "q6", "q7", "q8", "q9", "q10", "q11", "q12"];

/// The table `[robot.arm]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawArm {
    kind: Option<ArmKind>,
    dh: Option<Vec<[f64; 4]>>,
    /// A file of the data set.
    urdf: Option<String>,
    /// Links of that file.
    base: Option<String>,
    tip: Option<String>,
    /// The chain in a session's own data set.
    chain: Option<Box<Arm>>,
}

/// An arm as `[robot.arm]` names it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum NamedArm {
    Model(ArmModel),
    Urdf { file: String, base: Option<String>, tip: Option<String>, span: Range<usize> },
}

impl NamedArm {
    /// The file that it is in.
    pub(super) fn file(&self) -> Option<&String> {
        match self {
            Self::Model(_) => None,
            Self::Urdf { file, .. } => Some(file),
        }
    }

    /// The arm, out of its `file` where it is in one; checked for the number of its joints.
    pub(super) fn model(&self, file: Option<&TextFile>, joints: usize) -> Result<ArmModel, Spanning> {
        match (self, file) {
            (Self::Urdf { base, tip, span, .. }, Some(file)) => {
                let read = Urdf::parse(&file.text, &file.path.display().to_string());
                let arm = read.and_then(|urdf| urdf.arm(base.as_deref(), tip.as_deref()));
                let arm = arm.map_err(|error| (span.clone(), DatasetProblem::Urdf(error)))?;
                counted(ArmModel::Chain(Box::new(arm)), joints, span)
            }
            (Self::Urdf { file, span, .. }, None) => Err((span.clone(), DatasetProblem::Unreadable(file.clone()))),
            (Self::Model(model), _) => Ok(model.clone()),
        }
    }
}

/// Joint angles according to `[robot]`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JointColumns {
    /// Number of columns.
    pub count: usize,
    pub unit: AngleUnit,
    pub arm: Option<NamedArm>,
}

/// Checks the joint angles in `[robot]`; `None` when it has none.
pub(super) fn joint_columns(
    joints: Option<&Spanned<i64>>,
    unit: Option<AngleUnit>,
    arm: Option<&Spanned<RawArm>>,
    whole: Range<usize>,
) -> Result<Option<JointColumns>, Spanning> {
    let missing = |span, key, why| (span, DatasetProblem::MissingKey { table: "robot", key, why });
    let Some(joints) = joints else {
        return match (arm, unit) {
            (Some(arm), _) => {
                let why = "[robot.arm] is given: how many columns q1, q2, … follow the rotation in the pose table";
                Err(missing(arm.span(), "joints", why))
            }
            (None, Some(_)) => {
                Err(missing(whole, "joints", "joint_unit is given: how many columns q1, q2, … follow the rotation"))
            }
            (None, None) => Ok(None),
        };
    };
    let count = usize::try_from(*joints.get_ref()).unwrap_or(0);
    if count == 0 || count > MAX_JOINTS {
        return Err(bad(joints, "joints", "a whole number of joints from 1 to 12"));
    }
    let Some(unit) = unit else {
        return Err(missing(joints.span(), "joint_unit", "joint angles are in \"rad\" or \"deg\""));
    };
    let arm = arm.map(|raw| named_arm(raw, count)).transpose()?;
    Ok(Some(JointColumns { count, unit, arm }))
}

fn named_arm(raw: &Spanned<RawArm>, joints: usize) -> Result<NamedArm, Spanning> {
    let conflict = |why| Err((raw.span(), DatasetProblem::Conflict(why)));
    let RawArm { kind, dh, urdf, base, tip, chain } = raw.get_ref();
    if urdf.is_none() && (base.is_some() || tip.is_some()) {
        return conflict("[robot.arm] has base and tip, which are links of a URDF, and no urdf: name the file");
    }
    let model = match (kind, dh, urdf, chain) {
        (Some(kind), None, None, None) => ArmModel::Kind(*kind),
        (None, Some(rows), None, None) => ArmModel::Dh(rows.clone()),
        (None, None, None, Some(chain)) => ArmModel::Chain(chain.clone()),
        (None, None, Some(file), None) => {
            return Ok(NamedArm::Urdf { file: file.clone(), base: base.clone(), tip: tip.clone(), span: raw.span() });
        }
        _ => return conflict("[robot.arm] has one of kind, dh, urdf and chain"),
    };
    counted(model, joints, &raw.span()).map(NamedArm::Model)
}

fn counted(model: ArmModel, joints: usize, span: &Range<usize>) -> Result<ArmModel, Spanning> {
    let at = |problem| (span.clone(), problem);
    let need = model.arm().map_err(|error| at(DatasetProblem::Arm(error)))?.joint_count();
    if joints == need { Ok(model) } else { Err(at(DatasetProblem::JointCount { got: joints, need })) }
}

/// The arm of a data set, and how well joint angles and reported poses agree with it.
#[derive(Debug, Clone, PartialEq)]
pub struct DatasetArm {
    /// The arm as `[robot.arm]` names it.
    pub model: ArmModel,
    /// Place of the arm and deviation of each view, in the order of the entries; otherwise why the joint angles are not
    /// used. Then every [`Entry::tip_from_joints`] is empty.
    pub placement: Result<Placement, PlacementError>,
}

impl DatasetArm {
    /// Checks the joint angles against the poses, and fills in where the joints are at the tip where they fit.
    pub(super) fn of(model: ArmModel, entries: &mut [Entry]) -> Self {
        let placement = placed(&model, entries);
        if let Ok((_, of_views)) = &placement {
            for (entry, frames) in entries.iter_mut().zip(of_views) {
                entry.tip_from_joints.clone_from(frames);
            }
        }
        Self { model, placement: placement.map(|(placement, _)| placement) }
    }
}

fn placed(model: &ArmModel, entries: &[Entry]) -> Result<(Placement, TipFromJoints), PlacementError> {
    // Every row of the table has a pose and joint angles.
    let views: Vec<JointView<'_>> = entries
        .iter()
        .filter_map(|entry| {
            Some(JointView { base_from_tip: entry.base_from_tip?, joints_rad: entry.joints_rad.as_deref()? })
        })
        .collect();
    placement::place_checked(&model.arm()?, &views)
}

#[cfg(test)]
#[path = "joints_tests.rs"]
mod tests;
