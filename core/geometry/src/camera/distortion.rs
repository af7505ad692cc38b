//! Lens distortion: from a point to normalised image coordinates and back.
//!
//! Reference: OpenCV documentation of `calib3d` (pinhole, `fisheye`), Brown 1966, Kannala & Brandt 2006.

use nalgebra::{Matrix2, Unit, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::CameraError;

/// Largest distance in normalised coordinates that the inverse may leave as error: far below a thousandth of a pixel.
const INVERSE_TOLERANCE: f64 = 1e-12;
/// Newton steps for the inverse; five are enough inside the model, the rest is for starts near the fold.
const INVERSE_STEPS: usize = 50;

/// A distortion model and its coefficients in OpenCV's order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", content = "coefficients", rename_all = "snake_case")]
pub enum Distortion {
    /// An ideal pinhole.
    None,
    /// `k1 k2 p1 p2 k3`; ROS calls it `plumb_bob`.
    BrownConrady([f64; 5]),
    /// `k1 k2 p1 p2 k3 k4 k5 k6`; ROS calls it `rational_polynomial`.
    Rational([f64; 8]),
    /// `k1 k2 k3 k4` in powers of the angle to the axis; ROS calls it `equidistant`.
    Fisheye([f64; 4]),
}

/// Two numbers that belong to x and y of the image.
type Pair = [f64; 2];

/// Normalised image coordinates with derivatives.
pub(super) struct Distorted {
    pub value: Pair,
    pub by_point: [Pair; 3],
    /// Derivatives by the coefficients; zero beyond those of the model.
    pub by_coefficients: [Pair; 8],
}

impl Distortion {
    /// The coefficients in OpenCV's order; empty for none.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::None => &[],
            Self::BrownConrady(k) => k,
            Self::Rational(k) => k,
            Self::Fisheye(k) => k,
        }
    }

    /// Name in files: `none`, `brown_conrady`, `rational`, `fisheye`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::BrownConrady(_) => "brown_conrady",
            Self::Rational(_) => "rational",
            Self::Fisheye(_) => "fisheye",
        }
    }

    /// The model with this name and all coefficients zero; `None` for an unknown name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "none" => Some(Self::None),
            "brown_conrady" => Some(Self::BrownConrady([0.0; 5])),
            "rational" => Some(Self::Rational([0.0; 8])),
            "fisheye" => Some(Self::Fisheye([0.0; 4])),
            _ => None,
        }
    }

    /// The same model with other coefficients; missing ones keep their value.
    #[must_use]
    pub fn with_coefficients(&self, coefficients: &[f64]) -> Self {
        let mut out = *self;
        let slots: &mut [f64] = match &mut out {
            Self::None => &mut [],
            Self::BrownConrady(k) => k,
            Self::Rational(k) => k,
            Self::Fisheye(k) => k,
        };
        for (slot, value) in slots.iter_mut().zip(coefficients) {
            *slot = *value;
        }
        out
    }

    pub(super) fn distort(&self, point: &Vector3<f64>) -> Result<Vector2<f64>, CameraError> {
        match self {
            Self::None => normalise(point),
            Self::BrownConrady(k) => Ok(polynomial(&normalise(point)?, &widen(k))),
            Self::Rational(k) => Ok(polynomial(&normalise(point)?, k)),
            Self::Fisheye(k) => fisheye(point, k),
        }
    }

    /// [`Self::distort`] with its derivatives.
    #[inline]
    pub(super) fn linearise(&self, point: &Vector3<f64>) -> Result<Distorted, CameraError> {
        match self {
            Self::None => on_plane(point, Lens::none),
            Self::BrownConrady(k) => on_plane(point, |x| polynomial_linearised::<false>(x, &widen(k))),
            Self::Rational(k) => on_plane(point, |x| polynomial_linearised::<true>(x, k)),
            Self::Fisheye(k) => fisheye_linearised(point, k),
        }
    }

    /// The ray that distorts to `distorted`; `None` where the model has none.
    pub(super) fn undistort(&self, distorted: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        if !(distorted.x.is_finite() && distorted.y.is_finite()) {
            return None;
        }
        match self {
            Self::None => Some(ray(distorted)),
            Self::BrownConrady(k) => undistort_polynomial(distorted, &widen(k)).map(|x| ray(&x)),
            Self::Rational(k) => undistort_polynomial(distorted, k).map(|x| ray(&x)),
            Self::Fisheye(k) => undistort_fisheye(distorted, k),
        }
    }
}

fn ray(x: &Vector2<f64>) -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(x.x, x.y, 1.0))
}

/// Brown–Conrady is the rational model with denominator 1.
fn widen(k: &[f64; 5]) -> [f64; 8] {
    [k[0], k[1], k[2], k[3], k[4], 0.0, 0.0, 0.0]
}

