//! How near a tool arrives at a point that the camera saw: by the uncorrected controller, and by corrected commands.
//!
//! # What it estimates
//! The distance between a point of the target, seen by the camera from a pose of the session, and the tip of a tool that is sent
//! there: its 95 % quantile over the views, over points of the target, over directions of the tool and over the uncertainty of arm
//! and camera. The tool is sent against the target's normal with the camera on the arm, along the mean axis of the tip with the
//! camera next to it, tilted by up to 15° with any turn about its axis. The TCP is what the same arm finds by turning about one
//! point, as is usual in practice. An arm with fewer than six joints does not turn like that: its TCP is what it finds by touching
//! points that the camera saw, and its tool is sent in the direction nearest to the wanted one, up to 30° from it.
//!
//! # How
//! Errors of the arm and both transforms are drawn from their joint posterior; every draw is an arm that the data allow. The
//! command does not depend on the draw, so the inverse kinematics is solved once for each touch, and a tool that is found a
//! little elsewhere is counted to first order. The draws are the same in every run.
//!
//! # Degenerate cases
//! Touches out of reach of the arm are left out; with fewer than a quarter of them left nothing is stated. Where the controller
//! uses another chain than the one that is known, the errors are relative to the poses that it reports, and no commands are
//! corrected by them: the error with corrected commands is not stated then.

use nalgebra::{
    Cholesky, DMatrix, DVector, Isometry3, Matrix3, Matrix3x6, Matrix6, Point3, UnitQuaternion, Vector3, Vector6,
};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::arm_fit::ArmFit;
use crate::corrected_arm::CorrectedArm;
use crate::few_joints::{self, PointGoal, has_few_joints};
use crate::handeye::draw::Draw;
use crate::handeye::joint::ArmErrors;
use crate::handeye::{HandEye, Mode};
use handeye_arm::Arm;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::se3;
use handeye_geometry::targets::TargetSpec;

/// Touches of a session. The error of uncorrected commands is almost the same in every draw, so that its quantile is one over the
/// touches, which is too small over a few: of 24 the 23rd has 23 of 25 below it in the mean, of these the 92nd has 92 of 97.
const TOUCHES: usize = 96;
/// Draws of arm and camera.
pub(crate) const DRAWS: usize = 100;
/// Every touch is evaluated with one in this many draws.
pub(crate) const APART: usize = 4;
/// Poses in which the tip of the tool is found.
const PIVOTS: usize = 8;
/// Distance in metres and angle in radians at which a touch has arrived: far below its error.
const ARRIVED: f64 = 1e-7;
/// Largest tilt of the tool, radians.
const TILT_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Largest angle between the wanted direction of the tool and the nearest one of an arm with few joints, radians.
const TURN_OF_FEW_JOINTS: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Share of errors within the stated one.
const LEVEL: f64 = 0.95;
/// Step of differences: metres and radians, of functions that vary over lengths of a metre.
const STEP: f64 = 1e-6;
/// Seed of the draws: the same in every run.
pub(crate) const SEED: u64 = 0x72_6561_6368;
const TOUCH_SEED: u64 = 0x74_6f75_6368;

/// Length of a tool where none is stated, metres.
pub const USUAL_TOOL_M: f64 = 0.1;
/// The tip of that tool in the frame of the tip: along z.
pub const USUAL_TOOL: [f64; 3] = [0.0, 0.0, USUAL_TOOL_M];

/// A view of the session.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Joint values as reported, radians.
    pub joints_rad: Vec<f64>,
    /// Where the camera saw the target.
    pub camera_from_target: Pose<Camera, Target>,
}

/// Distances that a touch stays below with a probability of 95 %, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReachErrors {
    /// With reported poses, their transform, and uncorrected commands.
    pub as_it_is_95_m: f64,
    /// With corrected poses and commands; `None` where no commands are corrected.
    pub corrected_95_m: Option<f64>,
    /// The part of the first that no view lowers: the effect of the most probable errors of the arm and of its repeatability; or
    /// what follows from the stated accuracy of the robot.
    pub as_it_is_least_95_m: f64,
    /// The part of the error by corrected poses that no view lowers: the repeatability of the arm, at the view, at the touch and
    /// where the tool is found; `None` where only the accuracy of the arm is known.
    pub repeatability_95_m: Option<f64>,
}

