//! Colour of a surface point: lamp, finish, fading of the ground.

use std::sync::LazyLock;

use nalgebra::Isometry3;

use super::board::floor;
use super::shapes::{Vec3, dot, scale_add};
use super::{Finish, Light, LightSource, Solid};

/// Sharpness of the highlight on satin and brushed surfaces, as a power of two of the cosine.
const GLOSS_DOUBLINGS: u32 = 5;
/// Strength of that highlight as a part of the diffuse lamp.
const GLOSS: f32 = 0.22;
/// Where the endless plane starts to fade into the background, as a part of the far distance.
const FADE_START: f64 = 0.55;

/// A light in camera coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lamp {
    place: Place,
    ambient: f32,
    diffuse: f32,
}

#[derive(Debug, Clone, Copy)]
enum Place {
    Direction(Vec3),
    Point(Vec3),
}

impl Lamp {
    pub fn new(light: &Light, camera_from_world: &Isometry3<f64>) -> Self {
        let place = match light.source {
            LightSource::Directional(towards) => Place::Direction((camera_from_world * towards.into_inner()).into()),
            LightSource::Point(at) => Place::Point((camera_from_world * at).coords.into()),
        };
        Self { place, ambient: light.ambient, diffuse: light.diffuse }
    }

    /// Unit vector from a point to the lamp.
    pub fn towards(&self, point: &Vec3) -> Vec3 {
        match self.place {
            Place::Direction(direction) => direction,
            Place::Point(at) => unit(&scale_add(-1.0, point, &at)),
        }
    }

    /// Whether a flat matt surface has one brightness all over.
    pub fn is_uniform(&self) -> bool {
        matches!(self.place, Place::Direction(_))
    }

    /// Part of the light that a matt surface sends back, with `sunlit` of the lamp reaching it.
    pub fn brightness(&self, normal: &Vec3, towards: &Vec3, sunlit: f32) -> f32 {
        let cosine = dot(normal, towards) as f32;
        // Surfaces that face away are a little darker still, so that round bodies keep their form in the shade.
        self.ambient * (0.85 + 0.15 * cosine) + self.diffuse * cosine.max(0.0) * sunlit
    }

    fn highlight(&self, normal: &Vec3, towards: &Vec3, ray: &Vec3) -> f32 {
        let half = unit(&scale_add(-1.0, &unit(ray), towards));
        let mut cosine = dot(normal, &half).max(0.0) as f32;
        for _ in 0..GLOSS_DOUBLINGS {
            cosine *= cosine;
        }
        GLOSS * self.diffuse * cosine
    }
}

/// The look of a solid, ready for points in camera coordinates.
#[derive(Debug, Clone)]
pub(super) struct Coat {
    colour: [f32; 3],
    finish: Finish,
    shape_from_camera: [Vec3; 3],
    origin: Vec3,
    /// Depth range over which an endless plane turns into the background.
    fade: Option<[f64; 2]>,
}

/// What is known about the pixel that is being coloured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Direction of its ray, `(x, y, 1)`.
    pub ray: Vec3,
    /// How the ray direction changes per pixel, see [`super::rays::Ray`].
    pub by_pixel: [f32; 4],
    /// Point on the surface.
    pub point: Vec3,
    pub normal: Vec3,
    /// Part of the lamp that reaches the point.
    pub sunlit: f32,
}

impl Spot {
    /// Coordinate of the point along a direction, and half the range that it has over the pixel.
    fn along(&self, direction: &Vec3, origin: f64) -> (f64, f64) {
        let Self { point, normal, by_pixel, .. } = self;
        let value = dot(direction, point);
        let facing = value / dot(normal, point);
        // A point on the plane n·p = const moves by depth · (e - p n_e / n·p) when the ray changes along the axis e.
        let by_x = point[2] * (direction[0] - facing * normal[0]);
        let by_y = point[2] * (direction[1] - facing * normal[1]);
        let [x_by_u, x_by_v, y_by_u, y_by_v] = by_pixel.map(f64::from);
        let range = (by_x * x_by_u + by_y * y_by_u).abs() + (by_x * x_by_v + by_y * y_by_v).abs();
        (value + origin, 0.5 * range)
    }
}

