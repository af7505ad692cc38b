//! Motions through a driver: goals and steps, by the controller's own planning. Where the chain of joints is known they are
//! checked beforehand, and poses are planned.

use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_coppeliasim::CancelToken;
use handeye_coppeliasim::cell::{ArmKinematics, BoardInView, FollowEnd, FollowMoment, FollowRequest};
use handeye_driver::message::Ability;
use handeye_driver::{ChainPlacement, Driver, DriverCell, DriverError, Goal, MoveEnd, Reading};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_plan::guided::choose::Robot;
use handeye_plan::{Contact, Surroundings};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::port_error;
use crate::limits;
use crate::moved::moved_text;
use crate::remote::{contact_text, no_views};
use crate::{Axis, Jog, JogFrame, MotionGoal, MotionOutcome};
use crate::{JogRequest, MotionPort, PortError, Room, ViewsRequest};
use handeye_wording::Text;
use handeye_wording::text;

/// In addition to its length a step of the tip may deviate by this \[m\] from the straight way: the wrist turns about other
/// axes than the tip, and a change of configuration swings the arm by more.
const STRAY_M: f64 = 0.02;
/// Number of points of the way at which that is checked.
const STRAY_SAMPLES: usize = 8;

pub(super) struct DriverMotion {
    cell: DriverCell,
    /// Zones of the user that the arm must avoid.
    keep_out: Surroundings,
}

/// The arm where it is now, where its chain of joints is known.
struct Placed {
    kinematics: Arc<ArmKinematics>,
    joints: JointValues,
    around: Surroundings,
}

impl DriverMotion {
    pub fn new(cell: DriverCell) -> Self {
        Self { cell, keep_out: Surroundings::default() }
    }

    fn kinematics(&self) -> Result<Arc<ArmKinematics>, Text> {
        match self.robot().chain_placement() {
            ChainPlacement::Known(kinematics) => Ok(kinematics),
            ChainPlacement::Unnamed => Err(text!(
                "The robot's driver names no chain of joints, so no poses can be planned: use “Guide me”, or taught poses"
            )),
            ChainPlacement::Open { .. } => Err(text!(
                "It is not known yet where the robot's joints begin and what tool it carries: let it stand at four places, each \
                 turned by 15° or more, about two axes"
            )),
            ChainPlacement::Foreign { distance_m, angle_rad } => Err(text!(
                "By its joints the tip of the robot is {distance} mm and {angle}° from where its driver reports it: its chain of joints is not used",
                distance = format!("{:.1}", distance_m * 1e3),
                angle = format!("{:.2}", angle_rad.to_degrees())
            )),
        }
    }

    fn placed(&self) -> Result<Result<Placed, Text>, PortError> {
        let reading = match self.now()? {
            Ok(reading) => reading,
            Err(why) => return Ok(Err(why)),
        };
        let Some(joints) = reading.joints else { return Ok(Err(text!("The robot does not report its joints"))) };
        Ok(self.kinematics().map(|kinematics| {
            let around = self.around(&kinematics, &joints);
            Placed { kinematics, joints, around }
        }))
    }

    /// The known obstacles: those of the user, and the plane under the arm while the arm is above it, because an arm on a
    /// pedestal reaches below its foot.
    fn around(&self, kinematics: &ArmKinematics, joints: &JointValues) -> Surroundings {
        let plane = kinematics.among(kinematics.plane(), None);
        let is_below = matches!(plane.arm.contact(joints, &plane.around, 0.0), Some(Contact::Box { .. }));
        let around = self.keep_out.clone();
        if is_below { around } else { plane.around.and(around) }
    }

    /// What is in the way of a motion that is nearly straight in joint space; `None` where that is not known.
    fn obstacle(&self, goal: &Goal) -> Result<Option<Text>, PortError> {
        let Ok(Placed { kinematics, joints, around }) = self.placed()? else { return Ok(None) };
        let goal = match goal {
            Goal::Joints(goal) => *goal,
            // The controller decides whether it is in reach, as its limits count.
            Goal::Tip(pose) => match kinematics.reach(pose, &joints) {
                Ok(goal) => goal,
                Err(_) => return Ok(None),
            },
        };
        let among = kinematics.among(around, None);
        let guard = among.guard(&joints);
        let contact = guard.contact(&goal).or_else(|| guard.contact_on_path(&joints, &goal));
        Ok(contact.as_ref().map(contact_text))
    }

