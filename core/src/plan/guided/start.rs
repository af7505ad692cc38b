//! Poses before there is an answer: small turns of the tip, then tilts of the camera about the board.
//!
//! The small turns ([`super::fan`]) need to know nothing. Where the board nearly fills the image, or lies near its edge, they are
//! so small that they determine no lens. But with a lens that is guessed they give a rough answer, and by that the board can
//! be tilted in the image without leaving it. Turns of the tip by an angle `a` move the board in the image by
//! `f a (1 + l / z)`, where `l` is the lever from tip to camera along the line of sight, and `z`, the distance of the board, is
//! `f` times what its pixels say. So whatever `f` is guessed, `l + z`, the place of the board before the tip, comes out right, and
//! a tilt turns the tip about that place. What comes out wrong is where the camera sits: it is not what is kept clear of things,
//! the camera at the tip still is.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::choose::{Plan, Proposal, Robot};
use super::{
    CAREFUL_ROOM_M, Ending, Guide, Known, LARGEST_FAN_WAY_RAD, MOST_FAN, Next, ViewRange, Why, fan, with_board,
};
use crate::estimate::handeye::Mode;
use crate::estimate::{CameraKnowledge, Method, Observations, calibrate};
use crate::geometry::arm::JointValues;
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::frames::{Base, Camera, Pose, Target, Tip};
use crate::plan::clearance::travel;
use crate::progress::CancelToken;
use crate::targets::observation::Corner;

/// Views that a rough answer takes: the first one and turns about two axes, one of them in both directions.
const ROUGH_VIEWS: usize = 4;
/// Tilts of the camera about the board, in their order: axis in the camera and degrees. An estimate of a lens takes 20° and more
/// about two axes; the first ones are smaller, because the answer that they go by is rough.
const TILTS: [([f64; 3], f64); 10] = [
    ([1.0, 0.0, 0.0], 10.0),
    ([0.0, 1.0, 0.0], 10.0),
    ([-1.0, 0.0, 0.0], 20.0),
    ([0.0, -1.0, 0.0], 20.0),
    ([1.0, 0.0, 0.0], 28.0),
    ([0.0, 1.0, 0.0], 28.0),
    ([-1.0, 0.0, 0.0], 28.0),
    ([0.0, -1.0, 0.0], 28.0),
    ([0.7, 0.7, 0.0], 28.0),
    ([-0.7, -0.7, 0.0], 28.0),
];
/// Distances from the board that a tilt is tried at, as parts of the first: what is tilted takes more room in the image.
const DISTANCES: [f64; 4] = [1.0, 1.1, 1.25, 1.5];

/// The first view, about which the others lie.
struct FirstView<'o> {
    base_from_tip: Pose<Base, Tip>,
    corners: &'o [Corner],
}

impl Guide {
    /// A pose that takes no answer: a small turn about the first view, or a tilt by a rough answer once there are some.
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

    /// A tilt about the board; `None` where no rough answer is found, or all were tried.
    fn tilt(&mut self, known: &Known<'_>, first: &Pose<Base, Tip>, cancel: &CancelToken) -> Option<Next> {
        if self.tilts_tried >= TILTS.len() {
            return None;
        }
        let observations = known.observations;
        let (target, lens) = (&observations.target, lens(observations));
        let rough = Observations { camera: CameraKnowledge::Fixed(lens), ..observations.clone() };
        let hand_eye = calibrate(&rough, Method::Joint, cancel).ok()?.hand_eye?;
        let robot = known.robot.map(|robot| {
            let mut around = with_board(robot, &hand_eye, observations, CAREFUL_ROOM_M);
            if hand_eye.mode() == Mode::EyeInHand {
                around.arm.carried.clone_from(&robot.arm.carried);
            }
            around
        });
        let seen_first = hand_eye.camera_from_target(first);
        let middle = (seen_first.isometry() * target.centre()).coords;
        let range = ViewRange::about([middle.norm()].into_iter())?;
        for (offset, (axis, deg)) in TILTS[self.tilts_tried..].iter().enumerate() {
            let turn_rad = deg.to_radians();
            let about = UnitQuaternion::from_scaled_axis(Vector3::from(*axis).normalize() * turn_rad);
            let tilted =
                DISTANCES.iter().map(|distance| about_board(&seen_first, &about, &(middle * *distance), target));
            for camera_from_target in tilted.filter(|view| range.shows(&lens, target, view, None)) {
                let base_from_tip = hand_eye.base_from_tip(&camera_from_target);
                if let Some(joints) = reached(robot.as_ref(), &base_from_tip) {
                    self.tilts_tried += offset + 1;
                    return Some(go(base_from_tip, camera_from_target, joints, Why::FirstTilts { turn_rad }));
                }
            }
        }
        None
    }
}

/// The lens that is known or, where none is, a usual one: 53° wide, without distortion.
fn lens(observations: &Observations) -> Intrinsics {
    match observations.camera {
        CameraKnowledge::Fixed(intrinsics) | CameraKnowledge::Estimate { start: Some(intrinsics), .. } => intrinsics,
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
    target: &crate::targets::TargetSpec,
) -> Pose<Camera, Target> {
    let turned = Isometry3::from_parts(Translation3::from(*middle), about * seen.rotation());
    Pose::from_isometry(turned * Translation3::from(-target.centre().coords))
}

/// Joint values by which the arm gets to a tip pose along a free way that is not long; `Some(None)` without an arm.
#[expect(
    clippy::option_option,
    reason = "the outer one says whether it is reached, the inner one whether there is an arm"
)]
fn reached(robot: Option<&Robot>, base_from_tip: &Pose<Base, Tip>) -> Option<Option<JointValues>> {
    let Some(robot) = robot else { return Some(None) };
    let joints = robot.arm.reach(base_from_tip, &robot.joints)?;
    let is_free = travel(&robot.joints, &joints) <= LARGEST_FAN_WAY_RAD
        && robot.arm.is_free(&joints, &robot.around, robot.clearance_m)
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
        Proposal { base_from_tip, camera_from_target, joints, travel_s: 0.0, error_ratio: 1.0, rotation_part: 1.0 };
    Next::Go { plan: Plan { proposals: vec![proposal], best_ratio: 1.0, candidates: 1 }, why }
}
