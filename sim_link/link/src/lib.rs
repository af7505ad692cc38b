//! A cell as a program uses it: a robot, images with its pose at their instant, and motions. Whether that is the built-in
//! cell, a CoppeliaSim or drivers of a real arm makes no difference to who holds a [`Cell`].
//!
//! | module | what it knows |
//! | --- | --- |
//! | [`Cell`], [`ControlPort`], [`CameraPort`], [`MotionPort`] | what can be asked of a cell, by three connections that do not wait for each other |
//! | [`RemoteCell`] | the remote API of CoppeliaSim; starts the built-in cell where that is the one |
//! | [`DrivenCell`] | [drivers](handeye_driver) of robot and camera |
//! | [`limits`] | default speeds of the arm |
//!
//! ```no_run
//! use handeye_coppeliasim::{CancelToken, cell::CellPaths};
//! use handeye_link::{CellSource, MotionGoal};
//!
//! let cell = CellSource::Address("tcp://127.0.0.1:23000".to_owned()).cell(&CellPaths::default());
//! let cancel = CancelToken::default();
//! let mut robot = cell.control(&cancel)?.port;
//! if let Some(now) = robot.state()? {
//!     let goal = MotionGoal::Joints(now.joints_rad);
//!     println!("{:?}", cell.motion(&cancel)?.port.move_to(&goal, 0.2, &cancel)?);
//! }
//! # Ok::<(), handeye_link::PortError>(())
//! ```
//!
//! Never depends on a window, its own estimator, or a session.

#![warn(missing_docs)]

mod drivers;
mod facts;
mod goal;
pub mod limits;
mod moved;
mod port;
mod remote;
mod source;

pub use drivers::{DrivenCell, Drivers};
pub use facts::{ArmDoubt, CellFacts, JointFacts, Moves, RobotState, Simulation, Truth};
pub use goal::{Axis, Jog, JogFrame, MotionGoal, MotionOutcome};
pub use moved::moved_text;
pub use port::{
    CameraPort, Cell, Connected, ControlPort, JogRequest, MotionPort, Newest, PortError, RawFrame, Room, ViewsRequest,
};
pub use remote::{RemoteCell, end_of_following};
pub use source::CellSource;
