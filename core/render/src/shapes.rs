//! Surfaces in camera coordinates: where a ray meets them, and which tiles of the image they can touch.
//!
//! A ray leaves the origin along `(x, y, 1)`, so the distance parameter of a hit is its depth along the optical axis.
//! Plain arrays, because this is the innermost loop of the renderer.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Shape, Solid};

pub(super) type Vec3 = [f64; 3];

pub(super) fn dot(a: &Vec3, b: &Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `scale · a + b`.
pub(super) fn scale_add(scale: f64, a: &Vec3, b: &Vec3) -> Vec3 {
    [scale * a[0] + b[0], scale * a[1] + b[1], scale * a[2] + b[2]]
}

/// Bounds of the rays of a tile of pixels, footprints included.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rays {
    /// Middle of the ray directions `(x, y)`.
    pub middle: [f64; 2],
    /// Half of their range.
    pub half: [f64; 2],
    /// Unit axis of a cone around them, and the cosine and sine of its half angle.
    pub axis: Vec3,
    pub cosine: f64,
    pub sine: f64,
}

impl Rays {
    /// The cone and the box around directions between `low` and `high`.
    pub fn around(low: [f64; 2], high: [f64; 2]) -> Self {
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let half = [0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1])];
        let unit = |x: f64, y: f64| Vector3::new(x, y, 1.0).normalize();
        let axis = unit(middle[0], middle[1]);
        // The farthest of a rectangle's points from any axis is one of its corners.
        let cosine = [(low[0], low[1]), (low[0], high[1]), (high[0], low[1]), (high[0], high[1])]
            .iter()
            .map(|&(x, y)| axis.dot(&unit(x, y)))
            .fold(1.0, f64::min);
        Self { middle, half, axis: axis.into(), cosine, sine: (1.0 - cosine * cosine).max(0.0).sqrt() }
    }

    /// A ball around where the rays meet a plane, cut off at a depth.
    pub fn patch(&self, inverse_depth: &Vec3, deepest: f64) -> (Vec3, f64) {
        let corner = |i: f64, j: f64| {
            let ray = [self.middle[0] + i * self.half[0], self.middle[1] + j * self.half[1], 1.0];
            let inverse = dot(inverse_depth, &ray);
            let depth = if inverse * deepest > 1.0 { 1.0 / inverse } else { deepest };
            ray.map(|c| c * depth)
        };
        let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, -1.0), corner(1.0, 1.0)];
        let middle = std::array::from_fn(|k| 0.25 * corners.iter().map(|c| c[k]).sum::<f64>());
        let distance = |c: &Vec3| {
            let away = scale_add(-1.0, &middle, c);
            dot(&away, &away)
        };
        (middle, corners.iter().map(distance).fold(0.0, f64::max).sqrt())
    }

    /// Least and greatest value of a linear form over the directions.
    pub fn range(&self, form: &Vec3) -> (f64, f64) {
        let middle = form[0] * self.middle[0] + form[1] * self.middle[1] + form[2];
        let half = form[0].abs() * self.half[0] + form[1].abs() * self.half[1];
        (middle - half, middle + half)
    }

    fn may_touch_ball(&self, centre: &Vec3, radius: f64) -> bool {
        let distance = dot(centre, centre).sqrt();
        if distance <= radius {
            return true;
        }
        let sine = radius / distance;
        let cosine = (1.0 - sine * sine).sqrt();
        dot(&self.axis, centre) >= distance * (cosine * self.cosine - sine * self.sine)
    }
}

/// The surface as seen by a tile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// No hit is nearer.
    pub nearest: f64,
    /// Every ray hits, none farther than this; `None` where some rays may miss.
    pub covers_within: Option<f64>,
}

/// Where a facet ends, in the coordinates that its forms span.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Outline {
    Rectangle,
    Disc,
    Endless,
}

/// A flat piece: the ray `d` hits it at depth `1 / (c·d)`, at the coordinates `(a·d, b·d) / (c·d)` in ±1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    a: Vec3,
    b: Vec3,
    c: Vec3,
    outline: Outline,
    /// Unit normal towards the camera.
    pub normal: Vec3,
}

impl Facet {
    /// Spanned by two orthogonal half sides from its middle; `None` when the camera sees it edge on or it has no size.
    fn new(middle: &Vector3<f64>, half_u: &Vector3<f64>, half_v: &Vector3<f64>, outline: Outline) -> Option<Self> {
        let normal = half_u.cross(half_v).try_normalize(0.0)?;
        let offset = normal.dot(middle);
        if offset.abs() < 1e-9 {
            return None;
        }
        let c = normal / offset;
        let across = |half: &Vector3<f64>| (half - c * half.dot(middle)) / half.norm_squared();
        let towards_camera = -normal * offset.signum();
        Some(Self {
            a: across(half_u).into(),
            b: across(half_v).into(),
            c: c.into(),
            outline,
            normal: towards_camera.into(),
        })
    }

