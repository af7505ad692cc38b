//! How the images are looked at, and points that are measured in them.

use handeye_geometry::depth::{ColourMap, DepthSample};
use nalgebra::Vector2;

use super::command::{Command, Event};
use crate::app::Numbers;
use crate::by_hand::update::look_by_hand;
use crate::connect::update::ask_camera;
use crate::model::{DepthScale, ImagePoint, LiveFrame, Model, PickedPoint};
use crate::text::Text;
use crate::worker::{CameraTask, Workers};
use handeye_wording::text;

/// Does what is wanted of the live images.
pub(crate) fn apply(model: &mut Model, workers: &Workers, command: Command) {
    match command {
        Command::SetDepthScale(scale) => set_depth_scale(model, workers, scale),
        Command::SetDepthColours(colours) => set_depth_colours(model, workers, colours),
        Command::SetOverlays(overlays) => model.view.overlays = overlays,
        Command::SetViewport(viewport) => model.viewport = viewport,
        Command::PointAt(point) => model.cursor = point,
        Command::Pick(pixel) => pick(model, pixel),
    }
}

/// Takes in an image, or what was seen in one.
pub(crate) fn absorb(model: &mut Model, workers: &Workers, numbers: &mut Numbers, event: Event) {
    match event {
        Event::Frame { info, dropped, images } => {
            model.dropped_frames = dropped;
            // A frame out of a log has no pixels, and nothing to show.
            if let Some(images) = images {
                model.frame = Some(LiveFrame { info, images });
            }
        }
        Event::Detection(detection) => {
            if detection.corners.is_some() {
                model.board_seen_s = Some(model.now_s);
            }
            model.detection = Some(*detection);
            look_by_hand(model, workers, numbers);
        }
    }
}

fn set_depth_scale(model: &mut Model, workers: &Workers, scale: DepthScale) {
    if ask_camera(model, workers, CameraTask::SetDepthScale(scale), text!("The depth range was not changed")) {
        model.view.depth_scale = scale;
    }
}

fn set_depth_colours(model: &mut Model, workers: &Workers, colours: ColourMap) {
    if ask_camera(model, workers, CameraTask::SetDepthColours(colours), text!("The colours were not changed")) {
        model.view.depth_colours = colours;
    }
}

/// Measures the point at a pixel of the live image.
fn pick(model: &mut Model, pixel: Option<ImagePoint>) {
    model.picked = pixel.and_then(|pixel| measure(model, pixel));
}

fn measure(model: &Model, pixel: ImagePoint) -> Option<PickedPoint> {
    let frame = model.frame.as_ref()?;
    let px = Vector2::new(f64::from(pixel.column), f64::from(pixel.row));
    let Some(calibrated) = model.calibrated() else {
        let why = || Err(text!("there is no calibration yet"));
        return Some(PickedPoint { pixel, from_depth: why(), from_board: why() });
    };
    let words = Text::from;
    let from_depth = match frame.images.depth_at(pixel, frame.info.far_plane_m) {
        DepthSample::Metres(depth_m) => match &frame.info.base_from_tip {
            Some(base_from_tip) => calibrated.point_at_depth(base_from_tip, &px, f64::from(depth_m)).map_err(words),
            None => Err(text!("the pose of the robot is not known")),
        },
        DepthSample::Far | DepthSample::Invalid => Err(text!("there is no depth at this pixel")),
    };
    // The board and the tip of the same image: the newest frame may be a later one. The board is as large and as
    // bent as the calibration found it.
    let seen = model.detection.as_ref().and_then(|it| {
        let board = calibrated.board(&model.document().meta.target);
        let seen = calibrated.seen(&board, (it.corners.as_ref()?, None), &it.camera_from_target?)?;
        Some((seen, it.base_from_tip?))
    });
    let from_board = match seen {
        Some((camera_from_target, base_from_tip)) => {
            calibrated.point_on_board(&base_from_tip, &px, &camera_from_target).map_err(words)
        }
        None => Err(text!("the board is not in the image")),
    };
    Some(PickedPoint { pixel, from_depth, from_board })
}