    /// The goal in the form that the robot accepts: for a robot that only moves to joint values, those that put its tip there,
    /// by the chain of its joints.
    fn in_its_terms(&self, goal: Goal) -> Result<Result<Goal, Text>, PortError> {
        let Goal::Tip(pose) = goal else { return Ok(Ok(goal)) };
        if self.robot().hello().can(Ability::MoveTip) {
            return Ok(Ok(goal));
        }
        if matches!(self.robot().chain_placement(), ChainPlacement::Unnamed) {
            return Ok(Err(text!(
                "The robot's driver moves to joint values alone and names no chain of joints: move single joints, or have it name \
                 its arm"
            )));
        }
        Ok(self.placed()?.and_then(|Placed { kinematics, joints, .. }| {
            let found = kinematics.reach(&pose, &joints);
            found.map(Goal::Joints).map_err(Text::from)
        }))
    }

    /// Whether the tip stays near its straight way from here on a way that is straight in joint space: a small step must not swing
    /// the arm into another configuration.
    fn strays(&self, from: &Reading, goal: &Goal, along_m: f64) -> bool {
        let (Goal::Joints(to), Some(joints), Ok(kinematics)) = (goal, &from.joints, self.kinematics()) else {
            return false;
        };
        let at = |part: f64| {
            let joints = JointValues::from_fn(joints.len(), |i| joints[i] + part * (to[i] - joints[i]));
            kinematics.tip(&joints).translation()
        };
        let (begin, end) = (at(0.0), at(1.0));
        let off = |part: f64| (at(part) - (begin + (end - begin) * part)).norm();
        (1..STRAY_SAMPLES)
            .map(|k| off(k as f64 / STRAY_SAMPLES as f64))
            .any(|off_m| off_m.is_nan() || off_m > STRAY_M + along_m)
    }

    fn robot(&self) -> &Driver {
        self.cell.robot()
    }

    fn now(&self) -> Result<Result<Reading, Text>, PortError> {
        if !self.robot().hello().can(Ability::State) {
            return Ok(Err(text!("This cell has no robot that could be moved")));
        }
        let now = self.robot().state().map_err(port_error)?;
        Ok(now.map(|now| now.reading).ok_or_else(|| text!("Waiting until the robot has been read")))
    }

    fn drive(&self, goal: &Goal, speed: f64, cancel: &CancelToken) -> Result<MotionOutcome, PortError> {
        if let Some(why) = self.obstacle(goal)? {
            return Ok(MotionOutcome::Refused(why));
        }
        match self.robot().move_to(goal, speed, cancel) {
            Ok(MoveEnd::Arrived) => Ok(MotionOutcome::Arrived),
            Ok(MoveEnd::NotThere(moved)) => Ok(MotionOutcome::Failed(text!(
                "The driver says that the robot is there, and its states say otherwise: {moved}. Use its own stop, and look at the \
                 driver",
                moved = moved_text(&moved, |joint| self.robot().hello().joints.get(joint).map(|joint| joint.kind))
            ))),
            Ok(MoveEnd::Unseen) => Ok(MotionOutcome::Failed(text!(
                "The driver says that the robot is there, and sends no states that show it"
            ))),
            Ok(MoveEnd::Stopped(_)) if cancel.is_cancelled() => Ok(MotionOutcome::Stopped),
            // STOP comes over another connection.
            Ok(MoveEnd::Stopped(why)) if why.is_empty() => Ok(MotionOutcome::Stopped),
            Ok(MoveEnd::Stopped(why)) => Ok(MotionOutcome::Failed(text!("The robot stopped: {why}", why = why))),
            Ok(MoveEnd::Refused(why)) => Ok(MotionOutcome::Refused(text!("The robot refuses: {why}", why = why))),
            Err(DriverError::NotArmed { why, .. }) => Ok(MotionOutcome::Refused(read_only(why))),
            Err(error @ (DriverError::Cannot { .. } | DriverError::Busy { .. } | DriverError::Refused { .. })) => {
                Ok(MotionOutcome::Refused(error.into()))
            }
            Err(error) => Err(port_error(error)),
        }
    }
}

impl MotionPort for DriverMotion {
    fn check(&mut self) -> Result<(), PortError> {
        self.cell.check().map_err(port_error)
    }