    pub fn rectangle(middle: &Vector3<f64>, half_u: &Vector3<f64>, half_v: &Vector3<f64>) -> Option<Self> {
        Self::new(middle, half_u, half_v, Outline::Rectangle)
    }

    /// The linear form whose value at a ray is one over the depth of the hit.
    pub fn inverse_depth(&self) -> &Vec3 {
        &self.c
    }

    fn hit(&self, d: &Vec3) -> f64 {
        let c = dot(&self.c, d);
        let inside = match self.outline {
            Outline::Endless => c > 0.0,
            Outline::Rectangle => dot(&self.a, d).abs() <= c && dot(&self.b, d).abs() <= c,
            Outline::Disc => {
                let (a, b) = (dot(&self.a, d), dot(&self.b, d));
                c > 0.0 && a * a + b * b <= c * c
            }
        };
        if inside { 1.0 / c } else { f64::INFINITY }
    }

    fn reach(&self, rays: &Rays) -> Option<Reach> {
        let (low, high) = rays.range(&self.c);
        if high <= 0.0 {
            return None;
        }
        let mut covers = low > 0.0 && self.outline != Outline::Disc;
        if self.outline != Outline::Endless {
            for (form, sign) in [(&self.a, 1.0), (&self.a, -1.0), (&self.b, 1.0), (&self.b, -1.0)] {
                let (margin_low, margin_high) = rays.range(&scale_add(sign, form, &self.c));
                if margin_high < 0.0 {
                    return None;
                }
                covers &= margin_low >= 0.0;
            }
        }
        Some(Reach { nearest: 1.0 / high, covers_within: covers.then(|| 1.0 / low) })
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    centre: Vec3,
    radius: f64,
    /// Squared distance of the camera less the squared radius.
    excess: f64,
}

impl Ball {
    fn new(centre: &Vector3<f64>, radius: f64) -> Self {
        Self { centre: (*centre).into(), radius, excess: centre.norm_squared() - radius * radius }
    }

    fn hit(&self, d: &Vec3) -> f64 {
        let along = dot(&self.centre, d);
        let squared = dot(d, d);
        let discriminant = along * along - squared * self.excess;
        if along > 0.0 && discriminant > 0.0 { (along - discriminant.sqrt()) / squared } else { f64::INFINITY }
    }
}

/// The side of a cylinder between two ends.
#[derive(Debug, Clone)]
pub(super) struct CylinderSide {
    start: Vec3,
    axis: Vec3,
    length: f64,
    radius: f64,
    /// `start` less its part along the axis, and its squared length less the squared radius.
    across: Vec3,
    excess: f64,
    /// Balls that together contain it.
    bounds: Vec<Ball>,
}

impl CylinderSide {
    fn new(start: &Vector3<f64>, end: &Vector3<f64>, radius: f64) -> Option<Self> {
        let along = end - start;
        let length = along.norm();
        let axis = along.try_normalize(0.0)?;
        let across = start - axis * start.dot(&axis);
        let pieces = (length / (2.0 * radius)).ceil().clamp(1.0, 16.0);
        let half_piece = 0.5 * length / pieces;
        let bounds = (0..pieces as usize)
            .map(|i| Ball::new(&(start + axis * (half_piece * (2 * i + 1) as f64)), radius.hypot(half_piece)))
            .collect();
        Some(Self {
            start: (*start).into(),
            axis: axis.into(),
            length,
            radius,
            across: across.into(),
            excess: across.norm_squared() - radius * radius,
            bounds,
        })
    }

    fn hit(&self, d: &Vec3) -> f64 {
        let d_axis = dot(d, &self.axis);
        let squared = dot(d, d) - d_axis * d_axis;
        let along = dot(d, &self.across);
        let discriminant = along * along - squared * self.excess;
        // Written so that a NaN from a ray along the axis counts as a miss.
        if !(along > 0.0 && discriminant > 0.0) {
            return f64::INFINITY;
        }
        let t = (along - discriminant.sqrt()) / squared;
        let height = t * d_axis - dot(&self.start, &self.axis);
        if height >= 0.0 && height <= self.length && t > 0.0 { t } else { f64::INFINITY }
    }
}

/// A simple surface.
#[derive(Debug, Clone)]
pub(super) enum Surface {
    Facet(Facet),
    Ball(Ball),
    CylinderSide(CylinderSide),
}

impl Surface {
    /// Depth at which a ray meets the surface from outside; infinite where it does not.
    pub fn hit(&self, d: &Vec3) -> f64 {
        match self {
            Self::Facet(facet) => facet.hit(d),
            Self::Ball(ball) => ball.hit(d),
            Self::CylinderSide(mantle) => mantle.hit(d),
        }
    }

