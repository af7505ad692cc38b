//! Chessboards with the exact area of every pixel: pixels are cut along the lines between squares in the undistorted
//! image.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::Scene;
use handeye_geometry::targets::Grid;

/// The squares of a board and how they lie before the camera.
pub(super) struct Squares {
    grid: Grid,
    first_dark: bool,
    /// Homography from the plane at depth 1 to squares: an inner corner (c, r) is at (c, r).
    board_from_flat: Matrix3<f64>,
}

impl Squares {
    pub fn of(scene: &Scene) -> Self {
        let (grid, pose) = (scene.grid(), &scene.camera_from_target);
        let r = pose.rotation.to_rotation_matrix().into_inner();
        let columns = [r.column(0) * grid.square_m, r.column(1) * grid.square_m, pose.translation.vector];
        let board_from_flat = Matrix3::from_columns(&columns).try_inverse().expect("the board is not edge-on");
        Self { grid, first_dark: scene.first_dark, board_from_flat }
    }

    /// The light in every pixel before the lens blurs it.
    pub fn levels(&self, scene: &Scene) -> Vec<f64> {
        let (width, height) = (scene.camera.width as usize, scene.camera.height as usize);
        // Corners of pixels, shared by their neighbours.
        let across = width + 1;
        let corners: Vec<Vector2<f64>> = (0..across * (height + 1))
            .map(|i| {
                let px = Vector2::new((i % across) as f64 - 0.5, (i / across) as f64 - 0.5);
                let ray = scene.camera.unproject(&px).expect("inside the lens model");
                ray.xy() / ray.z
            })
            .collect();
        let mut levels = Vec::with_capacity(width * height);
        for v in 0..height {
            for u in 0..width {
                let first = v * across + u;
                let pixel = [first, first + 1, first + across + 1, first + across].map(|i| corners[i]);
                levels.push(scene.light + (scene.dark - scene.light) * self.dark_part(&pixel));
            }
        }
        levels
    }

    fn dark_part(&self, pixel: &[Vector2<f64>; 4]) -> f64 {
        let [first, rest @ ..] = pixel.map(|p| self.on_board(&p).map(f64::floor));
        if rest.iter().all(|b| *b == first) {
            return if self.is_dark(&first) { 1.0 } else { 0.0 };
        }
        self.dark_area(pixel) / area(pixel)
    }

    fn dark_area(&self, polygon: &[Vector2<f64>]) -> f64 {
        let h = &self.board_from_flat;
        for axis in 0..2 {
            let values = polygon.iter().map(|p| self.on_board(p)[axis]);
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
            let line = (low + 1e-12).ceil();
            let outermost = [self.grid.columns, self.grid.rows][axis] as f64;
            if line < high - 1e-12 && line >= -1.0 && line <= outermost {
                // On the line, h.row(axis) * p = line * h.row(2) * p.
                let cut = h.row(axis) - h.row(2) * line;
                let side = |p: &Vector2<f64>| cut[0] * p.x + cut[1] * p.y + cut[2];
                return self.dark_area(&clip(polygon, &side)) + self.dark_area(&clip(polygon, &|p| -side(p)));
            }
        }
        let area = area(polygon);
        let centre = polygon.iter().sum::<Vector2<f64>>() / polygon.len() as f64;
        if area > 0.0 && self.is_dark(&self.on_board(&centre)) { area } else { 0.0 }
    }

    fn on_board(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let b = self.board_from_flat * Vector3::new(p.x, p.y, 1.0);
        Vector2::new(b.x / b.z, b.y / b.z)
    }

    /// One square all around the inner corners, then light paper.
    fn is_dark(&self, b: &Vector2<f64>) -> bool {
        let (c, r) = (b.x.floor() as i64, b.y.floor() as i64);
        let on_board = c >= -1 && r >= -1 && c < self.grid.columns as i64 && r < self.grid.rows as i64;
        on_board && ((c + r).rem_euclid(2) == 0) == self.first_dark
    }
}

/// The part of a convex polygon where `side` is positive.
fn clip(polygon: &[Vector2<f64>], side: &dyn Fn(&Vector2<f64>) -> f64) -> Vec<Vector2<f64>> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (sa, sb) = (side(a), side(b));
        if sa >= 0.0 {
            out.push(*a);
        }
        if sa * sb < 0.0 {
            out.push(a + (b - a) * (sa / (sa - sb)));
        }
    }
    out
}

fn area(polygon: &[Vector2<f64>]) -> f64 {
    let n = polygon.len();
    0.5 * (0..n).map(|i| polygon[i].perp(&polygon[(i + 1) % n])).sum::<f64>().abs()
}
