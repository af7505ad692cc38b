//! Bags of ROS 2, in MCAP or SQLite: images where the robot stood still, its poses from the tree of frames or from messages of poses,
//! joint values, cameras.
//!
//! Frames of the tree are composed by the stamps of their transforms; an instant is at rest when nothing that moves in the bag
//! moves around it. Of each rest one image is taken.

mod cdr;
mod images;
mod storage;

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Isometry3;

use super::tree;
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::project::import::conventions::{Direction, LengthUnit, RotationForm};
use crate::project::import::recording::{FoundCamera, Known, Numbers, Recording, Role, Sample, Stated, Track};
use cdr::Reader;

/// Half of the time around an instant in which nothing may move.
const REST_NS: i64 = 250_000_000;
/// What counts as no motion: metres, radians (and metres of prismatic joints).
const STILL_M: f64 = 5e-4;
const STILL_RAD: f64 = 2e-3;
/// Most images that are taken out of a bag, and most frames that may be the tip.
const MOST_IMAGES: usize = 1000;
const MOST_TIPS: usize = 8;
/// Most messages of one kind that are kept.
const MOST_MESSAGES: usize = 2_000_000;

type Moving = Vec<(i64, Isometry3<f64>)>;

#[derive(Default)]
struct Bag {
    /// By child: its parent, whether it is static, its poses by time.
    frames: BTreeMap<String, (String, bool, Moving)>,
    /// By topic.
    poses: BTreeMap<String, Moving>,
    joints: BTreeMap<String, Vec<(i64, Vec<f64>)>>,
    cameras: BTreeMap<String, FoundCamera>,
    /// Stamps of images by topic.
    images: BTreeMap<String, Vec<i64>>,
}

/// Takes what a bag has into a recording; `parts` are its files in order.
///
/// # Errors
/// A sentence, where it is no bag or its images cannot be unpacked.
pub(in crate::project::import) fn read(file: &str, parts: &[PathBuf], recording: &mut Recording) -> Result<(), String> {
    let mut bag = Bag::default();
    for part in parts {
        storage::visit(part, &mut |message| bag.take(&message))?;
    }
    bag.sort();
    if bag.images.is_empty() {
        return Err("has no images".into());
    }
    let mut chosen: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    for (topic, stamps) in &bag.images {
        let rests = bag.rests(stamps);
        recording.beliefs.push(format!(
            "{file}: {} images on {topic}, {} of them taken where everything stood still",
            stamps.len(),
            rests.len()
        ));
        if rests.len() >= tree::LEAST_POSES {
            chosen.insert(topic.clone(), rests);
        }
    }
    if chosen.is_empty() {
        return Err("has no three instants at which the robot stood still, by its transforms or joint values".into());
    }
    images::unpack(file, parts, &chosen, recording)?;
    for (topic, stamps) in &chosen {
        recording.tracks.extend(bag.tracks(file, topic, stamps));
    }
    recording.cameras.extend(bag.cameras.into_values());
    Ok(())
}

impl Bag {
    fn take(&mut self, message: &storage::Message) {
        // A message that is not as its type says is left out.
        let _read = self.read(message.topic, message.kind, message.data, message.log_ns);
    }