impl Coat {
    /// One colour without gloss or texture.
    pub fn matt(colour: [f32; 3]) -> Self {
        Self { colour, finish: Finish::Matt, shape_from_camera: [[0.0; 3]; 3], origin: [0.0; 3], fade: None }
    }

    pub fn new(solid: &Solid, camera_from_shape: &Isometry3<f64>, far_m: f64) -> Self {
        let inverse = camera_from_shape.inverse();
        let rotation = inverse.rotation.to_rotation_matrix();
        let row = |i: usize| [rotation[(i, 0)], rotation[(i, 1)], rotation[(i, 2)]];
        Self {
            colour: solid.colour,
            finish: solid.finish,
            shape_from_camera: [row(0), row(1), row(2)],
            origin: inverse.translation.vector.into(),
            fade: matches!(solid.shape, super::Shape::Plane).then_some([FADE_START * far_m, far_m]),
        }
    }

    /// One colour for all points of a flat face, where the coat has no texture and the lamp is uniform.
    pub fn flat(&self, lamp: &Lamp, normal: &Vec3) -> Option<[f32; 3]> {
        let plain = matches!(self.finish, Finish::Matt) && self.fade.is_none() && lamp.is_uniform();
        plain.then(|| {
            let light = lamp.brightness(normal, &lamp.towards(&[0.0; 3]), 1.0);
            self.colour.map(|c| c * light)
        })
    }

    pub fn colour_at(&self, spot: &Spot, lamp: &Lamp, background: [f32; 3]) -> [f32; 3] {
        let towards = lamp.towards(&spot.point);
        let tone = lamp.brightness(&spot.normal, &towards, spot.sunlit) * self.texture(spot);
        let shine = match self.finish {
            Finish::Satin | Finish::Brushed => lamp.highlight(&spot.normal, &towards, &spot.ray) * spot.sunlit,
            Finish::Matt | Finish::Tiles { .. } | Finish::Wood => 0.0,
        };
        let lit = self.colour.map(|c| c * tone + shine);
        let Some([start, end]) = self.fade else { return lit };
        let x = ((spot.point[2] - start) / (end - start)).clamp(0.0, 1.0) as f32;
        let mist = x * x * (3.0 - 2.0 * x);
        std::array::from_fn(|i| lit[i] + mist * (background[i] - lit[i]))
    }

    /// Factor on the colour.
    fn texture(&self, spot: &Spot) -> f32 {
        let along = |axis: usize| spot.along(&self.shape_from_camera[axis], self.origin[axis]);
        match self.finish {
            Finish::Matt | Finish::Satin => 1.0,
            Finish::Brushed => {
                let (z, width) = along(2);
                1.0 + 0.06 * grain(z * 900.0, width * 900.0)
            }
            Finish::Tiles { pitch_m, joint_m } => {
                let per_metre = 1.0 / pitch_m;
                let ((x, x_width), (y, y_width)) = (along(0), along(1));
                let (x, y) = (x * per_metre, y * per_metre);
                let (x_width, y_width) = (x_width * per_metre, y_width * per_metre);
                let joint = joint_m * per_metre;
                let open = (1.0 - stripes(x, x_width, joint)) * (1.0 - stripes(y, y_width, joint));
                let tone = fading(x_width.max(y_width)) * lattice(floor(x) as i64, floor(y) as i64);
                (0.7 + 0.3 * open as f32) * (1.0 + 0.03 * tone)
            }
            Finish::Wood => {
                let rows = &self.shape_from_camera;
                // Grain runs along x on the flat sides and around the edge between them.
                let across_edge = scale_add(1.0, &rows[1], &rows[2]);
                let ((x, _), (y, width)) = (along(0), spot.along(&across_edge, self.origin[1] + self.origin[2]));
                wood(x, y, width)
            }
        }
    }
}

