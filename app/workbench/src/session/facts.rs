//! What the bars show about the session. The only place where they read it.

use handeye_session::Edit;

use crate::model::Model;
use crate::text::Text;
use handeye_wording::text;

/// The session in a few words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SessionFacts {
    /// Its name; `None` before there is anything to keep.
    pub name: Option<String>,
    /// Whether all of it is on the disk.
    pub saved: bool,
    /// What undo would take back.
    pub undo: Option<Text>,
    /// What redo would make again.
    pub redo: Option<Text>,
}

/// What the model contains. What it shows of a session is on the disk already.
pub fn of(model: &Model) -> SessionFacts {
    let session = &model.session;
    SessionFacts {
        name: session.name(),
        saved: session.folder.is_some(),
        undo: session.undo.as_ref().map(name_of),
        redo: session.redo.as_ref().map(name_of),
    }
}

/// A change by its name.
fn name_of(edit: &Edit) -> Text {
    match edit {
        Edit::AddCapture(capture) => text!("capture {id}", id = capture.id),
        Edit::DeleteCaptures(ids) if ids.len() == 1 => text!("delete capture {id}", id = ids[0]),
        Edit::DeleteCaptures(ids) => text!("delete {count} captures", count = ids.len()),
        Edit::SetExcluded { ids, excluded: true } => {
            text!("exclude {count} {count|capture|captures}", count = ids.len())
        }
        Edit::SetExcluded { ids, excluded: false } => {
            text!("include {count} {count|capture|captures}", count = ids.len())
        }
        Edit::SetRole { ids, .. } => text!("purpose of {count} {count|capture|captures}", count = ids.len()),
        Edit::SetTarget(_) => text!("change of the target"),
        Edit::SetMode(_) => text!("change of where the camera sits"),
        Edit::SetCamera(_) => text!("change of what is known of the camera"),
        Edit::SetRobotAccuracy(_) => text!("change of the accuracy of the robot"),
        Edit::SetTaught { .. } => text!("change of the taught poses"),
        Edit::SetExportNames(_) => text!("change of the names in exports"),
    }
}
