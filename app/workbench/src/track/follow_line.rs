//! The path of the tracked board to the arm: what the vision thread saw last, and where the tip has to be for it. It
//! bypasses the window, which may be busy. No thread, no clock: time is that of the simulation.

use std::sync::{Mutex, MutexGuard, PoisonError};

use handeye_coppeliasim::cell::{BoardInView, FollowGoal, FollowMoment, FollowRequest as ArmRequest};
use handeye_estimate::handeye::HandEye;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_track::{Estimate, Keep, Rest, Setup, State, TipGoal, Update};

use super::worker::TrackedBy;
use crate::text::Text;
use crate::track::state::{FollowRequest, FollowStatus};
use handeye_wording::text;

/// How far \[s\] the motion of the board is extrapolated from the newest image: a few images, so that a late one does
/// not end everything, and less than the distance an arm at its speed limit could go because of a wrong guess.
const LONGEST_GUESS_S: f64 = 0.4;

/// How long \[s\] an arm at rest waits for the board to be seen: after it was moved to another place, and where the board is lost
/// or images are late during the motion. The whole image is searched within a few images, and a board that was covered by mistake
/// is uncovered.
const PATIENCE_S: f64 = 3.0;

/// What the arm should do about the board.
#[derive(Default)]
pub struct FollowLine {
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    by: Option<TrackedBy>,
    newest: Option<Update>,
    rest: Rest,
    aim: Option<Aim>,
    /// How long the board may be out of sight before the first goal \[s\].
    patience_s: f64,
    /// Deadline for that, once there was a pass.
    waits_until_s: Option<f64>,
    /// Since when there has been no goal during the motion \[s\].
    without_goal_since_s: Option<f64>,
    ended: Option<Text>,
    status: Option<FollowStatus>,
}

/// Why there is no goal.
enum NoGoal {
    /// It may come back.
    Now(Text),
    /// There will be none.
    Ever(Text),
}

enum Aim {
    /// To be fixed at the first pass, from where the arm is by then.
    Wished(FollowRequest),
    Fixed(Keep),
}

impl FollowLine {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is tracked from now on, or that nothing is.
    pub(crate) fn set_up(&self, by: Option<TrackedBy>) {
        let mut inner = self.inner();
        inner.by = by;
        (inner.newest, inner.rest) = (None, Rest::default());
    }

    /// An image was tracked.
    pub(crate) fn see(&self, update: &Update) {
        let mut inner = self.inner();
        inner.rest.see(update);
        inner.newest = Some(update.clone());
    }

    /// Whether the board is seen.
    pub fn is_seen(&self) -> bool {
        self.inner().newest.as_ref().is_some_and(|newest| matches!(newest.state, State::Tracking { .. }))
    }

    /// The board as tracked now, for a camera on the tip; `None` while its place is not known.
    pub(crate) fn board_in_view(&self) -> Option<BoardInView> {
        let inner = self.inner();
        let setup = &inner.by.as_ref()?.setup;
        let HandEye::EyeInHand { tip_from_camera, .. } = setup.calibrated.hand_eye else { return None };
        Some(BoardInView {
            base_from_target: inner.newest.as_ref()?.estimate.as_ref()?.base_from_target,
            target: setup.target,
            intrinsics: setup.calibrated.intrinsics,
            tip_from_camera,
        })
    }

    /// What the arm should do from its next pass on.
    pub fn begin(&self, request: FollowRequest) {
        let mut inner = self.inner();
        inner.aim = Some(Aim::Wished(request));
        (inner.patience_s, inner.waits_until_s, inner.without_goal_since_s) = (0.0, None, None);
        inner.ended = None;
    }

    /// The same after the arm was moved, when the board may have to be found again.
    pub(crate) fn begin_elsewhere(&self, request: FollowRequest) {
        self.begin(request);
        self.inner().patience_s = PATIENCE_S;
    }

    /// Why following has ended by itself since it began.
    pub fn take_ended(&self) -> Option<Text> {
        self.inner().ended.take()
    }

    /// The status, if it has changed.
    pub fn take_status(&self) -> Option<FollowStatus> {
        self.inner().status.take()
    }

    /// What the arm should do in a pass.
    pub(crate) fn request(&self, moment: &FollowMoment) -> ArmRequest {
        let mut inner = self.inner();
        if inner.waits(moment) {
            return ArmRequest::Rest;
        }
        match inner.goal(moment) {
            Ok(goal) => {
                inner.without_goal_since_s = None;
                inner.status = Some(following(&goal.base_from_tip, moment));
                ArmRequest::Towards(FollowGoal {
                    base_from_tip: goal.base_from_tip,
                    velocity_m_s: goal.velocity_m_s,
                    angular_velocity_rad_s: goal.angular_velocity_rad_s,
                })
            }
            Err(NoGoal::Now(_)) if inner.has_patience(moment) => {
                inner.status = Some(FollowStatus::Waiting);
                ArmRequest::Rest
            }
            Err(NoGoal::Now(why) | NoGoal::Ever(why)) => {
                inner.ended.get_or_insert(why);
                ArmRequest::End
            }
        }
    }
}

