//! The threads behind the window. All but `vision` own one connection to the cell and re-establish it when it breaks.
//!
//! | thread | does | reports through |
//! | --- | --- | --- |
//! | `control` | robot state, simulation, stop | events; newest [`RobotState`](handeye_link::RobotState) |
//! | `camera` | images, colours of the depth | events; newest [`LiveFrame`](crate::model::LiveFrame) |
//! | `motion` | motions and jogs, one at a time | events; refusals through the [`MotionQueue`] |
//! | `vision` | board in the newest image, captures | events; newest [`LiveDetection`](crate::model::LiveDetection); [`Measured`](crate::capture::Measured) |
//!
//! What happens once travels as an [`Event`](crate::command::Event) in a bounded channel. What is only of interest while it is new (images,
//! robot state) waits in a [`LatestSlot`](channels::LatestSlot). Nothing here knows the window: a [`Waker`] wakes it.

pub mod channels;
pub(crate) mod files;
pub(crate) mod link;
pub(crate) mod newest;
pub(crate) mod rate;
pub(crate) mod reconnect;
pub(crate) mod shared;
pub(crate) mod started;
pub(crate) mod threads;
pub(crate) mod vision;

#[cfg(feature = "testing")]
pub mod fake;

pub use crate::connect::worker::ControlTask;
pub use crate::live::worker::CameraTask;
pub use crate::motion::desk::MotionQueue;
pub use crate::motion::stop_line::StopLine;
pub use crate::motion::worker::MotionLook;
pub use crate::session::archive::{timestamp, timestamp_rfc3339};
pub use crate::solve::worker::{SolveJob, answer, examined};
pub use crate::track::follow_line::FollowLine;
pub use crate::track::worker::{TrackedBy, TrackedImage, Tracking};
pub use handeye_link::{Cell, PortError};
pub use shared::{Clock, Waker};
pub use started::Started;
