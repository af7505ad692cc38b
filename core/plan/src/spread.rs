//! Poses from which to look at a board: reachable, safe to drive between, and as different as possible.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::clearance::{Arm, travel};
use super::contact::Contact;
use super::surroundings::Surroundings;
use handeye_arm::JointValues;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;

/// Number of directions in which a board may move that are checked; between two of them it leaves the image by no more than 8 % of
/// the distance.
const DIRECTIONS: u32 = 8;

/// The planner's model of a cell. Errors of a centimetre or a few degrees only cost margin, so estimates and drawings
/// are sufficient.
#[derive(Debug, Clone)]
pub struct ViewSetup {
    /// Pose of the target.
    pub base_from_target: Pose<Base, Target>,
    /// The target that is to be seen.
    pub target: TargetSpec,
    /// The lens.
    pub intrinsics: Intrinsics,
    /// Pose of the camera on the tip.
    pub tip_from_camera: Pose<Tip, Camera>,
    /// The arm and its tool.
    pub arm: Arm,
    /// Configuration to start from; poses are reached without changing over to another branch where possible.
    pub start_joints: JointValues,
    /// The surroundings, including the board.
    pub around: Surroundings,
}

/// Requirements for the views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewOptions {
    /// Number of views.
    pub count: usize,
    /// Seed of the candidates.
    pub seed: u64,
    /// Nearest and farthest distance between camera and board.
    pub distance_m: [f64; 2],
    /// Largest angle between the line of sight and the normal of the board.
    pub cone_rad: f64,
    /// Largest roll of the camera either way.
    pub roll_rad: f64,
    /// How far from the middle of the board the line of sight may meet it.
    pub aim_m: f64,
    /// Free pixels between the printed squares and the edge of the image.
    pub margin_px: f64,
    /// Distance that the board may move in its plane and still be wholly in the image, without free pixels; 0 for a board at rest.
    pub leeway_m: f64,
    /// Free space around the arm and its tool.
    pub clearance_m: f64,
    /// Number of random views that are tried.
    pub candidates: usize,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            count: 20,
            seed: 1,
            distance_m: [0.3, 0.5],
            cone_rad: 45_f64.to_radians(),
            roll_rad: std::f64::consts::PI,
            aim_m: 0.03,
            margin_px: 12.0,
            leeway_m: 0.0,
            clearance_m: 0.02,
            candidates: 3000,
        }
    }
}

/// A pose to look at the board from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedView {
    /// Joint values, radians; metres for a prismatic joint.
    pub joints: JointValues,
    /// Tip pose there.
    pub base_from_tip: Pose<Base, Tip>,
}

/// Why there are not enough views.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum PlanError {
    /// Fewer views than requested fit the cell.
    #[error(
        "only {found} of {wanted} views: of {candidates} tried, {not_in_view} would not show the whole board, \
         {unreachable} are out of the arm's reach, {in_the_way} would touch something and {no_path} cannot be driven \
         to safely from the others: move the board towards the middle of the workspace, or allow other distances and \
         angles"
    )]
    TooFewViews {
        /// Views found.
        found: usize,
        /// Views wanted.
        wanted: usize,
        /// Random views tried.
        candidates: usize,
        /// Number of these that do not show the whole board.
        not_in_view: usize,
        /// Number that the arm cannot reach within its limits.
        unreachable: usize,
        /// Number that would touch the arm itself or an obstacle.
        in_the_way: usize,
        /// Number without a free straight path in joint space to every view chosen.
        no_path: usize,
    },
    /// Even the configuration to start from is not free.
    #[error("in the configuration to start from the arm is {there}: move it into free space first", there = by.here())]
    StartBlocked {
        /// What it is too close to.
        by: Contact,
    },
}

/// Picks views of the board that differ as much as possible in rotation.
///
/// Random views are drawn from a cone about the board's normal, with any roll, distance and a small random offset of
/// the aim from the middle. Kept are those that show the whole board, that the arm reaches within its limits and that
/// touch nothing. From these the one nearest to the start is taken first, then always the one whose rotation is
/// farthest from all taken so far, provided that the straight path in joint space is free between it and every other,
/// and the start. So any order of visiting them is safe, and the first few are well spread too.
///
/// The same setup and options give the same views.
///
/// # Errors
/// [`PlanError`] states why candidates failed.
pub fn poses_looking_at(setup: &ViewSetup, options: &ViewOptions) -> Result<Vec<PlannedView>, PlanError> {
    poses_unlike(setup, options, &[])
}

