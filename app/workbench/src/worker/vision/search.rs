//! The board in live images.

use std::time::Instant;

use handeye_detect::{DetectOptions, detect_with};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use image::GrayImage;

use crate::capture::state::LiveDetection;
use crate::live::state::LiveFrame;

/// What is looked for, and the lens.
#[derive(Debug, Default)]
pub struct Search {
    pub target: Option<TargetSpec>,
    pub intrinsics: Option<Intrinsics>,
}

impl Search {
    /// Looks for the board with the quick search; `None` while there is no board to look for.
    pub fn live(
        &self,
        frame: &LiveFrame,
        grey: &GrayImage,
        dropped: u64,
        cancel: &CancelToken,
    ) -> Option<LiveDetection> {
        let target = self.target?;
        let began = Instant::now();
        let (corners, problem) = match detect_with(grey, &target, &DetectOptions::live().cancelled_by(cancel)) {
            Ok(corners) => (corners, None),
            Err(problem) => (None, Some(problem)),
        };
        let camera_from_target = corners.as_deref().zip(self.intrinsics).and_then(|(corners, intrinsics)| {
            planar_pose::camera_from_target(corners, &target, &intrinsics)
                .inspect_err(|error| tracing::debug!(%error, "the board has no pose"))
                .ok()
        });
        Some(LiveDetection {
            frame: frame.info.number,
            corners,
            camera_from_target,
            base_from_tip: frame.info.base_from_tip,
            joints_rad: frame.info.joints_rad,
            took_s: began.elapsed().as_secs_f64(),
            problem,
            dropped,
        })
    }
}
