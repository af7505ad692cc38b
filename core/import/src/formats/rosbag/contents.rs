//! The contents of a bag's messages, by time.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Isometry3;

use super::frames::Frames;
use super::storage::{self, Message};
use super::{STILL_M, STILL_RAD, images};
use crate::recording::FoundCamera;
use handeye_files::budget::Budget;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_wording::Text;

/// Most messages of one kind that are kept, and most topics or frames that are distinguished.
pub(super) const MOST_MESSAGES: usize = 2_000_000;
const MOST_NAMES: usize = 10_000;
/// Joints of the largest robots.
const MOST_JOINTS: usize = 64;

/// Values by their time in nanoseconds.
pub(super) type Timed<T> = Vec<(i64, T)>;

#[derive(Default)]
pub(super) struct Bag {
    pub frames: Frames,
    /// Poses by topic.
    pub poses: BTreeMap<String, Timed<Isometry3<f64>>>,
    /// Joint values by topic and names of the joints: those of an arm and of its gripper may be published on one topic.
    pub joints: BTreeMap<(String, Vec<String>), Timed<Vec<f64>>>,
    pub cameras: BTreeMap<String, FoundCamera>,
    /// Stamps of images by topic.
    pub images: BTreeMap<String, Vec<i64>>,
}

impl Bag {
    /// Reads the files of a bag, in order.
    ///
    /// # Errors
    /// A sentence, where one is not a bag or the budget is spent.
    pub fn read(parts: &[PathBuf], budget: &Budget<'_>) -> Result<Self, Text> {
        let mut bag = Self::default();
        for part in parts {
            // A message that does not match its type is left out.
            storage::visit(part, budget, &mut |message| {
                let _read = bag.take(&message);
            })?;
        }
        bag.frames.sort();
        bag.poses.values_mut().for_each(|moving| moving.sort_by_key(|(stamp, _)| *stamp));
        bag.joints.values_mut().for_each(|values| values.sort_by_key(|(stamp, _)| *stamp));
        bag.images.values_mut().for_each(|stamps| stamps.sort_unstable());
        Ok(bag)
    }

    fn take(&mut self, message: &Message) -> Option<()> {
        let (topic, kind) = (message.topic, message.kind);
        let mut reader = message.reader()?;
        match kind {
            "tf2_msgs/msg/TFMessage" => {
                let count = reader.u32()?.min(10_000);
                let is_static = topic.ends_with("tf_static");
                for _ in 0..count {
                    let header = reader.header()?;
                    let child = reader.text()?;
                    let pose = reader.transform()?;
                    self.frames.add(&header.frame, &child, is_static, header.stamp_ns, pose);
                }
            }
            "geometry_msgs/msg/PoseStamped" | "geometry_msgs/msg/TransformStamped" => {
                let header = reader.header()?;
                if kind.ends_with("TransformStamped") {
                    reader.text()?;
                }
                let pose = reader.transform()?;
                keep(&mut self.poses, topic.to_owned(), (header.stamp_ns, pose));
            }
            "sensor_msgs/msg/JointState" => {
                let header = reader.header()?;
                let count = reader.u32()?;
                if count as usize > MOST_JOINTS {
                    return None;
                }
                let names = (0..count).map(|_| reader.text()).collect::<Option<Vec<String>>>()?;
                let values = reader.f64s()?;
                if values.len() > MOST_JOINTS || values.is_empty() {
                    return None;
                }
                keep(&mut self.joints, (topic.to_owned(), names), (header.stamp_ns, values));
            }
            "sensor_msgs/msg/CameraInfo" => {
                reader.header()?;
                let (height, width) = (reader.u32()?, reader.u32()?);
                let model = reader.text()?;
                let d = reader.f64s()?;
                let k = [(); 9].map(|()| reader.f64());
                let distortion = match (&*model, d.as_slice()) {
                    _ if d.iter().all(|v| *v == 0.0) => Distortion::None,
                    ("equidistant", &[a, b, c, d]) => Distortion::Fisheye([a, b, c, d]),
                    ("plumb_bob", &[a, b, c, d, e]) => Distortion::BrownConrady([a, b, c, d, e]),
                    ("rational_polynomial", &[a, b, c, d, e, f, g, h]) => {
                        Distortion::Rational([a, b, c, d, e, f, g, h])
                    }
                    _ => return None,
                };
                let intrinsics = Intrinsics { width, height, fx: k[0]?, fy: k[4]?, cx: k[2]?, cy: k[5]?, distortion };
                intrinsics.validate().ok()?;
                if self.cameras.len() < MOST_NAMES {
                    let why = "CameraInfo";
                    self.cameras.insert(topic.to_owned(), FoundCamera { name: topic.to_owned(), intrinsics, why });
                }
            }
            "sensor_msgs/msg/Image" | "sensor_msgs/msg/CompressedImage" => {
                keep(&mut self.images, topic.to_owned(), images::stamp_of(message)?);
            }
            _ => {}
        }
        Some(())
    }

    /// Whether nothing moves from one time to another, as far as the messages show.
    pub fn is_still(&self, from: i64, to: i64) -> bool {
        let mut reported = false;
        for moving in self.frames.moving().chain(self.poses.values()) {
            let within = between(moving, from, to);
            let Some((_, first)) = within.first() else { continue };
            reported |= within.len() > 1;
            let is_near = |pose: &Isometry3<f64>| {
                (pose.translation.vector - first.translation.vector).norm() < STILL_M
                    && pose.rotation.angle_to(&first.rotation) < STILL_RAD
            };
            if !within.iter().all(|(_, pose)| is_near(pose)) {
                return false;
            }
        }
        for values in self.joints.values() {
            let within = between(values, from, to);
            let Some((_, first)) = within.first() else { continue };
            reported |= within.len() > 1;
            let is_near = |other: &Vec<f64>| other.iter().zip(first).all(|(a, b)| (a - b).abs() < STILL_RAD);
            if !within.iter().all(|(_, other)| is_near(other)) {
                return false;
            }
        }
        reported
    }
}

fn keep<K: Ord, V>(all: &mut BTreeMap<K, Vec<V>>, key: K, value: V) {
    if all.len() >= MOST_NAMES && !all.contains_key(&key) {
        return;
    }
    let values = all.entry(key).or_default();
    if values.len() < MOST_MESSAGES {
        values.push(value);
    }
}

/// The values between two times.
pub(super) fn between<T>(values: &[(i64, T)], from: i64, to: i64) -> &[(i64, T)] {
    let start = values.partition_point(|(stamp, _)| *stamp < from);
    let end = values.partition_point(|(stamp, _)| *stamp <= to);
    &values[start..end.max(start)]
}

/// The value nearest in time, if it is near enough.
pub(super) fn nearest<T>(values: &[(i64, T)], stamp: i64, within_ns: i64) -> Option<&T> {
    let near = between(values, stamp.saturating_sub(within_ns), stamp.saturating_add(within_ns));
    near.iter().min_by_key(|(other, _)| other.abs_diff(stamp)).map(|(_, value)| value)
}
