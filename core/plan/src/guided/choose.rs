//! Which views to take next: of many random ones those that together lower the error most, and that the arm reaches.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::candidates::ViewRange;
use super::design::{Design, Part};
use crate::carried::Carried;
use crate::clearance::{Arm, travel};
use crate::contact::Guard;
use crate::pace::Pace;
use crate::sight::Sight;
use crate::surroundings::Surroundings;
use handeye_arm::JointValues;
use handeye_estimate::Observations;
use handeye_estimate::handeye::HandEye;
use handeye_estimate::handeye::joint::{ExpectedView, Posture, ViewModel};
use handeye_estimate::reach_error::Reach;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;

/// Draws for each candidate that is wanted: most views at random are not wholly in the image.
const DRAWS_PER_CANDIDATE: usize = 40;
/// Candidates to which a path is searched before giving up: where this many of the best cannot be reached, the rest
/// gains little.
const MOST_WAYS: usize = 400;
/// Passes over the plan that take one view out and the best one in.
const EXCHANGES: usize = 3;
/// Fraction of the error by which an exchange has to be better.
const EXCHANGE_GAIN: f64 = 1e-3;
/// A failed view is not tried again within this distance [m, rad].
const FAILED_NEAR: (f64, f64) = (0.04, 8.0 * std::f64::consts::PI / 180.0);

/// An arm that is driven, and what it must not touch.
#[derive(Debug, Clone)]
pub struct Robot {
    /// The arm, with what is on its tip.
    pub arm: Arm,
    /// The surroundings, without the board.
    pub around: Surroundings,
    /// Free space around arm and tool, metres.
    pub clearance_m: f64,
    /// Its joint values, radians; metres for a prismatic joint.
    pub joints: JointValues,
    /// How fast they are driven.
    pub pace: Pace,
    /// Camera and board, where they are known: the arm keeps out of the line of sight.
    pub sight: Option<Sight>,
}

/// Options of a plan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChooseOptions<'a> {
    /// Views that are compared.
    pub candidates: usize,
    /// How many views are planned ahead.
    pub ahead: usize,
    /// Seed of the candidates.
    pub seed: u64,
    /// Duration of a capture after the arm has arrived, seconds.
    pub dwell_s: f64,
    /// Views that failed: not tried again, nor their neighbourhood.
    pub failed: &'a [Pose<Base, Tip>],
    /// How far the tip may turn from the nearest view so far, radians.
    pub turn_rad: f64,
    /// Factor on the uncertainty of the place of the board in the image; 1 as long as it was where expected.
    pub doubt_factor: f64,
}

/// A view that is proposed.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Pose of the tip.
    pub base_from_tip: Pose<Base, Tip>,
    /// Expected pose of the board.
    pub camera_from_target: Pose<Camera, Target>,
    /// The joint values there; `None` for an arm whose chain is not known.
    pub joints: Option<JointValues>,
    /// Travel time of the arm from its present configuration, seconds; zero for an arm whose chain is not known.
    pub travel_s: f64,
    /// Expected error over the box with it and those before it in the plan, over that without any of them.
    pub error_ratio: f64,
    /// What it determines most, weighted by the effect on the tip.
    pub part: Part,
}

/// The views that come next, the first one first.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// In the order in which they are to be taken; empty where nothing can be reached.
    pub proposals: Vec<Proposal>,
    /// Error with the best view alone over that without it; 1 where nothing can be reached.
    pub best_ratio: f64,
    /// Views that were compared.
    pub candidates: usize,
}

/// What a plan is made from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chooser<'a> {
    /// The model of the calibration so far.
    pub model: &'a ViewModel,
    pub target: &'a TargetSpec,
    /// Range of the views of it that are searched.
    pub range: &'a ViewRange,
    /// The arm, if it is driven and its chain is known.
    pub robot: Option<&'a Robot>,
    /// The reach of the arm of the views, if its joints are known.
    pub reach: Option<&'a Reach>,
    /// Tip poses of the views so far.
    pub taken: &'a [Pose<Base, Tip>],
    /// Ends the search: the plan is then shorter, or empty.
    pub cancel: &'a CancelToken,
}

