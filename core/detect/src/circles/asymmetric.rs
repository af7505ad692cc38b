//! Grids of dots with every other row shifted: found by OpenCV, numbered by what the pattern allows.

use image::GrayImage;
use nalgebra::{Matrix3, Vector2};
use opencv::calib3d;

use super::dots;
use crate::error::go_on;
use crate::options::Effort;
use crate::{VisionError, circles};
use handeye_geometry::planar_pose::homography::{homography, jacobian, mapped};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};

/// Largest RMS deviation from the flat pattern as a part of the distance between rows: what a strong lens bends, and a
/// third of what a wrong numbering makes.
const MAX_MISFIT: f64 = 0.2;

/// Finds all dots. OpenCV's order may be turned or mirrored, and where rows are even in number, the two of each pair may
/// be exchanged: of all ways to read it, those that fit the pattern and are right-handed in the image remain, and of two
/// the one whose x axis points most to the right.
pub(crate) fn find(
    image: &GrayImage,
    grid: &Grid,
    effort: Effort,
    cancel: &CancelToken,
) -> Result<Option<Vec<Corner>>, VisionError> {
    const PLAIN: i32 = calib3d::CALIB_CB_ASYMMETRIC_GRID;
    const CLUSTERED: i32 = calib3d::CALIB_CB_ASYMMETRIC_GRID + calib3d::CALIB_CB_CLUSTERING;
    let attempts: &[(bool, i32)] = match effort {
        Effort::Live => &[(true, PLAIN)],
        Effort::Thorough => &[(true, PLAIN), (true, CLUSTERED), (false, PLAIN), (false, CLUSTERED)],
    };
    let target = TargetSpec::AsymmetricCircles(*grid);
    let on_target: Vec<Vector2<f64>> = target.points().iter().map(|p| p.coords.xy()).collect();
    for &(dark, flags) in attempts {
        go_on(cancel)?;
        let Some(centres) = circles::centres(image, grid, dark, flags)? else { continue };
        if let Some((points, map)) = numbered(&centres, &on_target, grid) {
            return Ok(refined(image, &points, &on_target, &map, grid, dark));
        }
    }
    Ok(None)
}

/// The centres in the order of the target, and the map from target to image.
fn numbered(
    centres: &[Vector2<f64>],
    on_target: &[Vector2<f64>],
    grid: &Grid,
) -> Option<(Vec<Vector2<f64>>, Matrix3<f64>)> {
    let mut best: Option<(f64, Vec<Vector2<f64>>, Matrix3<f64>)> = None;
    for way in 0..8 {
        let [flip_x, flip_y, exchange] = [way & 1 > 0, way & 2 > 0, way & 4 > 0];
        if exchange && !grid.rows.is_multiple_of(2) {
            continue;
        }
        let order = (0..grid.len()).map(|index| {
            let (column, row) = (index % grid.columns, index / grid.columns);
            let column = if flip_x { grid.columns - 1 - column } else { column };
            let row = if flip_y { grid.rows - 1 - row } else { row };
            centres[(row ^ usize::from(exchange)) * grid.columns + column]
        });
        let points: Vec<Vector2<f64>> = order.collect();
        let pairs: Vec<_> = on_target.iter().copied().zip(points.iter().copied()).collect();
        let Some(map) = homography(&pairs) else { continue };
        let middle = on_target.iter().sum::<Vector2<f64>>() / on_target.len() as f64;
        let slope = jacobian(&map, middle);
        let area = slope.determinant();
        let off = pairs.iter().map(|(a, b)| (mapped(&map, *a) - b).norm_squared()).sum::<f64>() / pairs.len() as f64;
        let fits = off.sqrt() <= MAX_MISFIT * grid.square_m * area.abs().sqrt();
        let to_the_right = slope[(0, 0)] / slope.column(0).norm();
        if fits && area > 0.0 && best.as_ref().is_none_or(|(other, ..)| to_the_right > *other) {
            best = Some((to_the_right, points, map));
        }
    }
    best.map(|(_, points, map)| (points, map))
}

fn refined(
    image: &GrayImage,
    points: &[Vector2<f64>],
    on_target: &[Vector2<f64>],
    map: &Matrix3<f64>,
    grid: &Grid,
    dark: bool,
) -> Option<Vec<Corner>> {
    let step = grid.square_m;
    // The next dots are diagonal: they span a cell of twice the square of the distance between rows.
    let (first, second) = (Vector2::new(step, step), Vector2::new(-step, step));
    let mut centres = points.to_vec();
    let mut radii = vec![None; points.len()];
    for (i, centre) in centres.iter_mut().enumerate() {
        let slope = jacobian(map, on_target[i]);
        let steps = (slope * first, slope * second);
        if let Some(dot) = dots::measure(image, points[i], &steps, dark).filter(|dot| dot.whole) {
            *centre = dot.centre;
            radii[i] = Some(dots::radius(&dot, 2.0 * step * step));
        }
    }
    dots::image_of_centres(&mut centres, on_target, &radii)?;
    Some(centres.into_iter().enumerate().map(|(index, px)| Corner::new(index, px)).collect())
}
