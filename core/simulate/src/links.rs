//! The mounts of camera and target, and the poses that follow from them.

use nalgebra::{Isometry3, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};
use rand::{Rng, RngExt as _};
use rand_distr::{Distribution as _, StandardNormal};

use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use handeye_geometry::observations::{Mode, Noise};

/// The two rigid links of a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Links {
    /// Who carries the camera.
    pub mode: Mode,
    pub mount_from_camera: Pose<Mount, Camera>,
    pub anchor_from_target: Pose<Anchor, Target>,
}

impl Links {
    /// From position \[m\] and rotation vector \[rad\] of camera and target.
    pub fn at(mode: Mode, camera: [[f64; 3]; 2], target: [[f64; 3]; 2]) -> Self {
        let at = |[place, turn]: [[f64; 3]; 2]| Isometry3::new(place.into(), turn.into());
        Self {
            mode,
            mount_from_camera: Pose::from_isometry(at(camera)),
            anchor_from_target: Pose::from_isometry(at(target)),
        }
    }

    /// Pose of the target in the camera with the tip there.
    pub fn camera_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Camera, Target> {
        let (camera, target) = (self.mount_from_camera.isometry(), self.anchor_from_target.isometry());
        let tip = base_from_tip.isometry();
        Pose::from_isometry(match self.mode {
            Mode::EyeInHand => (tip * camera).inverse() * target,
            Mode::EyeToHand => camera.inverse() * tip * target,
        })
    }

    /// Pose of the tip that gives the camera this pose of the target.
    pub fn base_from_tip(&self, camera_from_target: &Pose<Camera, Target>) -> Pose<Base, Tip> {
        let (camera, target) = (self.mount_from_camera.isometry(), self.anchor_from_target.isometry());
        let seen = camera_from_target.isometry();
        Pose::from_isometry(match self.mode {
            Mode::EyeInHand => target * (camera * seen).inverse(),
            Mode::EyeToHand => camera * seen * target.inverse(),
        })
    }
}

/// A normal number of deviation 1.
pub fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Three metres, then three radians of noise with these deviations.
pub fn noise_twist(rng: &mut impl Rng, metres: f64, radians: f64) -> Vector6<f64> {
    Vector6::from_fn(|i, _| normal(rng) * if i < 3 { metres } else { radians })
}

/// Error of the robot at a pose: true = reported · error.
pub fn robot_error(rng: &mut impl Rng, noise: &Noise) -> Isometry3<f64> {
    shift_and_turn(&noise_twist(rng, noise.robot_m, noise.robot_rad))
}

/// The tip pose that a robot reports which is really at another.
pub fn reported(rng: &mut impl Rng, base_from_tip: &Pose<Base, Tip>, noise: &Noise) -> Pose<Base, Tip> {
    Pose::from_isometry(base_from_tip.isometry() * robot_error(rng, noise).inverse())
}

/// A translation \[m\] and a rotation vector \[rad\] apart from each other.
pub fn shift_and_turn(by: &Vector6<f64>) -> Isometry3<f64> {
    Isometry3::new(by.fixed_rows::<3>(0).into_owned(), by.fixed_rows::<3>(3).into_owned())
}

/// The motion along a screw, `exp` of a twist in metres and radians, as the exponential of its matrix.
pub fn screw(twist: &Vector6<f64>) -> Isometry3<f64> {
    let mut generator = Matrix4::zeros();
    let turn = twist.fixed_rows::<3>(3).into_owned();
    generator.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn.cross_matrix());
    generator.fixed_view_mut::<3, 1>(0, 3).copy_from(&twist.fixed_rows::<3>(0));
    let moved = generator.exp();
    let rotation = Rotation3::from_matrix_unchecked(moved.fixed_view::<3, 3>(0, 0).into_owned());
    let shift = Translation3::from(moved.fixed_view::<3, 1>(0, 3).into_owned());
    Isometry3::from_parts(shift, UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Errors of a robot that are affine in where the tip is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Point without error, metres in the base.
    pub origin_m: Vector3<f64>,
    /// Metres and radians in the axes of the tip, per metre along each axis of the base.
    pub slopes: nalgebra::SMatrix<f64, 6, 3>,
}

impl Field {
    /// Error of the robot at a reported pose: true = reported · error.
    pub fn error(&self, base_from_tip: &Pose<Base, Tip>) -> Isometry3<f64> {
        shift_and_turn(&(self.slopes * (base_from_tip.translation() - self.origin_m)))
    }
}

/// A number evenly from `-most` to `most`.
pub(crate) fn evenly(rng: &mut impl Rng, most: f64) -> f64 {
    rng.random_range(-most..most)
}

#[cfg(test)]
mod tests {
    use handeye_geometry::se3;

    use super::*;

    #[test]
    fn a_screw_is_the_exponential_of_the_estimator_and_both_ways_along_the_links_agree() {
        let twist = Vector6::new(0.3, -0.2, 0.5, 0.7, -0.4, 0.2);
        let (here, there) = (screw(&twist), se3::exp(&twist));
        assert!((here.to_homogeneous() - there.to_homogeneous()).norm() < 1e-13);
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let links = Links::at(mode, [[0.1, 0.2, 0.3], [0.4, 0.1, -0.2]], [[0.5, 0.0, 0.1], [3.0, 0.1, 0.0]]);
            let tip = Pose::from_isometry(here);
            let (off_m, off_rad) = links.base_from_tip(&links.camera_from_target(&tip)).distance_to(&tip);
            assert!(off_m < 1e-14 && off_rad < 1e-7, "{mode:?}");
            let chained =
                links.mount_from_camera.inverse() * mode.anchor_from_mount(&tip).inverse() * links.anchor_from_target;
            assert!(chained.distance_to(&links.camera_from_target(&tip)).0 < 1e-14, "{mode:?}");
        }
    }
}
