//! Views of a board at random: wholly in the image, near enough to be found, as tilted as a detector tolerates.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use handeye_estimate::handeye::joint::ExpectedPixels;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;

/// Margin to the edge of the image in standard deviations of the expected place of the board: one view in eighty is cut
/// on a side.
const SURE: f64 = 2.5;

/// Range of the views of a board that are searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewRange {
    /// Nearest and farthest distance from the camera to the middle of the board \[m\].
    pub distance_m: [f64; 2],
    /// Largest angle between the line of sight and the normal of the board.
    pub tilt_rad: f64,
    /// Free pixels between the board and the edge of the image.
    pub margin_px: f64,
    /// Least distance of two neighbouring corners in the image.
    pub spacing_px: f64,
}

/// Tilt that every detector of targets tolerates.
const TILT_RAD: f64 = 50.0 * std::f64::consts::PI / 180.0;
/// Width of the print around the outermost points, in squares.
const BORDER_SQUARES: f64 = 1.0;

impl ViewRange {
    /// A range around the distances \[m\] from which a person chose to view the board: from two thirds of the nearest to one
    /// and a half times the farthest, where cameras of a fixed focus are still sharp.
    pub fn about(distances_m: impl Iterator<Item = f64>) -> Option<Self> {
        let (nearest, farthest) =
            distances_m.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), d| (low.min(d), high.max(d)));
        (farthest > 0.0 && nearest.is_finite()).then_some(Self {
            distance_m: [nearest / 1.5, farthest * 1.5],
            tilt_rad: TILT_RAD,
            margin_px: 12.0,
            spacing_px: 8.0,
        })
    }

    /// A view with the middle of the board anywhere in the image, turned and tilted at random. Whether it is wholly in the
    /// image is checked separately, see [`Self::shows`].
    pub fn draw(
        &self,
        rng: &mut ChaCha8Rng,
        intrinsics: &Intrinsics,
        target: &TargetSpec,
    ) -> Option<Pose<Camera, Target>> {
        let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let place = Vector2::new(
            uniform(0.0, f64::from(intrinsics.width) - 1.0),
            uniform(0.0, f64::from(intrinsics.height) - 1.0),
        );
        // Evenly on a logarithmic scale: a factor of distance is worth the same everywhere.
        let distance_m = uniform(self.distance_m[0].ln(), self.distance_m[1].ln()).exp();
        // Uniform on the cap of the sphere: its area is proportional to its height.
        let tilt = uniform(self.tilt_rad.cos(), 1.0).clamp(-1.0, 1.0).acos();
        let azimuth = uniform(0.0, std::f64::consts::TAU);
        let roll = uniform(-std::f64::consts::PI, std::f64::consts::PI);
        let sight = intrinsics.unproject(&place).ok()?;
        // The target's z points into the board, so the viewer is on the side of -z.
        let facing = Rotation3::rotation_between(&Vector3::z(), &sight)?;
        let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
            * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
        let turn = UnitQuaternion::from_rotation_matrix(&facing) * tilted;
        let at = Translation3::from(sight.into_inner() * distance_m);
        Some(Pose::from_isometry(Isometry3::from_parts(at, turn) * Translation3::from(-target.centre().coords)))
    }

    /// Whether the board is wholly in the image and large enough there.
    pub fn shows(
        &self,
        intrinsics: &Intrinsics,
        target: &TargetSpec,
        camera_from_target: &Pose<Camera, Target>,
    ) -> bool {
        let pose = camera_from_target.isometry();
        let inside = |point: &Point3<f64>| {
            intrinsics.project(&(pose * point)).is_ok_and(|px| self.holds(intrinsics, &px, &Vector2::zeros()))
        };
        outline(target).iter().all(inside) && self.is_large(intrinsics, target, pose)
    }

    /// Whether it is in spite of the uncertainty, with `doubt_factor` times the usual margin for that.
    pub(crate) fn surely_shows(&self, target: &TargetSpec, expected: &ExpectedPixels<'_>, doubt_factor: f64) -> bool {
        let intrinsics = expected.intrinsics();
        let inside = |point: &Point3<f64>| {
            expected
                .of(point)
                .is_some_and(|(px, sigma_px)| self.holds(intrinsics, &px, &(sigma_px * SURE * doubt_factor)))
        };
        outline(target).iter().all(inside) && self.is_large(intrinsics, target, expected.camera_from_target())
    }

    /// Whether a pixel with this uncertainty is in the image, with the margin.
    fn holds(&self, intrinsics: &Intrinsics, px: &Vector2<f64>, within_px: &Vector2<f64>) -> bool {
        let last = [f64::from(intrinsics.width) - 1.0, f64::from(intrinsics.height) - 1.0];
        let free = within_px.map(|px| px + self.margin_px - 0.5);
        (0..2).all(|axis| px[axis] >= free[axis] && px[axis] <= last[axis] - free[axis])
    }

    fn is_large(&self, intrinsics: &Intrinsics, target: &TargetSpec, pose: &Isometry3<f64>) -> bool {
        let grid = target.grid();
        let centre = target.centre();
        // The smaller of the two singular values of how the image of the board moves along it.
        let Ok(seen) = intrinsics.project_with_jacobians(&(pose * centre)) else { return false };
        let along = seen.px_by_point * pose.rotation.to_rotation_matrix().matrix().fixed_view::<3, 2>(0, 0);
        let least = along.svd(false, false).singular_values.min();
        least * grid.square_m >= self.spacing_px
    }
}

/// Points along the edge of the board, in its frame \[m\]: corners and the middles between them.
fn outline(target: &TargetSpec) -> Vec<Point3<f64>> {
    let grid = target.grid();
    let (extent, centre) = (target.extent(), target.centre());
    let half = extent / 2.0 + Vector2::repeat(BORDER_SQUARES * grid.square_m);
    let at = |x: f64, y: f64| Point3::new(centre.x + x * half.x, centre.y + y * half.y, 0.0);
    let sides = [-1.0, 0.0, 1.0];
    sides.iter().flat_map(|&x| sides.map(|y| at(x, y))).filter(|point| *point != at(0.0, 0.0)).collect()
}
