//! What a pane of the camera shows.

use std::sync::Arc;

use handeye_geometry::depth::DepthSample;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_session::CaptureId;

use crate::live::textures::LiveTextures;
use handeye_workbench::model::{FrameImages, ImagePoint, Model};

/// The images that are shown.
#[derive(Clone, Copy)]
pub struct Shown<'a> {
    /// The pixels.
    pub images: &'a Arc<FrameImages>,
    /// The capture they were recorded with; `None` for the live ones.
    pub capture: Option<CaptureId>,
    /// Where the robot reported its tip at that time.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// The sensor's far plane \[m\].
    pub far_plane_m: f32,
    /// Depths \[m\] at the ends of the colours.
    pub depth_range_m: Option<[f32; 2]>,
}

impl<'a> Shown<'a> {
    /// The images of the model; `None` while there are none.
    pub fn of(model: &'a Model, textures: &LiveTextures) -> Option<Self> {
        let far_plane_m = model.frame.as_ref().map_or(f32::INFINITY, |frame| frame.info.far_plane_m);
        if let Some(review) = &model.review {
            return Some(Self {
                images: review.images.as_ref()?,
                capture: Some(review.id),
                base_from_tip: model.document().capture(review.id).and_then(|record| record.base_from_tip),
                far_plane_m,
                depth_range_m: textures.review_range_m(),
            });
        }
        let frame = model.frame.as_ref()?;
        Some(Self {
            images: &frame.images,
            capture: None,
            base_from_tip: frame.info.base_from_tip,
            far_plane_m,
            depth_range_m: frame.images.depth.is_some().then_some(frame.info.depth_range_m),
        })
    }

    /// Depth \[m\] at a pixel of the colour image; `None` without a surface.
    pub fn depth_m(&self, point: ImagePoint) -> Option<f32> {
        match self.images.depth_at(point, self.far_plane_m) {
            DepthSample::Metres(depth_m) => Some(depth_m),
            DepthSample::Far | DepthSample::Invalid => None,
        }
    }
}
