//! The plane of a target by its depths, where a depth image is registered to the image.
//!
//! The depths are taken where the corners are, so that each has its place `(x, y)` on the target without any model of the lens, and
//! over the target's plane the depth is linear in that place:
//!
//! ```text
//! z = t_z + r₃₁ x + r₃₂ y
//! ```
//!
//! where `t` and `R` are the target's pose in the camera. Its two slopes are the third row of `R`: they determine the tilt, which
//! corners determine worst. The depth of a corner is that of a plane through the inverse depths of the pixels around it, because
//! inverse depth is linear in the pixel.

use nalgebra::{Matrix2, Matrix3, Point3, Vector2, Vector3};

use crate::depth::{DepthImage, DepthSample, outlier_reach_m};
use crate::statistics::median_high;
use crate::targets::TargetSpec;
use crate::targets::observation::Corner;

/// Where nothing reflects a sensor reports its far plane, which no target is at, so that it need not be known.
const FAR_M: f32 = f32::INFINITY;
/// Pixels around a corner extend over this part of the distance to the nearest other one, so that no depth counts for
/// many corners.
const AROUND: f64 = 0.4;
/// And the least and the largest extent, pixels.
const RADIUS_PX: (f64, f64) = (1.0, 8.0);
/// Part of the pixels around a corner that has to be measured.
const LEAST_AROUND: f64 = 0.5;
/// Least part of the corners that has to have a depth on one plane: with fewer another object may be taken for the target.
const LEAST: f64 = 0.5;
/// And the least number: three determine a plane.
const LEAST_CORNERS: usize = 6;
/// Planes through three corners that are tried: with half of the corners off, one in eight triples is good, and all are bad once in
/// six hundred images.
const TRIED: usize = 48;
const ROUNDS: usize = 8;

/// The plane of a target by the depths at its corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthPlane {
    /// The mean place of the depths on the target as drawn, metres.
    pub place_m: Vector2<f64>,
    /// The depth there, metres, and by how much it grows along the target's x and y, metres per metre.
    pub depth: Vector3<f64>,
    /// Information on these three, as if all depths together had the variance of one: the mean of `g gᵀ` over the depths with
    /// `g = (1, x, y)` from the mean place. The inverse, times the variance of a depth, is a covariance.
    pub information: Matrix3<f64>,
    /// Scatter of single depths about the plane, one standard deviation, metres.
    pub scatter_m: f64,
    /// Part of the pixels around the corners that are measured.
    pub fill: f64,
}

/// Depths off by more than this factor are in another unit, or from another image: the worst depth cameras are off by some
/// percent.
const GROSS: f64 = 1.2;

/// Whether depths that are this many times those expected are in metres and from the same image.
pub fn are_of_right_size(ratio: f64) -> bool {
    (1.0 / GROSS..=GROSS).contains(&ratio)
}

/// The depth at a corner of the target.
#[derive(Clone, Copy)]
struct Sample {
    place: Vector2<f64>,
    depth_m: f64,
    /// Variance of the single depths around it about their plane.
    variance_m2: f64,
}

impl DepthPlane {
    /// The plane at the corners of an image with this width and height, by the depth image registered to it. `None` where that
    /// has another size, and where less than half of the corners, or fewer than six, have depths of one plane.
    pub fn new(depth: &DepthImage, image_size: (u32, u32), corners: &[Corner], target: &TargetSpec) -> Option<Self> {
        if (depth.width, depth.height) != image_size {
            return None;
        }
        let points = target.points();
        let mut samples = Vec::with_capacity(corners.len());
        let (mut measured, mut looked_at) = (0, 0);
        for corner in corners {
            let Some(point) = points.get(corner.index) else { continue };
            let seen = depth_around(depth, &corner.px, radius_px(corner, corners));
            measured += seen.measured;
            looked_at += seen.looked_at;
            let place = point.xy().coords;
            samples.extend(seen.depth.map(|(depth_m, variance_m2)| Sample { place, depth_m, variance_m2 }));
        }
        let least = LEAST_CORNERS.max((LEAST * corners.len() as f64).ceil() as usize);
        let fill = f64::from(measured) / f64::from(looked_at.max(1));
        on_one_plane(samples, least).map(|plane| Self { fill, ..plane })
    }

    /// The depth of the plane at a place of the target as drawn, metres.
    pub fn depth_at(&self, place: &Point3<f64>) -> f64 {
        let lateral = place.xy().coords - self.place_m;
        self.depth.dot(&Vector3::new(1.0, lateral.x, lateral.y))
    }

    /// The same where the target is numbered from another corner, this many of its [quarter turns](TargetSpec::quarter_turns)
    /// away.
    #[must_use]
    pub fn renumbered(&self, target: &TargetSpec, quarter_turns: usize) -> Self {
        // A point of the target in the old numbering is `turn` times that in the new one, about the middle of the target.
        let turn = match quarter_turns % 4 {
            0 => Matrix2::identity(),
            1 => Matrix2::new(0.0, -1.0, 1.0, 0.0),
            2 => -Matrix2::identity(),
            _ => Matrix2::new(0.0, 1.0, -1.0, 0.0),
        };
        let centre = target.centre().xy().coords;
        let mut of_all = Matrix3::identity();
        of_all.fixed_view_mut::<2, 2>(1, 1).copy_from(&turn);
        Self {
            place_m: centre + turn.transpose() * (self.place_m - centre),
            depth: of_all.transpose() * self.depth,
            information: of_all.transpose() * self.information * of_all,
            ..*self
        }
    }

