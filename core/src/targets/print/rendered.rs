//! Images of a drawing through a camera, for tests that need the truth.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Rotation3, Translation3, Unit, UnitQuaternion, Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::Drawing;
use crate::detect::rendered::blur;
use crate::geometry::camera::Intrinsics;
use crate::targets::TargetSpec;

/// Levels of ink, paper, and what is around the paper.
const INK: f64 = 45.0;
const PAPER: f64 = 205.0;
const TABLE: f64 = 120.0;
/// Samples along a side of a pixel that an outline crosses: 1/100 of a pixel's contrast at the worst.
const SAMPLES: usize = 10;
/// Buckets of shapes along a side.
const BUCKETS: usize = 96;

/// An image to be taken of a target.
pub(crate) struct Photo {
    pub camera: Intrinsics,
    pub camera_from_target: Isometry3<f64>,
    /// Standard deviation of the lens blur in pixels, on top of the pixel's own area.
    pub blur_px: f64,
    /// Standard deviation of the noise in grey levels.
    pub noise: f64,
    /// Left, top, right and bottom of something in front of the target \[px\].
    pub covered: Option<[u32; 4]>,
    target: TargetSpec,
    drawing: Drawing,
    buckets: Buckets,
}

impl Photo {
    /// The target's middle is `distance_m` in front of the camera and imaged `offset_px` from the middle of the image;
    /// the target is tilted by `tilt` about an axis at `azimuth` in the image, and turned by `roll`.
    pub fn new(
        target: TargetSpec,
        camera: Intrinsics,
        distance_m: f64,
        [tilt, azimuth, roll]: [f64; 3],
        offset_px: Vector2<f64>,
    ) -> Self {
        let axis = Unit::new_normalize(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0));
        let rotation = Rotation3::from_axis_angle(&axis, tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), roll);
        let at = Vector3::new(offset_px.x / camera.fx, offset_px.y / camera.fy, 1.0) * distance_m;
        let camera_from_target =
            Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&rotation))
                * Translation3::from(-target.centre().coords);
        let drawing = Drawing::of(&target).expect("drawn");
        let buckets = Buckets::of(&drawing);
        Self { camera, camera_from_target, blur_px: 0.7, noise: 1.0, covered: None, target, drawing, buckets }
    }

    /// Where all points are, in sight or not.
    pub fn truth(&self) -> Vec<Vector2<f64>> {
        let points = self.target.points().into_iter();
        points.map(|p| self.camera.project(&(self.camera_from_target * p)).expect("in front")).collect()
    }

    pub fn render(&self, seed: u64) -> GrayImage {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let eye = Eye::of(self);
        // Levels at the corners of pixels, shared by their neighbours.
        let across = width + 1;
        let corner = |i: usize| self.level(&eye, (i % across) as f64 - 0.5, (i / across) as f64 - 0.5);
        let corners: Vec<f64> = (0..across * (height + 1)).map(corner).collect();
        let mut levels = vec![TABLE; width * height];
        for v in 0..height {
            for u in 0..width {
                let first = v * across + u;
                let centre = self.level(&eye, u as f64, v as f64);
                let around = [corners[first], corners[first + 1], corners[first + across], corners[first + across + 1]];
                let even = around.iter().all(|level| *level == centre);
                levels[v * width + u] = if even { centre } else { self.mean_level(&eye, u as f64, v as f64) };
            }
        }
        if let Some([left, top, right, bottom]) = self.covered {
            for v in top..bottom {
                for u in left..right {
                    levels[v as usize * width + u as usize] = TABLE;
                }
            }
        }
        blur(&mut levels, width, height, self.blur_px);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise).expect("a deviation");
        GrayImage::from_fn(self.camera.width, self.camera.height, |u, v| {
            let level = levels[v as usize * width + u as usize] + noise.sample(&mut rng);
            Luma([level.round().clamp(0.0, 255.0) as u8])
        })
    }

    fn mean_level(&self, eye: &Eye, u: f64, v: f64) -> f64 {
        let place = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
        let all = (0..SAMPLES * SAMPLES).map(|i| self.level(eye, u + place(i % SAMPLES), v + place(i / SAMPLES)));
        all.sum::<f64>() / (SAMPLES * SAMPLES) as f64
    }

    fn level(&self, eye: &Eye, u: f64, v: f64) -> f64 {
        let Some(ray) = self.camera.unproject(&Vector2::new(u, v)).ok() else { return TABLE };
        let towards = eye.target_from_camera * ray.into_inner();
        let p = (eye.at - towards * (eye.at.z / towards.z)).xy();
        let (low, high, quiet) = (self.buckets.low, self.buckets.high, self.drawing.quiet_m);
        let on_paper = p.x > low.x - quiet && p.y > low.y - quiet && p.x < high.x + quiet && p.y < high.y + quiet;
        if !on_paper {
            return TABLE;
        }
        let black = self.buckets.at(&p).iter().any(|&i| self.drawing.shapes[i].contains(&p));
        if black { INK } else { PAPER }
    }
}

/// The camera in the frame of the target.
struct Eye {
    target_from_camera: Rotation3<f64>,
    at: Vector3<f64>,
}

impl Eye {
    fn of(photo: &Photo) -> Self {
        let inverse = photo.camera_from_target.inverse();
        Self { target_from_camera: inverse.rotation.to_rotation_matrix(), at: inverse.translation.vector }
    }
}

/// Which shapes there are in which part of the drawing.
struct Buckets {
    low: Vector2<f64>,
    high: Vector2<f64>,
    all: Vec<Vec<usize>>,
}

impl Buckets {
    fn of(drawing: &Drawing) -> Self {
        let (low, high) = drawing.bounds();
        let mut out = Self { low, high, all: vec![Vec::new(); BUCKETS * BUCKETS] };
        for (index, shape) in drawing.shapes.iter().enumerate() {
            let (from, to) = shape.bounds();
            let (from, to) = (out.place(&from), out.place(&to));
            for row in from[1]..=to[1] {
                for column in from[0]..=to[0] {
                    out.all[row * BUCKETS + column].push(index);
                }
            }
        }
        out
    }

    fn place(&self, p: &Vector2<f64>) -> [usize; 2] {
        let part = (p - self.low).component_div(&(self.high - self.low));
        [part.x, part.y].map(|t| ((t * BUCKETS as f64).max(0.0) as usize).min(BUCKETS - 1))
    }

    fn at(&self, p: &Vector2<f64>) -> &[usize] {
        let [column, row] = self.place(p);
        &self.all[row * BUCKETS + column]
    }
}