impl ReachErrors {
    /// The errors of an answer that something else moves this far, metres.
    #[must_use]
    pub(crate) fn moved_by(self, moved_m: f64) -> Self {
        Self {
            as_it_is_95_m: self.as_it_is_95_m + moved_m,
            corrected_95_m: self.corrected_95_m.map(|corrected_m| corrected_m + moved_m),
            ..self
        }
    }

    /// The larger of both, number by number.
    pub(crate) fn worse(self, other: Self) -> Self {
        let worse = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a.max(b));
        Self {
            as_it_is_95_m: self.as_it_is_95_m.max(other.as_it_is_95_m),
            corrected_95_m: worse(self.corrected_95_m, other.corrected_95_m),
            as_it_is_least_95_m: self.as_it_is_least_95_m.max(other.as_it_is_least_95_m),
            repeatability_95_m: worse(self.repeatability_95_m, other.repeatability_95_m),
        }
    }
}

/// One way to reach a point: by reported poses, or by corrected ones.
#[derive(Debug, Clone)]
struct Way {
    hand_eye: HandEye,
    /// The arm as modelled by this way: without errors if by reported poses.
    arm: CorrectedArm,
    /// The mean z axis of the tip over the views, in the base.
    axis: Vector3<f64>,
}

/// A touch in one of the two ways.
struct Touch {
    /// Joint values of the view and of the command.
    view: At,
    command: At,
    in_camera: Point3<f64>,
    /// Turn of the tip in the base as modelled by this way.
    turn: UnitQuaternion<f64>,
}

/// An arm at some joint values.
struct At {
    base_from_tip: Pose<Base, Tip>,
    tip_from_joints: Vec<Isometry3<f64>>,
}

impl At {
    fn new(arm: &Arm, joints_rad: &[f64]) -> Option<Self> {
        let base_from_tip = arm.forward(joints_rad).ok()?;
        let tip_from_joints = arm.tip_from_joints(&base_from_tip, joints_rad).ok()?;
        Some(Self { base_from_tip, tip_from_joints })
    }

    fn tip(&self, errors: &ArmErrors) -> Isometry3<f64> {
        self.base_from_tip.isometry() * errors.reported_from_true(&self.base_from_tip, &self.tip_from_joints)
    }
}

/// How near a tool arrives by a calibration of an arm that is known, at any point that the camera sees.
#[derive(Debug, Clone)]
pub struct Reach {
    as_it_is: Way,
    corrected: Way,
    views: Vec<Seen>,
    /// Orientations of the tip in them, as reported.
    turned: Vec<UnitQuaternion<f64>>,
    tool: Vector3<f64>,
    /// Turns about one point by which the tool is found.
    turns: [UnitQuaternion<f64>; PIVOTS],
    /// Arms and cameras that the data allow.
    possible: Vec<Possible>,
    /// The most probable arm and camera, with a draw of the arm's repeatability error in each of them.
    repeated: Vec<Possible>,
    /// Whether commands are corrected.
    is_corrected: bool,
    target: TargetSpec,
}

/// Which points are touched, from which view, and the orientation of the tool relative to the target.
pub(crate) struct Plan {
    pub view: usize,
    pub in_camera: Point3<f64>,
    pub turn: UnitQuaternion<f64>,
}

impl Reach {
    /// The reach of a session whose arm is known; `answer` is the calibration by reported poses, and `is_corrected` whether
    /// commands can be corrected, which is possible where the reported poses are those of the chain. `None` without views, and for a covariance that is not valid.
    pub(crate) fn new(
        (arm, fit): (&CorrectedArm, &ArmFit),
        answer: &HandEye,
        views: Vec<Seen>,
        target: &TargetSpec,
        is_corrected: bool,
    ) -> Option<Self> {
        let as_it_is = CorrectedArm { errors: ArmErrors::none(fit.errors.joint_count()), ..arm.clone() };
        let axis = mean_axis(&arm.arm, &views)?;
        let turned = |seen: &Seen| Some(arm.arm.forward(&seen.joints_rad).ok()?.rotation());
        let turned = views.iter().map(turned).collect::<Option<_>>()?;
        let mut random = Draw::new(SEED);
        let turns = turns(&mut random);
        let possible = possible(fit, &mut random)?;
        let best = |one: &Possible| Possible { errors: fit.errors.clone(), hand_eye: fit.hand_eye, ..one.clone() };
        Some(Self {
            as_it_is: Way { hand_eye: *answer, arm: as_it_is, axis },
            corrected: Way { hand_eye: fit.hand_eye, arm: arm.clone(), axis },
            views,
            turned,
            tool: arm.tool_m,
            turns,
            repeated: possible.iter().map(best).collect(),
            possible,
            is_corrected,
            target: *target,
        })
    }

