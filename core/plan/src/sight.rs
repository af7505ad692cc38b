//! The line of sight between a camera and a board, one of them on the tip: no part of the arm may be in it.

use nalgebra::{Point3, Vector3};

use super::capsule::Capsule;
use super::clearance::Arm;
use handeye_estimate::handeye::HandEye;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::TargetSpec;

/// Largest distance between the points of a board that are checked, metres: a link is thicker.
const PITCH_M: f64 = 0.05;
/// Most of them along an edge.
const MOST: usize = 9;
/// What is this close to camera or board, metres, is its holder, and hides the same in every view.
const HELD_M: f64 = 0.05;
/// Free space about a line of sight, metres: by as much a link may be thicker than its capsule.
const ROOM_M: f64 = 0.01;

/// A camera and a board that it is to see.
#[derive(Debug, Clone)]
pub struct Sight {
    hand_eye: HandEye,
    /// Points all over the board, in its frame.
    points: Vec<Point3<f64>>,
}

impl Sight {
    /// The line of sight by the estimated poses of both.
    pub(crate) fn new(hand_eye: &HandEye, target: &TargetSpec) -> Self {
        let (centre, extent) = (target.centre(), target.extent());
        let parts = |extent_m: f64| ((extent_m / PITCH_M).ceil() as usize).clamp(1, MOST - 1);
        let (columns, rows) = (parts(extent.x), parts(extent.y));
        let along = |k: usize, parts: usize, extent_m: f64| (k as f64 / parts as f64 - 0.5) * extent_m;
        let points = (0..=columns).flat_map(|i| {
            (0..=rows).map(move |j| {
                Point3::from(centre.coords + Vector3::new(along(i, columns, extent.x), along(j, rows, extent.y), 0.0))
            })
        });
        Self { hand_eye: *hand_eye, points: points.collect() }
    }

    /// Whether no part of an arm with these joint values, which put its tip there, is between camera and board.
    pub(crate) fn is_free(&self, arm: &Arm, joints: &[f64], base_from_tip: &Pose<Base, Tip>) -> bool {
        let Some(filled) = arm.filled(joints) else { return false };
        let tip = base_from_tip.isometry();
        let (base_from_camera, base_from_target) = match &self.hand_eye {
            HandEye::EyeInHand { tip_from_camera, base_from_target } => {
                (tip * tip_from_camera.isometry(), *base_from_target.isometry())
            }
            HandEye::EyeToHand { base_from_camera, tip_from_target } => {
                (*base_from_camera.isometry(), tip * tip_from_target.isometry())
            }
        };
        let eye = Point3::from(base_from_camera.translation.vector);
        self.points.iter().map(|point| base_from_target * point).all(|point| {
            let way = point - eye;
            let length_m = way.norm();
            if length_m <= 2.0 * HELD_M {
                return true;
            }
            let held = way * (HELD_M / length_m);
            let line = Capsule { from: eye + held, to: point - held, radius_m: ROOM_M };
            filled.inner.iter().all(|link| link.distance_to(&line) > 0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::ArmBody;
    use handeye_arm::ArmKind;
    use handeye_geometry::testing::BOARD;

    /// A camera beyond the forearm does not see the board behind it, and one on the other side does; all links of the wrist are
    /// near the board in both cases.
    #[test]
    fn a_link_between_camera_and_board_hides_it_wherever_the_camera_stands() {
        let chain = ArmKind::Ur5e.arm();
        for body in [ArmBody::of(&chain), ArmBody::Ur5] {
            let arm = Arm {
                body,
                chain: chain.clone(),
                world_from_arm: Isometry3::translation(0.1, -0.2, 0.3),
                connection_from_tip: Isometry3::identity(),
                carried: Vec::new(),
            };
            let joints = [std::f64::consts::PI, -1.6, 1.9, -1.9, -1.57, 0.0];
            let tip = arm.tip(&joints).expect("its joints");
            let tip_from_target = Isometry3::translation(0.0, 0.0, 0.05) * Isometry3::translation(-0.07, -0.05, 0.0);
            let board = tip.isometry() * tip_from_target * BOARD.centre();
            let longest = arm.filled(&joints).expect("its joints").inner;
            let forearm =
                longest.iter().max_by(|a, b| a.from.z.min(a.to.z).total_cmp(&b.from.z.min(b.to.z))).expect("links");
            let middle = nalgebra::center(&forearm.from, &forearm.to);
            let sees_from = |eye: Point3<f64>| {
                let base_from_camera = Isometry3::face_towards(&eye, &board, &Vector3::x());
                let hand_eye = HandEye::EyeToHand {
                    base_from_camera: Pose::from_isometry(base_from_camera),
                    tip_from_target: Pose::from_isometry(tip_from_target),
                };
                Sight::new(&hand_eye, &BOARD).is_free(&arm, &joints, &tip)
            };
            assert!(!sees_from(board + (middle - board) * 2.5), "the link is in between");
            assert!(sees_from(board - (middle - board) * 1.5), "from the other side");
        }
    }
}
