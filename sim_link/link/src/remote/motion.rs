//! The arm of a cell over the remote API.

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::{
    Among, Arm, ArmJog, ArmKinematics, BoardInView, FollowEnd, FollowLimits, FollowMoment, FollowRequest, JogAxes,
    JogEnd, JogObstacle, MotionTolerance, SceneObstacles, SettleOptions, UnknownKinematics,
};
use handeye_coppeliasim::{CallOptions, CancelToken, LinkError, SimulationState};
use handeye_dataset::taught_poses;
use handeye_plan::guided::choose::Robot;
use handeye_plan::{Contact, PlanError, Surroundings};
use nalgebra::Vector3;

use super::error::{check_arm, is_lost, port_error};
use crate::limits;
use crate::{Axis, Jog, JogFrame, MotionGoal, MotionOutcome};
use crate::{JogRequest, MotionPort, PortError, Room, ViewsRequest};
use handeye_wording::Text;
use handeye_wording::text;

/// Seed of the detours that are compared: the same question gets the same way.
const VIEWS_SEED: u64 = 1;

/// A connection that moves the arm.
pub(crate) struct RemoteMotion {
    arm: Arm,
    kinematics: Result<ArmKinematics, UnknownKinematics>,
    /// The obstacles of the cell, as they were when the connection was made.
    obstacles_found: SceneObstacles,
    /// All of them, the zones of the user, and what holds the board: plans are for a board at rest.
    around: Surroundings,
    /// The arm among all of it that does not go along with the board.
    among: Option<Among>,
    /// The fastest that it moves.
    limits: taught_poses::MotionLimits,
}

impl RemoteMotion {
    /// With an arm, whose kinematics is read at once.
    pub fn new(mut arm: Arm) -> Result<Self, LinkError> {
        let kinematics = arm.kinematics()?;
        let obstacles_found = match &kinematics {
            Ok(kinematics) => arm.surroundings(kinematics)?,
            Err(why) => {
                tracing::warn!(%why, "the kinematics of the arm is not known: goals are not checked beforehand");
                SceneObstacles::default()
            }
        };
        let mut live = Self {
            arm,
            kinematics,
            obstacles_found,
            around: Surroundings::default(),
            among: None,
            limits: limits::SEQUENCE,
        };
        live.keep_to(&Surroundings::default());
        Ok(live)
    }

    /// Obstacles and the zones of the user apply from the next motion on.
    fn keep_to(&mut self, keep_out: &Surroundings) {
        let Ok(kinematics) = &self.kinematics else { return };
        self.around = self.obstacles_found.all().and(keep_out.clone());
        self.among = Some(kinematics.among(self.obstacles_found.around.clone().and(keep_out.clone()), None));
        self.arm.keep_clear(self.among.clone());
    }

    /// Checks for a way before anything moves. `Some` is the reason why there is none.
    fn obstacle(&mut self, goal: &MotionGoal) -> Result<Option<Text>, LinkError> {
        let (MotionGoal::Tip(goal), Ok(kinematics)) = (goal, &self.kinematics) else { return Ok(None) };
        let joints = self.arm.joint_values()?;
        Ok(kinematics.reach(goal, &joints).err().map(|why| text!("The arm cannot go there: {why}", why = why)))
    }

    fn drive(&mut self, goal: &MotionGoal, speed: f64, cancel: &CancelToken) -> Result<MotionOutcome, LinkError> {
        if let Some(why) = bad_speed(speed) {
            return Ok(MotionOutcome::Refused(why));
        }
        let direct = match (goal, self.obstacle(goal)?) {
            (_, Some(why)) => Err(why),
            (MotionGoal::Joints(joints), None) => Self::unless_in_the_way(self.go_through(&[*joints], speed, cancel))?,
            (MotionGoal::Tip(pose), None) => {
                let limits = limits::of_tip(&self.limits, speed);
                let moved = self.arm.move_to_pose(pose, &limits, &MotionTolerance::default(), cancel);
                Self::unless_in_the_way(moved)?
            }
        };
        // Nothing has moved where something is in the way.
        let Err(why) = direct else { return Ok(MotionOutcome::Arrived) };
        match self.way_around(goal, cancel)? {
            Some(way) => self.go_through(&way, speed, cancel).map(|()| MotionOutcome::Arrived),
            None => Ok(MotionOutcome::Refused(why)),
        }
    }