    /// Errors at points of the target where it was seen; `None` where too few touches are in reach.
    pub(crate) fn at_target(&self) -> Option<ReachErrors> {
        let points = self.target.points();
        let seen = |view: usize, random: &mut Draw| {
            self.views[view].camera_from_target.isometry() * points[random.below(points.len())]
        };
        if points.is_empty() { None } else { self.errors(seen) }
    }

    /// Errors at points in the coordinates of a camera next to the robot, metres: the largest of the errors of those that are in
    /// reach. `None` where none of them is, and with a camera on the arm, for which a point in the camera is at a different place
    /// in each view.
    pub(crate) fn at_points(&self, in_camera: &[Point3<f64>]) -> Option<ReachErrors> {
        let points = in_camera.iter().filter(|_| self.is_eye_to_hand());
        points.filter_map(|point| self.errors(|_, _| *point)).reduce(ReachErrors::worse)
    }

    /// The joints relative to the tip with the tip there, see [`Arm::tip_from_joints`], in the configuration of the nearest view;
    /// `None` where the arm does not get there from that view.
    pub fn tip_from_joints(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Vec<Isometry3<f64>>> {
        let arm = &self.as_it_is.arm.arm;
        let there = base_from_tip.rotation();
        let turns = self.turned.iter().map(|turned| turned.angle_to(&there));
        let (nearest, _) = self.views.iter().zip(turns).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let joints_rad = arm.inverse_nearby(base_from_tip, &nearest.joints_rad)?;
        arm.tip_from_joints(base_from_tip, &joints_rad).ok()
    }

    /// Whether the camera is next to the robot (eye to hand).
    pub(crate) fn is_eye_to_hand(&self) -> bool {
        self.corrected.hand_eye.mode() == Mode::EyeToHand
    }

    /// Length of the tool, metres.
    pub(crate) fn tool_length_m(&self) -> f64 {
        self.tool.norm()
    }

    fn errors(&self, point: impl Fn(usize, &mut Draw) -> Point3<f64>) -> Option<ReachErrors> {
        let planned = planned(self.views.len(), point);
        let as_it_is = self.touches(&self.as_it_is, &planned)?;
        let corrected = self.touches(&self.corrected, &planned)?;
        let corrected_95_m = self.quantile(&self.corrected, &corrected, &self.possible)?;
        Some(ReachErrors {
            as_it_is_95_m: self.quantile(&self.as_it_is, &as_it_is, &self.possible)?,
            corrected_95_m: self.is_corrected.then_some(corrected_95_m),
            as_it_is_least_95_m: self.quantile(&self.as_it_is, &as_it_is, &self.repeated)?,
            repeatability_95_m: Some(self.quantile(&self.corrected, &corrected, &self.repeated)?),
        })
    }

    /// Sensitivity of the miss of a touch by corrected commands to what is not known: the mean over touches of `Jᵀ J`, with `J` the
    /// derivatives of the vector from the point to the tip of the tool by `[mount_from_camera (6), errors of the arm]`, metres and
    /// radians, the errors in the order of [`ArmErrors::numbers`]. For touches at the target, or at points in camera coordinates.
    /// `None` where too few touches are in reach.
    pub(crate) fn weight(&self, in_camera: Option<&[Point3<f64>]>) -> Option<DMatrix<f64>> {
        let target = self.target.points();
        if in_camera.map_or(target.is_empty(), <[Point3<f64>]>::is_empty) {
            return None;
        }
        let planned = planned(self.views.len(), |view, random| match in_camera {
            Some(points) => points[random.below(points.len())],
            None => self.views[view].camera_from_target.isometry() * target[random.below(target.len())],
        });
        // A mean of squares needs no more.
        let planned: Vec<Plan> = planned.into_iter().step_by(APART).collect();
        let way = &self.corrected;
        let touches = self.touches(way, &planned)?;
        let pivots = way.pivots(&touches[0], &self.turns, &self.views, &self.tool);
        let best = Possible { unexplained: Unexplained::nothing(), ..self.repeated[0].clone() };
        let misses = |truth: &Possible| -> Option<DVector<f64>> {
            let found = way.tool_by(&pivots, &touches, truth, &self.tool)?;
            let each = touches.iter().flat_map(|touch| {
                let miss: [f64; 3] = Way::miss(touch, truth, &self.tool, &found).into();
                miss
            });
            Some(DVector::from_iterator(3 * touches.len(), each))
        };
        let (at_best, arm) = (misses(&best)?, best.errors.number_count());
        let columns: Option<Vec<DVector<f64>>> = (0..6 + arm)
            .map(|k| {
                let mut there = best.clone();
                if k < 6 {
                    let mut step = Vector6::zeros();
                    step[k] = STEP;
                    let (mount, anchor) = (there.hand_eye.mount_from_camera(), there.hand_eye.anchor_from_target());
                    there.hand_eye = HandEye::new(there.hand_eye.mode(), mount.perturbed(&step), anchor);
                } else {
                    *there.errors.numbers_mut().nth(k - 6)? += STEP;
                }
                Some((misses(&there)? - &at_best) / STEP)
            })
            .collect();
        let by_unknowns = DMatrix::from_columns(&columns?);
        Some(by_unknowns.tr_mul(&by_unknowns) / touches.len() as f64)
    }

    fn touches(&self, way: &Way, planned: &[Plan]) -> Option<Vec<Touch>> {
        let touches: Vec<Touch> = planned.iter().filter_map(|plan| way.touch(&self.views, plan, &self.tool)).collect();
        (4 * touches.len() >= planned.len()).then_some(touches)
    }

    /// The quantile of the distances in one way where the truth is one of these.
    fn quantile(&self, way: &Way, touches: &[Touch], truths: &[Possible]) -> Option<f64> {
        let pivots = way.pivots(&touches[0], &self.turns, &self.views, &self.tool);
        let mut distances: Vec<f64> = Vec::with_capacity(truths.len() * touches.len());
        for (k, truth) in truths.iter().enumerate() {
            let found = way.tool_by(&pivots, touches, truth, &self.tool)?;
            let its_touches = touches.iter().skip(k % APART).step_by(APART);
            distances.extend(its_touches.map(|touch| Way::miss(touch, truth, &self.tool, &found).norm()));
        }
        quantile(distances)
    }
}

impl Way {
    fn touch(&self, views: &[Seen], plan: &Plan, tool: &Vector3<f64>) -> Option<Touch> {
        let seen = &views[plan.view];
        let view = At::new(&self.arm.arm, &seen.joints_rad)?;
        let in_camera = plan.in_camera;
        let base_from_tip = view.tip(&self.arm.errors);
        let base_from_camera = camera(&self.hand_eye, &base_from_tip);
        let turn = along(self.hand_eye.mode(), &base_from_camera, &seen.camera_from_target, &self.axis) * plan.turn;
        let point = base_from_camera * in_camera;
        let goal = Isometry3::from_parts((point.coords - turn * tool).into(), turn);
        let command = self.at(&goal, &seen.joints_rad)?;
        let turn = if has_few_joints(&self.arm) { command.tip(&self.arm.errors).rotation } else { turn };
        Some(Touch { view, command, in_camera, turn })
    }