/// As [`poses_looking_at`], but also as different as possible from existing views: the first is the one whose rotation
/// is farthest from all of `taken`, and none is nearer to one of these than to those chosen before it.
///
/// # Errors
/// [`PlanError`] states why candidates failed.
pub fn poses_unlike(
    setup: &ViewSetup,
    options: &ViewOptions,
    taken: &[Pose<Base, Tip>],
) -> Result<Vec<PlannedView>, PlanError> {
    if let Some(by) = setup.arm.contact(&setup.start_joints, &setup.around, options.clearance_m) {
        return Err(PlanError::StartBlocked { by });
    }
    let mut draws = Draws::new(setup, options);
    let views = draws.by_ref().flatten().collect();
    let (chosen, no_path) = choose(setup, options, views, taken);
    draws.result(chosen, no_path)
}

/// All random views that show the whole board, that the arm reaches and that touch nothing, in the order in which they
/// were drawn: for callers that choose among them by another criterion.
pub fn views_of_board(setup: &ViewSetup, options: &ViewOptions) -> Vec<PlannedView> {
    Draws::new(setup, options).flatten().collect()
}

/// Random views, each `None` when something is wrong with it, and what that was.
struct Draws<'a> {
    setup: &'a ViewSetup,
    options: &'a ViewOptions,
    rng: ChaCha8Rng,
    drawn: usize,
    not_in_view: usize,
    unreachable: usize,
    in_the_way: usize,
}

impl<'a> Draws<'a> {
    fn new(setup: &'a ViewSetup, options: &'a ViewOptions) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(options.seed);
        Self { setup, options, rng, drawn: 0, not_in_view: 0, unreachable: 0, in_the_way: 0 }
    }

    fn result(&self, chosen: Vec<PlannedView>, no_path: usize) -> Result<Vec<PlannedView>, PlanError> {
        if chosen.len() >= self.options.count {
            return Ok(chosen);
        }
        Err(PlanError::TooFewViews {
            found: chosen.len(),
            wanted: self.options.count,
            candidates: self.options.candidates,
            not_in_view: self.not_in_view,
            unreachable: self.unreachable,
            in_the_way: self.in_the_way,
            no_path,
        })
    }
}

impl Iterator for Draws<'_> {
    type Item = Option<PlannedView>;

    fn next(&mut self) -> Option<Self::Item> {
        let (setup, options) = (self.setup, self.options);
        if self.drawn == options.candidates {
            return None;
        }
        self.drawn += 1;
        let target_from_camera = draw(setup, options, &mut self.rng);
        if !shows_whole_board(setup, options, &target_from_camera) {
            self.not_in_view += 1;
            return Some(None);
        }
        let base_from_tip = setup.base_from_target * target_from_camera * setup.tip_from_camera.inverse();
        let Some(joints) = setup.reach(&base_from_tip) else {
            self.unreachable += 1;
            return Some(None);
        };
        if !setup.is_free(&joints, options.clearance_m) {
            self.in_the_way += 1;
            return Some(None);
        }
        Some(Some(PlannedView { joints, base_from_tip }))
    }
}

/// Orders views so that each is near the one before: less time on the way, but less spread in the first few.
pub fn order_by_travel(start: &[f64], views: &mut [PlannedView]) {
    for next in 0..views.len() {
        let before = next.checked_sub(1).map(|last| views[last].joints);
        let from = before.as_deref().unwrap_or(start);
        let nearest = (next..views.len())
            .min_by(|&a, &b| travel(from, &views[a].joints).total_cmp(&travel(from, &views[b].joints)))
            .unwrap_or(next);
        views.swap(next, nearest);
    }
}

impl ViewSetup {
    fn reach(&self, base_from_tip: &Pose<Base, Tip>) -> Option<JointValues> {
        self.arm.reach(base_from_tip, &self.start_joints)
    }

    /// Whether the arm touches neither itself nor anything else there.
    pub fn is_free(&self, joints: &[f64], clearance_m: f64) -> bool {
        self.arm.is_free(joints, &self.around, clearance_m)
    }

    /// Whether the straight path in joint space between two configurations touches nothing; its ends are not checked.
    pub fn path_is_free(&self, from: &[f64], to: &[f64], clearance_m: f64) -> bool {
        self.arm.path_is_free(from, to, &self.around, clearance_m)
    }
}

