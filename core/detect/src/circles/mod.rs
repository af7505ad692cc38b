//! Grids of dots: found by OpenCV, centred by [`super::circles::dots`], brought into one order.

pub(crate) mod asymmetric;
pub(crate) mod dots;

use image::GrayImage;
use nalgebra::Vector2;
use opencv::calib3d;
use opencv::core::{Point2f, Size, Vector};

use super::VisionError;
use super::bridge::{failed, from_points2f, mat_from_gray};
use super::circles::dots::{Dot, quantile};
use super::error::go_on;
use super::options::Effort;
use super::order::{Ordered, canonical};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::Grid;

/// A dot counts as the larger one when its area is this many times the usual: drawn 1.5 times as wide it has 2.25
/// times the area, and perspective and blur vary the ratio of equal dots by less than a fifth.
const LARGER_DOT: f64 = 1.5;
/// Largest distance of a dot from the middle of its two neighbours, as a part of their distance.
const MAX_BEND: f64 = 0.1;

pub(super) fn find(
    image: &GrayImage,
    grid: &Grid,
    effort: Effort,
    cancel: &CancelToken,
) -> Result<Option<Ordered>, VisionError> {
    let Some((found, dark)) = search(image, grid, effort, cancel)? else { return Ok(None) };
    let dots: Vec<Option<Dot>> = (0..found.points.len())
        .map(|i| dots::measure(image, found.points[i], &found.steps(i % found.columns, i / found.columns), dark))
        .collect();
    let larger = larger_dot(&found, &dots);
    let mut refined = found;
    for (point, dot) in refined.points.iter_mut().zip(&dots) {
        if let Some(dot) = dot.filter(|dot| dot.whole) {
            *point = dot.centre;
        }
    }
    let on_target: Vec<Vector2<f64>> = (0..grid.len()).map(|i| grid.point(i).coords.xy()).collect();
    let cell_m2 = grid.square_m * grid.square_m;
    let radii: Vec<Option<f64>> =
        dots.iter().map(|dot| dot.filter(|dot| dot.whole).map(|dot| dots::radius(&dot, cell_m2))).collect();
    if dots::image_of_centres(&mut refined.points, &on_target, &radii).is_none() {
        return Ok(None);
    }
    let origin = larger.map(|index| refined.points[index]);
    Ok(Some(canonical(&refined, grid, |order| origin == Some(order.points[0]))))
}

/// The points in some order, and whether the dots are dark on light.
fn search(
    image: &GrayImage,
    grid: &Grid,
    effort: Effort,
    cancel: &CancelToken,
) -> Result<Option<(Ordered, bool)>, VisionError> {
    const PLAIN: i32 = calib3d::CALIB_CB_SYMMETRIC_GRID;
    const CLUSTERED: i32 = calib3d::CALIB_CB_SYMMETRIC_GRID + calib3d::CALIB_CB_CLUSTERING;
    let attempts: &[(bool, i32)] = match effort {
        Effort::Live => &[(true, PLAIN)],
        Effort::Thorough => &[(true, PLAIN), (true, CLUSTERED), (false, PLAIN), (false, CLUSTERED)],
    };
    for &(dark, flags) in attempts {
        go_on(cancel)?;
        let Some(centres) = centres(image, grid, dark, flags)? else { continue };
        let order = Ordered::new(centres, grid);
        if order.is_regular() && order.is_smooth(MAX_BEND) {
            return Ok(Some((order, dark)));
        }
    }
    Ok(None)
}

/// All centres of a grid as OpenCV finds and orders them.
pub(super) fn centres(
    image: &GrayImage,
    grid: &Grid,
    dark: bool,
    flags: i32,
) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let mat = mat_from_gray(image)?;
    // The sizes are checked before: see `detect`.
    let pattern = Size::new(grid.columns as i32, grid.rows as i32);
    let detector = dots::blob_detector(image, grid.len(), dark)?;
    let mut centres = Vector::<Point2f>::new();
    let found = calib3d::find_circles_grid(&mat, pattern, &mut centres, flags, Some(&detector))
        .map_err(failed("look for a grid of dots"))?;
    Ok((found && centres.len() == grid.len()).then(|| from_points2f(&centres)))
}

/// Index of the one larger dot, when it is at a corner of the grid.
fn larger_dot(order: &Ordered, dots: &[Option<Dot>]) -> Option<usize> {
    let mut areas: Vec<f64> = dots.iter().flatten().map(|dot| dot.area).collect();
    let usual = quantile(&mut areas, 0.5)?;
    let mut larger = (0..dots.len()).filter(|&i| dots[i].is_some_and(|dot| dot.area > LARGER_DOT * usual));
    let (index, more) = (larger.next()?, larger.next());
    let (column, row) = (index % order.columns, index / order.columns);
    let at_corner = (column == 0 || column + 1 == order.columns) && (row == 0 || row + 1 == order.rows());
    (more.is_none() && at_corner).then_some(index)
}
