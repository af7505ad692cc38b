//! The mean of images and depths.

use image::RgbImage;

use handeye_geometry::depth::{DepthImage, DepthSample};

/// The mean of images of one size.
///
/// Colours are the mean of each channel, rounded to the nearest level (halves up). A depth is the mean of the valid
/// ones; a pixel that never had one keeps the sensor's value for no measurement, and is far away when it was far away
/// at least once.
#[derive(Debug, Clone)]
pub struct Average {
    frames: u32,
    size: (u32, u32),
    colours: Vec<u32>,
    /// `None` without depths.
    depth_size: Option<(u32, u32)>,
    depths: Vec<DepthSum>,
}

#[derive(Debug, Clone, Copy)]
struct DepthSum {
    metres: f64,
    count: u32,
    /// The value for no measurement, and whether it is the far plane.
    hole: f32,
    hole_is_far: bool,
}

impl Average {
    /// Begins with an image, and a depth where there is one; `far_plane_m` as in [`DepthImage::sample`].
    pub(crate) fn begin(rgb: &RgbImage, depth: Option<&DepthImage>, far_plane_m: f32) -> Self {
        let none = DepthSum { metres: 0.0, count: 0, hole: f32::NAN, hole_is_far: false };
        let mut average = Self {
            frames: 0,
            size: rgb.dimensions(),
            colours: vec![0; rgb.as_raw().len()],
            depth_size: depth.map(|depth| (depth.width, depth.height)),
            depths: vec![none; depth.map_or(0, |depth| depth.metres.len())],
        };
        average.add(rgb, depth, far_plane_m);
        average
    }

    /// Images in it.
    pub(crate) fn frames(&self) -> u32 {
        self.frames
    }

    /// Adds an image with its depth; `false`, and nothing happens, when their sizes are others or only some have a depth.
    pub(crate) fn add(&mut self, rgb: &RgbImage, depth: Option<&DepthImage>, far_plane_m: f32) -> bool {
        let depth_size = depth.map(|depth| (depth.width, depth.height));
        let samples = depth.map_or(&[][..], |depth| &depth.metres);
        if (rgb.dimensions(), depth_size, samples.len()) != (self.size, self.depth_size, self.depths.len()) {
            return false;
        }
        for (sum, &level) in self.colours.iter_mut().zip(rgb.as_raw()) {
            *sum = sum.saturating_add(u32::from(level));
        }
        for (sum, &metres) in self.depths.iter_mut().zip(samples) {
            match DepthSample::of(metres, far_plane_m) {
                DepthSample::Metres(metres) => {
                    sum.metres += f64::from(metres);
                    sum.count += 1;
                }
                DepthSample::Far => (sum.hole, sum.hole_is_far) = (metres, true),
                DepthSample::Invalid if !sum.hole_is_far => sum.hole = metres,
                DepthSample::Invalid => {}
            }
        }
        self.frames += 1;
        true
    }

    /// The mean.
    pub(crate) fn finish(&self) -> (RgbImage, Option<DepthImage>) {
        let frames = self.frames.max(1);
        let levels = self.colours.iter().map(|sum| (sum.saturating_add(frames / 2) / frames) as u8).collect();
        // The length is that of an image of this size; otherwise the image is empty.
        let rgb = RgbImage::from_raw(self.size.0, self.size.1, levels).unwrap_or_default();
        let mean = |sum: &DepthSum| {
            if sum.count > 0 { (sum.metres / f64::from(sum.count)) as f32 } else { sum.hole }
        };
        let metres = || self.depths.iter().map(mean).collect();
        (rgb, self.depth_size.map(|(width, height)| DepthImage { width, height, metres: metres() }))
    }
}
