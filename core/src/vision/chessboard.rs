//! Inner corners of a chessboard: OpenCV finds the grid, a saddle fit places the corners.

use image::GrayImage;
use image::imageops::{self, FilterType};
use nalgebra::Vector2;
use opencv::calib3d;
use opencv::core::{Point2f, Size, TermCriteria, TermCriteria_Type, Vector};
use opencv::imgproc;

use super::{Effort, VisionError, is_empty, mat, order, saddle};
use crate::target::Grid;

/// Images with fewer pixels than this are also tried at twice their size.
const SMALL_IMAGE: u32 = 1_000_000;

pub fn detect(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    if is_empty(image) {
        return Ok(None);
    }
    let Some(rough) = find_grid(image, grid, effort)? else { return Ok(None) };
    let start = sub_pixel(image, grid, rough)?;
    let placed = saddle::refine_all(image, grid, &start);
    Ok(Some(order::chessboard(placed, grid, image)))
}

fn find_grid(image: &GrayImage, grid: &Grid, effort: Effort) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let base = calib3d::CALIB_CB_ADAPTIVE_THRESH | calib3d::CALIB_CB_NORMALIZE_IMAGE;
    if effort == Effort::Live {
        return classic(image, grid, base | calib3d::CALIB_CB_FAST_CHECK);
    }
    if let Some(found) = classic(image, grid, base)? {
        return Ok(Some(found));
    }
    let (width, height) = image.dimensions();
    // Half the size joins squares that noise or print texture has torn; twice the size parts squares that touch.
    let scale = if width * height < SMALL_IMAGE { 2.0 } else { 0.5 };
    let resized = imageops::resize(
        image,
        (f64::from(width) * scale) as u32,
        (f64::from(height) * scale) as u32,
        FilterType::Triangle,
    );
    if !is_empty(&resized)
        && let Some(found) = classic(&resized, grid, base)?
    {
        // Pixel centres: (u + 0.5) scales, u does not.
        return Ok(Some(found.into_iter().map(|p| (p.add_scalar(0.5) / scale).add_scalar(-0.5)).collect()));
    }
    sector_based(image, grid)
}

fn pattern_size(grid: &Grid) -> Size {
    Size::new(grid.columns as i32, grid.rows as i32)
}

fn classic(image: &GrayImage, grid: &Grid, flags: i32) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let mut corners = Vector::<Point2f>::new();
    let found = calib3d::find_chessboard_corners(&mat(image)?, pattern_size(grid), &mut corners, flags)
        .map_err(VisionError::opencv("look for a chessboard"))?;
    Ok((found && corners.len() == grid.len()).then(|| from_points(&corners)))
}

fn sector_based(image: &GrayImage, grid: &Grid) -> Result<Option<Vec<Vector2<f64>>>, VisionError> {
    let mut corners = Vector::<Point2f>::new();
    let flags = calib3d::CALIB_CB_ACCURACY;
    let found = calib3d::find_chessboard_corners_sb(&mat(image)?, pattern_size(grid), &mut corners, flags)
        .map_err(VisionError::opencv("look for a chessboard"))?;
    Ok((found && corners.len() == grid.len()).then(|| from_points(&corners)))
}

fn from_points(points: &Vector<Point2f>) -> Vec<Vector2<f64>> {
    points.iter().map(|p| Vector2::new(f64::from(p.x), f64::from(p.y))).collect()
}

/// OpenCV's refinement with a window that stays inside the squares next to a corner: a fixed window of eleven pixels
/// reaches into the next corner of a small board and pulls by half a pixel.
fn sub_pixel(image: &GrayImage, grid: &Grid, rough: Vec<Vector2<f64>>) -> Result<Vec<Vector2<f64>>, VisionError> {
    const LARGEST_WINDOW: i32 = 11;
    let spacing = saddle::smallest_spacing(grid, &rough);
    let half = ((0.4 * spacing) as i32).clamp(1, LARGEST_WINDOW);
    let mut corners: Vector<Point2f> = rough.iter().map(|p| Point2f::new(p.x as f32, p.y as f32)).collect();
    let criteria = TermCriteria {
        typ: TermCriteria_Type::COUNT as i32 | TermCriteria_Type::EPS as i32,
        max_count: 100,
        epsilon: 1e-4,
    };
    imgproc::corner_sub_pix(&mat(image)?, &mut corners, Size::new(half, half), Size::new(-1, -1), criteria)
        .map_err(VisionError::opencv("refine corners"))?;
    Ok(from_points(&corners))
}