    fn through(samples: &[Sample]) -> Option<Self> {
        let count = samples.len() as f64;
        let place_m = samples.iter().map(|sample| sample.place).sum::<Vector2<f64>>() / count;
        let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
        for Sample { place, depth_m, .. } in samples {
            let row = Vector3::new(1.0, place.x - place_m.x, place.y - place_m.y);
            information += row * row.transpose() / count;
            pull += row * (*depth_m / count);
        }
        let depth = information.cholesky()?.solve(&pull);
        let plane = Self { place_m, depth, information, scatter_m: 0.0, fill: 0.0 };
        let squares: f64 = samples.iter().map(|sample| plane.off_m(sample).powi(2)).sum();
        let within: f64 = samples.iter().map(|sample| sample.variance_m2).sum();
        Some(Self { scatter_m: (squares / (count - 3.0).max(1.0) + within / count).sqrt(), ..plane })
    }

    fn off_m(&self, Sample { place, depth_m, .. }: &Sample) -> f64 {
        depth_m - self.depth_at(&Point3::new(place.x, place.y, 0.0))
    }
}

fn radius_px(corner: &Corner, corners: &[Corner]) -> f64 {
    let others = corners.iter().filter(|other| other.index != corner.index);
    let nearest = others.map(|other| (other.px - corner.px).norm()).fold(f64::INFINITY, f64::min);
    (AROUND * nearest).clamp(RADIUS_PX.0, RADIUS_PX.1)
}

/// The depths of the pixels around a corner.
struct Around {
    /// The depth of the corner, metres, and the variance of the single ones, square metres.
    depth: Option<(f64, f64)>,
    measured: u32,
    looked_at: u32,
}

fn depth_around(depth: &DepthImage, px: &Vector2<f64>, radius: f64) -> Around {
    let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
    let (mut sum, mut squares) = (0.0, 0.0);
    let (mut measured, mut looked_at) = (0, 0);
    let range = |at: f64, size: u32| {
        let low = (at - radius).ceil().max(0.0);
        let high = (at + radius).floor().min(f64::from(size) - 1.0);
        low as u32..(high + 1.0).max(0.0) as u32
    };
    for row in range(px.y, depth.height) {
        for column in range(px.x, depth.width) {
            looked_at += 1;
            match depth.sample(column, row, FAR_M) {
                DepthSample::Metres(metres) if metres.is_finite() => {
                    let g = Vector3::new(1.0, f64::from(column) - px.x, f64::from(row) - px.y);
                    let inverse = f64::from(metres).recip();
                    information += g * g.transpose();
                    pull += g * inverse;
                    sum += inverse;
                    squares += inverse * inverse;
                    measured += 1;
                }
                _ => {}
            }
        }
    }
    let enough = measured >= 3 && f64::from(measured) >= LEAST_AROUND * f64::from(looked_at);
    // Pixels in one line determine no slope across it: then their mean.
    let count = f64::from(measured.max(1));
    let (inverse, left, unknowns) = match information.cholesky().map(|factor| factor.solve(&pull)) {
        Some(plane) => (plane.x, squares - plane.dot(&pull), 3.0),
        None => (sum / count, squares - sum * sum / count, 1.0),
    };
    let variance = left.max(0.0) / (count - unknowns).max(1.0);
    // A change of the inverse depth changes the depth by its square.
    let depth = (enough && inverse > 0.0).then(|| (inverse.recip(), variance * inverse.powi(-4)));
    Around { depth, measured, looked_at }
}

/// The plane through the depths, without those that are not on it.
fn on_one_plane(mut samples: Vec<Sample>, least: usize) -> Option<DepthPlane> {
    if samples.len() < least {
        return None;
    }
    let median_off = |plane: &DepthPlane| median_high(samples.iter().map(|sample| plane.off_m(sample).abs()));
    let (_, mut plane) = triples(samples.len())
        .filter_map(|chosen| {
            let plane = DepthPlane::through(&chosen.map(|i| samples[i]))?;
            Some((median_off(&plane)?, plane))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    for _ in 0..ROUNDS {
        let off: Vec<f64> = samples.iter().map(|sample| plane.off_m(sample).abs()).collect();
        let reach = outlier_reach_m(&off);
        let near = samples.iter().zip(&off).filter(|(_, off)| **off <= reach);
        let near: Vec<Sample> = near.map(|(sample, _)| *sample).collect();
        if near.len() < least {
            return None;
        }
        let settled = near.len() == samples.len();
        plane = DepthPlane::through(&near)?;
        samples = near;
        if settled {
            break;
        }
    }
    Some(plane)
}

/// Triples of `count` numbers, spread evenly (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences").
fn triples(count: usize) -> impl Iterator<Item = [usize; 3]> {
    /// Powers of the root of x⁴ = x + 1.
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_4];
    (1..=TRIED).map(move |k| STEPS.map(|step| ((0.5 + k as f64 * step).fract() * count as f64) as usize))
}
