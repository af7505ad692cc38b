//! ROS 1 and ROS 2 through rosbridge: JSON over a WebSocket. Where the arm is comes from tf, images from a topic.
//!
//! # Reference
//! *rosbridge v2.0 Protocol Specification* of the `rosbridge_suite`, and the definitions of `tf2_msgs/TFMessage`,
//! `sensor_msgs/JointState`, `sensor_msgs/Image`, `sensor_msgs/CompressedImage` and `sensor_msgs/CameraInfo` in ROS 1 and 2.

mod camera_info;
mod device;
mod fragments;
mod images;
mod joints;
mod link;
mod messages;
mod scene;
mod tf;

pub use device::{Rosbridge, RosbridgeOptions};

/// Where rosbridge listens unless it is told otherwise.
pub const PORT: u16 = 9090;

/// Most bytes of one message of rosbridge: a colour image of 4k in base64, and room to spare.
const MAX_MESSAGE: usize = 64 << 20;

/// Why there is nothing to read from rosbridge.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RosbridgeError {
    /// Not an address of a rosbridge.
    #[error("{url:?} is no address of a rosbridge: {why}; it looks like ws://192.168.0.7:9090")]
    Url {
        /// What was given.
        url: String,
        /// What is wrong with it.
        why: String,
    },
    /// No connection.
    #[error(
        "no rosbridge answers at {url}: {why}. Start it with `ros2 launch rosbridge_server rosbridge_websocket_launch.xml` \
             (ROS 1: `roslaunch rosbridge_server rosbridge_websocket.launch`)"
    )]
    Unreachable {
        /// Its address.
        url: String,
        /// What the system says.
        why: String,
    },
    /// It ended.
    #[error("rosbridge closed the connection{why}")]
    Closed {
        /// With what it said, after a colon.
        why: String,
    },
    /// Not even an answer to a ping.
    #[error("rosbridge has sent nothing for {seconds} s")]
    Silent {
        /// How long.
        seconds: u64,
    },
    /// Bytes that are no message of rosbridge.
    #[error("rosbridge sent what is no message of its protocol: {why}")]
    Malformed {
        /// What is wrong.
        why: String,
    },
    /// A message on a topic is not what it should be.
    #[error("{topic}: {why}")]
    Topic {
        /// Its name.
        topic: String,
        /// What is wrong, and what to do.
        why: String,
    },
}

impl RosbridgeError {
    fn malformed(why: impl std::fmt::Display) -> Self {
        Self::Malformed { why: why.to_string() }
    }

    fn topic(topic: &str, why: impl std::fmt::Display) -> Self {
        Self::Topic { topic: topic.to_owned(), why: why.to_string() }
    }
}
