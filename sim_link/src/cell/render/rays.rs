//! The ray of every pixel of one camera, and the picture cut into tiles.

use handeye_core::camera::{Distortion, Intrinsics};
use nalgebra::{Point3, Vector2};

use super::shapes::{Rays, Vec3};

/// Side of a tile in pixels.
const TILE: usize = 16;
/// Rays steeper than this to the axis are left out: no lens of a sensor with flat clipping planes sees along them.
const MAX_SLOPE: f64 = 1e4;

/// The direction `(x, y, 1)` that a pixel sees.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub x: f64,
    pub y: f64,
    /// Derivatives by the pixel: x by u, x by v, y by u, y by v.
    pub by_pixel: [f32; 4],
}

impl Ray {
    /// A pixel that the lens model does not reach.
    const NONE: Self = Self { x: f64::NAN, y: f64::NAN, by_pixel: [0.0; 4] };

    pub fn exists(&self) -> bool {
        !self.x.is_nan()
    }

    pub fn direction(&self) -> Vec3 {
        [self.x, self.y, 1.0]
    }

    /// The ray `du` pixels to the right and `dv` down.
    pub fn beside(&self, du: f64, dv: f64) -> Self {
        let [x_by_u, x_by_v, y_by_u, y_by_v] = self.by_pixel.map(f64::from);
        Self { x: self.x + x_by_u * du + x_by_v * dv, y: self.y + y_by_u * du + y_by_v * dv, ..*self }
    }
}

/// A block of pixels with the bounds of its rays; `None` where no pixel has one.
#[derive(Debug, Clone)]
pub(super) struct Tile {
    pub columns: std::ops::Range<usize>,
    pub rows: std::ops::Range<usize>,
    pub rays: Option<Rays>,
}

/// All rays of a camera, row by row from the top.
#[derive(Debug, Clone)]
pub(super) struct RayTable {
    pub width: usize,
    pub height: usize,
    pub rays: Vec<Ray>,
    pub tiles: Vec<Tile>,
}

impl RayTable {
    pub fn new(camera: &Intrinsics) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let usable = camera.validate().is_ok();
        let rays: Vec<Ray> = (0..width * height)
            .map(|i| {
                let px = Vector2::new((i % width) as f64, (i / width) as f64);
                if usable { ray_of(camera, &px).unwrap_or(Ray::NONE) } else { Ray::NONE }
            })
            .collect();
        let mut tiles = Vec::new();
        for top in (0..height).step_by(TILE) {
            for left in (0..width).step_by(TILE) {
                let columns = left..(left + TILE).min(width);
                let rows = top..(top + TILE).min(height);
                let block = rows.clone().flat_map(|y| &rays[y * width + columns.start..y * width + columns.end]);
                tiles.push(Tile { rays: bounds(block), columns, rows });
            }
        }
        Self { width, height, rays, tiles }
    }
}

fn ray_of(camera: &Intrinsics, px: &Vector2<f64>) -> Option<Ray> {
    if camera.distortion == Distortion::None {
        let by_pixel = [1.0 / camera.fx, 0.0, 0.0, 1.0 / camera.fy].map(|d| d as f32);
        return Some(Ray { x: (px.x - camera.cx) / camera.fx, y: (px.y - camera.cy) / camera.fy, by_pixel });
    }
    let ray = camera.unproject(px).ok()?;
    let (x, y) = (ray.x / ray.z, ray.y / ray.z);
    if ray.z <= 0.0 || x.hypot(y) > MAX_SLOPE {
        return None;
    }
    let projection = camera.project_with_jacobians(&Point3::new(x, y, 1.0)).ok()?;
    let by_pixel = projection.px_by_point.fixed_columns::<2>(0).try_inverse()?;
    let by_pixel = [by_pixel.m11, by_pixel.m12, by_pixel.m21, by_pixel.m22];
    by_pixel.iter().all(|d| d.is_finite()).then(|| Ray { x, y, by_pixel: by_pixel.map(|d| d as f32) })
}

/// Bounds of the footprints of some pixels.
fn bounds<'a>(rays: impl Iterator<Item = &'a Ray>) -> Option<Rays> {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for ray in rays.filter(|ray| ray.exists()) {
        for (u, v) in [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)] {
            let corner = ray.beside(u, v);
            low = [low[0].min(corner.x), low[1].min(corner.y)];
            high = [high[0].max(corner.x), high[1].max(corner.y)];
        }
    }
    (low[0] <= high[0]).then(|| Rays::around(low, high))
}