    /// The arm commanded to a goal as modelled by this way; the tip of the tool alone arrives where it has few joints.
    fn at(&self, goal: &Isometry3<f64>, near: &[f64]) -> Option<At> {
        let goal = Pose::from_isometry(*goal);
        let joints_rad = if has_few_joints(&self.arm) {
            let goal = PointGoal { base_from_tip: &goal, free_about_tool: true, turn_rad: TURN_OF_FEW_JOINTS };
            few_joints::joints_for(&self.arm, &goal, near, ARRIVED)
        } else {
            self.arm.joints_for(&goal, near, ARRIVED)
        };
        At::new(&self.arm.arm, &joints_rad.ok()?)
    }

    /// The arm at turns about the point of a touch; none where it has too few joints for them.
    fn pivots(
        &self,
        touch: &Touch,
        turns: &[UnitQuaternion<f64>],
        views: &[Seen],
        tool: &Vector3<f64>,
    ) -> Vec<(At, UnitQuaternion<f64>)> {
        if has_few_joints(&self.arm) {
            return Vec::new();
        }
        let tip = touch.command.tip(&self.arm.errors);
        let point = tip * Point3::from(*tool);
        let at = |turn: &UnitQuaternion<f64>| {
            let turn = touch.turn * turn;
            let goal = Isometry3::from_parts((point.coords - turn * tool).into(), turn);
            Some((self.at(&goal, &views[0].joints_rad)?, turn))
        };
        turns.iter().filter_map(at).collect()
    }

