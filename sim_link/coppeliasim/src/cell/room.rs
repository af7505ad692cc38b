//! Room to follow: whether an arm that keeps its view of a board can go along with it, and from where it can.
//!
//! A camera that keeps its view goes wherever the board goes, and about it when the board turns. Where the arm is close to
//! its column, nearly stretched, or has two axes in line, some direction needs joints faster than they are, and following
//! ends there; and the arm stays behind where it would touch something. So a place is judged by the worst of all poses of the
//! board within a reach: by the share of its limits that the tip can have there in every direction at once, if nothing is touched,
//! and by whether the whole board is still in the image there before the arm has moved.

use handeye_arm::{JointKind, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Matrix6, Matrix6xX, MatrixXx6, Point3, RowVector6, Translation3, UnitQuaternion, Vector3};

use super::follow_goal::FollowLimits;
use super::jog_plan::nearest;
use super::joints::in_rad;
use super::reach::ArmKinematics;
use super::surroundings::Among;
use super::views::BoardInView;
use handeye_plan::{self as planning, Guard, PlannedView, Surroundings, ViewOptions};

/// With this share of its limits in every direction the tip goes along with a board at 50 mm/s that turns by 10° a second,
/// and still comes closer to it.
const ENOUGH: f64 = 0.25;
/// With less it is slowed down wherever the board goes, and a little further it stops.
const LEAST: f64 = 0.12;

/// Steps to each end of the reach: on the way there the arm must not get into a singular position either.
const STEPS: u32 = 2;

/// A place for several paths of a board, one after the other, has room for this many times the reach of a single path.
const WIDER: f64 = 1.5;

/// Other distances between camera and board that are tried, relative to that of now.
const DISTANCES: [f64; 2] = [0.8, 1.3];
/// Free pixels about the board: an arm that starts after it lags behind for a moment.
const MARGIN_PX: f64 = 30.0;
/// Random places that are tried: enough for one within a few degrees of any.
const CANDIDATES: usize = 3000;

/// How far a board may go from where it is now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardReach {
    /// In its plane, either way along both sides \[m\].
    pub in_plane_m: f64,
    /// Along its normal, either way \[m\].
    pub out_of_plane_m: f64,
    /// About any axis through its middle \[rad\].
    pub turn_rad: f64,
}

impl Default for BoardReach {
    /// Twice what the built-in cell moves its board by from the middle of its path (40 mm in its plane, 20 mm along its
    /// normal, 3°): a start at one end of the path has all of it on one side.
    fn default() -> Self {
        Self { in_plane_m: 0.08, out_of_plane_m: 0.04, turn_rad: 6.0_f64.to_radians() }
    }
}

impl BoardReach {
    /// Half as far again: where one path ends the next begins, up to 40 mm away.
    fn wider(&self) -> Self {
        let Self { in_plane_m, out_of_plane_m, turn_rad } = *self;
        Self { in_plane_m: in_plane_m * WIDER, out_of_plane_m: out_of_plane_m * WIDER, turn_rad }
    }

    /// Shift in the axes of the board and turn about its middle, at every corner of the box, unturned and turned about
    /// each axis.
    fn ends(&self) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> {
        let Self { in_plane_m, out_of_plane_m, turn_rad } = *self;
        let signs = [-1.0, 1.0];
        let corners = signs.into_iter().flat_map(move |x| {
            signs
                .into_iter()
                .flat_map(move |y| signs.map(|z| Vector3::new(x * in_plane_m, y * in_plane_m, z * out_of_plane_m)))
        });
        let turns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis * turn_rad);
        let turns: Vec<Vector3<f64>> =
            std::iter::once(Vector3::zeros()).chain(turns).chain(turns.map(|turn| -turn)).collect();
        corners
            .chain([Vector3::zeros()])
            .flat_map(move |shift| turns.clone().into_iter().map(move |turn| (shift, turn)))
    }
}

/// A place to follow a board from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowPlace {
    /// The joints there.
    pub joints: JointValues,
    /// The tip there.
    pub base_from_tip: Pose<Base, Tip>,
    /// The least share of its limits that the tip can have in every direction, wherever the board goes within its reach.
    pub room: f64,
}