fn draw(setup: &ViewSetup, options: &ViewOptions, rng: &mut ChaCha8Rng) -> Pose<Target, Camera> {
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    // Uniform on the cap of the sphere: its area is proportional to its height.
    let tilt = uniform(options.cone_rad.cos(), 1.0).clamp(-1.0, 1.0).acos();
    let heading = uniform(0.0, std::f64::consts::TAU);
    let distance_m = uniform(options.distance_m[0], options.distance_m[1]);
    let roll = uniform(-options.roll_rad, options.roll_rad);
    let beside = Vector3::new(uniform(-options.aim_m, options.aim_m), uniform(-options.aim_m, options.aim_m), 0.0);
    let aim = setup.target.centre() + beside;
    // The target's z points into the board, so the viewer is on the side of -z.
    let to_camera = Vector3::new(tilt.sin() * heading.cos(), tilt.sin() * heading.sin(), -tilt.cos());
    let forward = -to_camera;
    // Upright is the camera whose x is nearest to the target's; with a tilt below 90° there is one.
    let right = (Vector3::x() - forward * forward.x).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let upright = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let rolled = upright * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
    let eye = aim + to_camera * distance_m;
    Pose::from_isometry(Isometry3::from_parts(Translation3::from(eye.coords), rolled))
}

fn shows_whole_board(setup: &ViewSetup, options: &ViewOptions, target_from_camera: &Pose<Target, Camera>) -> bool {
    let camera_from_target = target_from_camera.inverse();
    shows_outline(&setup.intrinsics, &setup.target, &camera_from_target, options.margin_px)
        && shows_within(&setup.intrinsics, &setup.target, &camera_from_target, options.leeway_m)
}

/// Whether the whole board stays in the image when it moves in its plane by this much, metres.
pub fn shows_within(
    intrinsics: &Intrinsics,
    target: &TargetSpec,
    camera_from_target: &Pose<Camera, Target>,
    leeway_m: f64,
) -> bool {
    leeway_m <= 0.0
        || (0..DIRECTIONS).all(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS);
            let shift = Translation3::new(leeway_m * angle.cos(), leeway_m * angle.sin(), 0.0);
            let shifted = Pose::from_isometry(camera_from_target.isometry() * shift);
            shows_outline(intrinsics, target, &shifted, 0.0)
        })
}

/// Whether the printed pattern is in the image with this many free pixels.
fn shows_outline(
    intrinsics: &Intrinsics,
    target: &TargetSpec,
    camera_from_target: &Pose<Camera, Target>,
    margin_px: f64,
) -> bool {
    let grid = target.grid();
    let (width, height) = (f64::from(intrinsics.width), f64::from(intrinsics.height));
    let margin = margin_px - 0.5;
    // The printed pattern extends one square beyond its outermost points; its border bounds it in any lens.
    let (last_column, last_row) = (grid.columns as i64, grid.rows as i64);
    (-1..=last_row).all(|row| {
        (-1..=last_column).filter(|&column| row == -1 || row == last_row || column == -1 || column == last_column).all(
            |column| {
                let point = Point3::new(column as f64 * grid.square_m, row as f64 * grid.square_m, 0.0);
                intrinsics.project(&(camera_from_target.isometry() * point)).is_ok_and(|px| {
                    px.x >= margin && px.y >= margin && px.x <= width - 1.0 - margin && px.y <= height - 1.0 - margin
                })
            },
        )
    })
}

/// Greedy farthest-point selection; also counts the candidates that were dropped for lack of a path.
fn choose(
    setup: &ViewSetup,
    options: &ViewOptions,
    mut rest: Vec<PlannedView>,
    taken: &[Pose<Base, Tip>],
) -> (Vec<PlannedView>, usize) {
    let mut chosen: Vec<PlannedView> = Vec::with_capacity(options.count);
    let mut no_path = 0;
    // Angle from each remaining candidate to the nearest one taken or chosen; while there is none, closeness to the start.
    let angle_to =
        |view: &PlannedView, other: &Pose<Base, Tip>| view.base_from_tip.rotation().angle_to(&other.rotation());
    let first_score = |view: &PlannedView| match taken {
        [] => -travel(&setup.start_joints, &view.joints),
        taken => taken.iter().map(|other| angle_to(view, other)).fold(f64::INFINITY, f64::min),
    };
    let mut scores: Vec<f64> = rest.iter().map(first_score).collect();
    while chosen.len() < options.count {
        let Some(best) = (0..rest.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b])) else { break };
        let view = rest.swap_remove(best);
        scores.swap_remove(best);
        let reachable = |from: &[f64]| setup.path_is_free(from, &view.joints, options.clearance_m);
        if !(reachable(&setup.start_joints) && chosen.iter().all(|other| reachable(&other.joints))) {
            no_path += 1;
            continue;
        }
        let first = chosen.is_empty() && taken.is_empty();
        for (score, other) in scores.iter_mut().zip(&rest) {
            let angle = angle_to(other, &view.base_from_tip);
            *score = if first { angle } else { score.min(angle) };
        }
        chosen.push(view);
    }
    (chosen, no_path)
}
