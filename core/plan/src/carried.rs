//! What is mounted on the tip in addition to the tool: a camera, or a board.

use nalgebra::{Isometry3, Point3};

use super::capsule::Capsule;
use super::{SHEET_EDGE_SQUARES, SHEET_M};
use handeye_geometry::frames::{Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;

/// Radius of a camera's housing, metres.
const HOUSING_RADIUS_M: f64 = 0.03;
/// Its length behind the lens, metres.
const HOUSING_M: f64 = 0.03;
/// Radius of the capsules that a board is made of: they make it thicker than it is by less than a centimetre on each side.
const PLATE_RADIUS_M: f64 = 0.01;
/// Distance between two of them: midway they are still 4 mm thick on each side, more than the sheet.
const PLATE_PITCH_M: f64 = 0.018;
/// How far they begin inside the edge: their round ends reach over it, and still cover the corners.
const PLATE_INSET_M: f64 = 0.004;
/// Capsules of a board at most; those of a board that is wider than about half a metre are thicker instead.
const MOST_PLATE_CAPSULES: usize = 30;

/// What is mounted on the tip, as capsules in the frame of the tip.
#[derive(Debug, Clone, PartialEq)]
pub struct Carried {
    capsules: Vec<Capsule>,
    /// The camera, which has to stay in the work volume as the tip does.
    watched: Option<Point3<f64>>,
    /// Whether it is as wide as the wrist is long, so that it may touch the wrist.
    is_wide: bool,
}

impl Carried {
    /// A camera with its lens at this pose in the tip, and the housing behind it.
    pub fn camera(tip_from_camera: &Isometry3<f64>) -> Self {
        let lens = Point3::from(tip_from_camera.translation.vector);
        let back = tip_from_camera * Point3::new(0.0, 0.0, -HOUSING_M);
        let housing = Capsule { from: lens, to: back, radius_m: HOUSING_RADIUS_M };
        Self { capsules: vec![housing], watched: Some(lens), is_wide: false }
    }

    /// A board with the whole of its sheet, with a margin for the uncertainty of its place, metres.
    pub(crate) fn board(target: &TargetSpec, tip_from_target: &Pose<Tip, Target>, room_m: f64) -> Self {
        let (centre, extent, square_m) = (target.centre(), target.extent(), target.grid().square_m);
        let edges_m = [extent.x, extent.y].map(|points_m| points_m + 2.0 * SHEET_EDGE_SQUARES * square_m);
        let (long, short) = if edges_m[0] >= edges_m[1] { (0, 1) } else { (1, 0) };
        let count = ((edges_m[short] / PLATE_PITCH_M).ceil() as usize).clamp(1, MOST_PLATE_CAPSULES);
        let pitch_m = edges_m[short] / count as f64;
        let radius_m = PLATE_RADIUS_M.max(0.5 * pitch_m + SHEET_M) + room_m;
        let half_m = (0.5 * edges_m[long] - PLATE_INSET_M).max(0.0);
        let at = |along_m: f64, across_m: f64| {
            let mut point = Point3::new(centre.x, centre.y, 0.5 * SHEET_M);
            point[long] += along_m;
            point[short] += across_m;
            tip_from_target.isometry() * point
        };
        let capsules = (0..count).map(|k| {
            let across_m = (k as f64 + 0.5) * pitch_m - 0.5 * edges_m[short];
            Capsule { from: at(-half_m, across_m), to: at(half_m, across_m), radius_m }
        });
        Self { capsules: capsules.collect(), watched: None, is_wide: true }
    }

    pub(super) fn capsules(&self) -> &[Capsule] {
        &self.capsules
    }

    pub(super) fn watched(&self) -> Option<Point3<f64>> {
        self.watched
    }

    pub(super) fn is_wide(&self) -> bool {
        self.is_wide
    }

    /// From the tip to its farthest point, metres.
    pub(super) fn reach_m(&self) -> f64 {
        let ends = self.capsules.iter().flat_map(|c| [c.from, c.to].map(|end| end.coords.norm() + c.radius_m));
        ends.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::Obstacle;
    use handeye_geometry::testing::BOARD;

    /// Compared with the sheet itself, point by point.
    #[test]
    fn a_board_is_as_large_as_its_sheet_to_a_centimetre() {
        let tip_from_target = Isometry3::new(Vector3::new(0.02, -0.01, 0.05), Vector3::new(0.3, 2.0, -0.4));
        let board = Carried::board(&BOARD, &Pose::from_isometry(tip_from_target), 0.0);
        let (centre, extent) = (BOARD.centre(), BOARD.extent());
        let edge_m = SHEET_EDGE_SQUARES * BOARD.grid().square_m;
        let mut sheet = Vec::new();
        for i in 0..=60 {
            for j in 0..=60 {
                let along = |k: i32, extent_m: f64| (f64::from(k) / 60.0 - 0.5) * (extent_m + 2.0 * edge_m);
                sheet.push(
                    tip_from_target * Point3::new(centre.x + along(i, extent.x), centre.y + along(j, extent.y), 0.0),
                );
            }
        }
        for (x, y, z) in [(0.3, 0.0, 0.0), (0.0, 0.25, 0.1), (0.1, 0.1, 0.3), (-0.2, -0.2, 0.0), (0.0, 0.0, 0.2)] {
            let probe = Obstacle::new("probe", Isometry3::translation(x, y, z), [0.0; 3]);
            let by_capsules = board.capsules().iter().map(|c| c.distance_to_box(&probe)).fold(f64::INFINITY, f64::min);
            let by_points = sheet.iter().map(|p| probe.distance_to(p)).fold(f64::INFINITY, f64::min);
            assert!(by_capsules <= by_points + 1e-3, "{by_capsules} m is farther than {by_points} m");
            assert!(by_capsules > by_points - 0.0115, "{by_capsules} m is nearer than {by_points} m");
        }
        // No hole that something thin could be in.
        for point in &sheet {
            let probe = Obstacle::new("probe", Isometry3::translation(point.x, point.y, point.z), [0.0; 3]);
            assert!(board.capsules().iter().any(|c| c.distance_to_box(&probe) < 0.0), "{point}");
        }
    }
}