    fn read(&mut self, topic: &str, kind: &str, data: &[u8], log_ns: i64) -> Option<()> {
        let mut reader = Reader::new(data)?;
        match kind {
            "tf2_msgs/msg/TFMessage" => {
                let count = reader.u32()?.min(10_000);
                let is_static = topic.ends_with("tf_static");
                for _ in 0..count {
                    let header = reader.header()?;
                    let child = reader.text()?;
                    let pose = reader.transform()?;
                    let parent = header.frame.trim_start_matches('/').to_owned();
                    let child = child.trim_start_matches('/').to_owned();
                    let frame = self.frames.entry(child).or_insert_with(|| (parent.clone(), is_static, Vec::new()));
                    frame.0 = parent;
                    if frame.2.len() < MOST_MESSAGES {
                        frame.2.push((header.stamp_ns, pose));
                    }
                }
            }
            "geometry_msgs/msg/PoseStamped" | "geometry_msgs/msg/TransformStamped" => {
                let header = reader.header()?;
                if kind.ends_with("TransformStamped") {
                    reader.text()?;
                }
                let pose = reader.transform()?;
                self.poses.entry(topic.to_owned()).or_default().push((header.stamp_ns, pose));
            }
            "sensor_msgs/msg/JointState" => {
                let header = reader.header()?;
                let names = reader.u32()?.min(10_000);
                for _ in 0..names {
                    reader.text()?;
                }
                let values = reader.f64s()?;
                self.joints.entry(topic.to_owned()).or_default().push((header.stamp_ns, values));
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
                let why = "CameraInfo".to_owned();
                self.cameras.insert(topic.to_owned(), FoundCamera { name: topic.to_owned(), intrinsics, why });
            }
            "sensor_msgs/msg/Image" | "sensor_msgs/msg/CompressedImage" => {
                let stamp = reader.header()?.stamp_ns;
                // Drivers without a clock leave the stamp at zero.
                let stamp = if stamp == 0 { log_ns } else { stamp };
                self.images.entry(topic.to_owned()).or_default().push(stamp);
            }
            _ => {}
        }
        Some(())
    }

    fn sort(&mut self) {
        for (.., moving) in self.frames.values_mut() {
            moving.sort_by_key(|(stamp, _)| *stamp);
        }
        self.poses.values_mut().for_each(|moving| moving.sort_by_key(|(stamp, _)| *stamp));
        self.joints.values_mut().for_each(|values| values.sort_by_key(|(stamp, _)| *stamp));
        self.images.values_mut().for_each(|stamps| stamps.sort_unstable());
    }

    /// Of every rest the image in its middle.
    fn rests(&self, stamps: &[i64]) -> Vec<i64> {
        let mut out = Vec::new();
        let mut rest: Vec<i64> = Vec::new();
        for stamp in stamps {
            let goes_on = rest.first().is_none_or(|first| self.is_still(*first, *stamp));
            if self.is_still(stamp.saturating_sub(REST_NS), stamp.saturating_add(REST_NS)) && goes_on {
                rest.push(*stamp);
                continue;
            }
            out.extend(rest.get(rest.len() / 2).copied());
            rest.clear();
        }
        out.extend(rest.get(rest.len() / 2).copied());
        out.truncate(MOST_IMAGES);
        out
    }

    /// Whether nothing moves from one time to another, as far as anything says so.
    fn is_still(&self, from: i64, to: i64) -> bool {
        let mut said = false;
        let moving = self.frames.values().filter(|(_, is_static, _)| !is_static).map(|(.., moving)| moving);
        for moving in moving.chain(self.poses.values()) {
            let within = between(moving, from, to);
            let Some((_, first)) = within.first() else { continue };
            said |= within.len() > 1;
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
            said |= within.len() > 1;
            let is_near = |other: &Vec<f64>| other.iter().zip(first).all(|(a, b)| (a - b).abs() < STILL_RAD);
            if !within.iter().all(|(_, other)| is_near(other)) {
                return false;
            }
        }
        said
    }

    /// The series of the robot's poses at these times: of every frame that may be the tip, and of every topic of poses.
    fn tracks(&self, file: &str, topic: &str, stamps: &[i64]) -> Vec<Track> {
        let mut out = Vec::new();
        for tip in self.tips() {
            let poses: Vec<Option<Isometry3<f64>>> = stamps.iter().map(|stamp| self.root_from(&tip, *stamp)).collect();
            let root = self.root_of(&tip);
            let why = format!("the tree of frames: {tip} in {root}");
            out.extend(self.track(file, topic, &format!("tf:{root}->{tip}"), stamps, &poses, &why));
        }
        for (name, moving) in &self.poses {
            let poses: Vec<_> = stamps.iter().map(|stamp| nearest(moving, *stamp)).collect();
            let why = format!("poses on {name}, taken to be of the tip in the base");
            let mut track = self.track(file, topic, name, stamps, &poses, &why);
            // A message of a pose does not say which way it is meant.
            if let Some(track) = &mut track {
                track.stated.direction = None;
                track.role = tree::role(name);
            }
            out.extend(track);
        }
        out
    }

