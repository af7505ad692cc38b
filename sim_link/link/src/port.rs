//! What can be asked of a cell.

use std::time::Duration;

use handeye_arm::JointValues;
use handeye_coppeliasim::CancelToken;
use handeye_coppeliasim::cell::{ArmKinematics, BoardInView, BoardMotion, FollowEnd, FollowMoment, FollowRequest};
use handeye_dataset::taught_poses::MotionLimits;
use handeye_driver::LogLevel;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_plan::Surroundings;
use handeye_plan::guided::choose::Robot;
use image::RgbImage;

use crate::{CellFacts, Jog, MotionGoal, MotionOutcome, RobotState};
use handeye_wording::Text;
use handeye_wording::text;

/// Why a port has no answer.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum PortError {
    /// The connection is broken or was never made: worth another try.
    Lost(Text),
    /// The cell answered no.
    Refused(Text),
    /// The simulation stands still because another client holds it.
    Held(Text),
    /// It cannot work before the user changes something.
    Hopeless(Text),
    /// As [`Self::Lost`], where the cell itself is not to be tried more often than this.
    Later {
        /// Why there is none.
        why: Text,
        /// How many tries in a row came to nothing.
        tries: u32,
        /// How long until the next.
        pause: Duration,
    },
    /// The user wants that it is not tried.
    Rests(Text),
}

impl PortError {
    /// Why, for the screen.
    pub fn why(&self) -> &Text {
        match self {
            Self::Lost(why)
            | Self::Refused(why)
            | Self::Held(why)
            | Self::Hopeless(why)
            | Self::Later { why, .. }
            | Self::Rests(why) => why,
        }
    }
}

/// A connection that has just been made.
pub struct Connected<Port> {
    /// To make calls.
    pub port: Port,
    /// Where the server is.
    pub address: String,
    /// What it is, for example `CoppeliaSim 4.10.0`.
    pub server: String,
}