fn normalise(p: &Vector3<f64>) -> Result<Vector2<f64>, CameraError> {
    if p.z > 0.0 { Ok(Vector2::new(p.x / p.z, p.y / p.z)) } else { Err(CameraError::BehindCamera { z_m: p.z }) }
}

/// A distortion of the plane z = 1 with its derivatives.
struct Lens {
    value: Pair,
    /// Derivatives by x and by y of the plane.
    by_x: [Pair; 2],
    by_coefficients: [Pair; 8],
}

impl Lens {
    /// No distortion.
    fn none(x: Pair) -> Self {
        Self { value: x, by_x: [[1.0, 0.0], [0.0, 1.0]], by_coefficients: [[0.0; 2]; 8] }
    }
}

/// Puts the perspective division in front of a distortion of the plane z = 1.
#[inline]
fn on_plane(p: &Vector3<f64>, lens: impl Fn(Pair) -> Lens) -> Result<Distorted, CameraError> {
    if p.z.is_nan() || p.z <= 0.0 {
        return Err(CameraError::BehindCamera { z_m: p.z });
    }
    let w = 1.0 / p.z;
    let x = [p.x * w, p.y * w];
    let Lens { value, by_x, by_coefficients } = lens(x);
    let [across, down] = by_x.map(|column| column.map(|d| d * w));
    let by_depth = [0, 1].map(|row| -(x[0] * across[row] + x[1] * down[row]));
    Ok(Distorted { value, by_point: [across, down, by_depth], by_coefficients })
}

fn polynomial(x: &Vector2<f64>, k: &[f64; 8]) -> Vector2<f64> {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = *k;
    let (a, b) = (x.x, x.y);
    let r2 = a * a + b * b;
    let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
    Vector2::new(
        a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
    )
}

/// [`polynomial`] with its derivatives; `RATIONAL` states whether its denominator is free.
#[inline]
fn polynomial_linearised<const RATIONAL: bool>([a, b]: Pair, k: &[f64; 8]) -> Lens {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = *k;
    let (aa, bb, ab2) = (a * a, b * b, 2.0 * a * b);
    let r2 = aa + bb;
    let r4 = r2 * r2;
    let r6 = r4 * r2;
    let numerator = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3));
    let (radial, radial_by_r2, up) = if RATIONAL {
        let up = 1.0 / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let radial = numerator * up;
        (radial, (slope - radial * (k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6)))) * up, up)
    } else {
        (numerator, slope, 1.0)
    };
    let cross = ab2 * radial_by_r2 + 2.0 * (p1 * a + p2 * b);
    let (across, down) = ([a * up, b * up], [-a * up * radial, -b * up * radial]);
    let times = |v: Pair, s: f64| v.map(|c| c * s);
    let of_denominator = |s: f64| if RATIONAL { times(down, s) } else { [0.0; 2] };
    Lens {
        value: [a * radial + p1 * ab2 + p2 * (r2 + 2.0 * aa), b * radial + p1 * (r2 + 2.0 * bb) + p2 * ab2],
        by_x: [
            [radial + 2.0 * aa * radial_by_r2 + 2.0 * p1 * b + 6.0 * p2 * a, cross],
            [cross, radial + 2.0 * bb * radial_by_r2 + 6.0 * p1 * b + 2.0 * p2 * a],
        ],
        by_coefficients: [
            times(across, r2),
            times(across, r4),
            [ab2, r2 + 2.0 * bb],
            [r2 + 2.0 * aa, ab2],
            times(across, r6),
            of_denominator(r2),
            of_denominator(r4),
            of_denominator(r6),
        ],
    }
}

/// [`polynomial`] and its derivative by the plane.
fn polynomial_with_slope(x: &Vector2<f64>, k: &[f64; 8]) -> (Vector2<f64>, Matrix2<f64>) {
    let lens = polynomial_linearised::<true>([x.x, x.y], k);
    (lens.value.into(), lens.by_x.into())
}