    /// Unit normal at one of its points, towards the camera.
    pub fn normal(&self, point: &Vec3) -> Vec3 {
        match self {
            Self::Facet(facet) => facet.normal,
            Self::Ball(ball) => scaled(&scale_add(-1.0, &ball.centre, point), 1.0 / ball.radius),
            Self::CylinderSide(mantle) => {
                let from_start = scale_add(-1.0, &mantle.start, point);
                let height = dot(&from_start, &mantle.axis);
                scaled(&scale_add(-height, &mantle.axis, &from_start), 1.0 / mantle.radius)
            }
        }
    }

    /// The surface as seen by the tile with these rays; `None` when none of them hits.
    pub fn reach(&self, rays: &Rays) -> Option<Reach> {
        match self {
            Self::Facet(facet) => facet.reach(rays),
            Self::Ball(ball) => rays
                .may_touch_ball(&ball.centre, ball.radius)
                .then(|| Reach { nearest: ball.centre[2] - ball.radius, covers_within: None }),
            Self::CylinderSide(mantle) => mantle
                .bounds
                .iter()
                .filter(|ball| rays.may_touch_ball(&ball.centre, ball.radius))
                .map(|ball| ball.centre[2] - ball.radius)
                .reduce(f64::min)
                .map(|nearest| Reach { nearest, covers_within: None }),
        }
    }
}

fn scaled(a: &Vec3, scale: f64) -> Vec3 {
    [scale * a[0], scale * a[1], scale * a[2]]
}

/// The smooth pieces of a solid that face the camera, each of one piece or of several that join without an edge;
/// empty when the camera is inside.
pub(super) fn faces(solid: &Solid, camera_from_shape: &Isometry3<f64>) -> Vec<Vec<Surface>> {
    let camera = camera_from_shape.inverse() * Point3::origin();
    let put = |p: &Point3<f64>| (camera_from_shape * p).coords;
    let turn = |v: Vector3<f64>| camera_from_shape.rotation * v;
    match solid.shape {
        Shape::Sphere { radius } if radius > 0.0 && camera.coords.norm() > radius => {
            vec![vec![Surface::Ball(Ball::new(&put(&Point3::origin()), radius))]]
        }
        Shape::Capsule { a, b, radius } if radius > 0.0 && distance_to_segment(&camera, &a, &b) > radius => {
            let ends = [Surface::Ball(Ball::new(&put(&a), radius)), Surface::Ball(Ball::new(&put(&b), radius))];
            vec![
                CylinderSide::new(&put(&a), &put(&b), radius)
                    .map(Surface::CylinderSide)
                    .into_iter()
                    .chain(ends)
                    .collect(),
            ]
        }
        Shape::Box { half_extents: half } => {
            let sides = (0..3).filter(|&i| camera[i].abs() > half[i]);
            let facet = |i: usize| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let along = |axis: usize| Vector3::ith(axis, half[axis]);
                let middle = Point3::from(along(i) * camera[i].signum());
                Facet::rectangle(&put(&middle), &turn(along(j)), &turn(along(k)))
            };
            sides.filter_map(facet).map(|f| vec![Surface::Facet(f)]).collect()
        }
        Shape::Cylinder { radius, half_height } if radius > 0.0 => {
            let end = |sign: f64| Point3::new(0.0, 0.0, sign * half_height);
            let mut all = Vec::new();
            if camera.x.hypot(camera.y) > radius {
                all.extend(
                    CylinderSide::new(&put(&end(-1.0)), &put(&end(1.0)), radius)
                        .map(|m| vec![Surface::CylinderSide(m)]),
                );
            }
            if camera.z.abs() > half_height {
                let (u, v) = (turn(Vector3::x() * radius), turn(Vector3::y() * radius));
                let cap = Facet::new(&put(&end(camera.z.signum())), &u, &v, Outline::Disc);
                all.extend(cap.map(|f| vec![Surface::Facet(f)]));
            }
            all
        }
        Shape::Plane if camera.z > 0.0 => {
            let below = put(&Point3::new(camera.x, camera.y, 0.0));
            let ground = Facet::new(&below, &turn(Vector3::x()), &turn(Vector3::y()), Outline::Endless);
            ground.map(|f| vec![Surface::Facet(f)]).into_iter().collect()
        }
        Shape::Sphere { .. } | Shape::Capsule { .. } | Shape::Cylinder { .. } | Shape::Plane => Vec::new(),
    }
}

fn distance_to_segment(p: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
    let along = b - a;
    let squared = along.norm_squared();
    let tau = if squared > 0.0 { ((p - a).dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (p - (a + along * tau)).norm()
}
