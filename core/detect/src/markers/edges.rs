//! Corners of black squares on white as the crossings of their edges.
//!
//! A corner of a tag has no half-turn symmetry, so that blur moves what most corner detectors call its place. Its edges
//! are not moved. Every line of pixels across an edge has it where its steepest steps are, which needs no level to be
//! known; a curve of second degree through these places is where a fit to all pixels begins, with a Gaussian blur, `I =
//! m(s) + h(s) erf((x − c(s)) / √2 σ)`. Where the image is sharper than its pixels that profile is wrong, and the sum
//! of the grey levels of each line shows how much of it is dark, whatever the profile. The bend of the edges by the
//! lens is estimated from all of them together, and two of them meet in a corner. Small squares that touch the tag at
//! its corners, as Kalibr prints them, lie beyond the ends of the edges and are not touched.

use image::GrayImage;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::edge::{Edge, MIN_KEPT, Scan};
use super::edge_profile::Profile;
use handeye_geometry::statistics::median_high;

/// Content beyond the dark border and beyond the light gap reaches this far into them [px]: twice the usual blur.
const BLUR_BEYOND_PX: f64 = 1.5;
/// Narrowest border or gap \[px\].
const NARROWEST_PX: f64 = 1.9;
/// Pixels on either side of an edge: fewer hold no blurred edge, more gain nothing but noise.
const REACH_PX: (f64, f64) = (1.4, 4.5);
/// The blur of the next edge reaches this far along an edge \[px\].
const END_PX: f64 = 2.0;
/// Fewest crossings that make an edge.
const MIN_CROSSINGS: usize = 5;
/// Largest deviation of crossings from the curve [px RMS]: an outline without any blur has steps of a pixel, 0.29 px RMS.
const MAX_RMS_PX: f64 = 0.5;
/// Number of times that the window is placed again around the found edge: the first guess has an error of one or two
/// pixels.
const PASSES: usize = 3;
/// How far edges may be bent when nothing is known yet: their curvature times the width of the image. A wide lens
/// (k₁ = −0.3 at a focal length of 0.8 widths) bends them by 0.3 at the border.
const ANY_BEND: f64 = 1.0;
/// Prior of that bend, and its weight as a number of edges.
const USUAL_BEND: (f64, f64) = (0.1, 2.0);
/// No lens is straighter than this.
const LEAST_BEND: f64 = 0.01;
/// Below this blur \[px\] the profile of an edge is that of the pixels' area, not Gaussian.
const SHARP_PX: f64 = 0.5;
/// An edge with less than this part of the usual contrast has another object next to it.
const MIN_CONTRAST_PART: f64 = 0.6;
/// Crossings are no better than this [px]: the grey levels of a pixel are not perfectly linear in its area.
const FLOOR_PX: f64 = 0.01;

/// A corner and its covariance in squared pixels.
pub(crate) type Refined = (Vector2<f64>, Matrix2<f64>);

/// The corners of dark squares, given to a pixel or two and clockwise in the image. `border` is the width of their solid
/// dark border and `gap` that of the light around them, both as parts of a side. `None` for a corner at an edge that is
/// covered or cut by the border of the image, and for squares too small for their blur.
///
/// All edges are fitted twice: first with any bend; then with no more than is usual in this image.
pub(crate) fn refine(
    image: &GrayImage,
    squares: &[[Vector2<f64>; 4]],
    border: f64,
    gap: f64,
) -> Vec<[Option<Refined>; 4]> {
    let sides = |squares: &[[Vector2<f64>; 4]], bend: f64| -> Vec<[Option<Edge>; 4]> {
        let mut sides: Vec<_> = squares.iter().map(|corners| edges_of(image, corners, border.min(gap), bend)).collect();
        keep_clear(&mut sides);
        sides
    };
    let width = f64::from(image.width().max(image.height()));
    let free = sides(squares, ANY_BEND / width);
    let bend = usual_bend(free.iter().flatten().flatten(), width);
    // From corners that are right to a fraction of a pixel, so that no window reaches around one.
    let nearer: Vec<[Vector2<f64>; 4]> = squares
        .iter()
        .zip(&free)
        .map(|(corners, edges)| {
            let found = crossings(corners, edges);
            std::array::from_fn(|i| found[i].map_or(corners[i], |(px, _)| px))
        })
        .collect();
    let edges = sides(&nearer, bend / width);
    nearer.iter().zip(&edges).map(|(corners, edges)| crossings(corners, edges)).collect()
}