    fn unless_in_the_way(moved: Result<(), LinkError>) -> Result<Result<(), Text>, LinkError> {
        match moved {
            Err(LinkError::InTheWay { contact }) => Ok(Err(contact_text(&contact))),
            moved => moved.map(Ok),
        }
    }

    /// From configuration to configuration, straight in joint space.
    fn go_through(&mut self, way: &[JointValues], speed: f64, cancel: &CancelToken) -> Result<(), LinkError> {
        let limits = limits::of_joints(&self.limits, speed, self.arm.info().joint_kinds());
        for joints in way {
            self.arm.move_to_joints(joints, &limits, cancel)?;
        }
        self.arm.settle(&SettleOptions::default(), cancel).map(|_settled| ())
    }

    /// A way to the goal where the direct one touches an obstacle; `None` where none is found.
    fn way_around(&mut self, goal: &MotionGoal, cancel: &CancelToken) -> Result<Option<Vec<JointValues>>, LinkError> {
        let start = self.arm.joint_values()?;
        let Some(among) = &self.among else { return Ok(None) };
        let guard = among.guard(&start);
        Ok(match goal {
            MotionGoal::Joints(joints) => guard.detour(&start, joints, VIEWS_SEED, cancel),
            MotionGoal::Tip(pose) => guard.detour_to(&start, pose, VIEWS_SEED, cancel),
        })
    }

    fn jog_by(
        &mut self,
        request: &JogRequest,
        length: Option<f64>,
        held: &mut dyn FnMut() -> Option<f64>,
    ) -> Result<Result<JogEnd, Text>, LinkError> {
        if let Some(why) = bad_speed(request.speed) {
            return Ok(Err(why));
        }
        let jog = match arm_jog(request, self.kinematics.as_ref()) {
            Ok(jog) => jog,
            Err(why) => return Ok(Err(why)),
        };
        self.arm.jog(&jog, length, held).map(Ok)
    }
}

impl MotionPort for RemoteMotion {
    fn renew(&mut self) -> Result<(), PortError> {
        super::renew(self.arm.sim())
    }

    fn step_by_step(&mut self, on: bool) -> Result<(), PortError> {
        self.arm.sim().set_stepping(on).map_err(port_error)
    }

    fn pass(&mut self, cancel: &CancelToken) -> Result<(), PortError> {
        self.arm.sim().step(&CallOptions::cancelled_by(cancel)).map_err(port_error)
    }

    fn plan_by(&mut self, kinematics: &ArmKinematics) {
        self.kinematics = Ok(kinematics.clone());
        self.keep_to(&Surroundings::default());
    }

    fn limit(&mut self, limits: &taught_poses::MotionLimits) {
        self.limits = *limits;
    }

    fn check(&mut self) -> Result<(), PortError> {
        check_arm(&mut self.arm)
    }

    fn move_to(&mut self, goal: &MotionGoal, speed: f64, cancel: &CancelToken) -> Result<MotionOutcome, PortError> {
        let outcome = self.drive(goal, speed, cancel);
        outcome.or_else(|error| outcome_of(error, cancel))
    }

