//! How the images are looked at, and points measured in them.

use handeye_estimate::verify::{Predictor, TipAt};
use handeye_geometry::depth::{ColourMap, DepthSample};
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::Vector2;

use super::command::{Command, Event};
use crate::app::context::Numbers;
use crate::by_hand::update::look_by_hand;
use crate::connect::update::ask_camera;
use crate::live::state::{ImagePoint, LiveFrame, MeasuredTwice, PickedPoint};
use crate::live::worker::CameraTask;
use crate::model::Model;
use crate::motion::correction::corrected;
use crate::shell::view::DepthScale;
use crate::text::Text;
use crate::worker::threads::Workers;
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
            // A frame from a log has no pixels, and nothing to show.
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
    let Some(calibrated) = model.calibrated() else {
        let why = || Err(text!("there is no calibration yet"));
        return Some(PickedPoint {
            pixel,
            as_reported: MeasuredTwice { from_depth: why(), from_board: why() },
            corrected: None,
        });
    };
    let as_reported = measured(model, frame, pixel, calibrated, |reported, _| Some(reported?.into()));
    let corrected = corrected(model).map(|(_, corrected)| {
        measured(model, frame, pixel, &corrected.calibrated, |_, joints_rad| corrected.arm.tip_at(joints_rad).ok())
    });
    Some(PickedPoint { pixel, as_reported, corrected })
}

/// With a calibration and the tip that goes with it, for a pose of the robot and its joints.
fn measured(
    model: &Model,
    frame: &LiveFrame,
    pixel: ImagePoint,
    calibrated: &Predictor,
    tip: impl Fn(Option<&Pose<Base, Tip>>, &[f64]) -> Option<TipAt>,
) -> MeasuredTwice {
    let px = Vector2::new(f64::from(pixel.column), f64::from(pixel.row));
    let words = Text::from;
    let info = &frame.info;
    let from_depth = match frame.images.depth_at(pixel, info.far_plane_m) {
        DepthSample::Metres(depth_m) => match tip(info.base_from_tip.as_ref(), &info.joints_rad) {
            Some(tip) => calibrated.point_at_depth(tip, &px, f64::from(depth_m)).map_err(words),
            None => Err(text!("the pose of the robot is not known")),
        },
        DepthSample::Far | DepthSample::Invalid => Err(text!("there is no depth at this pixel")),
    };
    // The board and the tip of the same image: the newest frame may be a later one. The board has the size and bend
    // that the calibration found.
    let seen = model.detection.as_ref().and_then(|it| {
        let board = calibrated.board(&model.document().meta.target);
        let seen = calibrated.seen(&board, (it.corners.as_ref()?, None), &it.camera_from_target?)?;
        Some((seen, tip(it.base_from_tip.as_ref(), &it.joints_rad)?))
    });
    let from_board = match seen {
        Some((camera_from_target, tip)) => calibrated.point_on_board(tip, &px, &camera_from_target).map_err(words),
        None => Err(text!("the board is not in the image")),
    };
    MeasuredTwice { from_depth, from_board }
}

#[cfg(test)]
mod tests {
    use handeye_estimate::handeye::HandEye;

    use super::*;
    use crate::testing::sample;

    #[test]
    fn a_point_is_measured_from_where_the_tip_is_reported_and_from_where_it_really_is() {
        let model = sample::with_errors_of_the_arm();
        let corrected = corrected(&model).expect("the arm that stands here").1;
        let info = &model.frame.as_ref().expect("an image").info;
        let pixel = ImagePoint { column: 320, row: 240 };
        let picked = measure(&model, pixel).expect("an image");
        let by_arm = picked.corrected.expect("the errors of the arm are known");
        let tips = [info.base_from_tip.expect("reported"), corrected.arm.actual(&info.joints_rad).expect("six joints")];
        let twice = [&picked.as_reported, &by_arm];
        let calibrations = [model.calibrated().expect("solved"), &corrected.calibrated];
        for ((tip, measured), calibrated) in tips.iter().zip(twice).zip(calibrations) {
            let HandEye::EyeInHand { tip_from_camera, .. } = calibrated.hand_eye else { panic!("on the tip") };
            for point in [&measured.from_depth, &measured.from_board] {
                let point = point.as_ref().expect("measured");
                let expected = tip.isometry() * tip_from_camera.isometry() * point.in_camera.point();
                assert!((point.in_base.point() - expected).norm() < 1e-12);
            }
        }
        let [reported, really] = twice.map(|measured| *measured.from_depth.as_ref().expect("measured"));
        assert!((reported.in_base.point() - really.in_base.point()).norm() > 1e-4);
        // The uncertainty of the arm is added to that of the camera.
        let [reported, really] = [reported, really].map(|point| point.covariance_in_base.expect("stated").trace());
        assert!(really > reported, "{really} {reported}");
    }
}