    /// Where this way finds the tip of the tool in the frame of its tip, when the arm is as in `truth` and turns about one point:
    /// with `l_k` the tip of the tool as it is at turn `R_k`, the place `t` and the shift `s` of the point for which all
    /// `R_k (t − l_k) − s` are least. Where the arm reaches too few turns, the true place is returned.
    fn tool_by(
        &self,
        pivots: &[(At, UnitQuaternion<f64>)],
        touches: &[Touch],
        truth: &Possible,
        tool: &Vector3<f64>,
    ) -> Option<Vector3<f64>> {
        if has_few_joints(&self.arm) {
            return Some(Self::tool_by_touching(touches, truth, tool));
        }
        let (mut information, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for ((at, turn), unexplained) in pivots.iter().zip(&truth.unexplained.pivots) {
            let believed_from_true = at.tip(&self.arm.errors).inverse() * at.tip(&truth.errors) * unexplained;
            let place = (believed_from_true * Point3::from(*tool)).coords;
            let row = pivot_row(turn);
            information += row.transpose() * row;
            right += row.transpose() * (turn * place);
        }
        if pivots.len() < PIVOTS / 2 {
            return Some(*tool);
        }
        Some(Cholesky::new(information)?.solve(&right).fixed_rows::<3>(0).into_owned())
    }

    /// Where touches of points that the camera saw find the tip of the tool: the mean of what each of them is off.
    fn tool_by_touching(touches: &[Touch], truth: &Possible, tool: &Vector3<f64>) -> Vector3<f64> {
        let apart = touches.len().div_ceil(PIVOTS);
        let found: Vec<Vector3<f64>> = touches
            .iter()
            .step_by(apart)
            .zip(truth.unexplained.pivots.iter().zip(truth.unexplained.pivots.iter().rev()))
            .map(|(touch, (at_view, at_touch))| {
                let unexplained = Unexplained { view: *at_view, touch: *at_touch, ..truth.unexplained.clone() };
                let truth = Possible { unexplained, ..truth.clone() };
                tool + touch.turn.inverse() * Self::miss(touch, &truth, tool, tool)
            })
            .collect();
        found.iter().sum::<Vector3<f64>>() / found.len() as f64
    }

    /// Vector from the point to the tip of the tool.
    fn miss(touch: &Touch, draw: &Possible, tool: &Vector3<f64>, found: &Vector3<f64>) -> Vector3<f64> {
        let at_view = touch.view.tip(&draw.errors) * draw.unexplained.view;
        let point = camera(&draw.hand_eye, &at_view) * touch.in_camera;
        let tip = touch.command.tip(&draw.errors) * draw.unexplained.touch * Point3::from(*tool);
        // The command was for the true tool.
        tip - point - touch.turn * (found - tool)
    }
}

/// Touches that are spread evenly over the views; `point` is the place of one in the camera, by the view.
pub(crate) fn planned(views: usize, point: impl Fn(usize, &mut Draw) -> Point3<f64>) -> Vec<Plan> {
    let mut random = Draw::new(TOUCH_SEED);
    let plan = |k: usize| {
        let azimuth = random.even() * std::f64::consts::TAU;
        let tilt = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * (TILT_RAD * random.even().sqrt());
        let about = Vector3::z() * random.even() * std::f64::consts::TAU;
        let view = k * views / TOUCHES;
        let in_camera = point(view, &mut random);
        let turn = UnitQuaternion::from_scaled_axis(tilt) * UnitQuaternion::from_scaled_axis(about);
        Plan { view, in_camera, turn }
    };
    (0..TOUCHES).map(plan).collect()
}

/// Turns about one point by which the tip of a tool is found.
pub(crate) fn turns(random: &mut Draw) -> [UnitQuaternion<f64>; PIVOTS] {
    std::array::from_fn(|_| UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| random.even() - 0.5)))
}

/// The distance that 95 % of these stay below.
pub(crate) fn quantile(mut distances: Vec<f64>) -> Option<f64> {
    distances.sort_by(f64::total_cmp);
    let last = distances.len().checked_sub(1)?;
    Some(distances[((distances.len() as f64 * LEVEL) as usize).min(last)])
}

