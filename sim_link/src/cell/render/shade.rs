//! Colour of a surface point: lamp, finish, fading of the ground.

use nalgebra::Isometry3;

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
    /// How the point moves on the surface per pixel to the right and per pixel down.
    fn across_pixel(&self) -> [Vec3; 2] {
        let Self { point, normal, by_pixel, .. } = self;
        let depth = point[2];
        let facing = 1.0 / dot(normal, point);
        let by_ray = |axis: usize| {
            let mut step = scale_add(-depth * normal[axis] * facing, point, &[0.0; 3]);
            step[axis] += depth;
            step
        };
        let (by_x, by_y) = (by_ray(0), by_ray(1));
        let [x_by_u, x_by_v, y_by_u, y_by_v] = by_pixel.map(f64::from);
        let along = |x: f64, y: f64| scale_add(x, &by_x, &scale_add(y, &by_y, &[0.0; 3]));
        [along(x_by_u, y_by_u), along(x_by_v, y_by_v)]
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
        let place = |axis: usize| dot(&self.shape_from_camera[axis], &spot.point) + self.origin[axis];
        if matches!(self.finish, Finish::Matt | Finish::Satin) {
            return 1.0;
        }
        let [by_u, by_v] = spot.across_pixel();
        let half_width = |axis: usize| {
            let row = &self.shape_from_camera[axis];
            0.5 * (dot(row, &by_u).abs() + dot(row, &by_v).abs())
        };
        match self.finish {
            Finish::Matt | Finish::Satin => 1.0,
            Finish::Brushed => 1.0 + 0.05 * grain(place(2) / 0.0011, half_width(2) / 0.0011, 7),
            Finish::Tiles { pitch_m, joint_m } => {
                let (x, y) = (place(0) / pitch_m, place(1) / pitch_m);
                let (wx, wy) = (half_width(0) / pitch_m, half_width(1) / pitch_m);
                let joint = joint_m / pitch_m;
                let open = (1.0 - stripes(x, wx, joint)) * (1.0 - stripes(y, wy, joint));
                let tile = lattice(x.floor() as i64, y.floor() as i64);
                let far = fading(wx.max(wy));
                (1.0 - 0.30 * (1.0 - open) as f32) * (1.0 + 0.035 * far * tile)
            }
            Finish::Wood => {
                let (x, y) = (place(0), place(1));
                let (wx, wy) = (half_width(0), half_width(1));
                let board = (y / 0.14).floor();
                let bend = f64::from(cloud(x * 1.7 + board * 17.3, y * 9.0 + board * 5.1)) * 0.012;
                let fine = 520.0;
                let rings = cloud(x * 2.2 + board * 31.7, (y + bend) * 75.0) * fading(wy * 75.0);
                let pores = cloud(x * 14.0, (y + bend) * fine) * fading((wy * fine).max(wx * 14.0));
                let seam = stripes(y / 0.14, wy / 0.14, 0.006) as f32;
                (1.0 + 0.10 * rings + 0.05 * pores + 0.05 * lattice(board as i64, 3)) * (1.0 - 0.4 * seam)
            }
        }
    }
}

fn unit(a: &Vec3) -> Vec3 {
    let scale = 1.0 / dot(a, a).sqrt();
    [a[0] * scale, a[1] * scale, a[2] * scale]
}

/// Part of the interval `x ± half` that lies in stripes of width `width` before every integer.
fn stripes(x: f64, half: f64, width: f64) -> f64 {
    let up_to = |x: f64| x.floor() * width + (x - x.floor() - (1.0 - width)).max(0.0);
    let half = half.max(1e-9);
    (up_to(x + half) - up_to(x - half)) / (2.0 * half)
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

/// Smooth random numbers along a line, in ±1, fading where a pixel is wider than the detail.
fn grain(x: f64, half: f64, row: i64) -> f32 {
    let visible = fading(half);
    if visible == 0.0 {
        return 0.0;
    }
    let i = x.floor();
    let f = (x - i) as f32;
    let (a, b) = (lattice(i as i64, row), lattice(i as i64 + 1, row));
    visible * (a + (b - a) * f)
}

/// Smooth random numbers over a plane, in ±1.
fn cloud(x: f64, y: f64) -> f32 {
    let (i, j) = (x.floor(), y.floor());
    let (f, g) = ((x - i) as f32, (y - j) as f32);
    let (f, g) = (f * f * (3.0 - 2.0 * f), g * g * (3.0 - 2.0 * g));
    let at = |di: i64, dj: i64| lattice(i as i64 + di, j as i64 + dj);
    let low = at(0, 0) + (at(1, 0) - at(0, 0)) * f;
    let high = at(0, 1) + (at(1, 1) - at(0, 1)) * f;
    low + (high - low) * g
}