/// Newton from the distorted point, damped so that the residual falls at every step.
///
/// A solution counts only where the map still has positive determinant on the whole way there from the centre,
/// checked at the solution: past the fold a second, false pre-image exists.
fn undistort_polynomial(distorted: &Vector2<f64>, k: &[f64; 8]) -> Option<Vector2<f64>> {
    let mut x = *distorted;
    let (mut value, mut by_x) = polynomial_with_slope(&x, k);
    if by_x.determinant() <= 0.0 {
        // The start is past the fold; the centre never is.
        x = Vector2::zeros();
        (value, by_x) = polynomial_with_slope(&x, k);
    }
    let mut residual = value - distorted;
    for _ in 0..INVERSE_STEPS {
        if residual.norm() < INVERSE_TOLERANCE {
            return Some(x);
        }
        let step = by_x.try_inverse()? * residual;
        let mut scale = 1.0;
        loop {
            let candidate = x - step * scale;
            let (new_value, new_by_x) = polynomial_with_slope(&candidate, k);
            let new_residual = new_value - distorted;
            if new_by_x.determinant() > 0.0 && new_residual.norm() < residual.norm() {
                (x, by_x, residual) = (candidate, new_by_x, new_residual);
                break;
            }
            scale *= 0.5;
            if scale < 1e-6 {
                // No descent left: either rounding prevents it, or there is no pre-image.
                return (residual.norm() < 1e3 * INVERSE_TOLERANCE).then_some(x);
            }
        }
    }
    (residual.norm() < 1e3 * INVERSE_TOLERANCE).then_some(x)
}

/// `theta_d` and its derivative by `theta`.
fn fisheye_angle(theta: f64, k: &[f64; 4]) -> (f64, f64) {
    let t2 = theta * theta;
    let [k1, k2, k3, k4] = *k;
    (
        theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))),
        1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4))),
    )
}

/// Below this ratio of radius to depth the fisheye is its own first-order expansion.
const FISHEYE_AXIS: f64 = 1e-9;

fn fisheye(p: &Vector3<f64>, k: &[f64; 4]) -> Result<Vector2<f64>, CameraError> {
    let r = (p.x * p.x + p.y * p.y).sqrt();
    if r <= FISHEYE_AXIS * p.z.abs() {
        return normalise(p);
    }
    let (theta_d, _) = fisheye_angle(r.atan2(p.z), k);
    Ok(Vector2::new(p.x, p.y) * (theta_d / r))
}

#[inline]
fn fisheye_linearised(p: &Vector3<f64>, k: &[f64; 4]) -> Result<Distorted, CameraError> {
    let r2 = p.x * p.x + p.y * p.y;
    let r = r2.sqrt();
    if r <= FISHEYE_AXIS * p.z.abs() {
        return on_plane(p, Lens::none);
    }
    let theta = r.atan2(p.z);
    let (theta_d, slope) = fisheye_angle(theta, k);
    let over_r = 1.0 / r;
    let (a, b) = (p.x * over_r, p.y * over_r);
    // The angle changes with the radius and with the depth; the direction only with displacements across the radius.
    let over_d2 = 1.0 / (r2 + p.z * p.z);
    let (by_radius, by_depth) = (slope * p.z * over_d2, -slope * r * over_d2);
    let turn = theta_d * over_r;
    let cross = a * b * (by_radius - turn);
    let t2 = theta * theta;
    let mut by_coefficients = [[0.0; 2]; 8];
    let mut power = theta;
    for column in &mut by_coefficients[..4] {
        power *= t2;
        *column = [a * power, b * power];
    }
    Ok(Distorted {
        value: [a * theta_d, b * theta_d],
        by_point: [
            [a * a * by_radius + b * b * turn, cross],
            [cross, b * b * by_radius + a * a * turn],
            [a * by_depth, b * by_depth],
        ],
        by_coefficients,
    })
}

fn undistort_fisheye(distorted: &Vector2<f64>, k: &[f64; 4]) -> Option<Unit<Vector3<f64>>> {
    let theta_d = distorted.norm();
    if theta_d < 1e-12 {
        return Some(ray(distorted));
    }
    let theta = invert_fisheye_angle(theta_d, k)?;
    let direction = distorted / theta_d;
    Some(Unit::new_normalize(Vector3::new(direction.x * theta.sin(), direction.y * theta.sin(), theta.cos())))
}

/// The smallest angle with this distorted angle: marches up to bracket it, then Newton inside the bracket.
fn invert_fisheye_angle(theta_d: f64, k: &[f64; 4]) -> Option<f64> {
    const MARCH: f64 = 0.05;
    let mut low = 0.0;
    let mut high = loop {
        let next: f64 = low + MARCH;
        let (value, slope) = fisheye_angle(next, k);
        if value >= theta_d {
            break next;
        }
        if slope <= 0.0 || next > std::f64::consts::PI {
            return None;
        }
        low = next;
    };
    let mut theta = 0.5 * (low + high);
    for _ in 0..INVERSE_STEPS {
        let (value, slope) = fisheye_angle(theta, k);
        let residual = value - theta_d;
        if residual.abs() < INVERSE_TOLERANCE {
            return Some(theta);
        }
        if residual > 0.0 {
            high = theta;
        } else {
            low = theta;
        }
        let newton = theta - residual / slope;
        theta = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
    }
    Some(theta)
}
