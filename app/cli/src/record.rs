//! What commands without a window note for Rerun.

use std::sync::Arc;

use handeye_coppeliasim::LinkError;
use handeye_coppeliasim::cell::{Arm, CellInfo, Frame, GroundTruth};
use handeye_session::Store;
use image::RgbImage;

use handeye_workbench::model::{CellFacts, ColouredDepth, FrameImages, FrameInfo, LiveFrame};
use handeye_workbench::rerun_log::{Entry, Recorder};

/// The cell and what it publishes of itself.
pub fn cell(recorder: &Recorder, arm: &mut Arm, truth: &GroundTruth) -> Result<(), LinkError> {
    if recorder.is_on() {
        let kinematics = arm.kinematics()?.ok();
        recorder.note(Entry::Cell(Arc::new(CellFacts::new(arm.info(), kinematics.as_ref(), Some(truth)))));
    }
    Ok(())
}

/// A capture: the robot, the last of its images, and the session with it.
pub fn capture(recorder: &Recorder, last: LiveFrame, session: &Store) {
    if recorder.is_on() {
        note(recorder, last);
        document(recorder, session);
    }
}

/// The robot and the image.
pub fn image(recorder: &Recorder, info: &CellInfo, number: u64, frame: Frame) {
    // There is no clock of a window here.
    let received_s = frame.sim_time_s;
    note(recorder, live_frame(info, number, received_s, frame));
}

fn note(recorder: &Recorder, LiveFrame { info, images }: LiveFrame) {
    let FrameInfo { sim_time_s, base_from_tip, joints_rad, .. } = info;
    if let Some(base_from_tip) = base_from_tip {
        recorder.note(Entry::Robot { sim_time_s, base_from_tip, joints_rad });
    }
    recorder.note(Entry::Image { info: Box::new(info), images });
}

/// Images as the window has them, without colours of depths: those are the window's, and a viewer has its own.
pub fn live_frame(info: &CellInfo, number: u64, received_s: f64, frame: Frame) -> LiveFrame {
    let Frame { rgb, depth, sim_time_s, image_age_s, base_from_tip, joints, base_from_target_true } = frame;
    let depth_range_m = [info.depth_optics.near_m as f32, info.depth_optics.far_m as f32];
    let info = FrameInfo {
        number,
        sim_time_s,
        image_age_s,
        image_off_m: 0.0,
        received_s,
        rate_hz: 0.0,
        depth_range_m,
        far_plane_m: depth_range_m[1],
        base_from_tip: Some(base_from_tip),
        no_pose: None,
        joints_rad: joints,
        base_from_target_true,
        clocks: None,
    };
    let depth = Some(ColouredDepth { metres: depth, colours: RgbImage::default() });
    LiveFrame { info, images: Arc::new(FrameImages { rgb, depth }) }
}

/// The session as it is now.
pub fn document(recorder: &Recorder, session: &Store) {
    let folder = Some(session.folder().to_path_buf());
    recorder.note(Entry::Document { folder, document: Arc::clone(session.document()) });
}
