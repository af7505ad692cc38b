//! Changes of a session by the user, as data: recorded in the journal, undone and redone as a whole.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::capture_id::CaptureId;
use super::document::{CaptureRecord, Document, Role, check_taught};
use super::edit_error::{EditError, TaughtChange};
use handeye_dataset::CameraInput;
use handeye_dataset::taught_poses::TaughtPose;
use handeye_estimate::handeye::Mode;
use handeye_geometry::targets::TargetSpec;

/// One change. Its text ([`fmt::Display`]) finishes the sentence “Undo …”.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Edit {
    /// A capture was taken.
    AddCapture(Box<CaptureRecord>),
    /// Captures are gone from the session; their files stay, for undo.
    DeleteCaptures(Vec<CaptureId>),
    /// Captures are taken out of the fit, or back in.
    SetExcluded {
        /// The captures that are changed.
        ids: Vec<CaptureId>,
        /// Out of the fit.
        excluded: bool,
    },
    /// Captures are for something else.
    SetRole {
        /// The captures that are changed.
        ids: Vec<CaptureId>,
        /// Their new role.
        role: Role,
    },
    /// Another target.
    SetTarget(TargetSpec),
    /// The camera sits elsewhere.
    SetMode(Mode),
    /// Something else is known of the camera beforehand.
    SetCamera(Option<CameraInput>),
    /// Accuracy of the robot, millimetres; `None` where that is not known.
    SetRobotAccuracy(Option<f64>),
    /// Other taught poses.
    SetTaught {
        /// The kind of change.
        change: TaughtChange,
        /// All of them afterwards.
        poses: Vec<TaughtPose>,
    },
    /// Other names for exports; `null` for none.
    SetExportNames(serde_json::Value),
}

impl Document {
    /// The document after a change.
    ///
    /// # Errors
    /// [`EditError`] when the change does not fit the document, makes it something that cannot be read again, or
    /// leaves it as it is ([`EditError::NoChange`]). Whether a number was used by a capture that is gone is not known
    /// here; [`super::History`] knows.
    pub(crate) fn apply(&self, edit: &Edit) -> Result<Self, EditError> {
        let mut next = self.clone();
        match edit {
            Edit::AddCapture(record) => {
                record.check()?;
                if self.capture(record.id).is_some() || self.captures.iter().any(|c| c.image == record.image) {
                    return Err(EditError::UsedNumber(record.id));
                }
                self.check_robot(record)?;
                next.captures.push((**record).clone());
            }
            Edit::DeleteCaptures(ids) => {
                self.check_ids(ids)?;
                next.captures.retain(|capture| !ids.contains(&capture.id));
            }
            Edit::SetExcluded { ids, excluded } => next.change_captures(ids, |capture| capture.excluded = *excluded)?,
            Edit::SetRole { ids, role } => next.change_captures(ids, |capture| capture.role = *role)?,
            Edit::SetTarget(target) => next.meta.target = *target,
            Edit::SetMode(mode) => next.meta.mode = *mode,
            Edit::SetCamera(camera) => next.meta.camera = *camera,
            Edit::SetRobotAccuracy(mm) => next.meta.robot_accuracy_mm = *mm,
            Edit::SetTaught { change, poses } => {
                check_taught(poses)?;
                if !change.fits(&self.taught, poses) {
                    return Err(EditError::TaughtChange(change.clone()));
                }
                next.taught.clone_from(poses);
            }
            Edit::SetExportNames(names) => next.export_names = Some(names.clone()).filter(|names| !names.is_null()),
        }
        next.meta.check()?;
        if next == *self { Err(EditError::NoChange) } else { Ok(next) }
    }

    fn check_ids(&self, ids: &[CaptureId]) -> Result<(), EditError> {
        if ids.is_empty() {
            return Err(EditError::NoCapture);
        }
        ids.iter().find(|id| self.capture(**id).is_none()).map_or(Ok(()), |id| Err(EditError::UnknownCapture(*id)))
    }

    fn change_captures(&mut self, ids: &[CaptureId], change: impl Fn(&mut CaptureRecord)) -> Result<(), EditError> {
        self.check_ids(ids)?;
        self.captures.iter_mut().filter(|capture| ids.contains(&capture.id)).for_each(change);
        Ok(())
    }
}

impl TaughtChange {
    /// Whether the poses before and after show it.
    fn fits(&self, before: &[TaughtPose], after: &[TaughtPose]) -> bool {
        // Poses of other cells may have the same name.
        let count = |poses: &[TaughtPose], name: &String| poses.iter().filter(|pose| pose.name == *name).count();
        let (had, has) = (|name: &String| count(before, name), |name: &String| count(after, name));
        match self {
            Self::Add(name) => has(name) == had(name) + 1,
            Self::Remove(name) => has(name) + 1 == had(name),
            Self::Rename { from, to } => has(from) + 1 == had(from) && has(to) == had(to) + 1,
            Self::Reorder(name) => had(name) > 0 && has(name) == had(name),
            Self::Import(_) | Self::Replace => true,
        }
    }
}

impl fmt::Display for Edit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mode = |mode: &Mode| match mode {
            Mode::EyeInHand => "eye in hand",
            Mode::EyeToHand => "eye to hand",
        };
        match self {
            Self::AddCapture(record) => write!(f, "capture {}", record.id),
            Self::DeleteCaptures(ids) => write!(f, "delete {}", Captures(ids)),
            Self::SetExcluded { ids, excluded: true } => write!(f, "exclude {}", Captures(ids)),
            Self::SetExcluded { ids, excluded: false } => write!(f, "include {}", Captures(ids)),
            Self::SetRole { ids, role: Role::Calibration } => write!(f, "use {} for calibration", Captures(ids)),
            Self::SetRole { ids, role: Role::Verification } => write!(f, "use {} for verification", Captures(ids)),
            Self::SetTarget(_) => f.write_str("change of target"),
            Self::SetMode(to) => write!(f, "change to {}", mode(to)),
            Self::SetCamera(_) => f.write_str("change of camera"),
            Self::SetRobotAccuracy(_) => f.write_str("change of robot accuracy"),
            Self::SetTaught { change, .. } => change.fmt(f),
            Self::SetExportNames(_) => f.write_str("change of export names"),
        }
    }
}

impl fmt::Display for TaughtChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Add(name) => write!(f, "teach pose {name}"),
            Self::Remove(name) => write!(f, "remove pose {name}"),
            Self::Rename { from, to } => write!(f, "rename pose {from} to {to}"),
            Self::Reorder(name) => write!(f, "move pose {name} in the order"),
            Self::Import(1) => f.write_str("import 1 pose"),
            Self::Import(count) => write!(f, "import {count} poses"),
            Self::Replace => f.write_str("replace taught poses"),
        }
    }
}

handeye_wording::plain_values!(TaughtChange);

/// “capture 3” or “2 captures”.
struct Captures<'a>(&'a [CaptureId]);

impl fmt::Display for Captures<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [id] => write!(f, "capture {id}"),
            ids => write!(f, "{} captures", ids.len()),
        }
    }
}

#[cfg(test)]
#[path = "edit_tests.rs"]
mod tests;