    fn move_to(&mut self, goal: &MotionGoal, speed: f64, cancel: &CancelToken) -> Result<MotionOutcome, PortError> {
        let goal = match *goal {
            MotionGoal::Joints(joints) => Goal::Joints(joints),
            MotionGoal::Tip(pose) => Goal::Tip(pose),
        };
        match self.in_its_terms(goal)? {
            Ok(goal) => self.drive(&goal, speed, cancel),
            Err(why) => Ok(MotionOutcome::Refused(why)),
        }
    }

    fn jog_step(
        &mut self,
        request: &JogRequest,
        length: f64,
        cancel: &CancelToken,
    ) -> Result<MotionOutcome, PortError> {
        let reading = match self.now()? {
            Ok(reading) => reading,
            Err(why) => return Ok(MotionOutcome::Refused(why)),
        };
        let (wanted, goal) = match step(request, length, &reading) {
            Ok(wanted) => (wanted, self.in_its_terms(wanted)?),
            Err(why) => return Ok(MotionOutcome::Refused(why)),
        };
        let along_m = if matches!(request.jog, Jog::Translate { .. }) { length } else { 0.0 };
        match goal {
            Ok(goal) if matches!(wanted, Goal::Tip(_)) && self.strays(&reading, &goal, along_m) => {
                Ok(MotionOutcome::Refused(text!(
                    "From here the arm would have to change its configuration for this step: move single joints, or choose a smaller step"
                )))
            }
            Ok(goal) => self.drive(&goal, request.speed, cancel),
            Err(why) => Ok(MotionOutcome::Refused(why)),
        }
    }

    fn jog(
        &mut self,
        _request: &JogRequest,
        _held: &mut dyn FnMut() -> Option<f64>,
    ) -> Result<Option<Text>, PortError> {
        Ok(Some(text!("A robot behind a driver moves in steps: choose a step in Jog")))
    }

    fn room(&mut self, _board: &BoardInView) -> Result<Room, PortError> {
        Ok(Room::Nowhere(cannot_follow()))
    }

    fn views(&mut self, request: &ViewsRequest) -> Result<Result<Vec<JointValues>, Text>, PortError> {
        let ViewsRequest { board, taken, count, seed } = request;
        Ok(self.placed()?.and_then(|Placed { kinematics, joints, around }| {
            let views = kinematics.views_unlike(board, taken, &joints, &around, *count, *seed);
            views.map_err(|why| no_views(&why))
        }))
    }

    fn robot(&mut self, speed: f64) -> Result<Result<Robot, Text>, PortError> {
        Ok(self.placed()?.map(|Placed { kinematics, joints, around }| {
            kinematics.guided_robot(&joints, limits::pace(&limits::SEQUENCE, speed), &around)
        }))
    }

    fn keep_out(&mut self, keep_out: &Surroundings) -> Result<Surroundings, Text> {
        self.keep_out = keep_out.clone();
        let known = self.kinematics().map(|_known| Surroundings::default());
        known.map_err(|_unknown| {
            text!(
                "The controller of a robot behind a driver plans its own paths, and as long as its chain of joints is not known they cannot be checked: set safety planes on the controller"
            )
        })
    }

    fn follow(
        &mut self,
        _wish: &mut dyn FnMut(&FollowMoment) -> FollowRequest,
    ) -> Result<Result<FollowEnd, MotionOutcome>, PortError> {
        Ok(Err(MotionOutcome::Refused(cannot_follow())))
    }
}

/// Where a step leads to.
fn step(request: &JogRequest, length: f64, reading: &Reading) -> Result<Goal, Text> {
    let (frame, axis, forward) = match request.jog {
        Jog::Joint { index, forward } => {
            let mut joints = reading.joints.ok_or_else(|| text!("The robot does not report its joints"))?;
            let joint = joints.get_mut(index).ok_or_else(|| text!("The robot has no such joint"))?;
            *joint += if forward { length } else { -length };
            return Ok(Goal::Joints(joints));
        }
        Jog::Translate { frame, axis, forward } | Jog::Rotate { frame, axis, forward } => (frame, axis, forward),
    };
    let along = match axis {
        Axis::X => Vector3::x(),
        Axis::Y => Vector3::y(),
        Axis::Z => Vector3::z(),
    } * if forward { length } else { -length };
    let moved = match request.jog {
        Jog::Rotate { .. } => Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_scaled_axis(along)),
        Jog::Translate { .. } | Jog::Joint { .. } => Isometry3::from_parts(along.into(), UnitQuaternion::identity()),
    };
    let now = *reading.base_from_tip.isometry();
    let goal = match frame {
        JogFrame::Base => {
            // Turns are about the tip, along the axes of the base.
            let rotation = moved.rotation * now.rotation;
            Isometry3::from_parts((moved.translation.vector + now.translation.vector).into(), rotation)
        }
        JogFrame::Tip => now * moved,
        JogFrame::Camera => {
            let tip_from_camera = request.tip_from_camera.ok_or_else(|| {
                text!("Where the camera is on the tip is not known yet: calibrate first, or jog along other axes")
            })?;
            let tip_from_camera = tip_from_camera.isometry();
            now * tip_from_camera * moved * tip_from_camera.inverse()
        }
    };
    Ok(Goal::Tip(Pose::<Base, Tip>::from_isometry(goal)))
}

