//! Views that guided capture chooses, starting from a random one.

use handeye_arm::JointValues;
use handeye_estimate::diagnose::calibrate_with;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::{Method, Options};
use handeye_geometry::progress::CancelToken;
use handeye_plan::guided::choose::Robot;
use handeye_plan::guided::{Guide, GuidedOptions, Known, Next};
use handeye_plan::{Arm, ArmBody, Pace, Surroundings};
use nalgebra::Isometry3;
use rand_chacha::ChaCha8Rng;

use crate::cell::{Cell, Taken};
use crate::session::{Placed, observed};

/// Limit of poses, with or without a view.
const MOST_POSES: usize = 60;

/// This many views, or as many as the guide finds.
pub fn guided(cell: &Cell, placed: &Placed, most_views: usize, free_lens: bool, rng: &mut ChaCha8Rng) -> Vec<Taken> {
    let mut taken = cell.take(1, rng);
    let Some(first) = taken.first() else { return taken };
    let values = |joints: &[f64]| JointValues::from_fn(joints.len(), |j| joints[j]);
    let chain = placed.arm.clone();
    let arm = Arm {
        body: ArmBody::of(&chain),
        chain,
        world_from_arm: Isometry3::identity(),
        connection_from_tip: Isometry3::identity(),
        carried: Vec::new(),
    };
    let pace = Pace { speed: 1.0, acceleration: 2.0, jerk: f64::INFINITY };
    let around = Surroundings::default();
    let mut robot = Robot { arm, around, clearance_m: 0.0, joints: values(&first.joints), pace, sight: None };
    // An unreachable goal: the number of views is the limit.
    let options = GuidedOptions { goal_m: 1e-6, least_gain: 0.0, most_views, ..GuidedOptions::default() };
    let mut guide = Guide::new(options);
    let mut calibration = None;
    let cancel = CancelToken::default();
    for _ in 0..MOST_POSES {
        let (observations, _) = observed(cell, placed, &taken, free_lens);
        let known = Known {
            observations: &observations,
            calibration: calibration.as_ref(),
            robot: Some(&robot),
            elapsed_s: 0.0,
        };
        let plan = match guide.next(&known, &cancel) {
            Next::Go { plan, .. } => plan,
            Next::End(ending) => {
                if std::env::var_os("VERBOSE").is_some() {
                    println!("{} views: {ending:?}", taken.len());
                }
                return taken;
            }
        };
        let Some(joints) = plan.proposals.first().and_then(|proposal| proposal.joints) else { return taken };
        robot.joints = joints;
        let Some(view) = cell.view_at(joints.to_vec(), rng) else {
            guide.failed();
            continue;
        };
        taken.push(view);
        guide.captured();
        let (observations, of_views) = observed(cell, placed, &taken, free_lens);
        let wanted = FindingOptions::default().with_arm(Some(&of_views));
        calibration = calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &cancel).ok();
    }
    taken
}
