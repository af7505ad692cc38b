//! Robots that are not there: servers for tests, of protocols that other programs read too.

mod rtde_robot;

pub use rtde_robot::{Output, RtdeRobot, RtdeScript};
