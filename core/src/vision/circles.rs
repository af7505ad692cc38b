//! Centres of a symmetric grid of dots.

use image::GrayImage;
use nalgebra::Vector2;
use opencv::calib3d;
use opencv::core::{Point2f, Ptr, Size, Vector};
use opencv::features2d::{Feature2D, SimpleBlobDetector, SimpleBlobDetector_Params};

use super::{VisionError, is_empty, mat, order};
use crate::target::Grid;

/// How much larger in area the origin's dot is than the median one before it counts as marked: printed dots vary by a
/// few percent, marks are larger by half or more.
const MARK_RATIO: f64 = 1.3;

pub fn detect(image: &GrayImage, grid: &Grid) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    if is_empty(image) {
        return Ok(None);
    }
    let mut parameters = SimpleBlobDetector_Params::default().map_err(VisionError::opencv("set up blobs"))?;
    parameters.min_area = 12.0;
    parameters.max_area = (image.width() * image.height()) as f32 / grid.len() as f32;
    parameters.min_dist_between_blobs = 4.0;
    let detector: Ptr<Feature2D> =
        SimpleBlobDetector::create(parameters).map_err(VisionError::opencv("set up blobs"))?.into();
    let mut centres = Vector::<Point2f>::new();
    let found = calib3d::find_circles_grid(
        &mat(image)?,
        Size::new(grid.columns as i32, grid.rows as i32),
        &mut centres,
        calib3d::CALIB_CB_SYMMETRIC_GRID | calib3d::CALIB_CB_CLUSTERING,
        Some(&detector),
    )
    .map_err(VisionError::opencv("look for a grid of dots"))?;
    if !found || centres.len() != grid.len() {
        return Ok(None);
    }
    let points: Vec<Vector2<f64>> = centres.iter().map(|p| Vector2::new(f64::from(p.x), f64::from(p.y))).collect();
    let candidates = order::orientations(points, grid);
    let marked = candidates.iter().position(|points| origin_is_marked(image, points, grid));
    Ok(Some(match marked {
        Some(index) => candidates.into_iter().nth(index).unwrap_or_default(),
        None => order::rightmost(candidates, grid),
    }))
}

/// Whether the first dot is clearly larger than the others, by the dark area within half a spacing.
fn origin_is_marked(image: &GrayImage, points: &[Vector2<f64>], grid: &Grid) -> bool {
    let mut areas: Vec<f64> = (0..points.len()).map(|i| dark_fraction(image, points, grid, i)).collect();
    let origin = areas[0];
    areas.sort_by(f64::total_cmp);
    origin > MARK_RATIO * areas[areas.len() / 2]
}

/// Part of a cell of the grid that is darker than halfway between its darkest and brightest pixel.
fn dark_fraction(image: &GrayImage, points: &[Vector2<f64>], grid: &Grid, index: usize) -> f64 {
    let (row, column) = (index / grid.columns, index % grid.columns);
    let across = if column + 1 < grid.columns { index + 1 } else { index - 1 };
    let down = if row + 1 < grid.rows { index + grid.columns } else { index - grid.columns };
    let (x, y) = ((points[across] - points[index]) * 0.5, (points[down] - points[index]) * 0.5);
    const STEPS: i32 = 20;
    let mut samples = Vec::with_capacity((4 * STEPS * STEPS) as usize);
    for i in -STEPS..STEPS {
        for j in -STEPS..STEPS {
            let at = points[index] + x * (f64::from(i) / f64::from(STEPS)) + y * (f64::from(j) / f64::from(STEPS));
            let (u, v) = (at.x.round(), at.y.round());
            if u >= 0.0 && v >= 0.0 && u < f64::from(image.width()) && v < f64::from(image.height()) {
                samples.push(image.get_pixel(u as u32, v as u32).0[0]);
            }
        }
    }
    let (Some(low), Some(high)) = (samples.iter().min(), samples.iter().max()) else { return 0.0 };
    let threshold = f64::midpoint(f64::from(*low), f64::from(*high));
    samples.iter().filter(|s| f64::from(**s) < threshold).count() as f64 / samples.len() as f64
}
