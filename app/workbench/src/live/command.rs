//! Commands and events of the live images.

use std::sync::Arc;

use handeye_geometry::depth::ColourMap;
use serde::{Deserialize, Serialize};

use crate::capture::state::LiveDetection;
use crate::live::state::{FrameImages, FrameInfo, ImagePoint, Overlays, Viewport};
use crate::shell::view::DepthScale;

/// What the user wants of the live images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Which depths the colour map covers.
    SetDepthScale(DepthScale),
    SetDepthColours(ColourMap),
    /// What is drawn over the images.
    SetOverlays(Overlays),
    /// Which part of the images is shown, and how large.
    SetViewport(Viewport),
    /// The pointer is over a pixel of the images, or over no pixel.
    PointAt(Option<ImagePoint>),
    /// Measure the point at a pixel of the image in base coordinates.
    Pick(Option<ImagePoint>),
}

/// What has happened to the live images.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "nearly all of them are frames")]
pub enum Event {
    /// New images.
    Frame {
        /// Their metadata.
        info: FrameInfo,
        /// Frames so far that were never shown.
        dropped: u64,
        /// The pixels, which a log does not keep.
        #[serde(skip)]
        images: Option<Arc<FrameImages>>,
    },
    /// The newest image was searched for the board.
    #[serde(skip)]
    Detection(Box<LiveDetection>),
}