/// An arm and a camera that the data allow.
#[derive(Debug, Clone)]
struct Possible {
    errors: ArmErrors,
    hand_eye: HandEye,
    unexplained: Unexplained,
}

/// What the errors of an arm do not explain of its poses at a view, at a touch and where the tool is found.
#[derive(Debug, Clone)]
struct Unexplained {
    view: Isometry3<f64>,
    touch: Isometry3<f64>,
    pivots: [Isometry3<f64>; PIVOTS],
}

impl Unexplained {
    fn nothing() -> Self {
        let still = Isometry3::identity();
        Self { view: still, touch: still, pivots: [still; PIVOTS] }
    }

    fn draw(fit: &ArmFit, random: &mut Draw) -> Self {
        let sigma = |i: usize| if i < 3 { fit.noise.robot_m } else { fit.noise.robot_rad };
        let mut next = || se3::exp(&Vector6::from_fn(|i, _| sigma(i) * random.normal()));
        Self { view: next(), touch: next(), pivots: std::array::from_fn(|_| next()) }
    }
}

/// Drawn from the posterior of a fit; `None` for a covariance that is not valid.
fn possible(fit: &ArmFit, random: &mut Draw) -> Option<Vec<Possible>> {
    let covariance = fit.links_and_errors_covariance();
    let count = covariance.nrows();
    let root = Cholesky::new(covariance)?.l();
    // Practically infinite.
    let freedom = fit.small_sample.degrees_of_freedom.min(1e4);
    let law = ChiSquared::new(freedom).ok()?;
    let mut drawn = Vec::with_capacity(DRAWS);
    for _ in 0..DRAWS {
        let unexplained = Unexplained::draw(fit, random);
        let step = &root * DVector::from_fn(count, |_, _| random.normal());
        let step = step * (freedom / law.inverse_cdf(random.even())).sqrt();
        let perturb = |at: usize| -> Vector6<f64> { step.fixed_rows::<6>(at).into_owned() };
        let mut errors = fit.errors.clone();
        errors.numbers_mut().zip(step.rows(12, count - 12).iter()).for_each(|(number, step)| *number += step);
        drawn.push(Possible {
            errors,
            hand_eye: HandEye::new(
                fit.hand_eye.mode(),
                fit.hand_eye.mount_from_camera().perturbed(&perturb(0)),
                fit.hand_eye.anchor_from_target().perturbed(&perturb(6)),
            ),
            unexplained,
        });
    }
    Some(drawn)
}

/// The mean z axis of the tip over the views, in the base.
fn mean_axis(arm: &Arm, views: &[Seen]) -> Option<Vector3<f64>> {
    let axes = views.iter().filter_map(|seen| Some(arm.forward(&seen.joints_rad).ok()?.rotation() * Vector3::z()));
    axes.sum::<Vector3<f64>>().try_normalize(1e-9)
}

/// Pose of the camera with the tip at a pose.
pub(crate) fn camera(hand_eye: &HandEye, base_from_tip: &Isometry3<f64>) -> Isometry3<f64> {
    match hand_eye {
        HandEye::EyeInHand { tip_from_camera, .. } => base_from_tip * tip_from_camera.isometry(),
        HandEye::EyeToHand { base_from_camera, .. } => *base_from_camera.isometry(),
    }
}

/// Orientation of a tool without tilt: against the target's normal, or with a camera next to the robot along the mean `axis` of the
/// tip.
pub(crate) fn along(
    mode: Mode,
    base_from_camera: &Isometry3<f64>,
    camera_from_target: &Pose<Camera, Target>,
    axis: &Vector3<f64>,
) -> UnitQuaternion<f64> {
    match mode {
        // A target's z axis points away from the viewer.
        Mode::EyeInHand => base_from_camera.rotation * camera_from_target.isometry().rotation,
        Mode::EyeToHand => facing(axis),
    }
}

/// Derivatives of the distance to the point about which a tool turns by the place of its tip and on the shift of that
/// point.
pub(crate) fn pivot_row(turn: &UnitQuaternion<f64>) -> Matrix3x6<f64> {
    let mut row = Matrix3x6::zeros();
    row.fixed_columns_mut::<3>(0).copy_from(turn.to_rotation_matrix().matrix());
    row.fixed_columns_mut::<3>(3).copy_from(&-Matrix3::identity());
    row
}

/// A turn whose z axis is along a direction.
fn facing(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}

#[cfg(test)]
#[path = "reach_error_tests.rs"]
mod tests;
