//! `session.json`: everything about a session that is not an image, for people and for other programs.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::capture_id::CaptureId;
use super::document::{CaptureRecord, Document};
use super::error::SessionProblem;
use handeye_files::json_text;
use handeye_wording::one_line;

/// Value of `format`.
pub const FORMAT: &str = "handeye-session";
/// The layout: a reader refuses another one.
pub const MAJOR_VERSION: u32 = 1;
/// Additions that an older reader may ignore. 1: `sequence`, `last_capture`, `taught`, `export_names`, and the fields of a
/// capture from `id` on. 2: `arm`. Without a separate number, as older readers do not read it: `joint_kinds`, for arms
/// with other joints than six revolute ones, `cell` of a taught pose, `tool_m` and `robot_accuracy_mm`. Older readers
/// refuse captures without `base_from_tip`, of a camera without a robot, and an `arm` that is a `chain`.
pub const MINOR_VERSION: u32 = 2;

/// The folder of images in a session.
pub(super) const IMAGES: &str = "images";

/// The document after some entry of the journal.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct SessionFile {
    /// The last entry of the journal that is in it; `None` in sessions that were written before there were journals.
    pub sequence: Option<u64>,
    /// The largest number of a capture so far, also of captures that are gone.
    #[serde(default = "CaptureId::none")]
    pub last_capture: CaptureId,
    #[serde(flatten)]
    pub document: Document,
}

/// The head is written for people and other programs; the reader checks format and version and leaves the
/// conventions, which are fixed.
#[derive(Serialize)]
struct Written<'a> {
    format: &'static str,
    version: String,
    conventions: Conventions,
    sequence: u64,
    last_capture: CaptureId,
    #[serde(flatten)]
    document: &'a Document,
}

#[derive(Serialize)]
struct Conventions {
    transforms: &'static str,
    units: &'static str,
    rotations: &'static str,
    covariances: &'static str,
    camera_axes: &'static str,
    pixels: &'static str,
    depth: &'static str,
}

const CONVENTIONS: Conventions = Conventions {
    transforms: "dst_from_src maps coordinates in src to coordinates in dst: p_dst = T * p_src",
    units: "metres, radians, seconds, pixels",
    rotations: "unit quaternions x y z w",
    covariances: "of [tx ty tz rx ry rz] in T * exp(delta)",
    camera_axes: "x right, y down, z forward",
    pixels: "(0, 0) is the centre of the top-left pixel",
    depth: "32-bit float TIFF, metres along the optical axis",
};

#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: String,
    #[serde(default)]
    version: String,
}

/// The text of `session.json` after an entry of the journal.
pub(super) fn to_json(document: &Document, sequence: u64, last_capture: CaptureId) -> Result<String, SessionProblem> {
    let version = format!("{MAJOR_VERSION}.{MINOR_VERSION}");
    let written = Written { format: FORMAT, version, conventions: CONVENTIONS, sequence, last_capture, document };
    json_text::pretty(&written).map_err(|e| SessionProblem::Json(one_line(&e)))
}

pub(super) fn from_json(text: &str) -> Result<SessionFile, SessionProblem> {
    let header: Header = serde_json::from_str(text).map_err(|e| SessionProblem::Json(one_line(&e)))?;
    if header.format != FORMAT {
        return Err(SessionProblem::Format(header.format.chars().take(40).collect()));
    }
    let major = header.version.split('.').next().and_then(|major| major.parse::<u32>().ok());
    if major != Some(MAJOR_VERSION) {
        let found = header.version.chars().take(40).collect();
        return Err(SessionProblem::Version { found, known: MAJOR_VERSION });
    }
    let mut file: SessionFile = serde_json::from_str(text).map_err(|e| SessionProblem::Json(one_line(&e)))?;
    number_captures(&mut file.document.captures);
    file.document.check()?;
    Ok(file)
}

/// Gives captures of version 1.0 their numbers: that of the image, or where it is taken or missing, one past all
/// others.
fn number_captures(captures: &mut [CaptureRecord]) {
    let mut used: BTreeSet<CaptureId> = captures.iter().map(|capture| capture.id).collect();
    let unnumbered = |capture: &&mut CaptureRecord| capture.id == CaptureId::none();
    for capture in captures.iter_mut().filter(unnumbered) {
        if let Some(id) = number_of(&capture.image).filter(|id| used.insert(*id)) {
            capture.id = id;
        }
    }
    for capture in captures.iter_mut().filter(unnumbered) {
        // A session without a free number keeps a capture without one, which the check refuses.
        let next = used.last().and_then(|last| last.0.checked_add(1)).unwrap_or(0);
        capture.id = CaptureId(next);
        used.insert(capture.id);
    }
}

/// The number in the name of an image, `images/0012.png`.
fn number_of(image: &str) -> Option<CaptureId> {
    let digits = image.strip_prefix(IMAGES)?.strip_prefix('/')?.strip_suffix(".png")?;
    digits.parse().ok().map(CaptureId).filter(|id| *id != CaptureId::none())
}
