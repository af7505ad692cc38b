//! Bags of ROS 2, in MCAP or SQLite, and of ROS 1: images at which the robot was at rest, its poses from the tree of frames or
//! from pose messages, joint values, cameras.
//!
//! Frames of the tree are composed by the stamps of their transforms; an instant is at rest when nothing that moves in the bag
//! moves around it. Of each rest one image is taken. Where there are too few rests, images of the moving robot are, with their
//! stamps, and the robot's poses as they come.

mod contents;
mod frames;
mod images;
mod motion;
mod storage;
mod wire;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Isometry3;

use super::{Encoding, File, Format, joints, tree};
use crate::conventions::{AngleUnit, Direction, LengthUnit, RotationForm};
use crate::folder;
use crate::formats::reader::Reader;
use crate::recording::{JointSeries, Known, Numbers, Recording, Role, Sample, Stated, Track};
use contents::{Bag, Timed, nearest};
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::text;

/// Half of the time around an instant without motion.
const REST_NS: i64 = 250_000_000;
/// What counts as no motion: metres, radians (or metres for prismatic joints).
const STILL_M: f64 = 5e-4;
const STILL_RAD: f64 = 2e-3;
/// Number of rests that give enough views: with fewer the motion between them gives more information.
const ENOUGH_RESTS: usize = 6;
/// Most images that are taken out of a bag.
const MOST_IMAGES: usize = 1000;

pub(super) struct Bags;

impl Format for Bags {
    fn name(&self) -> Text {
        text!("bags of ROS 2 and ROS 1")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        const HOW: Encoding = Encoding::Bag;
        &[("mcap", HOW), ("db3", HOW), ("bag", HOW), ("mcap.zstd", HOW), ("db3.zstd", HOW)]
    }

    fn read_together(&self, files: &[File], reader: &mut Reader<'_>) -> bool {
        for files in bags(files, reader.root) {
            let parts: Vec<PathBuf> = files.iter().map(|file| reader.root.join(file)).collect();
            let name = if files.len() > 1 { folder_of(files[0]) } else { files[0] };
            let read = read(&name.display().to_string(), &parts, reader.budget, &mut reader.recording);
            if let Err(why) = read {
                reader.not_used(files[0], why);
            }
        }
        true
    }
}

fn folder_of(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// The files of every bag: those of ROS 2 with a description file are one, compressed or not; others are each a bag.
fn bags<'a>(files: &'a [File], root: &Path) -> Vec<Vec<&'a Path>> {
    let has_description =
        |file: &Path| folder::ending(file) != "bag" && root.join(folder_of(file)).join("metadata.yaml").is_file();
    let mut bags: Vec<Vec<&Path>> = Vec::new();
    for file in files.iter().map(|file| file.path.as_path()) {
        // Playing a compressed bag leaves its unpacked files next to it.
        if folder::ending(file) == "zstd" && files.iter().any(|other| other.path == file.with_extension("")) {
            continue;
        }
        let open = bags.iter_mut().find(|bag| {
            has_description(file) && folder::ending(bag[0]) != "bag" && folder_of(bag[0]) == folder_of(file)
        });
        match open {
            Some(bag) => bag.push(file),
            None => bags.push(vec![file]),
        }
    }
    bags
}

/// Takes what a bag has into a recording; `parts` are its files in order.
///
/// # Errors
/// A sentence, where it is not a bag, its images cannot be unpacked or the budget is spent.
fn read(file: &str, parts: &[PathBuf], budget: &Budget<'_>, recording: &mut Recording) -> Result<(), Text> {
    let (parts, _scratch) = storage::plain_parts(parts, budget)?;
    let bag = Bag::read(&parts, budget)?;
    if bag.images.is_empty() {
        return Err(text!("has no images"));
    }
    let motions = motion::motions(&bag, file);
    let mut at_rest: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    let mut moving: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    let mut few_rests: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    for (topic, stamps) in &bag.images {
        let rests = rests(&bag, stamps, budget);
        budget.check()?;
        recording.beliefs.push(text!(
            "{file}: {images} images on {topic}, {rests} of them taken where everything stood still",
            file = file,
            images = stamps.len(),
            topic = topic,
            rests = rests.len()
        ));
        let in_motion = motion::chosen(stamps, &motions);
        if rests.len() < ENOUGH_RESTS && !in_motion.is_empty() {
            recording.beliefs.push(text!(
                "{file}: {images} images on {topic} of a robot that moves are looked at, to be given poses by their stamps",
                file = file,
                images = in_motion.len(),
                topic = topic
            ));
            let mut looked_at = in_motion;
            if rests.len() >= tree::LEAST_POSES {
                looked_at.extend(&rests);
                looked_at.sort_unstable();
                looked_at.dedup();
                few_rests.insert(topic.clone(), rests);
            }
            moving.insert(topic.clone(), looked_at);
        } else if rests.len() >= tree::LEAST_POSES {
            at_rest.insert(topic.clone(), rests);
        }
    }
    if at_rest.is_empty() && moving.is_empty() {
        return Err(text!(
            "has no three instants at which the robot stood still, by its transforms or joint values, and not enough \
             images of one that moves"
        ));
    }
    images::unpack(file, &parts, &at_rest, false, budget, recording)?;
    images::unpack(file, &parts, &moving, true, budget, recording)?;
    for (topic, stamps) in &at_rest {
        recording.tracks.extend(tracks(&bag, file, topic, stamps));
        recording.joints.extend(joints(&bag, file, topic, stamps));
    }
    for (topic, stamps) in &few_rests {
        recording.at_rest.extend(tracks(&bag, file, topic, stamps));
    }
    if !moving.is_empty() {
        recording.motions.extend(motions);
    }
    recording.cameras.extend(bag.cameras.into_values());
    Ok(())
}