/// A cell, however it is reached. It makes connections, each for a thread of its own; all calls block.
pub trait Cell: Send + Sync {
    /// A connection for joints, tip, simulation and stop.
    ///
    /// # Errors
    /// [`PortError`]; within a second after `shutdown` is raised.
    fn control(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn ControlPort>>, PortError>;

    /// A connection for images.
    ///
    /// # Errors
    /// As [`Self::control`].
    fn camera(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn CameraPort>>, PortError>;

    /// A connection for motions.
    ///
    /// # Errors
    /// As [`Self::control`].
    fn motion(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn MotionPort>>, PortError>;

    /// The user wants no more tries: from now on a connection that is not there is [`PortError::Rests`], and a try under way is
    /// given up. Waits for nothing. Only where a try starts a program is there reason to.
    fn rest(&self) {}

    /// The user wants it to be tried now. Waits for nothing.
    fn again(&self) {}
}

/// The robot and the simulation.
pub trait ControlPort: Send {
    /// What does not change while the connection lasts, or hardly.
    ///
    /// # Errors
    /// [`PortError`].
    fn facts(&mut self) -> Result<CellFacts, PortError>;

    /// Whether the facts are others than when they were asked for last.
    fn facts_differ(&mut self) -> bool {
        false
    }

    /// Reads the robot; `None` while nothing is known of it.
    ///
    /// # Errors
    /// [`PortError`].
    fn state(&mut self) -> Result<Option<RobotState>, PortError>;

    /// Lets simulated time advance.
    ///
    /// # Errors
    /// [`PortError`].
    fn start_simulation(&mut self) -> Result<(), PortError>;

    /// Ends the simulation, and waits until it has ended. Nothing where there is none.
    ///
    /// # Errors
    /// [`PortError`].
    fn stop_simulation(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    /// Where the scene of a simulation has its board; `None` where that is not known.
    ///
    /// # Errors
    /// [`PortError`].
    fn base_from_board(&mut self, _target: &TargetSpec) -> Result<Option<Pose<Base, Target>>, PortError> {
        Ok(None)
    }

    /// Has every joint stay where it is.
    ///
    /// # Errors
    /// [`PortError`]; the arm may then still move.
    fn stop(&mut self) -> Result<(), PortError>;

    /// Has a simulated cell move its board.
    ///
    /// # Errors
    /// [`PortError`], [`PortError::Refused`] by a cell that cannot.
    fn move_board(&mut self, motion: &BoardMotion) -> Result<(), PortError>;

    /// Has a simulated cell hide its board or show it again.
    ///
    /// # Errors
    /// As [`Self::move_board`].
    fn hide_board(&mut self, hidden: bool) -> Result<(), PortError>;

    /// Lets a robot behind a driver be moved, or no longer.
    ///
    /// # Errors
    /// [`PortError`], [`PortError::Refused`] by a driver that does not allow it.
    fn arm(&mut self, _on: bool) -> Result<(), PortError> {
        Ok(())
    }

    /// Goes on as another client of the same server: what that may still keep for this one would only be in the way.
    ///
    /// # Errors
    /// When nothing answers.
    fn renew(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    /// Takes the pose that a person reads off the pendant; `None` once the robot has been moved on.
    ///
    /// # Errors
    /// [`PortError::Refused`] by a cell that reports its pose.
    fn type_pose(&mut self, _pose: Option<Pose<Base, Tip>>) -> Result<(), PortError> {
        Err(PortError::Refused(text!("The robot reports its pose by itself")))
    }

    /// What the cell has said for people since the last call.
    fn heard(&mut self) -> Vec<(LogLevel, String)> {
        Vec::new()
    }
}

/// A jog that is asked for: for as long as a button is held, or by a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JogRequest {
    /// Which way.
    pub jog: Jog,
    /// Where the camera is, for jogs along and about its axes.
    pub tip_from_camera: Option<Pose<Tip, Camera>>,
    /// Share of the fastest speed, over 0 and up to 1.
    pub speed: f64,
}

/// Poses that are asked for to look at the board from.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewsRequest {
    /// What is looked at, and with what.
    pub board: BoardInView,
    /// Where it was looked at from already: the poses are to be others.
    pub taken: Vec<Pose<Base, Tip>>,
    /// How many are wanted; there may be fewer.
    pub count: usize,
    /// Of the views that are compared: the same question gets the same answer.
    pub seed: u64,
}

/// Whether an arm can go along with a board from where it is.
#[derive(Debug, Clone, PartialEq)]
pub enum Room {
    /// It can.
    Enough,
    /// It can from these joints \[rad\].
    At(JointValues),
    /// It can from nowhere, and this is why.
    Nowhere(Text),
}

/// What moves the arm.
pub trait MotionPort: Send {
    /// As [`ControlPort::renew`].
    ///
    /// # Errors
    /// As [`ControlPort::renew`].
    fn renew(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    /// From now on simulated time advances by [`Self::pass`] and the motions of this connection alone, or by itself again.
    /// Time that is not simulated goes on.
    ///
    /// # Errors
    /// [`PortError`].
    fn step_by_step(&mut self, _on: bool) -> Result<(), PortError> {
        Ok(())
    }

    /// Lets simulated time advance to the next pass. Nothing where it is not simulated.
    ///
    /// # Errors
    /// [`PortError`], [`PortError::Held`] among them.
    fn pass(&mut self, _cancel: &CancelToken) -> Result<(), PortError> {
        Ok(())
    }

    /// Plans for a simulated arm by this chain of joints from now on, in place of the one that was read from the simulation. Before
    /// [`Self::keep_out`].
    fn plan_by(&mut self, _kinematics: &ArmKinematics) {}

    /// The fastest that a simulated arm moves from now on; a robot behind a driver has limits of its own.
    fn limit(&mut self, _limits: &MotionLimits) {}

    /// Looks whether the cell is there, without asking it for anything.
    ///
    /// # Errors
    /// [`PortError::Lost`] when it has gone.
    fn check(&mut self) -> Result<(), PortError>;

    /// Moves to a goal, at a share of the fastest speed, and returns when the arm stands: there, or where `cancel`
    /// brought it to rest.
    ///
    /// # Errors
    /// [`PortError::Lost`]; everything else is an outcome.
    fn move_to(&mut self, goal: &MotionGoal, speed: f64, cancel: &CancelToken) -> Result<MotionOutcome, PortError>;

    /// Jogs by a length (metres or radians).
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn jog_step(&mut self, request: &JogRequest, length: f64, cancel: &CancelToken)
    -> Result<MotionOutcome, PortError>;

    /// Jogs for as long as `held` gives a share of the fastest speed, and returns when the arm stands; with the reason
    /// when it ended by itself, or did not begin.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn jog(&mut self, request: &JogRequest, held: &mut dyn FnMut() -> Option<f64>) -> Result<Option<Text>, PortError>;

    /// Whether the arm has room to keep its view of a board that moves, and where it has. Nothing moves.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn room(&mut self, board: &BoardInView) -> Result<Room, PortError>;

    /// Joints from which the whole board is seen; or why there are none. Nothing moves.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn views(&mut self, request: &ViewsRequest) -> Result<Result<Vec<JointValues>, Text>, PortError>;

    /// The arm as guided capture drives it at a share of its highest speed, where it stands; or why it cannot be. Nothing moves.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn robot(&mut self, speed: f64) -> Result<Result<Robot, Text>, PortError>;

    /// Has the arm keep out of these, too, from its next motion on. Gives what the cell says stands around; or why nothing can be
    /// kept out of.
    ///
    /// # Errors
    /// The reason, where the kinematics is not known.
    fn keep_out(&mut self, keep_out: &Surroundings) -> Result<Surroundings, Text>;

    /// Leads the tip where `wish` wants it, pass by pass, and returns when the arm stands: how that ended, or why it was not
    /// begun or failed.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn follow(
        &mut self,
        requested: &mut dyn FnMut(&FollowMoment) -> FollowRequest,
    ) -> Result<Result<FollowEnd, MotionOutcome>, PortError>;
}

/// Images as they come from the cell.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFrame {
    /// Colour, row 0 on top.
    pub rgb: RgbImage,
    /// Depth in metres, row 0 on top, from a camera that measures it.
    pub depth: Option<DepthImage>,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// How much older than pose and joints the images may be \[s\] of simulated time.
    pub image_age_s: f64,
    /// The tip as the controller reports it at that instant, where that is known.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// Why that is not known.
    pub no_pose: Option<Text>,
    /// The joints at that instant \[rad\]; none where the robot does not report them.
    pub joints_rad: JointValues,
    /// Where the board was at that instant, if the cell publishes it.
    pub base_from_target_true: Option<Pose<Base, Target>>,
    /// How far \[s\] the robot's clock is ahead of the camera's, and how well that is known; where they are two.
    pub clocks: Option<[f64; 2]>,
}

/// What a camera gives that is asked for its newest images.
#[derive(Debug, Clone, PartialEq)]
pub enum Newest {
    /// New ones.
    Frame(Box<RawFrame>),
    /// The camera answers that time stands still: it has none but those that were seen.
    Same,
    /// It has not answered yet.
    Awaited,
}

/// What images are fetched by.
pub trait CameraPort: Send {
    /// The newest images of another instant than the last ones, whose time was `seen_s`. Waits no longer than a tenth of a
    /// second for them.
    ///
    /// # Errors
    /// [`PortError`].
    fn newest(&mut self, seen_s: Option<f64>) -> Result<Newest, PortError>;

    /// As [`ControlPort::renew`].
    ///
    /// # Errors
    /// As [`ControlPort::renew`].
    fn renew(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    /// Depths \[m\] that the sensor can measure; it reports the far one where nothing reflects.
    fn depth_limits_m(&self) -> [f32; 2];
}
