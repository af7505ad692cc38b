//! How the images are looked at, and points that are measured in them.

use handeye_geometry::depth::{ColourMap, DepthSample};
use nalgebra::Vector2;

use crate::app::App;
use crate::model::{DepthScale, Dialog, ImagePoint, PickedPoint};
use crate::text::Text;
use crate::worker::CameraTask;
use handeye_wording::text;

impl App {
    pub(crate) fn set_depth_scale(&mut self, scale: DepthScale) {
        if self.ask_camera(CameraTask::SetDepthScale(scale), text!("The depth range was not changed")) {
            self.model.view.depth_scale = scale;
        }
    }

    pub(crate) fn set_depth_colours(&mut self, colours: ColourMap) {
        if self.ask_camera(CameraTask::SetDepthColours(colours), text!("The colours were not changed")) {
            self.model.view.depth_colours = colours;
        }
    }

    pub(crate) fn set_dialog(&mut self, dialog: Option<Dialog>) {
        self.model.dialog = dialog;
        if dialog != Some(Dialog::Import) {
            self.forget_import();
        }
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
            let folder =
                self.model.folder.as_ref().map_or_else(|| self.desk.sessions().to_path_buf(), |it| it.folder.clone());
            self.list_folder(folder);
        }
    }

    /// Measures the point at a pixel of the live image.
    pub(crate) fn pick(&mut self, pixel: Option<ImagePoint>) {
        self.model.picked = pixel.and_then(|pixel| self.measure(pixel));
    }

    fn measure(&self, pixel: ImagePoint) -> Option<PickedPoint> {
        let frame = self.model.frame.as_ref()?;
        let px = Vector2::new(f64::from(pixel.column), f64::from(pixel.row));
        let Some(calibrated) = self.model.calibrated() else {
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
        let seen = self.model.detection.as_ref().and_then(|it| {
            let board = calibrated.board(&self.model.document().meta.target);
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
}