/// Planks along x; `width` is half of what a pixel covers across.
fn wood(x: f64, y: f64, width: f64) -> f32 {
    const PLANK_M: f64 = 0.14;
    let plank = floor(y / PLANK_M);
    let shift = 1000.0 * f64::from(lattice(plank as i64, 3));
    let bend = 0.009 * f64::from(grain(x * 2.6 + shift, 0.0)) + 0.002 * f64::from(grain(x * 9.0 - shift, 0.0));
    let rings = grain((y + bend) * 95.0 + shift, width * 95.0);
    let pores = grain((y + bend) * 620.0 - shift, width * 620.0);
    let tone = 1.0 + 0.11 * rings + 0.07 * pores + 0.05 * lattice(plank as i64, 5);
    tone * (1.0 - 0.45 * stripes(y / PLANK_M, width / PLANK_M, 0.007) as f32)
}

fn unit(a: &Vec3) -> Vec3 {
    let scale = 1.0 / dot(a, a).sqrt();
    [a[0] * scale, a[1] * scale, a[2] * scale]
}

/// Part of the interval `x ± half` that lies in stripes of width `width` before every integer.
fn stripes(x: f64, half: f64, width: f64) -> f64 {
    let half = half.max(1e-9);
    let (low, high) = (x - half, x + half);
    let below = floor(low);
    if high - below < 1.0 - width {
        return 0.0;
    }
    let up_to = |x: f64, whole: f64| whole * width + (x - whole - (1.0 - width)).max(0.0);
    (up_to(high, floor(high)) - up_to(low, below)) / (2.0 * half)
}

/// 1 for detail much larger than a pixel, 0 for detail that a pixel would alias; `half` is in units of the detail.
fn fading(half: f64) -> f32 {
    (1.6 - 3.2 * half).clamp(0.0, 1.0) as f32
}

/// A fixed random number in ±1 for each point of a lattice.
fn lattice(i: i64, j: i64) -> f32 {
    let mut h = (i as u32).wrapping_mul(0x9E37_79B1) ^ (j as u32).wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 13;
    h as i32 as f32 / 2_147_483_648.0
}

/// Samples of [`GRAIN`] at its finest level, a power of two.
const GRAIN_SAMPLES: usize = 2048;
const GRAIN_LEVELS: usize = 8;

/// Random numbers in ±1 along a line, and their means over 2, 4, 8… neighbours.
static GRAIN: LazyLock<Vec<Vec<f32>>> = LazyLock::new(|| {
    let mut levels = vec![(0..GRAIN_SAMPLES as i64).map(|i| lattice(i, 11)).collect::<Vec<f32>>()];
    for level in 1..GRAIN_LEVELS {
        let halved = levels[level - 1].chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        levels.push(halved);
    }
    levels
});

/// Smooth random numbers along a line, in ±1 with detail of length 1, averaged over `x ± half`.
fn grain(x: f64, half: f64) -> f32 {
    let scale = (2.0 * half).max(1.0);
    // log2 by the bits of the float: exact at powers of two, linear between.
    let level = (scale.to_bits() as f64 / (1u64 << 52) as f64 - 1023.0).min((GRAIN_LEVELS - 1) as f64 - 1e-6);
    let fine = level as usize;
    let sample = |level: usize| {
        let samples = &GRAIN[level];
        let x = x / (1u32 << level) as f64 - 0.5;
        let whole = floor(x);
        let f = (x - whole) as f32;
        let i = whole as i64 as usize & (samples.len() - 1);
        let (a, b) = (samples[i], samples[(i + 1) & (samples.len() - 1)]);
        a + (b - a) * f * f * (3.0 - 2.0 * f)
    };
    let blend = (level - fine as f64) as f32;
    if blend == 0.0 { sample(fine) } else { sample(fine) * (1.0 - blend) + sample(fine + 1) * blend }
}