/// There is no place to follow from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error(
    "of {tried} places that show the whole board none has room for the arm to follow it: move the board away from \
     the column of the arm, and not to the end of its reach"
)]
pub struct NoPlace {
    /// Places that were checked.
    pub tried: usize,
}

impl BoardInView {
    /// Whether the whole board is in the image from this pose of the tip when it goes along its plane at once, as far as the reach.
    fn is_seen_over(&self, reach: &BoardReach, base_from_tip: &Pose<Base, Tip>) -> bool {
        let camera_from_target = (*base_from_tip * self.tip_from_camera).inverse() * self.base_from_target;
        planning::shows_within(&self.intrinsics, &self.target, &camera_from_target, reach.in_plane_m)
    }
}

impl ArmKinematics {
    /// Joints from which the arm follows a board: `None` where it has room from these joints
    /// ([`Self::has_room_to_follow`]), else [`Self::place_to_follow`].
    ///
    /// # Errors
    /// [`NoPlace`].
    pub fn where_to_follow(
        &self,
        limits: &FollowLimits,
        board: &BoardInView,
        from: &JointValues,
        around: &Surroundings,
        among: Option<&Among>,
    ) -> Result<Option<FollowPlace>, NoPlace> {
        let reach = BoardReach::default();
        if self.has_room_to_follow(limits, board, &reach, from, among) {
            return Ok(None);
        }
        self.place_to_follow(limits, board, &reach, from, around, among).map(Some)
    }

    /// Whether the tip can follow the board at a usual speed from these joints, wherever it goes within `reach` while its
    /// view is kept, touches none of the obstacles, and sees the whole board also when that is there at once.
    pub(crate) fn has_room_to_follow(
        &self,
        limits: &FollowLimits,
        board: &BoardInView,
        reach: &BoardReach,
        joints: &JointValues,
        among: Option<&Among>,
    ) -> bool {
        let guard = among.map(Among::strict);
        board.is_seen_over(reach, &self.tip(joints))
            && self.room_over(limits, board, reach, joints, ENOUGH, guard.as_ref()) >= ENOUGH
    }

    /// The nearest place from which the whole board is seen, also when it is elsewhere within `reach` at once, and the arm has room
    /// to go along with it over half as much again as `reach`; where there is none, over `reach`; where there is none either, one
    /// from which the board is seen where it is now, and where none has enough room the one with most. Following keeps clear of
    /// what it is `among`; the way there, straight for the joints, touches neither arm, board nor surroundings, and comes no nearer
    /// to one of them that the arm begins too near to.
    ///
    /// # Errors
    /// [`NoPlace`].
    pub(crate) fn place_to_follow(
        &self,
        limits: &FollowLimits,
        board: &BoardInView,
        reach: &BoardReach,
        from: &JointValues,
        around: &Surroundings,
        among: Option<&Among>,
    ) -> Result<FollowPlace, NoPlace> {
        let setup = self.view_setup(board, from, around);
        let guard = among.map(Among::strict);
        let distance_m = board.distance_m(&self.tip(from));
        let travel = |view: &PlannedView| planning::travel(from, &view.joints);
        let mut tried = 0;
        // Views that keep a board which jumps in the image are few, and checked first.
        for leeway_m in [reach.in_plane_m, 0.0] {
            let options = ViewOptions {
                distance_m: DISTANCES.map(|times| distance_m * times),
                margin_px: MARGIN_PX,
                leeway_m,
                candidates: CANDIDATES,
                ..ViewOptions::default()
            };
            let mut views = planning::views_of_board(&setup, &options);
            views.sort_by(|a, b| travel(a).total_cmp(&travel(b)));
            tried = views.len();
            let way = Guard::from(&setup.arm, &setup.around, from, options.clearance_m);
            let is_free = |joints: &JointValues| way.contact_on_path(from, joints).is_none();
            let place =
                |view: &PlannedView, room| FollowPlace { joints: view.joints, base_from_tip: view.base_from_tip, room };
            for reach in [&reach.wider(), reach] {
                for view in &views {
                    let room = self.room_over(limits, board, reach, &view.joints, ENOUGH, guard.as_ref());
                    if room >= ENOUGH && is_free(&view.joints) {
                        return Ok(place(view, room));
                    }
                }
            }
            if leeway_m > 0.0 {
                continue;
            }
            let mut best: Option<FollowPlace> = None;
            for view in &views {
                let wanted = best.map_or(LEAST, |best| best.room);
                let room = self.room_over(limits, board, reach, &view.joints, wanted, guard.as_ref());
                if room > wanted && is_free(&view.joints) {
                    best = Some(place(view, room));
                }
            }
            if let Some(best) = best {
                return Ok(best);
            }
        }
        Err(NoPlace { tried })
    }