/// The image in the middle of every rest; only of the first rests when the budget is spent.
fn rests(bag: &Bag, stamps: &[i64], budget: &Budget<'_>) -> Vec<i64> {
    let mut out = Vec::new();
    let mut rest: Vec<i64> = Vec::new();
    for stamp in stamps.iter().take_while(|_| !budget.is_spent()) {
        let goes_on = rest.first().is_none_or(|first| bag.is_still(*first, *stamp));
        if bag.is_still(stamp.saturating_sub(REST_NS), stamp.saturating_add(REST_NS)) && goes_on {
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

/// The series of the robot's poses at these times: of every frame that may be the tip, and of every topic of poses.
fn tracks(bag: &Bag, file: &str, topic: &str, stamps: &[i64]) -> Vec<Track> {
    let mut out = Vec::new();
    for tip in bag.frames.tips() {
        let poses: Vec<Option<Isometry3<f64>>> =
            stamps.iter().map(|stamp| bag.frames.root_from(&tip, *stamp, REST_NS)).collect();
        let root = bag.frames.root_of(&tip);
        let why = format!("the tree of frames: {tip} in {root}");
        out.extend(track(bag, file, topic, &format!("tf:{root}->{tip}"), stamps, &poses, &why));
    }
    for (name, moving) in &bag.poses {
        let poses: Vec<_> = stamps.iter().map(|stamp| nearest(moving, *stamp, REST_NS).copied()).collect();
        let why = format!("poses on {name}, taken to be of the tip in the base");
        let mut track = track(bag, file, topic, name, stamps, &poses, &why);
        // A pose message does not state its direction.
        if let Some(track) = &mut track {
            track.stated.direction = None;
            track.role = tree::role(name);
        }
        out.extend(track);
    }
    out
}

/// The joint values at these times, of every topic and robot.
fn joints(bag: &Bag, file: &str, topic: &str, stamps: &[i64]) -> Vec<JointSeries> {
    let of = |((name, names), values): (&(String, Vec<String>), &Timed<Vec<f64>>)| {
        let sample = |stamp: &i64| {
            let values = nearest(values, *stamp, REST_NS)?.clone();
            Some(joints::sample(place(file, name, *stamp), Some(images::name(topic, *stamp)), None, values))
        };
        let unit = Some(Known::by("ROS has radians", AngleUnit::Radian));
        let samples = stamps.iter().filter_map(sample).collect();
        joints::series(format!("{file}:{name}"), names.clone(), unit, samples)
    };
    bag.joints.iter().filter_map(of).collect()
}

/// The place of a message.
fn place(file: &str, name: &str, stamp_ns: i64) -> Text {
    let seconds = format!("{:.3}", stamp_ns as f64 * 1e-9);
    text!("{file}, {name} at {seconds} s", file = file, name = name, seconds = seconds)
}

fn track(
    bag: &Bag,
    file: &str,
    topic: &str,
    name: &str,
    stamps: &[i64],
    poses: &[Option<Isometry3<f64>>],
    why: &str,
) -> Option<Track> {
    // Joint values of an arm, and not of the gripper that may be published as well.
    let arm = bag.joints.values().max_by_key(|values| values.first().map_or(0, |(_, joints)| joints.len()));
    let sample = |(stamp, pose): (&i64, &Option<Isometry3<f64>>)| {
        let pose = (*pose)?;
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        Some(Sample {
            image: Some(images::name(topic, *stamp)),
            number: None,
            place: Arc::new(place(file, name, *stamp)),
            numbers: Numbers::Quaternion([t.x, t.y, t.z, q.x, q.y, q.z, q.w]),
            joints: arm.and_then(|values| nearest(values, *stamp, REST_NS).cloned()).unwrap_or_default(),
        })
    };
    let samples: Vec<Sample> = stamps.iter().zip(poses).filter_map(sample).collect();
    let stated = Stated {
        length: Some(Known::by("ROS has metres", LengthUnit::Metre)),
        rotation: Some(Known::by("ROS has x y z w", vec![RotationForm::Xyzw])),
        direction: Some(Known::by(why, Direction::Forward)),
        ..Stated::default()
    };
    let mut track =
        tree::track(format!("{file}:{name}"), "robot", stated, samples).filter(|track| !track.is_still())?;
    track.role = Role::Robot;
    Some(track)
}

#[cfg(test)]
mod tests;
