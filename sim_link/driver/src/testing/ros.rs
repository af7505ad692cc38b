//! A robot with a camera at its tool, as topics of ROS 1 or ROS 2.

use std::collections::BTreeMap;
use std::time::Duration;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use serde_json::{Value, json};

use super::Topic;

/// Format of the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RosVersion {
    /// `secs`, `nsecs`, `D`, `K`, and types without `/msg/`.
    One,
    /// `sec`, `nanosec`, `d`, `k`.
    Two,
}

/// The robot: `world`, `base_link`, `link_1` and `tool0` hang on one another, `tool0` and `camera` do not move there.
#[derive(Debug, Clone, Copy)]
pub struct RosScene {
    /// Version of the messages.
    pub version: RosVersion,
    /// Width of the images.
    pub width: u32,
    /// Height of the images.
    pub height: u32,
}

/// `x y z` and `x y z w`.
type Placed = ([f64; 3], [f64; 4]);

/// `base_link` to `link_1`: 0.3 m up, turned by 0.5 rad about z.
const LINK_1: Placed = ([0.1, -0.2, 0.3], [0.0, 0.0, 0.247_403_959_254_522_94, 0.968_912_421_710_644_8]);
/// `link_1` to `tool0`: turned by 90° about x.
const TOOL0: Placed = ([0.4, 0.05, 0.12], [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2]);
/// Pose of `base_link` in the `world`.
const BASE_LINK: Placed = ([1.0, 2.0, 0.0], [0.0, 0.0, 1.0, 0.0]);

impl RosScene {
    /// Images of 16×12.
    pub fn new(version: RosVersion) -> Self {
        Self { version, width: 16, height: 12 }
    }

    /// All topics of it.
    pub fn topics(self) -> BTreeMap<String, Topic> {
        let fast = Duration::from_millis(10);
        let slow = Duration::from_millis(50);
        let kind = |package: &str, name: &str| match self.version {
            RosVersion::One => format!("{package}/{name}"),
            RosVersion::Two => format!("{package}/msg/{name}"),
        };
        let sensor = |name: &str| kind("sensor_msgs", name);
        [
            ("/tf", Topic::every(&kind("tf2_msgs", "TFMessage"), fast, move |t| self.tf(t))),
            ("/tf_static", Topic::latched(&kind("tf2_msgs", "TFMessage"), self.tf_static())),
            ("/joint_states", Topic::every(&sensor("JointState"), fast, move |t| self.joints(t))),
            ("/camera/image_raw", Topic::every(&sensor("Image"), slow, move |t| self.image(t))),
            ("/camera/camera_info", Topic::every(&sensor("CameraInfo"), slow, move |t| self.camera_info(t))),
            ("/camera/depth", Topic::every(&sensor("Image"), slow, move |t| self.depth(t))),
        ]
        .into_iter()
        .map(|(name, topic)| (name.to_owned(), topic))
        .collect()
    }

    /// The header of a message.
    pub fn header(self, time_s: f64, frame: &str) -> Value {
        let seconds = time_s.floor();
        let nanoseconds = ((time_s - seconds) * 1e9) as u32;
        let stamp = match self.version {
            RosVersion::One => json!({"secs": seconds as i64, "nsecs": nanoseconds}),
            RosVersion::Two => json!({"sec": seconds as i64, "nanosec": nanoseconds}),
        };
        json!({"stamp": stamp, "frame_id": frame})
    }

    /// Pose of `tool0` in `base_link`.
    pub fn base_from_tip(self) -> Isometry3<f64> {
        let isometry = |(t, q): Placed| {
            let rotation = UnitQuaternion::from_quaternion(Quaternion::from(q));
            Isometry3::from_parts(t.into(), rotation)
        };
        isometry(LINK_1) * isometry(TOOL0)
    }

    fn transform(self, time_s: f64, parent: &str, child: &str, (t, q): Placed) -> Value {
        json!({
            "header": self.header(time_s, parent),
            "child_frame_id": child,
            "transform": {
                "translation": {"x": t[0], "y": t[1], "z": t[2]},
                "rotation": {"x": q[0], "y": q[1], "z": q[2], "w": q[3]},
            },
        })
    }

    fn tf(self, time_s: f64) -> Value {
        json!({"transforms": [self.transform(time_s, "base_link", "link_1", LINK_1)]})
    }

    fn tf_static(self) -> Value {
        let tool = self.transform(0.0, "link_1", "tool0", TOOL0);
        json!({"transforms": [tool, self.transform(0.0, "world", "base_link", BASE_LINK)]})
    }

    fn joints(self, time_s: f64) -> Value {
        json!({
            "header": self.header(time_s, ""),
            "name": ["elbow_joint", "shoulder_pan_joint"], "position": [-1.25, 0.5], "velocity": [null, 0.0], "effort": [],
        })
    }

    /// Red, green and blue of each pixel, row by row.
    pub fn pixels(self) -> Vec<u8> {
        (0..3 * self.width * self.height).map(|i| (i * 7 % 251) as u8).collect()
    }

    /// Depths in millimetres, two bytes each, little end first.
    pub fn depths(self) -> Vec<u8> {
        let pixels = u16::try_from(self.width * self.height).unwrap_or(u16::MAX);
        (0..pixels).flat_map(|i| (1000 + i).to_le_bytes()).collect()
    }

    /// Rows are padded by two bytes.
    fn image(self, time_s: f64) -> Value {
        let row = 3 * self.width as usize;
        let data: Vec<u8> = self.pixels().chunks(row).flat_map(|row| row.iter().copied().chain([0, 0])).collect();
        self.raw(time_s, "rgb8", row + 2, &data)
    }

    fn depth(self, time_s: f64) -> Value {
        // From the same exposure: image and depth have the same stamp, which is a multiple of their period.
        self.raw(time_s, "16UC1", 2 * self.width as usize, &self.depths())
    }

    fn raw(self, time_s: f64, encoding: &str, step: usize, data: &[u8]) -> Value {
        let exposure_s = (time_s / 0.05).floor() * 0.05;
        json!({
            "header": self.header(exposure_s, "camera"),
            "height": self.height, "width": self.width, "encoding": encoding, "is_bigendian": 0, "step": step,
            "data": data_encoding::BASE64.encode(data),
        })
    }

    fn camera_info(self, time_s: f64) -> Value {
        let (d, k, r, p) = match self.version {
            RosVersion::One => ("D", "K", "R", "P"),
            RosVersion::Two => ("d", "k", "r", "p"),
        };
        json!({
            "header": self.header(time_s, "camera"),
            "height": self.height, "width": self.width, "distortion_model": "plumb_bob",
            d: [0.11, -0.21, 0.001, -0.002, 0.03],
            k: [15.5, 0.0, 7.25, 0.0, 15.75, 5.5, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [15.0, 0.0, 7.0, 0.0, 0.0, 15.0, 5.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            "binning_x": 0, "binning_y": 0,
            "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": false},
        })
    }
}