/// Where the edges of a square meet, not too far from the assumed corners.
fn crossings(corners: &[Vector2<f64>; 4], edges: &[Option<Edge>; 4]) -> [Option<Refined>; 4] {
    std::array::from_fn(|i| {
        let (before, after) = (edges[(i + 3) % 4].as_ref()?, edges[i].as_ref()?);
        let refined = crossing(before, after, corners[i])?;
        let side = (corners[(i + 1) % 4] - corners[i]).norm();
        ((refined.0 - corners[i]).norm() <= 2.5 + 0.05 * side).then_some(refined)
    })
}

/// Leaves out edges of little contrast.
fn keep_clear(squares: &mut [[Option<Edge>; 4]]) {
    let contrasts = squares.iter().flatten().flatten().map(|edge| edge.contrast);
    let Some(usual) = median_high(contrasts) else { return };
    for edge in squares.iter_mut().flatten() {
        *edge = edge.filter(|edge| edge.contrast >= MIN_CONTRAST_PART * usual);
    }
}

/// The deviation of the curvature of edges, times the width of the image: their scatter less what noise makes of it
/// (a variance component by moments).
fn usual_bend<'a>(edges: impl Iterator<Item = &'a Edge>, width: f64) -> f64 {
    let (mut sum, mut weights, mut count) = (0.0, 0.0, 0.0);
    for edge in edges {
        let by_c2 = edge.curvature_by_c2() * width;
        let variance = edge.covariance[(2, 2)] * by_c2 * by_c2;
        // Edges with less information have less weight.
        let weight = 1.0 / (variance + USUAL_BEND.0 * USUAL_BEND.0).powi(2);
        sum += weight * ((edge.curve.z * by_c2).powi(2) - variance);
        weights += weight;
        count += 1.0;
    }
    let seen = if weights > 0.0 { f64::max(sum / weights, 0.0) } else { 0.0 };
    let (usual, worth) = USUAL_BEND;
    ((worth * usual * usual + count * seen) / (worth + count)).sqrt().max(LEAST_BEND)
}

/// The four sides of a square; `beside` is the width of the uniform area on both sides of them, as a part of a side.
fn edges_of(image: &GrayImage, corners: &[Vector2<f64>; 4], beside: f64, curvature: f64) -> [Option<Edge>; 4] {
    std::array::from_fn(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let along = (b - a).normalize();
        let opposite = (corners[(i + 2) % 4] + corners[(i + 3) % 4]) / 2.0;
        let even = beside * along.perp(&(opposite - a));
        let reach = (even - BLUR_BEYOND_PX).clamp(REACH_PX.0, REACH_PX.1);
        (even.is_finite() && even >= NARROWEST_PX).then(|| find(image, a, b, reach, curvature))?
    })
}

