//! Commands and events of the session.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_dataset::CameraInput;
use handeye_estimate::handeye::Mode;
use handeye_geometry::targets::TargetSpec;
use handeye_session::CaptureId;
use serde::{Deserialize, Serialize};

use crate::capture::state::CapturePurpose;
use crate::live::state::FrameImages;
use crate::session::state::{FolderListing, Observed, RecentSession, SessionState};
use crate::text::Text;

/// What the user wants of the session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Start a session, in a folder or under the folder of sessions.
    New(Option<PathBuf>),
    /// Continue a session, or copy a data set into one.
    Open(PathBuf),
    /// Copy the recorded sample that comes with the program into a session.
    OpenSample,
    /// Continue with a complete copy in another folder.
    SaveAs(PathBuf),
    /// Read the folders in a folder.
    ListFolder(PathBuf),
    /// Show a folder in the file manager of the system.
    OpenFolder(PathBuf),
    /// Undo the last change of the session.
    Undo,
    /// Redo the undone change.
    Redo,
    /// Which captures are selected; the last one's image is shown.
    Select(Vec<CaptureId>),
    /// Show the live image again.
    BackToLive,
    /// Exclude captures from the fit, or include them again.
    SetExcluded {
        ids: Vec<CaptureId>,
        /// Out.
        excluded: bool,
    },
    /// Captures enter the fit or verify it.
    SetPurpose {
        ids: Vec<CaptureId>,
        /// What they are for.
        purpose: CapturePurpose,
    },
    /// Delete captures; undo brings them back.
    Delete(Vec<CaptureId>),
    /// The camera is mounted elsewhere.
    SetMode(Mode),
    /// What is known of the camera.
    SetCamera(Option<CameraInput>),
    /// The robot is known to have this accuracy, millimetres RMS; `None` where that is not known.
    SetRobotAccuracy(Option<f64>),
}

/// What has happened to the session.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The session is now like this, on the disk.
    Document(Box<SessionState>),
    /// Another session is open.
    Opened {
        /// Whether its folder has files of exports that are newer than its last change.
        exported: bool,
    },
    /// A session could not be started, opened or copied.
    Failed { why: Text },
    /// A capture was searched.
    Observed {
        id: CaptureId,
        /// What was looked for.
        target: TargetSpec,
        /// What was seen; `None` when the image cannot be read.
        #[serde(skip)]
        observed: Option<Arc<Observed>>,
    },
    /// The images of a capture were read.
    Review {
        id: CaptureId,
        /// The pixels, which a log does not keep.
        #[serde(skip)]
        images: Option<Arc<FrameImages>>,
    },
    /// Folders were read.
    Folder(FolderListing),
    /// Sessions that were open before.
    Recent(Vec<RecentSession>),
}
