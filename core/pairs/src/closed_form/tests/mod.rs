mod degenerate;
mod exact;
mod linear;
mod noisy;
mod reference;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};
use proptest::prelude::*;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::ClosedFormSolution;
use crate::PosePair;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};

/// Noise-free data leave rounding alone: 1e-16 on metres and radians times a condition number of up to 1e5, which the
/// linear methods reach when a session is all tilts of a few degrees but two.
const EXACT: f64 = 1e-11;

/// A pose with any rotation and up to 2 m in each coordinate.
fn any_pose() -> impl Strategy<Value = Isometry3<f64>> {
    (prop::array::uniform3(-2.0..2.0f64), prop::array::uniform3(-1.0..1.0f64), 0.0..std::f64::consts::PI).prop_map(
        |(t, axis, angle)| {
            let axis = Vector3::from(axis).try_normalize(1e-3).unwrap_or(Vector3::x());
            isometry(t, (axis * angle).into())
        },
    )
}

fn isometry(translation_m: [f64; 3], rotation_vector: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(translation_m),
        UnitQuaternion::from_scaled_axis(Vector3::from(rotation_vector)),
    )
}

/// Robot poses as in a session: around one place, turned by up to a radian about any axis, and always by 40° about two
/// of them.
fn robot_poses() -> impl Strategy<Value = Vec<Pose<Anchor, Mount>>> {
    let turn = (prop::array::uniform3(-0.3..0.3f64), prop::array::uniform3(-0.57..0.57f64));
    (any_pose(), prop::collection::vec(turn, 0..6)).prop_map(|(centre, turns)| {
        let fixed = [([0.0; 3], [0.0; 3]), ([0.2, 0.1, 0.0], [0.7, 0.0, 0.0]), ([0.0, -0.1, 0.2], [0.0, 0.7, 0.0])];
        fixed.into_iter().chain(turns).map(|(t, r)| Pose::from_isometry(centre * isometry(t, r))).collect()
    })
}

/// A session to which the answer is known.
#[derive(Debug, Clone)]
struct Truth {
    mount_from_camera: Pose<Mount, Camera>,
    anchor_from_target: Pose<Anchor, Target>,
}

fn any_truth() -> impl Strategy<Value = Truth> {
    (any_pose(), any_pose()).prop_map(|(x, y)| Truth {
        mount_from_camera: Pose::from_isometry(x),
        anchor_from_target: Pose::from_isometry(y),
    })
}

impl Truth {
    fn view(&self, anchor_from_mount: Pose<Anchor, Mount>) -> PosePair {
        let anchor_from_camera = anchor_from_mount * self.mount_from_camera;
        PosePair { anchor_from_mount, camera_from_target: anchor_from_camera.inverse() * self.anchor_from_target }
    }

    fn views(&self, anchor_from_mount: &[Pose<Anchor, Mount>]) -> Vec<PosePair> {
        anchor_from_mount.iter().map(|pose| self.view(*pose)).collect()
    }

    /// Largest difference of the two links, metres or radians.
    fn error_of(&self, solution: &ClosedFormSolution) -> f64 {
        difference(
            solution,
            &ClosedFormSolution {
                mount_from_camera: self.mount_from_camera,
                anchor_from_target: self.anchor_from_target,
            },
        )
    }
}

/// Largest difference of the two links, metres or radians.
fn difference(a: &ClosedFormSolution, b: &ClosedFormSolution) -> f64 {
    let x = a.mount_from_camera.distance_to(&b.mount_from_camera);
    let y = a.anchor_from_target.distance_to(&b.anchor_from_target);
    x.0.max(x.1).max(y.0).max(y.1)
}

/// Moves every target pose by up to `size` metres and radians in each coordinate.
fn with_noise(views: &[PosePair], seed: u64, size: f64) -> Vec<PosePair> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    views
        .iter()
        .map(|view| {
            let delta = Vector6::from_fn(|_, _| rng.random_range(-size..=size));
            PosePair { camera_from_target: view.camera_from_target.perturbed(&delta), ..*view }
        })
        .collect()
}