    /// The least share of its limits that the tip can have in every direction from these joints, wherever the board goes
    /// within `reach` while its view is kept; 0 where some of it cannot be followed at all, or not without touching something.
    /// Given up with any smaller value as soon as it is below `wanted`.
    fn room_over(
        &self,
        limits: &FollowLimits,
        board: &BoardInView,
        reach: &BoardReach,
        joints: &JointValues,
        wanted: f64,
        guard: Option<&Guard<'_>>,
    ) -> f64 {
        let base_from_target = board.base_from_target.isometry();
        let centre = board.target.centre();
        let target_from_tip = base_from_target.inverse() * self.tip(joints).isometry();
        let touches = |joints: &JointValues| guard.is_some_and(|guard| guard.contact(joints).is_some());
        if touches(joints) {
            return 0.0;
        }
        let mut room = self.share_of_limits(limits, joints);
        for (shift, turn) in reach.ends() {
            let mut before = *joints;
            for step in 1..=STEPS {
                if room < wanted {
                    return room;
                }
                let part = f64::from(step) / f64::from(STEPS);
                let tip = base_from_target * moved_about(&centre, &(shift * part), &(turn * part)) * target_from_tip;
                if !limits.workspace.contains(&tip.translation.vector) {
                    return 0.0;
                }
                let Ok(next) = nearest(self, &Pose::from_isometry(tip), &before) else { return 0.0 };
                if touches(&next) {
                    return 0.0;
                }
                room = room.min(self.share_of_limits(limits, &next));
                before = next;
            }
        }
        room
    }

    /// The share of its limits of speed that the tip can have in every direction at once, so that no joint is too fast.
    fn share_of_limits(&self, limits: &FollowLimits, joints: &JointValues) -> f64 {
        let Some(per_twist) = self.jacobian(joints).and_then(|jacobian| least_rates(&jacobian)) else { return 0.0 };
        let share = |(kind, row): (JointKind, RowVector6<f64>)| {
            let (linear, angular) = (row.fixed_columns::<3>(0).norm(), row.fixed_columns::<3>(3).norm());
            let fastest = linear * limits.speed_m_s + angular * limits.turn_rad_s;
            in_rad(kind, fastest)
        };
        let rows = per_twist.row_iter().map(nalgebra::Matrix::into_owned);
        let fastest = self.kinds().zip(rows).map(share).fold(0.0, f64::max);
        if fastest.is_finite() { limits.joint_speed_rad_s / fastest } else { 0.0 }
    }
}

/// The joint rates of a motion of the tip; the smallest ones for a redundant arm. `None` where some motion has none.
fn least_rates(jacobian: &Matrix6xX<f64>) -> Option<MatrixXx6<f64>> {
    let rates = if jacobian.ncols() == 6 {
        let square: Matrix6<f64> = jacobian.fixed_columns::<6>(0).into_owned();
        square.try_inverse().map(|inverse| MatrixXx6::from_fn(6, |row, column| inverse[(row, column)]))
    } else {
        let square: Matrix6<f64> = jacobian * jacobian.transpose();
        square.try_inverse().map(|inverse| jacobian.transpose() * inverse)
    };
    // Fewer joints than a pose has dimensions leave a matrix that is singular up to rounding.
    rates.filter(|_| jacobian.ncols() >= 6)
}

/// A board shifted along its axes and turned about its middle, in its own axes before.
fn moved_about(centre: &Point3<f64>, shift: &Vector3<f64>, turn: &Vector3<f64>) -> Isometry3<f64> {
    Translation3::from(centre.coords + shift)
        * UnitQuaternion::from_scaled_axis(*turn)
        * Translation3::from(-centre.coords)
}

#[cfg(test)]
#[path = "room_tests.rs"]
mod tests;