    fn track(
        &self,
        file: &str,
        topic: &str,
        name: &str,
        stamps: &[i64],
        poses: &[Option<Isometry3<f64>>],
        why: &str,
    ) -> Option<Track> {
        let sample = |(stamp, pose): (&i64, &Option<Isometry3<f64>>)| {
            let pose = (*pose)?;
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            let joints = self.joints.values().find_map(|values| {
                let at = values.iter().min_by_key(|(other, _)| other.abs_diff(*stamp))?;
                (at.0.abs_diff(*stamp) < REST_NS.unsigned_abs()).then(|| at.1.clone())
            });
            Some(Sample {
                image: Some(images::name(topic, *stamp)),
                number: None,
                place: format!("{file}, {name} at {:.3} s", *stamp as f64 * 1e-9),
                numbers: Numbers::Quaternion([t.x, t.y, t.z, q.x, q.y, q.z, q.w]),
                joints: joints.unwrap_or_default(),
            })
        };
        let samples: Vec<Sample> = stamps.iter().zip(poses).filter_map(sample).collect();
        let stated = Stated {
            length: Some(Known::by("ROS has metres", LengthUnit::Metre)),
            rotation: Some(Known::by("ROS has x y z w", vec![RotationForm::Xyzw])),
            direction: Some(Known::by(why, Direction::Forward)),
            ..Stated::default()
        };
        let mut track = tree::track(format!("{file}:{name}"), "robot", stated, samples)?;
        track.role = Role::Robot;
        Some(track)
    }

    fn root_of(&self, frame: &str) -> String {
        let mut at = frame;
        for _ in 0..self.frames.len() {
            match self.frames.get(at) {
                Some((parent, ..)) => at = parent,
                None => break,
            }
        }
        at.to_owned()
    }

    fn root_from(&self, frame: &str, stamp: i64) -> Option<Isometry3<f64>> {
        let (mut at, mut pose) = (frame, Isometry3::identity());
        for _ in 0..=self.frames.len() {
            let Some((parent, is_static, moving)) = self.frames.get(at) else { return Some(pose) };
            let own = if *is_static { moving.last().map(|(_, pose)| *pose)? } else { nearest(moving, stamp)? };
            pose = own * pose;
            at = parent;
        }
        // A circle.
        None
    }

    fn moves(&self, frame: &str) -> bool {
        let mut at = frame;
        for _ in 0..=self.frames.len() {
            let Some((parent, is_static, moving)) = self.frames.get(at) else { return false };
            if !is_static && moving.iter().any(|(_, pose)| *pose != moving[0].1) {
                return true;
            }
            at = parent;
        }
        false
    }

    /// Frames that may be the tip: those that are called so, and the last that moves in its parent.
    fn tips(&self) -> Vec<String> {
        const NAMES: [&str; 9] = ["tool", "flange", "tcp", "ee", "tip", "hand", "gripper", "effector", "wrist_3"];
        let is_called = |name: &str| {
            let name = name.to_lowercase();
            NAMES.iter().any(|tip| name.split(['_', '/', '-']).any(|w| w.starts_with(tip)) || name.contains("wrist_3"))
        };
        let is_last = |name: &str| {
            let below = self.frames.iter().any(|(_, (parent, is_static, _))| parent == name && !is_static);
            self.frames.get(name).is_some_and(|(_, is_static, _)| !is_static) && !below
        };
        let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<String> {
            self.frames.keys().filter(|name| self.moves(name) && wanted(name)).take(MOST_TIPS).cloned().collect()
        };
        let called = of(&is_called);
        if called.is_empty() { of(&is_last) } else { called }
    }
}

/// What lies between two times.
fn between<T>(values: &[(i64, T)], from: i64, to: i64) -> &[(i64, T)] {
    let start = values.partition_point(|(stamp, _)| *stamp < from);
    let end = values.partition_point(|(stamp, _)| *stamp <= to);
    &values[start..end.max(start)]
}

/// The pose nearest in time, if it is near.
fn nearest(moving: &[(i64, Isometry3<f64>)], stamp: i64) -> Option<Isometry3<f64>> {
    let within = between(moving, stamp.saturating_sub(REST_NS), stamp.saturating_add(REST_NS));
    within.iter().min_by_key(|(other, _)| other.abs_diff(stamp)).map(|(_, pose)| *pose)
}

#[cfg(test)]
mod tests;
