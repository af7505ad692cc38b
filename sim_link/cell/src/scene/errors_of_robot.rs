//! How the arm's true pose differs from the one it reports.

use nalgebra::{Isometry3, Vector6};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::errors_of_arm::drawn;
use super::{JointError, RobotSpec};
use handeye_arm::{Arm, JointValues};

/// First stream of random numbers that belongs to settled positions; the ones below are the scene's own.
const FIRST_STREAM: u64 = 1 << 32;

/// The errors of one robot.
///
/// What the robot *reports* is the nominal kinematics of its encoders: `forward(q)`. Where it really *is* differs by three
/// more errors: constant joint offsets, links other than the nominal ones, and a displacement that differs every time it comes
/// to rest,
///
/// `true = forward_with_errors(q + joint_offset) * connection_from_tip * exp(settled(n))`
///
/// with the tangent vector `[t; r]` in the tip frame. `n` counts the times that the arm has come to rest: while it is
/// at rest its pose does not change, however often it is read.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotErrors {
    /// Added to the joint values of the encoders, radians.
    pub joint_offset_rad: JointValues,
    /// Error of each joint.
    pub joints: Vec<JointError>,
    /// 1σ per axis of the displacement, metres.
    pub repeatability_m: f64,
    /// 1σ per axis of the rotation, radians.
    pub repeatability_rad: f64,
    seed: u64,
}

impl RobotErrors {
    pub(super) fn new(robot: &RobotSpec, arm: &Arm, seed: u64) -> Self {
        let offset_deg = robot.joint_offset_deg.unwrap_or(JointValues::zeros(arm.joint_count()));
        Self {
            joint_offset_rad: offset_deg.map(f64::to_radians),
            joints: drawn(&robot.arm_errors, arm, seed),
            repeatability_m: robot.repeatability_mm * 1e-3,
            repeatability_rad: robot.repeatability_deg.to_radians(),
            seed,
        }
    }

    /// True minus nominal pose of the tip, `[t; r]` in metres and radians in the tip frame, the `index`-th time that
    /// the arm has come to rest. The same seed and index always give the same.
    pub fn settled(&self, index: u64) -> Vector6<f64> {
        gaussian(self.seed, FIRST_STREAM.wrapping_add(index), self.repeatability_m, self.repeatability_rad)
    }

    /// Where each joint really is, in its frame at rest turned so that the axis is z, with `gravity` as each one's share of the
    /// largest torque.
    pub(super) fn displacements(&self, gravity: &[f64]) -> Vec<Isometry3<f64>> {
        let errors = self.joints.iter().zip(&self.joint_offset_rad).zip(gravity);
        errors.map(|((error, offset_rad), gravity)| error.displacement(*offset_rad, *gravity)).collect()
    }
}

/// One of the independent sources of random numbers that a seed has.
pub(super) fn stream_of(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

/// Six independent Gaussian numbers `[t; r]` from one stream of a seed.
pub(super) fn gaussian(seed: u64, stream: u64, sigma_m: f64, sigma_rad: f64) -> Vector6<f64> {
    let mut rng = stream_of(seed, stream);
    Vector6::from_fn(|row, _| {
        let unit: f64 = StandardNormal.sample(&mut rng);
        unit * if row < 3 { sigma_m } else { sigma_rad }
    })
}
