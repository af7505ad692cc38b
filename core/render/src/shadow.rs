//! Soft shadows on floors and tables, from simple replacements of the bodies.
//!
//! They are only for the viewer, who sees from them where objects are. The print of the board gets none, so that no
//! edge appears on it that is not printed.

use nalgebra::{Isometry3, Point3, Vector3};

use super::shapes::{Vec3, dot, scale_add};
use super::{BoardSurface, Shape, Solid};

/// Half width of the penumbra per distance: the radius of the lamp by its distance.
const SOFTNESS: f64 = 0.10;
/// Half width of the penumbra at the foot of a body.
const CONTACT_M: f64 = 0.004;
/// A shadow thinner than this part of the light is left out.
const BARELY: f64 = 1e-3;

/// An object in the light, in camera coordinates.
#[derive(Debug, Clone)]
pub(super) struct ShadowCaster {
    form: Form,
    /// The solid that it represents; it casts no shadow on itself. `None` for the board.
    pub owner: Option<usize>,
}

#[derive(Debug, Clone, Copy)]
enum Form {
    /// All points within `radius` of a segment.
    Rod { from: Vec3, along: Vec3, radius: f64 },
    /// A rectangle with unit sides `u`, `v`.
    Plate { middle: Vec3, u: Vec3, v: Vec3, normal: Vec3, half: [f64; 2] },
}

impl ShadowCaster {
    /// The shadow caster of a solid; `None` if it casts no shadow.
    pub fn of_solid(owner: usize, solid: &Solid, camera_from_shape: &Isometry3<f64>) -> Option<Self> {
        let form = match solid.shape {
            Shape::Sphere { radius } => rod(camera_from_shape, &Point3::origin(), &Point3::origin(), radius),
            Shape::Capsule { a, b, radius } => rod(camera_from_shape, &a, &b, radius),
            Shape::Cylinder { radius, half_height } => {
                let inset = (half_height - radius).max(0.0);
                let end = Point3::new(0.0, 0.0, inset);
                rod(camera_from_shape, &end, &Point3::from(-end.coords), radius)
            }
            Shape::Box { half_extents } => {
                let thin = half_extents.imin();
                let (i, j) = ((thin + 1) % 3, (thin + 2) % 3);
                plate(camera_from_shape, &Point3::origin(), [i, j], [half_extents[i], half_extents[j]])
            }
            Shape::Plane => return None,
        };
        Some(Self { form, owner: Some(owner) })
    }

    pub fn of_board(board: &BoardSurface, middle: &Point3<f64>, camera_from_target: &Isometry3<f64>) -> Self {
        Self { form: plate(camera_from_target, middle, [0, 1], board.paper_m.map(|side| 0.5 * side)), owner: None }
    }

    /// Whether the shadow may fall within `radius` of a point, with the lamp that way.
    pub fn may_darken(&self, point: &Vec3, radius: f64, towards: &Vec3) -> bool {
        let (from, along, size) = match &self.form {
            Form::Rod { from, along, radius } => (*from, *along, *radius),
            Form::Plate { middle, half, .. } => (*middle, [0.0; 3], half[0].hypot(half[1])),
        };
        let near = approach(point, towards, &from, &along);
        let offset = scale_add(-1.0, point, &from);
        let ends = [dot(&offset, towards), dot(&offset, towards) + dot(&along, towards)];
        let longest = ends[0].max(ends[1]).max(0.0) + size + radius;
        near.distance < size + radius + CONTACT_M + SOFTNESS * longest
    }

    /// Part of the lamp that passes, as seen from a point.
    fn passing(&self, point: &Vec3, towards: &Vec3) -> f64 {
        let (clearance, way) = match &self.form {
            Form::Rod { from, along, radius } => {
                let near = approach(point, towards, from, along);
                (near.distance - radius, near.way)
            }
            Form::Plate { middle, u, v, normal, half } => {
                let offset = scale_add(-1.0, point, middle);
                let way = dot(&offset, normal) / dot(towards, normal);
                // Light along the plate, which gives a NaN or an infinity, passes.
                if way.is_nan() || way <= 0.0 {
                    return 1.0;
                }
                let across = scale_add(-way, towards, &offset);
                let beyond = |axis: &Vec3, half: f64| dot(&across, axis).abs() - half;
                (beyond(u, half[0]).max(beyond(v, half[1])), way)
            }
        };
        let half_width = CONTACT_M + SOFTNESS * way;
        let x = (0.5 + 0.5 * clearance / half_width).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }
}

/// Part of the lamp that reaches a point past all casters but its own solid.
pub(super) fn sunlit<'a>(
    casters: impl Iterator<Item = &'a ShadowCaster>,
    receiver: Option<usize>,
    point: &Vec3,
    towards: &Vec3,
) -> f32 {
    let mut light = 1.0;
    for caster in casters.filter(|caster| caster.owner != receiver) {
        light *= caster.passing(point, towards);
        if light < BARELY {
            return 0.0;
        }
    }
    light as f32
}

fn rod(camera_from_shape: &Isometry3<f64>, a: &Point3<f64>, b: &Point3<f64>, radius: f64) -> Form {
    let from = camera_from_shape * a;
    Form::Rod { from: from.coords.into(), along: (camera_from_shape * b - from).into(), radius }
}

fn plate(camera_from_shape: &Isometry3<f64>, middle: &Point3<f64>, sides: [usize; 2], half: [f64; 2]) -> Form {
    let axis = |i: usize| camera_from_shape.rotation * Vector3::ith(i, 1.0);
    let (u, v) = (axis(sides[0]), axis(sides[1]));
    Form::Plate {
        middle: (camera_from_shape * middle).coords.into(),
        u: u.into(),
        v: v.into(),
        normal: u.cross(&v).into(),
        half,
    }
}

struct Approach {
    distance: f64,
    /// Distance along the light.
    way: f64,
}

/// Closest approach of the way from a point to the lamp to a segment.
fn approach(point: &Vec3, towards: &Vec3, from: &Vec3, along: &Vec3) -> Approach {
    let offset = scale_add(-1.0, from, point);
    let squared = dot(along, along);
    let lean = dot(along, towards);
    let (offset_along, offset_way) = (dot(along, &offset), dot(&offset, towards));
    let spread = squared - lean * lean;
    let way = if spread > 1e-12 { (offset_along * lean - offset_way * squared) / spread } else { -offset_way };
    let tau = if squared > 0.0 { ((offset_along + way * lean) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let way = (tau * lean - offset_way).max(0.0);
    let gap = scale_add(way, towards, &scale_add(-tau, along, &offset));
    Approach { distance: dot(&gap, &gap).sqrt(), way }
}
