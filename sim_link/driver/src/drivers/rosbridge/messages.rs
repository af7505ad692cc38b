//! The messages of ROS that are read, as rosbridge writes them in JSON: of ROS 1 and of ROS 2.

use std::fmt;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::de::{self, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// An instant: `secs` and `nsecs` in ROS 1, `sec` and `nanosec` in ROS 2.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(super) struct Stamp {
    #[serde(alias = "secs")]
    sec: i64,
    #[serde(alias = "nsecs")]
    nanosec: u32,
}

impl Stamp {
    /// Seconds; of the epoch to a quarter of a microsecond.
    pub fn seconds(self) -> f64 {
        self.sec as f64 + f64::from(self.nanosec) * 1e-9
    }
}

/// When and in which frame.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Header {
    pub stamp: Stamp,
    #[serde(default)]
    pub frame_id: String,
}

/// `tf2_msgs/TFMessage`.
#[derive(Debug, Deserialize)]
pub(super) struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}

/// `geometry_msgs/TransformStamped`: the child's pose in the frame of the header.
#[derive(Debug, Deserialize)]
pub(super) struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    transform: Transform,
}

#[derive(Debug, Deserialize)]
struct Transform {
    translation: Vector,
    rotation: Rotation,
}

#[derive(Debug, Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Debug, Deserialize)]
struct Rotation {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl TransformStamped {
    /// Child in parent; `None` when the quaternion is no rotation.
    pub fn parent_from_child(&self) -> Option<Isometry3<f64>> {
        /// Rounding to three digits stays within; zeros, as of a field that was never set, do not.
        const UNIT_TOLERANCE: f64 = 1e-3;
        let Transform { translation: t, rotation: q } = &self.transform;
        let rotation = Quaternion::new(q.w, q.x, q.y, q.z);
        ((rotation.norm() - 1.0).abs() < UNIT_TOLERANCE)
            .then(|| Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), UnitQuaternion::from_quaternion(rotation)))
    }
}

/// `sensor_msgs/JointState`.
#[derive(Debug, Deserialize)]
pub(super) struct JointState {
    pub header: Header,
    pub name: Vec<String>,
    /// Null where ROS has a number that is none.
    #[serde(default)]
    pub position: Vec<Option<f64>>,
}

/// `sensor_msgs/Image` or `sensor_msgs/CompressedImage`: the first has an encoding, the second a format.
#[derive(Debug, Deserialize)]
pub(super) struct AnyImage {
    pub header: Header,
    #[serde(default)]
    pub height: u32,
    #[serde(default)]
    pub width: u32,
    pub encoding: Option<String>,
    pub format: Option<String>,
    #[serde(default)]
    pub is_bigendian: Flag,
    #[serde(default)]
    pub step: u32,
    pub data: Bytes,
}

/// A number or a truth value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Flag(pub bool);

impl<'de> Deserialize<'de> for Flag {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Either {
            Truth(bool),
            Number(u8),
        }
        Ok(Self(match Either::deserialize(deserializer)? {
            Either::Truth(truth) => truth,
            Either::Number(number) => number != 0,
        }))
    }
}

/// `uint8[]`: base64, as rosbridge writes it, or a list of numbers, as it can be told to.
#[derive(Debug)]
pub(super) struct Bytes(pub Vec<u8>);

impl<'de> Deserialize<'de> for Bytes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Bytes;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("bytes in base64 or a list of numbers")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Bytes, E> {
                data_encoding::BASE64.decode(text.as_bytes()).map(Bytes).map_err(E::custom)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Bytes, A::Error> {
                let mut bytes = Vec::new();
                while let Some(byte) = list.next_element()? {
                    bytes.push(byte);
                }
                Ok(Bytes(bytes))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// `sensor_msgs/CameraInfo`: capital letters in ROS 1, small ones in ROS 2.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct CameraInfo {
    pub height: u32,
    pub width: u32,
    pub distortion_model: String,
    #[serde(alias = "D")]
    pub d: Vec<f64>,
    #[serde(alias = "K")]
    pub k: [f64; 9],
    #[serde(alias = "P")]
    pub p: [f64; 12],
    #[serde(default)]
    pub binning_x: u32,
    #[serde(default)]
    pub binning_y: u32,
    #[serde(default)]
    pub roi: Option<Region>,
}

/// `sensor_msgs/RegionOfInterest`; all zero is the whole image.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Region {
    #[serde(default)]
    pub x_offset: u32,
    #[serde(default)]
    pub y_offset: u32,
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn stamps_of_both_versions_of_ros_are_seconds() {
        let one: Stamp = serde_json::from_value(json!({"secs": 12, "nsecs": 500_000_000})).expect("ROS 1");
        let two: Stamp = serde_json::from_value(json!({"sec": 12, "nanosec": 500_000_000})).expect("ROS 2");
        assert_eq!(one, two);
        assert!((one.seconds() - 12.5).abs() < 1e-12);
    }

    #[test]
    fn bytes_are_read_from_base64_and_from_a_list() {
        let coded: Bytes = serde_json::from_value(json!("AQL/")).expect("base64");
        let list: Bytes = serde_json::from_value(json!([1, 2, 255])).expect("a list");
        assert_eq!(coded.0, [1, 2, 255]);
        assert_eq!(list.0, [1, 2, 255]);
        assert!(serde_json::from_value::<Bytes>(json!("AQL")).is_err());
        assert!(serde_json::from_value::<Bytes>(json!([1, 256])).is_err());
    }

    #[test]
    fn a_transform_whose_quaternion_was_never_set_is_none() {
        let transform = |w: f64| -> TransformStamped {
            serde_json::from_value(json!({
                "header": {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "base"},
                "child_frame_id": "tool0",
                "transform": {"translation": {"x": 1.0, "y": 2.0, "z": 3.0}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": w}},
            }))
            .expect("a transform")
        };
        assert!(transform(0.0).parent_from_child().is_none());
        let pose = transform(1.0).parent_from_child().expect("a rotation");
        assert_eq!(pose.translation.vector.as_slice(), [1.0, 2.0, 3.0]);
    }
}
