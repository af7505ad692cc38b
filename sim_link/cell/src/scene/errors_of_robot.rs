//! How the arm's true pose differs from the one it reports.

use nalgebra::Vector6;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::RobotSpec;
use handeye_arm::JointValues;

/// First stream of random numbers that belongs to settled positions; the ones below are the scene's own.
const FIRST_STREAM: u64 = 1 << 32;

/// The errors of one robot.
///
/// What the robot *reports* is the nominal kinematics of its encoders: `forward(q)`. Where it really *is* has two
/// errors more: constant joint offsets, and a displacement that differs every time it comes to rest,
///
/// `true = forward(q + joint_offset) * connection_from_tip * exp(settled(n))`
///
/// with the tangent vector `[t; r]` in the tip frame. `n` counts the times that the arm has come to rest: while it
/// stands still its pose does not change, however often it is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotErrors {
    /// What is added to the joint values that the encoders show, radians.
    pub joint_offset_rad: JointValues,
    /// 1σ per axis of the displacement, metres.
    pub repeatability_m: f64,
    /// 1σ per axis of the rotation, radians.
    pub repeatability_rad: f64,
    seed: u64,
}

impl RobotErrors {
    pub(super) fn new(robot: &RobotSpec, joints: usize, seed: u64) -> Self {
        let offset_deg = robot.joint_offset_deg.unwrap_or(JointValues::zeros(joints));
        Self {
            joint_offset_rad: offset_deg.map(f64::to_radians),
            repeatability_m: robot.repeatability_mm * 1e-3,
            repeatability_rad: robot.repeatability_deg.to_radians(),
            seed,
        }
    }

    /// A robot of so many joints without errors.
    pub fn none(joints: usize) -> Self {
        Self { joint_offset_rad: JointValues::zeros(joints), repeatability_m: 0.0, repeatability_rad: 0.0, seed: 0 }
    }

    /// True minus nominal pose of the tip, `[t; r]` in metres and radians in the tip frame, the `index`-th time that
    /// the arm has come to rest. The same seed and index always give the same.
    pub fn settled(&self, index: u64) -> Vector6<f64> {
        gaussian(self.seed, FIRST_STREAM.wrapping_add(index), self.repeatability_m, self.repeatability_rad)
    }

    /// The true joint values for those that the encoders show, radians.
    pub fn true_joints(&self, encoders: &JointValues) -> JointValues {
        let offset = |i: usize| self.joint_offset_rad.get(i).copied().unwrap_or_default();
        JointValues::from_fn(encoders.len(), |i| encoders[i] + offset(i))
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
