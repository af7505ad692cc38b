//! Robots that are not there: servers for tests, of protocols that other programs read too.

mod ros;
mod rosbridge_server;
mod rtde_robot;
mod rtde_wire;

pub use ros::{RosScene, RosVersion};
pub use rosbridge_server::{RosbridgeServer, Topic};
pub use rtde_robot::{Output, RtdeRobot, RtdeScript};
