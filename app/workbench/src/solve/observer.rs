//! The observer: looks for the board in captures that were opened from the disk, or again when the target has changed.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_detect::observe_image;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_session::{CaptureId, CaptureRecord};

use crate::capture::thumbnail;
use crate::messages::state::Severity;
use crate::observe;
use crate::session;
use crate::session::state::Observed;
use crate::text::Text;
use crate::worker::link::Outlet;
use handeye_wording::text;

/// Captures to search.
pub struct ObserveJob {
    /// The session.
    pub folder: PathBuf,
    /// What to look for.
    pub target: TargetSpec,
    /// Where.
    pub captures: Vec<CaptureRecord>,
}

/// Searches one capture after the other and reports each.
pub fn observe(job: &ObserveJob, cancel: &CancelToken, outlet: &Outlet) {
    for capture in &job.captures {
        if cancel.is_cancelled() {
            return;
        }
        let observed = look(job, capture, cancel);
        if cancel.is_cancelled() {
            return;
        }
        if let Err(why) = &observed {
            let text = text!("Capture {id} cannot be read: {why}", id = capture.id, why = why);
            outlet.notice(Severity::Error, text);
        }
        report(capture.id, job.target, observed.ok(), outlet);
    }
}

fn report(id: CaptureId, target: TargetSpec, observed: Option<Observed>, outlet: &Outlet) {
    outlet.report(session::Event::Observed { id, target, observed: observed.map(Arc::new) });
}

fn look(job: &ObserveJob, capture: &CaptureRecord, cancel: &CancelToken) -> Result<Observed, Text> {
    let path = job.folder.join(&capture.image);
    let rgb = handeye_images::load_rgb(&path)?;
    let seen = observe_image(&rgb, &job.target, cancel)?;
    let corners = seen.map(|seen| seen.corners);
    let depth = corners
        .as_ref()
        .and_then(|corners| observe::depth_plane(&job.folder, capture, rgb.dimensions(), corners, &job.target));
    Ok(Observed { corners, depth, image_size: rgb.dimensions(), thumbnail: Arc::new(thumbnail(&rgb)) })
}