/// The edge from `a` to `b` with the dark side on the right (in the image, where v points down). `curvature` is the
/// deviation of its curvature a priori, 1/px.
fn find(image: &GrayImage, a: Vector2<f64>, b: Vector2<f64>, reach: f64, curvature: f64) -> Option<Edge> {
    let direction = (b - a).normalize();
    let axis = usize::from(direction.x.abs() < direction.y.abs());
    let (cos, sin) = (direction[axis].abs(), direction[1 - axis].abs());
    let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
    let trim = reach * sin + END_PX * cos;
    let (first, last) = ((low + trim).ceil(), (high - trim).floor());
    if last - first + 1.0 < MIN_CROSSINGS as f64 {
        return None;
    }
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let slope = (b[1 - axis] - a[1 - axis]) / (b[axis] - a[axis]);
    let curve = Vector3::new(a[1 - axis] + slope * (middle - a[axis]), slope * half, 0.0);
    let mut edge = Edge { axis, middle, half, curve, covariance: Matrix3::zeros(), cos, contrast: 0.0 };
    // The dark side is at (−d.y, d.x) from the edge.
    let dark_beyond = if axis == 0 { direction.x > 0.0 } else { direction.y < 0.0 };
    let scan = Scan { image, first: first as i64, last: last as i64, reach: reach / cos, dark_beyond };
    let bend = curvature / edge.curvature_by_c2();
    let mut kept = Vec::new();
    for _ in 0..PASSES {
        (edge, kept) = fitted(edge, &scan.steps(&edge)?, bend)?;
    }
    edge.contrast = scan.contrast(&edge)?;
    let profile = Profile { scan: &scan, along: kept, bend, least_blur: SHARP_PX / cos };
    if let Some(smooth) = profile.fit(&edge) {
        // Once more in a window around what was found.
        return Some(profile.fit(&smooth).unwrap_or(smooth));
    }
    // Too sharp, or another object next to the edge: its sums, if they agree as well as the steps do, or else the
    // steps.
    let by_sums = scan.crossings(&edge).and_then(|crossings| fitted(edge, &crossings, bend));
    Some(by_sums.map(|(edge, _)| edge).filter(|e| e.covariance[(0, 0)] <= edge.covariance[(0, 0)]).unwrap_or(edge))
}

/// The curve through the crossings, leaving out those far off, and where along the edge those are that are on it; the
/// curvature has the deviation `bend` a priori.
fn fitted(edge: Edge, crossings: &[Vector2<f64>], bend: f64) -> Option<(Edge, Vec<i64>)> {
    let mut kept: Vec<Vector2<f64>> = crossings.to_vec();
    let mut out = edge;
    let mut sigma = 0.1;
    for _ in 0..3 {
        let mut normal = Matrix3::zeros();
        let mut rhs = Vector3::zeros();
        for p in &kept {
            let terms = out.terms(p.x);
            normal += terms * terms.transpose();
            rhs += terms * p.y;
        }
        normal[(2, 2)] += (sigma / bend).powi(2);
        let inverse = normal.try_inverse()?;
        out.curve = inverse * rhs;
        out.covariance = inverse * sigma * sigma;
        let off = |p: &Vector2<f64>| (p.y - out.across(p.x)).abs();
        // 1.48 medians are a standard deviation.
        let robust = 1.48 * median_high(crossings.iter().map(off))?;
        sigma = robust.max(FLOOR_PX);
        let limit = (3.5 * sigma).max(0.05);
        kept = crossings.iter().copied().filter(|p| off(p) <= limit).collect();
        let squares = kept.iter().map(|p| off(p).powi(2)).sum::<f64>();
        let rms = (squares / (kept.len() as f64 - 2.0).max(1.0)).sqrt();
        sigma = sigma.min(rms.max(FLOOR_PX));
        let enough = kept.len() >= MIN_CROSSINGS && kept.len() as f64 >= MIN_KEPT * crossings.len() as f64;
        if !enough || rms.is_nan() || rms > MAX_RMS_PX {
            return None;
        }
    }
    Some((out, kept.iter().map(|p| p.x as i64).collect()))
}

/// Where two edges meet, by Newton's method from `start`.
fn crossing(before: &Edge, after: &Edge, start: Vector2<f64>) -> Option<Refined> {
    let mut at = start;
    let mut inverse = Matrix2::identity();
    for _ in 0..8 {
        let ((d1, g1), (d2, g2)) = (before.distance(&at), after.distance(&at));
        inverse = Matrix2::new(g1.x, g1.y, g2.x, g2.y).try_inverse()?;
        at -= inverse * Vector2::new(d1, d2);
    }
    let variances = Matrix2::from_diagonal(&Vector2::new(before.variance(&at), after.variance(&at)));
    let covariance = inverse * variances * inverse.transpose();
    let usable = at.iter().chain(covariance.iter()).all(|x| x.is_finite());
    usable.then_some((at, covariance))
}
