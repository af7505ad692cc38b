//! The ray of every pixel of one camera, and the image cut into tiles.

use std::ops::Range;

use handeye_geometry::camera::{Distortion, Intrinsics};
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

/// A block of pixels.
#[derive(Debug, Clone)]
pub(super) struct Tile {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
    /// Bounds of its rays; `None` where no pixel has one.
    pub rays: Option<Rays>,
    /// Whether every pixel has one.
    pub is_complete: bool,
}

/// All rays of a camera.
#[derive(Debug, Clone)]
pub(super) struct RayTable {
    pub width: usize,
    pub height: usize,
    pub tiles: Vec<Tile>,
    source: Source,
}

#[derive(Debug, Clone)]
enum Source {
    /// Without distortion it is faster to compute a ray than to load it.
    Pinhole { centre: [f64; 2], per_pixel: [f64; 2] },
    /// Row by row from the top.
    Table(Vec<Ray>),
}

impl RayTable {
    pub fn new(camera: &Intrinsics) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let usable = camera.validate().is_ok();
        let source = if usable && camera.distortion == Distortion::None {
            Source::Pinhole { centre: [camera.cx, camera.cy], per_pixel: [1.0 / camera.fx, 1.0 / camera.fy] }
        } else {
            let ray = |i: usize| {
                let px = Vector2::new((i % width) as f64, (i / width) as f64);
                if usable { ray_of(camera, &px).unwrap_or(Ray::NONE) } else { Ray::NONE }
            };
            Source::Table((0..width * height).map(ray).collect())
        };
        let mut table = Self { width, height, tiles: Vec::new(), source };
        for top in (0..height).step_by(TILE) {
            for left in (0..width).step_by(TILE) {
                let columns = left..(left + TILE).min(width);
                let rows = top..(top + TILE).min(height);
                let block: Vec<Ray> = rows
                    .clone()
                    .flat_map(|y| columns.clone().map(move |x| (x, y)))
                    .map(|(x, y)| table.ray(x, y))
                    .collect();
                let rays = bounds(block.iter());
                let is_complete = block.iter().all(Ray::exists);
                table.tiles.push(Tile { columns, rows, rays, is_complete });
            }
        }
        table
    }

    /// The ray of the pixel in column `x` and row `y`.
    pub fn ray(&self, x: usize, y: usize) -> Ray {
        match &self.source {
            Source::Pinhole { centre, per_pixel } => Ray {
                x: (x as f64 - centre[0]) * per_pixel[0],
                y: (y as f64 - centre[1]) * per_pixel[1],
                by_pixel: [per_pixel[0] as f32, 0.0, 0.0, per_pixel[1] as f32],
            },
            Source::Table(rays) => rays[y * self.width + x],
        }
    }
}

fn ray_of(camera: &Intrinsics, px: &Vector2<f64>) -> Option<Ray> {
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