    fn jog_step(
        &mut self,
        request: &JogRequest,
        length: f64,
        cancel: &CancelToken,
    ) -> Result<MotionOutcome, PortError> {
        let speed = request.speed;
        let mut held = || (!cancel.is_cancelled()).then_some(speed);
        match self.jog_by(request, Some(length), &mut held) {
            Ok(Ok(JogEnd::Arrived)) => Ok(MotionOutcome::Arrived),
            Ok(Ok(JogEnd::Released | JogEnd::Stopped)) => Ok(MotionOutcome::Stopped),
            Ok(Ok(JogEnd::NotFollowing { joint })) => Ok(MotionOutcome::Failed(not_following(joint))),
            Ok(Ok(JogEnd::Obstacle(obstacle))) => Ok(MotionOutcome::Refused(obstacle_text(&obstacle))),
            Ok(Ok(JogEnd::OtherTip)) => Ok(MotionOutcome::Refused(other_tip())),
            Ok(Err(why)) => Ok(MotionOutcome::Refused(why)),
            Err(error) => outcome_of(error, cancel),
        }
    }

    fn jog(&mut self, request: &JogRequest, held: &mut dyn FnMut() -> Option<f64>) -> Result<Option<Text>, PortError> {
        match self.jog_by(request, None, held) {
            Ok(Ok(JogEnd::Arrived | JogEnd::Released)) => Ok(None),
            Ok(Ok(JogEnd::Stopped)) => Ok(Some(text!("The arm was stopped"))),
            Ok(Ok(JogEnd::NotFollowing { joint })) => Ok(Some(not_following(joint))),
            Ok(Ok(JogEnd::Obstacle(obstacle))) => Ok(Some(obstacle_text(&obstacle))),
            Ok(Ok(JogEnd::OtherTip)) => Ok(Some(other_tip())),
            Ok(Err(why)) => Ok(Some(why)),
            Err(error) if is_lost(&error) => Err(port_error(error)),
            Err(error) => Ok(Some(error_text(&error))),
        }
    }

    fn room(&mut self, board: &BoardInView) -> Result<Room, PortError> {
        // Following itself reports an arm of unknown kinematics.
        let Ok(kinematics) = &self.kinematics else { return Ok(Room::Enough) };
        let joints = self.arm.joint_values().map_err(port_error)?;
        let limits = FollowLimits::default();
        Ok(match kinematics.where_to_follow(&limits, board, &joints, &self.around, self.among.as_ref()) {
            Ok(None) => Room::Enough,
            Ok(Some(place)) => Room::At(place.joints),
            Err(none) => Room::Nowhere(text!(
                "Of {tried} places that show the whole board none has room for the arm to follow it: move the board \
                 away from the column of the arm, and not to the end of its reach",
                tried = none.tried
            )),
        })
    }

    fn views(&mut self, request: &ViewsRequest) -> Result<Result<Vec<JointValues>, Text>, PortError> {
        let ViewsRequest { board, taken, count, seed } = request;
        let kinematics = match &self.kinematics {
            Ok(kinematics) => kinematics,
            Err(why) => {
                return Ok(Err(text!("The kinematics of the arm is not known: {why}", why = why)));
            }
        };
        let start = self.arm.joint_values().map_err(port_error)?;
        Ok(kinematics.views_unlike(board, taken, &start, &self.around, *count, *seed).map_err(|why| no_views(&why)))
    }

    fn robot(&mut self, speed: f64) -> Result<Result<Robot, Text>, PortError> {
        let kinematics = match &self.kinematics {
            Ok(kinematics) => kinematics,
            Err(why) => return Ok(Err(text!("The kinematics of the arm is not known: {why}", why = why))),
        };
        let joints = self.arm.joint_values().map_err(port_error)?;
        Ok(Ok(kinematics.guided_robot(&joints, limits::pace(&self.limits, speed), &self.around)))
    }

    fn keep_out(&mut self, keep_out: &Surroundings) -> Result<Surroundings, Text> {
        self.keep_to(keep_out);
        match &self.kinematics {
            Ok(_known) => Ok(self.obstacles_found.all()),
            Err(why) => Err(text!("The kinematics of the arm is not known: {why}", why = why)),
        }
    }

