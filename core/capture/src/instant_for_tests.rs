//! One instant with its own images.

use image::{GrayImage, Rgb, RgbImage};

use crate::Shot;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Tip};

/// One instant with its own images.
#[derive(Debug, Clone)]
pub struct Instant {
    pub number: u64,
    pub sim_time_s: f64,
    pub received_s: f64,
    pub base_from_tip: Pose<Base, Tip>,
    pub joints_rad: Vec<f64>,
    pub grey: GrayImage,
    pub rgb: RgbImage,
    pub depth: Option<DepthImage>,
}

impl Instant {
    pub fn new(number: u64, joints_rad: &[f64], grey: GrayImage) -> Self {
        let (width, height) = grey.dimensions();
        let rgb = RgbImage::from_fn(width, height, |u, v| Rgb([grey.get_pixel(u, v).0[0]; 3]));
        let depth = Some(DepthImage { width: 2, height: 1, metres: vec![0.5, f32::NAN] });
        let sim_time_s = number as f64 * 0.05;
        Self {
            number,
            sim_time_s,
            received_s: 100.0 + sim_time_s,
            base_from_tip: Pose::identity(),
            joints_rad: joints_rad.to_vec(),
            grey,
            rgb,
            depth,
        }
    }

    pub fn shot(&self) -> Shot<'_> {
        Shot {
            number: self.number,
            sim_time_s: self.sim_time_s,
            received_s: self.received_s,
            base_from_tip: self.base_from_tip,
            joints_rad: &self.joints_rad,
            rgb: &self.rgb,
            grey: &self.grey,
            depth: self.depth.as_ref(),
            far_plane_m: 3.5,
        }
    }
}
