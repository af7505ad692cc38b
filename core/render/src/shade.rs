//! Colour of a surface point: lamp, finish, fading of the ground.

use nalgebra::Isometry3;

use super::shapes::{Vec3, dot, scale_add};
use super::texture::{WoodAt, grain, tiles};
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
pub(super) struct SurfaceShade {
    colour: [f32; 3],
    finish: Finish,
    shape_from_camera: [Vec3; 3],
    origin: Vec3,
    /// Depth range over which an endless plane turns into the background.
    fade: Option<[f64; 2]>,
}

/// Known data of the pixel that is being coloured.
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

impl SurfaceShade {
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

    /// Whether shadows fall on it.
    pub fn is_ground(&self) -> bool {
        matches!(self.finish, Finish::Tiles { .. } | Finish::Wood)
    }

    pub fn colour_at(&self, spot: &Spot, lamp: &Lamp, background: [f32; 3]) -> [f32; 3] {
        let towards = lamp.towards(&spot.point);
        let tone = lamp.brightness(&spot.normal, &towards, spot.sunlit) * self.texture(spot);
        let shine = match self.finish {
            Finish::Satin | Finish::Brushed => lamp.highlight(&spot.normal, &towards, &spot.ray) * spot.sunlit,
            Finish::Matt | Finish::Tiles { .. } | Finish::Wood => 0.0,
        };
        let lit = self.colour.map(|c| c * tone + shine);
        match self.fade {
            Some(fade) => misty(lit, background, fade, spot.point[2]),
            None => lit,
        }
    }

    /// The directions, and the values at the camera, of the coordinates in which the pattern of a ground is drawn.
    pub fn pattern_axes(&self) -> ((Vec3, f64), (Vec3, f64)) {
        let (rows, origin) = (&self.shape_from_camera, &self.origin);
        let x = (rows[0], origin[0]);
        match self.finish {
            // Grain runs along x on the flat sides and around the edge between them.
            Finish::Wood => (x, (scale_add(1.0, &rows[1], &rows[2]), origin[1] + origin[2])),
            _ => (x, (rows[1], origin[1])),
        }
    }

    pub fn finish(&self) -> Finish {
        self.finish
    }

    pub fn colour(&self) -> [f32; 3] {
        self.colour
    }

    pub fn fade(&self) -> Option<[f64; 2]> {
        self.fade
    }

    /// Factor on the colour.
    fn texture(&self, spot: &Spot) -> f32 {
        let on_ground = || {
            let ((x_axis, x_origin), (y_axis, y_origin)) = self.pattern_axes();
            let ((x, x_half), (y, y_half)) = (spot.along(&x_axis, x_origin), spot.along(&y_axis, y_origin));
            ([x, y], [x_half, y_half])
        };
        match self.finish {
            Finish::Matt | Finish::Satin => 1.0,
            Finish::Brushed => {
                let (z, half) = spot.along(&self.shape_from_camera[2], self.origin[2]);
                1.0 + 0.06 * grain(z * 900.0, half * 900.0)
            }
            Finish::Tiles { pitch_m, joint_m } => {
                let (at, half) = on_ground();
                tiles(at, half, pitch_m, joint_m)
            }
            Finish::Wood => {
                let (at, half) = on_ground();
                WoodAt::new(half).tone(at[0], at[1])
            }
        }
    }
}

/// Fades a colour into the background over a range of depths.
pub(super) fn misty(colour: [f32; 3], background: [f32; 3], [start, end]: [f64; 2], depth: f64) -> [f32; 3] {
    let x = ((depth - start) / (end - start)).clamp(0.0, 1.0) as f32;
    let mist = x * x * (3.0 - 2.0 * x);
    std::array::from_fn(|i| colour[i] + mist * (background[i] - colour[i]))
}

fn unit(a: &Vec3) -> Vec3 {
    let scale = 1.0 / dot(a, a).sqrt();
    [a[0] * scale, a[1] * scale, a[2] * scale]
}