    fn follow(
        &mut self,
        requested: &mut dyn FnMut(&FollowMoment) -> FollowRequest,
    ) -> Result<Result<FollowEnd, MotionOutcome>, PortError> {
        let kinematics = match &self.kinematics {
            Ok(kinematics) => kinematics,
            Err(why) => {
                return Ok(Err(MotionOutcome::Refused(text!(
                    "The arm cannot follow, because its kinematics is not known: {why}",
                    why = why
                ))));
            }
        };
        match self.arm.follow(kinematics, &FollowLimits::default(), requested) {
            Ok(end) => Ok(Ok(end)),
            Err(error) => outcome_of(error, &CancelToken::default()).map(Err),
        }
    }
}

/// Why no poses can be planned.
pub(crate) fn no_views(why: &PlanError) -> Text {
    match why {
        PlanError::StartBlocked { by } => {
            text!("At its present place the arm is {there}: move it into free space first", there = by.here())
        }
        PlanError::TooFewViews { candidates, not_in_view, unreachable, in_the_way, no_path, .. } => text!(
            "Of {tried} views that were tried, {not_in_view} would not show the whole board, {unreachable} are out of \
             reach, {in_the_way} would touch something, and {no_path} cannot be driven to safely: move the board towards \
             the middle of the workspace",
            tried = candidates,
            not_in_view = not_in_view,
            unreachable = unreachable,
            in_the_way = in_the_way,
            no_path = no_path
        ),
        other => other.into(),
    }
}

/// Why the arm came to rest.
pub fn end_of_following(end: &FollowEnd) -> Text {
    match end {
        FollowEnd::Released => text!("it was released"),
        FollowEnd::Stopped => text!("The arm was stopped"),
        FollowEnd::Workspace => text!("The goal is outside the box in which the tip may follow"),
        FollowEnd::JointLimit { joint } => text!(
            "Joint {joint} is at the end of its range. Start again and make room first: the arm then begins from where its \
             joints have some on both sides",
            joint = joint
        ),
        FollowEnd::Singular => {
            text!(
                "The arm is nearly stretched, close to its column, or two of its axes are in line: it cannot follow there. \
                 Jog it to where it has more room and start again"
            )
        }
        FollowEnd::NotFollowing { joint } => not_following(*joint),
        FollowEnd::OtherTip => other_tip(),
    }
}

/// Why a share of the fastest speed is invalid.
fn bad_speed(speed: f64) -> Option<Text> {
    let is_good = speed > 0.0 && speed <= 1.0;
    let percent = speed * 100.0;
    (!is_good).then(|| text!("{percent} % is not a speed: choose one over 0 % and up to 100 %", percent = percent))
}

/// The outcome of a motion for an error of the arm; only a lost connection is an error here.
fn outcome_of(error: LinkError, cancel: &CancelToken) -> Result<MotionOutcome, PortError> {
    match error {
        LinkError::MotionStopped { .. } => Ok(MotionOutcome::Stopped),
        LinkError::Cancelled { .. } if cancel.is_cancelled() => Ok(MotionOutcome::Stopped),
        error if is_lost(&error) => Err(port_error(error)),
        error @ LinkError::Unreached { .. } => Ok(MotionOutcome::Unreached(error_text(&error))),
        error @ LinkError::Held { .. } => Ok(MotionOutcome::Held(error_text(&error))),
        // These are found out before anything moves.
        error @ (LinkError::JointOutOfRange { .. }
        | LinkError::JointCount { .. }
        | LinkError::InTheWay { .. }
        | LinkError::BadMotion { .. }
        | LinkError::NoSuchObject { .. }
        | LinkError::Unsupported { .. }) => Ok(MotionOutcome::Refused(error_text(&error))),
        error => Ok(MotionOutcome::Failed(error_text(&error))),
    }
}

