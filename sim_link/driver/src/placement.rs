//! Place and tool of the chain of a robot behind a driver, as far as its states show.
//!
//! A state has the values of the joints and the pose of the tip. A single state fits any place of the chain with some tool, so
//! it proves nothing, and an arm that is driven by a wrong chain moves along an unchecked path. These prove it:
//!
//! - the flange that the controller reports in addition to the tip, where the chain has it too;
//! - a tip that is computed from the chain, which is then the pose of all captures;
//! - several places at which the arm was at rest, turned about two axes: place and tool are then determined
//!   ([`place`]), and the residuals show whether the joints belong to the poses.
//!
//! Each state at rest after that is compared, and one that does not fit ends the placement.

use std::sync::Arc;

use handeye_arm::{Arm, ArmKind, JointRange, JointValues};
use handeye_estimate::placement::{DISTANCE_LIMIT_M, JointView, ROTATION_LIMIT_RAD, place};
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Vector3};

use super::message::{ArmMessage, Hello, StateMessage};
use super::rest::RestWatch;
use super::states::Reading;
use handeye_coppeliasim::cell::ArmKinematics;

/// Places count as different from this turn on \[rad\]: a degree that joints and poses may differ by is a small part of
/// it.
const APART_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Sine of the angle between two axes that count as two.
const TWO_AXES: f64 = 0.34;
/// Places by which the chain is placed: three determine it, and the fourth can contradict.
pub const NEED: usize = 4;
/// Most places that are kept.
const MOST: usize = 16;

/// What is known about the chain of a robot behind a driver.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ChainPlacement {
    /// The driver names no chain, or reports no joints.
    #[default]
    Unnamed,
    /// Fewer than the [`NEED`] places are there yet, or they are not turned about two axes.
    Open {
        /// Number of places at which the arm was at rest.
        places: usize,
    },
    /// Place and tool of the chain are known, and joints and poses belong together.
    Known(Arc<ArmKinematics>),
    /// The chain is not that of the robot, or is elsewhere than the driver reports.
    Foreign {
        /// Distance between the reported tip, or flange, and that of the joints, metres.
        distance_m: f64,
        /// Angle between them, radians.
        angle_rad: f64,
    },
}

/// A place at which the arm was at rest.
#[derive(Debug, Clone)]
struct RestPose {
    joints: JointValues,
    base_from_tip: Pose<Base, Tip>,
    /// Rotation of the end of the chain there.
    turned: nalgebra::UnitQuaternion<f64>,
}

/// Finds the placement from state to state.
#[derive(Debug, Default)]
pub struct ChainWatch {
    /// Bare, with the ranges of driver and chain.
    chain: Option<Arm>,
    is_ur5: bool,
    /// Place of the chain as the driver reports it.
    base_from_arm: Isometry3<f64>,
    rests: Vec<RestPose>,
    rest: RestWatch,
    placement: ChainPlacement,
}

impl ChainWatch {
    /// For a driver with this `hello` and this chain.
    ///
    /// # Errors
    /// A sentence, where ranges or place are invalid.
    pub fn new(hello: &Hello, arm: Option<&Arm>) -> Result<Self, String> {
        let Some(arm) = arm.filter(|arm| hello.joints.len() == arm.joint_count()) else { return Ok(Self::default()) };
        let ranges: Vec<JointRange> = arm
            .ranges()
            .into_iter()
            .zip(&hello.joints)
            .map(|(of_chain, joint)| JointRange {
                min: joint.min.map_or(of_chain.min, |min| min.max(of_chain.min)),
                max: joint.max.map_or(of_chain.max, |max| max.min(of_chain.max)),
                ..of_chain
            })
            .collect();
        let chain = arm.clone().with_ranges(&ranges).map_err(|error| error.to_string())?;
        let place = hello.base_from_arm.map(|pose| pose.pose::<Base, Base>("base_from_arm")).transpose();
        let base_from_arm = place.map_err(|error| error.to_string())?;
        let ur5 = ArmKind::Ur5Coppeliasim.name();
        Ok(Self {
            chain: Some(chain),
            is_ur5: matches!(&hello.arm, Some(ArmMessage::Name(name)) if name == ur5),
            base_from_arm: base_from_arm.map_or_else(Isometry3::identity, |pose| *pose.isometry()),
            placement: ChainPlacement::Open { places: 0 },
            ..Self::default()
        })
    }

    /// The same arm at the place that the driver reports.
    pub fn placed(&self, arm: Arm) -> Arm {
        let (base_from_first, flange_from_tip) = (self.base_from_arm * arm.base_from_first, arm.flange_from_tip);
        arm.mounted(base_from_first, flange_from_tip)
    }

    /// What is known now.
    pub fn placement(&self) -> &ChainPlacement {
        &self.placement
    }

