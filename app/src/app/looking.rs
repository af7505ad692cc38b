//! How the pictures are looked at, and points that are measured in them.

use handeye_core::depth::{ColourMap, DepthSample};
use handeye_core::verify;
use nalgebra::Vector2;

use super::App;
use crate::model::{DepthScale, Dialog, ImagePoint, MeasuredPoint, PickedPoint};
use crate::text;
use crate::worker::CameraTask;

impl App {
    pub(super) fn set_depth_scale(&mut self, scale: DepthScale) {
        if self.ask_camera(CameraTask::SetDepthScale(scale), text!("The depth range was not changed")) {
            self.model.view.depth_scale = scale;
        }
    }

    pub(super) fn set_depth_colours(&mut self, colours: ColourMap) {
        if self.ask_camera(CameraTask::SetDepthColours(colours), text!("The colours were not changed")) {
            self.model.view.depth_colours = colours;
        }
    }

    pub(super) fn set_dialog(&mut self, dialog: Option<Dialog>) {
        self.model.dialog = dialog;
        if matches!(
            self.model.dialog,
            Some(
                Dialog::Open
                    | Dialog::SaveAs
                    | Dialog::New
                    | Dialog::ImportPoses
                    | Dialog::ExportPoses
                    | Dialog::ExportFolder
            )
        ) {
            let folder = self.model.folder.as_ref().map_or_else(|| self.workers.sessions(), |it| it.folder.clone());
            self.list_folder(folder);
        }
    }

    /// Measures the point at a pixel of the live picture.
    pub(super) fn pick(&mut self, pixel: Option<ImagePoint>) {
        self.model.picked = pixel.and_then(|pixel| self.measure(pixel));
    }

    fn measure(&self, pixel: ImagePoint) -> Option<PickedPoint> {
        let frame = self.model.frame.as_ref()?;
        let intrinsics = self.model.intrinsics()?;
        let px = Vector2::new(f64::from(pixel.column), f64::from(pixel.row));
        let calibration = self.model.solve.solved.as_ref().map(|solved| &solved.calibration);
        let base_from_tip = &frame.info.base_from_tip;
        let depth_m = match frame.images.depth_at(pixel, frame.info.far_plane_m) {
            DepthSample::Metres(depth_m) => Some(f64::from(depth_m)),
            DepthSample::Far | DepthSample::Invalid => None,
        };
        let measured = |point: verify::MeasuredPoint| MeasuredPoint {
            in_camera_m: point.in_camera.coords(),
            in_base_m: point.in_base.map(|point| point.coords()),
            sigma_m: point.sigma_m,
        };
        let from_depth = depth_m
            .and_then(|depth_m| verify::point_from_depth(&px, depth_m, &intrinsics, calibration, base_from_tip).ok());
        let seen = self.model.detection.as_ref().and_then(|detection| detection.camera_from_target);
        let from_board = seen.and_then(|camera_from_target| {
            verify::point_on_target(&px, &camera_from_target, &intrinsics, calibration, base_from_tip).ok()
        });
        Some(PickedPoint { pixel, from_depth: from_depth.map(measured), from_board: from_board.map(measured) })
    }
}
