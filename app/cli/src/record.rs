//! What commands without a window note for Rerun.

use std::sync::Arc;

use handeye_link::RawFrame;
use handeye_session::Store;
use image::RgbImage;

use handeye_record::Recorder;
use handeye_workbench::model::{CellFacts, ColouredDepth, FrameImages, FrameInfo, LiveFrame};
use handeye_workbench::recording::{Entry, Recording as _};

/// The cell and what it publishes about itself.
pub fn cell(recorder: &Recorder, facts: &CellFacts) {
    if recorder.is_on() {
        recorder.note(Entry::Cell(Arc::new(facts.clone())));
    }
}

/// A capture: the robot, the last of its images, and the session with it.
pub fn capture(recorder: &Recorder, last: LiveFrame, session: &Store) {
    if recorder.is_on() {
        image(recorder, last);
        document(recorder, session);
    }
}

/// The robot and the image.
pub fn image(recorder: &Recorder, LiveFrame { info, images }: LiveFrame) {
    let FrameInfo { sim_time_s, base_from_tip, joints_rad, .. } = info;
    if let Some(base_from_tip) = base_from_tip {
        recorder.note(Entry::Robot { sim_time_s, base_from_tip, joints_rad });
    }
    recorder.note(Entry::Image { info: Box::new(info), images });
}

/// Images as in the window, without colours of depths: a viewer has its own.
pub fn live_frame(raw: RawFrame, depth_range_m: [f32; 2], number: u64, received_s: f64) -> LiveFrame {
    let info = FrameInfo {
        number,
        sim_time_s: raw.sim_time_s,
        image_age_s: raw.image_age_s,
        image_off_m: 0.0,
        received_s,
        rate_hz: 0.0,
        depth_range_m,
        far_plane_m: depth_range_m[1],
        base_from_tip: raw.base_from_tip,
        no_pose: raw.no_pose.map(Box::new),
        joints_rad: raw.joints_rad,
        base_from_target_true: raw.base_from_target_true,
        clocks: raw.clocks,
    };
    let depth = raw.depth.map(|metres| ColouredDepth { metres, colours: RgbImage::default() });
    LiveFrame { info, images: Arc::new(FrameImages { rgb: raw.rgb, depth }) }
}

/// The session as it is now.
pub fn document(recorder: &Recorder, session: &Store) {
    let folder = Some(session.folder().to_path_buf());
    recorder.note(Entry::Document { folder, document: Arc::clone(session.document()) });
}