    /// Takes in a state, which was read as this.
    pub fn take(&mut self, state: &StateMessage, reading: &Reading) {
        let Some(joints) = &reading.joints else { return };
        if !self.stood(reading) {
            return;
        }
        let Some(chain) = &self.chain else { return };
        let Ok(arm_from_end) = chain.forward(joints) else { return };
        let (is_ur5, base_from_arm) = (self.is_ur5, self.base_from_arm);
        let known = |base_from_arm, tool| known(chain, is_ur5, base_from_arm, tool);
        match &self.placement {
            ChainPlacement::Unnamed | ChainPlacement::Foreign { .. } => {}
            ChainPlacement::Known(kinematics) => {
                let miss = kinematics.tip(joints).distance_to(&reading.base_from_tip);
                if !is_near(miss) {
                    self.placement = foreign(miss);
                }
            }
            ChainPlacement::Open { .. } => {
                let computed = Pose::<Base, Tip>::from_isometry(base_from_arm * arm_from_end.isometry());
                // The pose of a flange was checked when the state was read.
                let flange =
                    state.base_from_flange.and_then(|flange| flange.pose::<Base, Tip>("base_from_flange").ok());
                let is_computed = state.base_from_tip.is_none() && flange.is_none();
                if let Some(flange) = flange.or(is_computed.then_some(computed)) {
                    let miss = computed.distance_to(&flange);
                    let tool = flange.isometry().inv_mul(reading.base_from_tip.isometry());
                    self.placement = if is_near(miss) { known(base_from_arm, tool) } else { foreign(miss) };
                } else {
                    self.add_rest(&RestPose {
                        joints: *joints,
                        base_from_tip: reading.base_from_tip,
                        turned: arm_from_end.isometry().rotation,
                    });
                }
            }
        }
    }

    /// Whether the arm is at rest in this state.
    fn stood(&mut self, reading: &Reading) -> bool {
        if reading.moving == Some(true) {
            self.rest.restart();
        }
        self.rest.take(reading.place())
    }

    /// Adds a place, where it differs from the others, and evaluates all of them.
    fn add_rest(&mut self, rest: &RestPose) {
        let is_other = |known: &RestPose| known.turned.angle_to(&rest.turned) >= APART_RAD;
        if self.rests.len() >= MOST || !self.rests.iter().all(is_other) {
            return;
        }
        self.rests.push(rest.clone());
        self.placement = ChainPlacement::Open { places: self.rests.len() };
        if self.rests.len() < NEED || !self.turned_about_two_axes() {
            return;
        }
        let Some(chain) = &self.chain else { return };
        let view = |rest: &'_ RestPose| (rest.base_from_tip, rest.joints);
        let views: Vec<_> = self.rests.iter().map(view).collect();
        let views: Vec<JointView<'_>> = views
            .iter()
            .map(|(base_from_tip, joints)| JointView { base_from_tip: *base_from_tip, joints_rad: joints })
            .collect();
        // What these places do not determine needs another one.
        let Ok(placed) = place(chain, &views) else { return };
        let excess = |miss: &(f64, f64)| (miss.0 / DISTANCE_LIMIT_M).max(miss.1 / ROTATION_LIMIT_RAD);
        let worst = placed.misses.iter().copied().max_by(|a, b| excess(a).total_cmp(&excess(b)));
        self.placement = match worst.filter(|miss| !is_near(*miss)) {
            Some(miss) => foreign(miss),
            None => known(chain, self.is_ur5, placed.arm.base_from_first, placed.arm.flange_from_tip),
        };
    }

    fn turned_about_two_axes(&self) -> bool {
        let Some((first, others)) = self.rests.split_first() else { return false };
        let axes: Vec<Vector3<f64>> =
            others.iter().filter_map(|other| Some((other.turned / first.turned).axis()?.into_inner())).collect();
        axes.iter().enumerate().any(|(i, a)| axes[..i].iter().any(|b| a.cross(b).norm() >= TWO_AXES))
    }
}

fn known(chain: &Arm, is_ur5: bool, base_from_arm: Isometry3<f64>, tool: Isometry3<f64>) -> ChainPlacement {
    let ur5 = is_ur5.then(|| ArmKinematics::ur5(base_from_arm, tool, &chain.ranges()).ok()).flatten();
    let kinematics = ur5.unwrap_or_else(|| {
        let (base_from_first, flange_from_tip) = (chain.base_from_first, chain.flange_from_tip * tool);
        ArmKinematics::new(chain.clone().mounted(base_from_first, flange_from_tip), base_from_arm)
    });
    ChainPlacement::Known(Arc::new(kinematics))
}

fn foreign((distance_m, angle_rad): (f64, f64)) -> ChainPlacement {
    ChainPlacement::Foreign { distance_m, angle_rad }
}

/// Whether joints and poses belong together; NaN does not.
fn is_near((distance_m, angle_rad): (f64, f64)) -> bool {
    distance_m <= DISTANCE_LIMIT_M && angle_rad <= ROTATION_LIMIT_RAD
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "placement_tests.rs"]
mod tests;
