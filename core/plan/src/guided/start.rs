//! Poses before there is an answer: small turns of the tip, then tilts of the camera about the board.
//!
//! The small turns ([`super::fan`]) need no prior knowledge. Where the board nearly fills the image, or is near its edge, they are
//! too small to determine a lens. But with a guessed lens they give a rough answer, with which the board can be tilted in the
//! image without leaving it. Turns of the tip by an angle `a` move the board in the image by `f a (1 + l / z)`, where `l` is the
//! lever from tip to camera along the line of sight, and `z`, the distance of the board, is `f` times the true size of the board
//! over that in pixels. So whatever `f` is guessed, `l + z`, the place of the board in front of the tip, is correct, and a tilt
//! turns the tip about that place. The place of the camera is wrong: it is not used for clearances, a camera at the tip is used
//! instead.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};

use super::choose::{Plan, Proposal, Robot};
use super::design::{Design, Part};
use super::{
    CAREFUL_NOISE, CAREFUL_ROOM_M, Ending, Guide, Known, LARGEST_FAN_WAY_RAD, MOST_FAN, Next, ViewRange, Why, at_least,
    expected_views, fan, used_views, with_board,
};
use crate::clearance::travel;
use handeye_arm::JointValues;
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::ViewModel;
use handeye_estimate::{self as estimate, CameraKnowledge, KnownLens, Method, Observations};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corner;

/// Views that a rough answer needs: the first one and turns about two axes.
const ROUGH_VIEWS: usize = 3;
/// Axes in the camera that it is tilted about, in their order, at most twice.
const AXES: [[f64; 3]; 6] =
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.7, 0.7, 0.0], [-0.7, -0.7, 0.0]];
/// Tilts, degrees: of each axis the largest one that surely shows the board. An estimate of a lens needs 20° and more about two.
const TILTS_DEG: [f64; 4] = [28.0, 20.0, 14.0, 10.0];
/// The tilt where none surely shows it, degrees, less after a view that did not.
const UNSURE_TILT_DEG: f64 = 10.0;
/// Distances from the board that a tilt is tried at, as parts of the first: a tilted board may need more room in the
/// image.
const DISTANCES: [f64; 4] = [1.0, 1.1, 1.25, 1.5];

/// The first view, around which the others are.
struct FirstView<'o> {
    base_from_tip: Pose<Base, Tip>,
    corners: &'o [Corner],
}

impl Guide {
    /// A pose that needs no answer: a small turn about the first view, or a tilt by a rough answer once there are some.
    pub(super) fn first_poses(&mut self, known: &Known<'_>, cancel: &CancelToken) -> Next {
        let observations = known.observations;
        let mut views = observations.views.iter().filter_map(|view| {
            let corners = view.corners.as_ref().filter(|corners| view.in_fit && corners.len() >= 4)?;
            Some(FirstView { base_from_tip: view.base_from_tip?, corners })
        });
        let Some(first) = views.next() else { return Next::End(Ending::NoStart) };
        if views.count() + 1 >= ROUGH_VIEWS
            && let Some(next) = self.tilt(known, &first.base_from_tip, cancel)
        {
            return next;
        }
        self.turn(known, &first)
    }

    /// A small turn of the tip about the first view.
    fn turn(&mut self, known: &Known<'_>, first: &FirstView<'_>) -> Next {
        let observations = known.observations;
        let corners_px = first.corners.iter().map(|corner| corner.px);
        let turn_rad = fan::free_turn_rad(corners_px, observations.image_size, lens(observations).fx);
        while self.fan_tried < MOST_FAN {
            let (base_from_tip, turn_rad) =
                fan::pose(&first.base_from_tip, self.fan_tried, turn_rad, self.failed.len());
            self.fan_tried += 1;
            if let Some(joints) = reached(known.robot, &base_from_tip) {
                return go(base_from_tip, Pose::identity(), joints, Why::FirstTurns { turn_rad });
            }
        }
        Next::End(Ending::NoStart)
    }

    /// A tilt about the board; `None` where no rough answer is found, or all tilts were tried.
    fn tilt(&mut self, known: &Known<'_>, first: &Pose<Base, Tip>, cancel: &CancelToken) -> Option<Next> {
        let rough = RoughAnswer::new(known, first, self.doubt_factor(), cancel)?;
        let left = self.tilts_tried..2 * AXES.len();
        let axis = |index: usize| AXES[index % AXES.len()];
        let sure = left.clone().find_map(|index| {
            let largest = TILTS_DEG.iter().find_map(|deg| rough.tilted(axis(index), *deg, true))?;
            Some((index, largest))
        });
        let (index, next) = sure.or_else(|| {
            let deg = UNSURE_TILT_DEG / rough.doubt_factor;
            left.clone().find_map(|index| Some((index, rough.tilted(axis(index), deg, false)?)))
        })?;
        self.tilts_tried = index + 1;
        Some(next)
    }
}

/// The geometry by the views so far and a guessed lens.
struct RoughAnswer {
    model: ViewModel,
    target: TargetSpec,
    design: Design,
    range: ViewRange,
    seen_first: Pose<Camera, Target>,
    robot: Option<Robot>,
    doubt_factor: f64,
}