/// How the arm moves to a candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Unknown,
    None,
    /// To its pose; whether the path from the present configuration is free is checked separately.
    To {
        joints: Option<JointValues>,
        travel_s: f64,
    },
}

struct Candidate {
    camera_from_target: Pose<Camera, Target>,
    base_from_tip: Pose<Base, Tip>,
    view: ExpectedView,
    way: Way,
}

impl Chooser<'_> {
    /// Plans the next views by the uncertainty that the views so far leave. The same arguments give the same plan;
    /// cancelled, it is shorter or empty.
    ///
    /// Greedy, view by view, each the one of all candidates after which the expected error is least; then one view after
    /// the other is taken out of the plan for the best one in its place, while that helps. Of the plan that view comes
    /// first which lowers the error most over the square root of its time, among those that the arm reaches on a
    /// straight path in joint space.
    pub fn plan(&self, design: &Design, options: &ChooseOptions<'_>) -> Plan {
        let mut pool = self.pool(design, options);
        let mut ways = 0;
        let mut chosen: Vec<usize> = Vec::with_capacity(options.ahead);
        let mut with_chosen = design.clone();
        while chosen.len() < options.ahead {
            let Some(best) = self.best(&mut pool, &with_chosen, &chosen, f64::INFINITY, &mut ways) else { break };
            with_chosen = with_chosen.with(&pool[best].view);
            chosen.push(best);
        }
        let best_ratio = chosen.first().map_or(1.0, |&best| design.error_with_m(&pool[best].view) / design.error_m());
        self.exchange(&mut pool, design, &mut chosen, &mut ways);
        let first = self.first(&mut pool, design, &chosen, options, &mut ways);
        let Some(first) = first else {
            return Plan { proposals: Vec::new(), best_ratio: 1.0, candidates: pool.len() };
        };
        chosen.retain(|&k| k != first);
        chosen.insert(0, first);
        chosen.truncate(options.ahead);
        let proposals = proposals(&pool, design, &chosen);
        Plan { proposals, best_ratio, candidates: pool.len() }
    }

    /// A random view that the arm reaches on a straight path in joint space.
    pub(crate) fn at_random(&self, design: &Design, options: &ChooseOptions<'_>) -> Option<Proposal> {
        let mut pool = self.pool(design, options);
        let mut ways = 0;
        let found =
            (0..pool.len()).find(|&k| self.way(&mut pool[k], &mut ways).is_some() && self.path_is_free(&pool[k]))?;
        proposals(&pool, design, &[found]).pop()
    }

    /// Random views that are wholly in the image, with their expected information.
    fn pool(&self, design: &Design, options: &ChooseOptions<'_>) -> Vec<Candidate> {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let (intrinsics, target) = (self.model.intrinsics(), self.target);
        let all: Vec<usize> = (0..target.len()).collect();
        let mut pool = Vec::with_capacity(options.candidates);
        for _ in 0..options.candidates * DRAWS_PER_CANDIDATE {
            if pool.len() >= options.candidates || self.cancel.is_cancelled() {
                break;
            }
            let Some(drawn) = self.range.draw(&mut rng, intrinsics, target) else { continue };
            if !self.range.shows(intrinsics, target, &drawn) {
                continue;
            }
            let base_from_tip = self.model.base_from_tip(&drawn);
            if !self.is_wanted(&base_from_tip, options) {
                continue;
            }
            let Some(posture) = self.posture(base_from_tip) else { continue };
            let pixels = self.model.pixels(&posture, design.covariance());
            if !self.range.surely_shows(target, &pixels, options.doubt_factor) {
                continue;
            }
            let camera_from_target = Pose::from_isometry(*pixels.camera_from_target());
            let Some(view) = self.model.expected(&posture, &all) else { continue };
            pool.push(Candidate { camera_from_target, base_from_tip, view, way: Way::Unknown });
        }
        pool
    }

    /// The posture of the arm there, where the information of a view depends on it; `None` where an arm that is not driven does not
    /// get there.
    fn posture(&self, base_from_tip: Pose<Base, Tip>) -> Option<Posture> {
        let tip_from_joints = match (self.robot, self.reach) {
            (Some(robot), _) if self.model.has_arm() => robot.arm.tip_from_joints(&base_from_tip, &robot.joints),
            (None, Some(reach)) if self.model.has_arm() => reach.tip_from_joints(&base_from_tip)?,
            _ => Vec::new(),
        };
        Some(Posture { base_from_tip, tip_from_joints })
    }

    /// Whether a pose is wanted: not where a view failed, and not turned too far from all views so far.
    fn is_wanted(&self, base_from_tip: &Pose<Base, Tip>, options: &ChooseOptions<'_>) -> bool {
        let failed = |pose: &Pose<Base, Tip>| {
            let (m, rad) = pose.distance_to(base_from_tip);
            m < FAILED_NEAR.0 && rad < FAILED_NEAR.1
        };
        let turn = |pose: &Pose<Base, Tip>| pose.rotation().angle_to(&base_from_tip.rotation());
        let nearest = self.taken.iter().map(turn).fold(f64::INFINITY, f64::min);
        !options.failed.iter().any(failed) && (self.taken.is_empty() || nearest <= options.turn_rad)
    }

    /// The candidate after which the error is least, less than a limit, that the arm reaches and that is not in the plan.
    fn best(
        &self,
        pool: &mut [Candidate],
        design: &Design,
        chosen: &[usize],
        below_m: f64,
        ways: &mut usize,
    ) -> Option<usize> {
        let mut ranking: Vec<(f64, usize)> = pool
            .iter()
            .enumerate()
            .filter(|(k, candidate)| candidate.way != Way::None && !chosen.contains(k))
            .map(|(k, candidate)| (design.error_with_m(&candidate.view), k))
            .filter(|(error_m, _)| *error_m < below_m)
            .collect();
        ranking.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranking.into_iter().map(|(_, k)| k).find(|&k| self.way(&mut pool[k], ways).is_some())
    }

    /// The joint values at a candidate and the travel time, if the arm reaches it.
    fn way(&self, candidate: &mut Candidate, ways: &mut usize) -> Option<(Option<JointValues>, f64)> {
        if self.cancel.is_cancelled() {
            return None;
        }
        if candidate.way == Way::Unknown {
            candidate.way = match self.robot {
                None => Way::To { joints: None, travel_s: 0.0 },
                Some(_) if *ways >= MOST_WAYS => return None,
                Some(robot) => {
                    *ways += 1;
                    robot.way_to(&candidate.base_from_tip)
                }
            };
        }
        match candidate.way {
            Way::To { joints, travel_s } => Some((joints, travel_s)),
            Way::Unknown | Way::None => None,
        }
    }

    /// Takes views out of the plan for better ones in their place.
    fn exchange(&self, pool: &mut [Candidate], design: &Design, chosen: &mut [usize], ways: &mut usize) {
        for _ in 0..EXCHANGES {
            let mut changed = false;
            for place in 0..chosen.len() {
                let others = chosen.iter().enumerate().filter(|(k, _)| *k != place).map(|(_, &c)| c);
                let without = others.fold(design.clone(), |design, k| design.with(&pool[k].view));
                let now_m = without.error_with_m(&pool[chosen[place]].view);
                if let Some(better) = self.best(pool, &without, chosen, now_m * (1.0 - EXCHANGE_GAIN), ways) {
                    chosen[place] = better;
                    changed = true;
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// The view to begin with: of the plan the one that gains most over the square root of its time, on a free path; where none
    /// has a free path, the best of all others that has one. With gain per second alone, short moves to views with little
    /// information would come first.
    fn first(
        &self,
        pool: &mut [Candidate],
        design: &Design,
        chosen: &[usize],
        options: &ChooseOptions<'_>,
        ways: &mut usize,
    ) -> Option<usize> {
        let now_m = design.error_m();
        let mut by_rate: Vec<(f64, usize)> = chosen
            .iter()
            .map(|&k| {
                let travel_s = self.way(&mut pool[k], ways).map_or(0.0, |(_, travel_s)| travel_s);
                let gain_m = now_m - design.error_with_m(&pool[k].view);
                (gain_m / (travel_s + options.dwell_s).sqrt(), k)
            })
            .collect();
        by_rate.sort_by(|a, b| b.0.total_cmp(&a.0));
        if let Some((_, k)) = by_rate.into_iter().find(|&(_, k)| self.path_is_free(&pool[k])) {
            return Some(k);
        }
        let mut others: Vec<(f64, usize)> = (0..pool.len()).map(|k| (design.error_with_m(&pool[k].view), k)).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        others
            .into_iter()
            .map(|(_, k)| k)
            .find(|&k| self.way(&mut pool[k], ways).is_some() && self.path_is_free(&pool[k]))
    }

    fn path_is_free(&self, candidate: &Candidate) -> bool {
        match (self.robot, candidate.way) {
            (Some(robot), Way::To { joints: Some(joints), .. }) => robot.path_is_free(&joints),
            (None, _) => true,
            _ => false,
        }
    }
}

impl Robot {
    fn way_to(&self, base_from_tip: &Pose<Base, Tip>) -> Way {
        match self.arm.reach(base_from_tip, &self.joints) {
            Some(joints) if self.is_good(&joints, base_from_tip) => {
                Way::To { joints: Some(joints), travel_s: self.travel_s(&self.joints, &joints) }
            }
            _ => Way::None,
        }
    }

    /// Whether the arm touches nothing with these joint values, which put its tip there, and is not between camera and board.
    pub(crate) fn is_good(&self, joints: &JointValues, base_from_tip: &Pose<Base, Tip>) -> bool {
        let sees = |sight: &Sight| sight.is_free(&self.arm, joints, base_from_tip);
        self.arm.is_free(joints, &self.around, self.clearance_m) && self.sight.as_ref().is_none_or(sees)
    }

    /// Whether the arm can be driven there on a straight path in joint space without touching anything. It may move away from
    /// what it is closer to than allowed at its present place: the arm is there, and the pose of the camera is an estimate that
    /// can be off by centimetres after the first turns.
    pub(crate) fn path_is_free(&self, joints: &JointValues) -> bool {
        let guard = Guard::from(&self.arm, &self.around, &self.joints, self.clearance_m);
        guard.contact_on_path(&self.joints, joints).is_none()
    }

    /// Travel time of the arm from one configuration to another: acceleration, constant speed and deceleration of the
    /// joint with the longest motion, within the limits of the surroundings. Limits of jerk are not included.
    pub fn travel_s(&self, from: &JointValues, to: &JointValues) -> f64 {
        let speed = self.arm.joint_speed(from, to, &self.around, self.pace.speed);
        Pace { speed, ..self.pace }.duration_s(travel(from, to))
    }
}

/// The arm with the camera or the board on its tip, at the estimated pose; and the other one of the two among the
/// obstacles, with a margin around the board in both cases, and around a camera next to the robot; with the line of sight
/// between them.
pub(super) fn with_board(robot: &Robot, hand_eye: &HandEye, observations: &Observations, room_m: f64) -> Robot {
    let mut robot = robot.clone();
    let target = &observations.target;
    robot.sight = Some(Sight::new(hand_eye, target));
    match hand_eye {
        HandEye::EyeInHand { tip_from_camera, base_from_target } => {
            robot.arm.carried = vec![Carried::camera(tip_from_camera.isometry())];
            robot.around.obstacles.push(crate::sheet(target, base_from_target, room_m));
        }
        HandEye::EyeToHand { base_from_camera, tip_from_target } => {
            robot.arm.carried = vec![Carried::board(target, tip_from_target, room_m)];
            robot.around.obstacles.push(crate::housing(base_from_camera, room_m));
        }
    }
    robot
}

fn proposals(pool: &[Candidate], design: &Design, chosen: &[usize]) -> Vec<Proposal> {
    let now_m = design.error_m();
    let mut before = design.clone();
    let mut out = Vec::with_capacity(chosen.len());
    for candidate in chosen.iter().map(|&k| &pool[k]) {
        let after = before.with(&candidate.view);
        let (joints, travel_s) = match candidate.way {
            Way::To { joints, travel_s } => (joints, travel_s),
            Way::Unknown | Way::None => (None, 0.0),
        };
        out.push(Proposal {
            base_from_tip: candidate.base_from_tip,
            camera_from_target: candidate.camera_from_target,
            joints,
            travel_s,
            error_ratio: after.error_m() / now_m,
            part: after.part_of_gain(&before),
        });
        before = after;
    }
    out
}
