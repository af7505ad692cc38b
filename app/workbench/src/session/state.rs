//! The session that is open, and what was seen in its captures.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::Corners;
use handeye_session::{CaptureId, Document, Edit};
use image::RgbImage;
use serde::{Deserialize, Serialize};

use crate::capture::state::CapturePurpose;
use crate::guided::state::GuidedProgress;
use crate::live::state::FrameImages;
use crate::text::Text;

/// A document as it is on the disk, and what undo and redo would do.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SessionState {
    /// The folder; `None` before there is anything to keep.
    pub folder: Option<PathBuf>,
    /// Mode, target, captures, taught poses.
    pub document: Arc<Document>,
    /// The change that undo takes back.
    pub undo: Option<Edit>,
    /// The change that redo makes again.
    pub redo: Option<Edit>,
}

impl SessionState {
    /// Name for display: that of its folder.
    pub fn name(&self) -> Option<String> {
        Some(self.folder.as_ref()?.file_name()?.to_string_lossy().into_owned())
    }
}

/// A session that was open before.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecentSession {
    /// Where it is.
    pub folder: PathBuf,
    /// How many captures it had when it was last open.
    pub captures: usize,
}

/// What is in the image of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Observed {
    /// The corners; `None` when the board is not found.
    pub corners: Option<Corners>,
    /// The plane of the board by the depths of the image; `None` where none were measured.
    pub depth: Option<DepthPlane>,
    /// Width and height of the image in pixels.
    pub image_size: (u32, u32),
    /// A small copy of the image.
    pub thumbnail: Arc<RgbImage>,
}

/// The capture whose image is shown instead of the live one.
#[derive(Debug, Clone, PartialEq)]
pub struct Review {
    pub id: CaptureId,
    /// Its images, once they are read from the disk.
    pub images: Option<Arc<FrameImages>>,
}

/// The outcome of one pose of a sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum StopOutcome {
    /// The arm was there, and a capture was taken if one was requested.
    Done,
    /// It was skipped, and this is why.
    Skipped(Text),
}

/// A sequence of the taught poses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseSequence {
    /// The poses in their order.
    pub names: Vec<String>,
    /// The joints at each \[rad\], for planned poses; `None` for taught ones, which the session has.
    pub planned: Option<Vec<JointValues>>,
    /// What is captured at each; `None` only moves.
    pub purpose: Option<CapturePurpose>,
    /// How the poses up to now went; the next one is under way.
    pub outcomes: Vec<StopOutcome>,
    /// When it began.
    pub began_s: f64,
    /// What chooses its poses along the way; `None` where they are known from the beginning.
    #[serde(skip)]
    pub guided: Option<Box<GuidedProgress>>,
}

impl PoseSequence {
    /// The pose that is under way.
    pub fn current(&self) -> Option<&str> {
        self.names.get(self.outcomes.len()).map(String::as_str)
    }

    /// Why the previous pose was skipped, if it was.
    pub fn last_skipped(&self) -> Option<&Text> {
        match self.outcomes.last()? {
            StopOutcome::Skipped(why) => Some(why),
            StopOutcome::Done => None,
        }
    }

    /// Whether there is something to continue after an interruption: poses that are left, or, where they are chosen along the
    /// way, the choice of the next one or of one to check the answer at.
    pub fn can_continue(&self) -> bool {
        self.guided.as_deref().map_or(self.current().is_some(), |guided| !guided.is_over)
    }

    /// Whether it visits poses that were planned for verification.
    pub fn is_planned(&self) -> bool {
        self.planned.is_some() && self.guided.is_none()
    }
}

/// An entry of a folder, for the dialogs that open and save.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FolderEntry {
    pub name: String,
    pub kind: FolderKind,
}

/// Kind of an entry of a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum FolderKind {
    Session,
    /// Recorded images and poses.
    Dataset,
    /// Images without a description of a data set: a recording to look at.
    Images,
    /// Something else.
    Plain,
    /// A file of taught poses, not a folder.
    File,
}

/// The content of a folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FolderListing {
    pub folder: PathBuf,
    /// Its folders and files of poses by name; or why it cannot be read.
    pub entries: Result<Vec<FolderEntry>, String>,
}
