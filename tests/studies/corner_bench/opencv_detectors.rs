//! OpenCV's two chessboard detectors at their best settings.

use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::Corner;
use image::GrayImage;
use nalgebra::Vector2;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Size, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER, Vector};

/// Window of `cornerSubPix` as a part of the smallest distance between corners, and its bounds \[px\].
const WINDOW: (f32, i32, i32) = (0.4, 2, 10);

/// `findChessboardCorners`, then `cornerSubPix` with a window matched to the squares.
pub fn classic(image: &GrayImage, grid: &Grid) -> Option<Vec<Corner>> {
    let mat = mat(image);
    let size = Size::new(grid.columns as i32, grid.rows as i32);
    let mut corners = Vector::<Point2f>::new();
    let flags = calib3d::CALIB_CB_ADAPTIVE_THRESH + calib3d::CALIB_CB_NORMALIZE_IMAGE + calib3d::CALIB_CB_FAST_CHECK;
    if !calib3d::find_chessboard_corners(&mat, size, &mut corners, flags).expect("searches") {
        return None;
    }
    let all: Vec<Point2f> = corners.iter().collect();
    let mut least = f32::INFINITY;
    for (i, a) in all.iter().enumerate() {
        for b in &all[i + 1..] {
            least = least.min((a.x - b.x).hypot(a.y - b.y));
        }
    }
    let half = ((WINDOW.0 * least) as i32).clamp(WINDOW.1, WINDOW.2);
    let criteria = TermCriteria { typ: TermCriteria_EPS + TermCriteria_MAX_ITER, max_count: 40, epsilon: 1e-3 };
    opencv::imgproc::corner_sub_pix(&mat, &mut corners, Size::new(half, half), Size::new(-1, -1), criteria)
        .expect("refines");
    Some(listed(&corners))
}

/// `findChessboardCornersSB` with the flag for accuracy (normalising the image makes it worse).
pub fn sectors(image: &GrayImage, grid: &Grid) -> Option<Vec<Corner>> {
    let size = Size::new(grid.columns as i32, grid.rows as i32);
    let mut corners = Vector::<Point2f>::new();
    let found = calib3d::find_chessboard_corners_sb(&mat(image), size, &mut corners, calib3d::CALIB_CB_ACCURACY);
    found.expect("searches").then(|| listed(&corners))
}

fn mat(image: &GrayImage) -> opencv::boxed_ref::BoxedRef<'_, Mat> {
    Mat::new_rows_cols_with_data(image.height() as i32, image.width() as i32, image.as_raw()).expect("an image")
}

fn listed(corners: &Vector<Point2f>) -> Vec<Corner> {
    let px = corners.iter().map(|p| Vector2::new(f64::from(p.x), f64::from(p.y)));
    px.enumerate().map(|(index, px)| Corner::new(index, px)).collect()
}