fn read_only(why: Option<String>) -> Text {
    match why {
        Some(why) => text!(
            "The robot's driver no longer moves it ({why}): press “Let the workbench move it” in Jog once that is put right",
            why = why
        ),
        None => text!("The robot is only read: press “Let the workbench move it” in Jog first"),
    }
}

fn cannot_follow() -> Text {
    text!("A robot behind a driver cannot follow the board")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading() -> Reading {
        let turned = UnitQuaternion::from_euler_angles(0.3, -0.4, 2.0);
        Reading {
            stamp_s: 0.0,
            base_from_tip: Pose::from_isometry(Isometry3::from_parts(Vector3::new(0.4, -0.1, 0.3).into(), turned)),
            joints: Some([0.1, 0.2, 0.3].into()),
            moving: None,
        }
    }

    fn assert_near(is: Vector3<f64>, wanted: Vector3<f64>) {
        assert!((is - wanted).norm() < 1e-12, "{is} instead of {wanted}");
    }

    fn tip(jog: Jog, tip_from_camera: Option<Isometry3<f64>>) -> Isometry3<f64> {
        let request = JogRequest { jog, tip_from_camera: tip_from_camera.map(Pose::from_isometry), speed: 0.2 };
        match step(&request, 0.05, &reading()) {
            Ok(Goal::Tip(goal)) => *goal.isometry(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_step_goes_along_or_about_the_axes_that_were_chosen() {
        let now = *reading().base_from_tip.isometry();
        let (axis, forward) = (Axis::Y, false);
        let moved = tip(Jog::Translate { frame: JogFrame::Base, axis, forward }, None);
        assert_near(moved.translation.vector - now.translation.vector, Vector3::new(0.0, -0.05, 0.0));
        assert!(moved.rotation.angle_to(&now.rotation) < 1e-7);
        let moved = tip(Jog::Translate { frame: JogFrame::Tip, axis, forward }, None);
        assert_near((now.inverse() * moved).translation.vector, Vector3::new(0.0, -0.05, 0.0));
        let turned = tip(Jog::Rotate { frame: JogFrame::Base, axis, forward }, None);
        assert_near(turned.translation.vector, now.translation.vector);
        let about = (turned.rotation * now.rotation.inverse()).scaled_axis();
        assert_near(about, Vector3::new(0.0, -0.05, 0.0));
    }

    #[test]
    fn a_turn_about_the_camera_leaves_the_camera_where_it_is() {
        let tip_from_camera = Isometry3::new(Vector3::new(0.05, 0.0, 0.1), Vector3::new(0.0, 0.2, 1.0));
        let turned = tip(Jog::Rotate { frame: JogFrame::Camera, axis: Axis::X, forward: true }, Some(tip_from_camera));
        let now = *reading().base_from_tip.isometry();
        let (before, after) = (now * tip_from_camera, turned * tip_from_camera);
        assert_near(before.translation.vector, after.translation.vector);
        assert_near((before.inverse() * after).rotation.scaled_axis(), Vector3::new(0.05, 0.0, 0.0));
    }

    #[test]
    fn a_joint_that_is_not_there_is_not_stepped() {
        let request =
            |index| JogRequest { jog: Jog::Joint { index, forward: true }, tip_from_camera: None, speed: 0.2 };
        assert_eq!(step(&request(1), 0.5, &reading()), Ok(Goal::Joints([0.1, 0.7, 0.3].into())));
        assert!(step(&request(3), 0.5, &reading()).is_err());
    }
}
