//! The interface to a cell.

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
    /// The simulation does not advance because another client holds it.
    Held(Text),
    /// It cannot work before the user changes something.
    Hopeless(Text),
    /// As [`Self::Lost`], with a minimum pause before the next attempt.
    Later {
        /// Why there is no connection.
        why: Text,
        /// Number of failed attempts in a row.
        tries: u32,
        /// Time until the next attempt.
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
    /// The port for calls.
    pub port: Port,
    /// Address of the server.
    pub address: String,
    /// Name of the server, for example `CoppeliaSim 4.10.0`.
    pub server: String,
}

/// A cell, however it is reached. It makes connections, each for its own thread; all calls block.
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

    /// The user wants no more attempts: from now on a missing connection is [`PortError::Rests`], and an attempt under way is
    /// given up. Does not block. Only needed where an attempt starts a program.
    fn rest(&self) {}

    /// The user wants it to be tried now. Waits for nothing.
    fn again(&self) {}
}

/// The robot and the simulation.
pub trait ControlPort: Send {
    /// Facts that do not change, or hardly, while the connection lasts.
    ///
    /// # Errors
    /// [`PortError`].
    fn facts(&mut self) -> Result<CellFacts, PortError>;

    /// Whether the facts differ from those of the last call of `facts`.
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

    /// Ends the simulation, and waits until it has ended. Does nothing where there is none.
    ///
    /// # Errors
    /// [`PortError`].
    fn stop_simulation(&mut self) -> Result<(), PortError> {
        Ok(())
    }

    /// Pose of the board in the scene of a simulation; `None` where that is not known.
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

    /// Log lines of the cell since the last call.
    fn heard(&mut self) -> Vec<(LogLevel, String)> {
        Vec::new()
    }
}

/// A requested jog: for as long as a button is held, or by a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JogRequest {
    /// Direction of the jog.
    pub jog: Jog,
    /// Pose of the camera, for jogs along and about its axes.
    pub tip_from_camera: Option<Pose<Tip, Camera>>,
    /// Share of the fastest speed, over 0 and up to 1.
    pub speed: f64,
}

/// A request for poses from which the board is seen.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewsRequest {
    /// The board, and the camera that looks at it.
    pub board: BoardInView,
    /// Poses from which it was seen already: the new ones are to differ.
    pub taken: Vec<Pose<Base, Tip>>,
    /// Number of poses requested; there may be fewer.
    pub count: usize,
    /// Seed of the candidate views: the same request gets the same answer.
    pub seed: u64,
}

/// Whether an arm can follow a board from where it is.
#[derive(Debug, Clone, PartialEq)]
pub enum Room {
    /// It can.
    Enough,
    /// It can from these joints \[rad\].
    At(JointValues),
    /// It can from nowhere, and this is why.
    Nowhere(Text),
}

/// The interface to the motions of the arm.
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

    /// Lets simulated time advance to the next pass. Does nothing where it is not simulated.
    ///
    /// # Errors
    /// [`PortError`], [`PortError::Held`] among them.
    fn pass(&mut self, _cancel: &CancelToken) -> Result<(), PortError> {
        Ok(())
    }

    /// Plans for a simulated arm by this chain of joints from now on, in place of the one that was read from the simulation. Before
    /// [`Self::keep_out`].
    fn plan_by(&mut self, _kinematics: &ArmKinematics) {}

    /// The fastest that a simulated arm moves from now on; a robot behind a driver has its own limits.
    fn limit(&mut self, _limits: &MotionLimits) {}

    /// Looks whether the cell is there, without asking it for anything.
    ///
    /// # Errors
    /// [`PortError::Lost`] when it has gone.
    fn check(&mut self) -> Result<(), PortError>;

    /// Moves to a goal, at a share of the fastest speed, and returns when the arm is at rest: there, or where `cancel`
    /// stopped it.
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

    /// Jogs for as long as `held` gives a share of the fastest speed, and returns when the arm is at rest; with the
    /// reason when it ended by itself, or did not begin.
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

    /// The arm as guided capture drives it at a share of its highest speed, where it is; or why that is not possible. Nothing
    /// moves.
    ///
    /// # Errors
    /// As [`Self::move_to`].
    fn robot(&mut self, speed: f64) -> Result<Result<Robot, Text>, PortError>;

    /// Makes the arm avoid these, too, from its next motion on. Returns the obstacles of the cell; or why none can be avoided.
    ///
    /// # Errors
    /// The reason, where the kinematics is not known.
    fn keep_out(&mut self, keep_out: &Surroundings) -> Result<Surroundings, Text>;

    /// Moves the tip where `requested` wants it, pass by pass, and returns when the arm is at rest: how that ended, or why
    /// it was not begun or failed.
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
    /// The joints at that instant \[rad\]; empty where the robot does not report them.
    pub joints_rad: JointValues,
    /// Pose of the board at that instant, if the cell publishes it.
    pub base_from_target_true: Option<Pose<Base, Target>>,
    /// Offset \[s\] of the robot's clock from the camera's, and its uncertainty; where there are two clocks.
    pub clocks: Option<[f64; 2]>,
}

/// Reply of a camera to a request for its newest images.
#[derive(Debug, Clone, PartialEq)]
pub enum Newest {
    /// New ones.
    Frame(Box<RawFrame>),
    /// The camera reports that simulated time does not advance: there are no newer images.
    Same,
    /// It has not answered yet.
    Awaited,
}

/// The interface to the images.
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