impl RoughAnswer {
    fn new(known: &Known<'_>, first: &Pose<Base, Tip>, doubt_factor: f64, cancel: &CancelToken) -> Option<Self> {
        let observations = known.observations;
        let target = observations.target;
        let fixed = Observations { camera: CameraKnowledge::Fixed(lens(observations)), ..observations.clone() };
        let fit = estimate::fit(&fixed, Method::Joint, cancel).ok()?;
        let model = ViewModel::new(&fit, &target)?;
        let noise = at_least(model.noise(), &CAREFUL_NOISE);
        let model = model.with_noise(noise);
        let views = expected_views(&model, &used_views(&fixed, Some(&fit)));
        let design = Design::new(model.prior(), &views, Matrix6::identity())?;
        let robot = known.robot.map(|robot| {
            let mut around = with_board(robot, model.hand_eye(), observations, CAREFUL_ROOM_M);
            if model.mode() == Mode::EyeInHand {
                around.arm.carried.clone_from(&robot.arm.carried);
                // The line of sight from there would go through the hand.
                around.sight.clone_from(&robot.sight);
            }
            around
        });
        let seen_first = model.hand_eye().camera_from_target(first);
        let range = ViewRange::about([(seen_first.isometry() * target.centre()).coords.norm()].into_iter())?;
        Some(Self { model, target, design, range, seen_first, robot, doubt_factor })
    }

    /// The camera tilted about the board, from the nearest distance from which that is in the image, surely or by the
    /// estimate, and that the arm reaches.
    fn tilted(&self, axis: [f64; 3], deg: f64, surely: bool) -> Option<Next> {
        let turn_rad = deg.to_radians();
        let about = UnitQuaternion::from_scaled_axis(Vector3::from(axis).normalize() * turn_rad);
        let middle = (self.seen_first.isometry() * self.target.centre()).coords;
        DISTANCES.iter().find_map(|distance| {
            let camera_from_target = about_board(&self.seen_first, &about, &(middle * *distance), &self.target);
            let base_from_tip = self.model.base_from_tip(&camera_from_target);
            let is_shown = if surely {
                let pixels = self.model.pixels(&base_from_tip.into(), self.design.covariance());
                self.range.surely_shows(&self.target, &pixels, self.doubt_factor)
            } else {
                self.range.shows(self.model.intrinsics(), &self.target, &camera_from_target)
            };
            let joints = is_shown.then(|| reached(self.robot.as_ref(), &base_from_tip))??;
            Some(go(base_from_tip, camera_from_target, joints, Why::FirstTilts { turn_rad }))
        })
    }
}

/// The lens that is known or, where none is, a usual one: 53° wide, without distortion.
fn lens(observations: &Observations) -> Intrinsics {
    match observations.camera {
        CameraKnowledge::Fixed(intrinsics)
        | CameraKnowledge::Near(KnownLens { intrinsics, .. })
        | CameraKnowledge::Estimate { start: Some(intrinsics), .. } => intrinsics,
        CameraKnowledge::Estimate { start: None, .. } => {
            let (width, height) = observations.image_size;
            let [fx, cx, cy] = [f64::from(width), f64::from(width) / 2.0 - 0.5, f64::from(height) / 2.0 - 0.5];
            Intrinsics { width, height, fx, fy: fx, cx, cy, distortion: Distortion::None }
        }
    }
}

/// The view with the middle of the board at a point of the camera, turned about it.
fn about_board(
    seen: &Pose<Camera, Target>,
    about: &UnitQuaternion<f64>,
    middle: &Vector3<f64>,
    target: &TargetSpec,
) -> Pose<Camera, Target> {
    let turned = Isometry3::from_parts(Translation3::from(*middle), about * seen.rotation());
    Pose::from_isometry(turned * Translation3::from(-target.centre().coords))
}

/// Joint values with which the arm reaches a tip pose on a short free path; `Some(None)` without an arm.
#[expect(
    clippy::option_option,
    reason = "the outer one says whether it is reached, the inner one whether there is an arm"
)]
fn reached(robot: Option<&Robot>, base_from_tip: &Pose<Base, Tip>) -> Option<Option<JointValues>> {
    let Some(robot) = robot else { return Some(None) };
    let joints = robot.arm.reach(base_from_tip, &robot.joints)?;
    let is_free = travel(&robot.joints, &joints) <= LARGEST_FAN_WAY_RAD
        && robot.is_good(&joints, base_from_tip)
        && robot.path_is_free(&joints);
    is_free.then_some(Some(joints))
}

fn go(
    base_from_tip: Pose<Base, Tip>,
    camera_from_target: Pose<Camera, Target>,
    joints: Option<JointValues>,
    why: Why,
) -> Next {
    let proposal =
        Proposal { base_from_tip, camera_from_target, joints, travel_s: 0.0, error_ratio: 1.0, part: Part::Rotation };
    Next::Go { plan: Plan { proposals: vec![proposal], best_ratio: 1.0, candidates: 1 }, why }
}