/// What the user can do about it, in the language of the window; rare errors keep the text of the client.
fn error_text(error: &LinkError) -> Text {
    match error {
        LinkError::NotRunning { state: SimulationState::Paused, .. } => {
            text!("The simulation is paused: continue it first")
        }
        LinkError::NotRunning { .. } => text!("The simulation is stopped: start it first"),
        LinkError::JointElsewhere { joint, at, goal } => text!(
            "Joint {joint} stands at {at} instead of {goal}: another client or a script of the scene moves or holds it",
            joint = joint,
            at = format!("{at:.3}"),
            goal = format!("{goal:.3}")
        ),
        LinkError::JointOutOfRange { joint, goal, min, max } => text!(
            "Joint {joint} cannot go to {goal}: its range is {min} to {max}",
            joint = joint,
            goal = format!("{goal:.2}"),
            min = format!("{min:.1}"),
            max = format!("{max:.1}")
        ),
        LinkError::JointCount { got, need } => text!(
            "{got} joint values for an arm of {need} joints: the goal was taught for another arm",
            got = got,
            need = need
        ),
        LinkError::InTheWay { contact } => contact_text(contact),
        LinkError::Unreached { distance_mm, angle_deg } => text!(
            "The tip stopped {mm} mm and {deg}° from its goal, which may be out of reach: choose another pose, or go \
             there joint by joint",
            mm = format!("{distance_mm:.2}"),
            deg = format!("{angle_deg:.2}")
        ),
        other => other.into(),
    }
}

fn arm_jog<'a>(
    request: &JogRequest,
    kinematics: Result<&'a ArmKinematics, &UnknownKinematics>,
) -> Result<ArmJog<'a>, Text> {
    let (frame, axis, forward) = match request.jog {
        Jog::Joint { index, forward } => return Ok(ArmJog::Joint { index, forward }),
        Jog::Translate { frame, axis, forward } | Jog::Rotate { frame, axis, forward } => (frame, axis, forward),
    };
    let kinematics = kinematics.map_err(|why| {
        text!("Only single joints can be jogged, because the kinematics of the arm is not known: {why}", why = why)
    })?;
    let axes = match frame {
        JogFrame::Base => JogAxes::Base,
        JogFrame::Tip => JogAxes::Tip,
        JogFrame::Camera => JogAxes::Camera(request.tip_from_camera.ok_or_else(|| {
            text!("Where the camera is on the tip is not known yet: calibrate first, or jog along other axes")
        })?),
    };
    let forwards = match axis {
        Axis::X => Vector3::x(),
        Axis::Y => Vector3::y(),
        Axis::Z => Vector3::z(),
    };
    let direction = if forward { forwards } else { -forwards };
    Ok(match request.jog {
        Jog::Rotate { .. } => ArmJog::Turn { kinematics, axes, about: direction },
        Jog::Translate { .. } | Jog::Joint { .. } => ArmJog::Line { kinematics, axes, along: direction },
    })
}

fn obstacle_text(obstacle: &JogObstacle) -> Text {
    match obstacle {
        JogObstacle::JointRange { joint, limit } => {
            text!("Joint {joint} is at the end of its range, {limit}", joint = joint, limit = format!("{limit:.1}"))
        }
        JogObstacle::Reach(why) => text!("The arm reaches no further: {why}", why = why),
        JogObstacle::Singular { joint } => text!(
            "The arm is stretched, or two of its axes are in line: joint {joint} would be too fast. Go another way or \
             move single joints",
            joint = joint
        ),
        JogObstacle::Contact(contact) => contact_text(contact),
        other => other.into(),
    }
}

/// What the arm would come too near to.
pub(crate) fn contact_text(contact: &Contact) -> Text {
    match contact {
        Contact::Box { name } => {
            text!("The arm, or what it carries, would come too near to “{name}”: go another way", name = name)
        }
        Contact::Itself => text!("The arm would touch itself, or what it carries: go another way"),
        Contact::Volume => text!("Tip or camera would leave the work volume: go another way"),
        other => other.into(),
    }
}

fn not_following(joint: usize) -> Text {
    text!("Joint {joint} is not where it was sent: something else moves or holds the arm", joint = joint)
}

fn other_tip() -> Text {
    text!("The tip is not where the arm's kinematics has it: it was moved. Connect again, or move single joints")
}