impl Inner {
    /// Whether the arm is at rest until the board is seen.
    fn waits(&mut self, moment: &FollowMoment) -> bool {
        let until_s = *self.waits_until_s.get_or_insert(moment.sim_time_s + self.patience_s);
        let is_fresh = self.newest.as_ref().is_some_and(|newest| {
            matches!(newest.state, State::Tracking { .. }) && moment.sim_time_s - newest.time_s <= LONGEST_GUESS_S
        });
        matches!(self.aim, Some(Aim::Wished(_))) && !is_fresh && moment.sim_time_s < until_s
    }

    /// Whether an arm that was following stays at rest a little longer.
    fn has_patience(&mut self, moment: &FollowMoment) -> bool {
        let since_s = *self.without_goal_since_s.get_or_insert(moment.sim_time_s);
        matches!(self.aim, Some(Aim::Fixed(_))) && (0.0..PATIENCE_S).contains(&(moment.sim_time_s - since_s))
    }

    fn goal(&mut self, moment: &FollowMoment) -> Result<TipGoal, NoGoal> {
        let ever = |why| NoGoal::Ever(why);
        let no_joints = || ever(text!("The joints are not those of the arm whose errors are corrected: solve again"));
        let by = self.by.as_ref().ok_or_else(|| ever(text!("The board is not tracked: start tracking first")))?;
        let setup = &by.setup;
        let newest = self.newest.as_ref().ok_or_else(|| ever(text!("The board has not been seen yet")))?;
        let (Some(estimate), State::Tracking { .. } | State::Coasting { .. }) = (&newest.estimate, newest.state) else {
            return Err(NoGoal::Now(text!("The board was lost: bring it into view and start again")));
        };
        let ahead_s = moment.sim_time_s - estimate.time_s;
        if !(-LONGEST_GUESS_S..=LONGEST_GUESS_S).contains(&ahead_s) {
            let why = text!(
                "The newest image is {age} s of simulation old: the camera fell silent, or the simulation runs faster than \
                 images are taken and has to keep real time",
                age = format!("{ahead_s:.1}")
            );
            // The clock of a restarted simulation goes back.
            return Err(if ahead_s > 0.0 { NoGoal::Now(why) } else { NoGoal::Ever(why) });
        }
        let now = self.rest.at().unwrap_or(estimate).carried_to(moment.sim_time_s);
        let keep = match self.aim.take() {
            Some(Aim::Fixed(keep)) => keep,
            Some(Aim::Wished(request)) => {
                let here = by.base_from_tip(moment.base_from_tip, &moment.joints).ok_or_else(no_joints)?;
                fixed(request, &now, setup, &here)
            }
            None => return Err(ever(text!("The arm was not asked to follow"))),
        };
        let goal = keep.tip_goal(&now, &setup.calibrated, &setup.target);
        self.aim = Some(Aim::Fixed(keep));
        let goal =
            goal.ok_or_else(|| ever(text!("Only a camera on the tip can follow: this one stands beside the robot")))?;
        let base_from_tip = by.command(goal.base_from_tip, &moment.joints).ok_or_else(no_joints)?;
        Ok(TipGoal { base_from_tip, ..goal })
    }
}

fn fixed(request: FollowRequest, now: &Estimate, setup: &Setup, base_from_tip: &Pose<Base, Tip>) -> Keep {
    match request {
        FollowRequest::KeepView | FollowRequest::KeepViewWithRoom => {
            let base_from_camera = setup.calibrated.base_from_camera(base_from_tip);
            Keep::View(base_from_camera.inverse() * now.base_from_target)
        }
        FollowRequest::KeepPose(camera_from_target) => Keep::View(camera_from_target),
        FollowRequest::Corner { index, stand_off_m } => {
            Keep::Corner { index, stand_off_m, base_from_tip_orientation: base_from_tip.rotation() }
        }
    }
}

fn following(goal: &Pose<Base, Tip>, moment: &FollowMoment) -> FollowStatus {
    let apart = moment.base_from_tip.inverse() * *goal;
    FollowStatus::Following {
        distance_m: apart.translation().norm(),
        angle_rad: apart.rotation().angle(),
        is_kept_off: moment.is_kept_off,
    }
}

#[cfg(test)]
#[path = "follow_line_tests.rs"]
mod tests;
