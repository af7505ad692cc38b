//! Poses of a moving robot at the times of images: the offset of the two clocks is estimated from the motion that both
//! observed, and refused where it is not determined.

use std::collections::HashSet;
use std::sync::Arc;

use nalgebra::Isometry3;

use super::conventions::{Direction, LengthUnit, RotationForm};
use super::error::ImportError;
use super::formats::tree;
use super::judge::Sights;
use super::recording::{Clocks, ImageFile, Known, Motion, Numbers, Recording, Role, Sample, Stated, Stream, Track};
use super::settings::Settings;
use super::sight::Sight;
use handeye_estimate::diagnose::hypotheses::agreement::agreement;
use handeye_estimate::diagnose::hypotheses::rules_out;
use handeye_estimate::handeye::{PosePair, subset};
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::progress::CancelToken;
use handeye_pairs::clock_offset::{ClockOffset, ClockOffsetError, clock_offset, pose_at};
use handeye_wording::text;

/// Clocks of one bag that are set by the network are apart by less.
const WITHIN_S: f64 = 2.0;
/// Views that are made of images of a moving robot: more of them are of neighbouring places.
const MOST_VIEWS: usize = 60;
/// Pairs by which the two places of the camera are compared.
const MOST_COMPARED: usize = 60;
/// Half of the time over which a speed is measured.
const SPEED_S: f64 = 0.02;

/// Gives images of a moving robot their poses, and keeps of the images those in which the robot was slowest.
///
/// Where the offset of the clocks cannot be determined, the images at which the robot was at rest are kept, if there are at
/// least three.
///
/// `None` where no stream has stamps; `sights` are those of the recording that comes back.
///
/// # Errors
/// [`ImportError::Clocks`] where the offset of the clocks cannot be determined and the robot was hardly at rest.
pub fn timed(
    recording: &Recording,
    sights: &mut Sights,
    settings: &Settings,
    cancel: &CancelToken,
) -> Result<Option<Recording>, ImportError> {
    let mut out = recording.clone();
    let mut is_timed = false;
    for i in 0..recording.streams.len() {
        let stream = &recording.streams[i];
        let Some(sight) = sights.streams.get(i).and_then(Option::as_ref) else { continue };
        let Some(first_ns) = stream.images.iter().find_map(|image| image.stamp_ns) else { continue };
        let seen = seen(stream, sight, first_ns);
        let mut found = Vec::new();
        let mut refusal = None;
        let is_wanted = |motion: &&Motion| match &settings.poses {
            Some(name) => *name == motion.name,
            None => motion.role != Role::Target,
        };
        for motion in recording.motions.iter().filter(is_wanted) {
            match stated(motion, &seen, sight, first_ns, settings, cancel) {
                Ok(offset) => found.push((motion, offset)),
                Err(why) => {
                    refusal =
                        Some(ImportError::Clocks { images: stream.name.clone(), poses: motion.name.clone(), why });
                }
            }
        }
        let Some((motion, offset)) = found.first() else {
            // Without a robot there is no time reference, which is reported later.
            let Some(refusal) = refusal else { continue };
            if !stood(recording, &mut out, sights, i, &refusal) {
                return Err(refusal);
            }
            is_timed = true;
            continue;
        };
        is_timed = true;
        let chosen =
            slowest(&seen, &anchor_from_mount(motion, Direction::Forward, first_ns), offset, sight.target.distance_m);
        for (motion, offset) in &found {
            out.tracks.extend(track(motion, stream, offset, &chosen, first_ns));
            let (images, poses) = (stream.name.clone(), motion.name.clone());
            let clocks = Clocks { images, poses, offset: *offset, count: seen.len() };
            out.beliefs.push(clocks.text());
            out.clocks.push(clocks);
        }
        let kept = |index: &usize| stream.images[*index].clone();
        out.streams[i].images = chosen.iter().map(kept).collect();
        sights.streams[i] = Some(sight.of_images(&chosen));
    }
    Ok(is_timed.then_some(out))
}

/// Keeps the images of a stream at which the robot was at rest, with their poses; returns whether there are enough.
fn stood(recording: &Recording, out: &mut Recording, sights: &mut Sights, i: usize, refusal: &ImportError) -> bool {
    let stream = &recording.streams[i];
    let Some(sight) = sights.streams.get(i).and_then(Option::as_ref) else { return false };
    let name = |image: &ImageFile| image.path.file_name().map(|name| name.to_string_lossy().into_owned());
    let names: HashSet<String> = stream.images.iter().filter_map(name).collect();
    let is_of_stream = |track: &&Track| {
        let images = track.samples.iter().filter(|it| it.image.as_ref().is_some_and(|image| names.contains(image)));
        images.count() >= tree::LEAST_POSES
    };
    let tracks: Vec<Track> = recording.at_rest.iter().filter(is_of_stream).cloned().collect();
    let at_rest: HashSet<&String> =
        tracks.iter().flat_map(|track| &track.samples).filter_map(|it| it.image.as_ref()).collect();
    let is_at_rest = |image: &usize| name(&stream.images[*image]).is_some_and(|name| at_rest.contains(&name));
    let kept: Vec<usize> = (0..stream.images.len()).filter(is_at_rest).collect();
    if tracks.is_empty() || kept.iter().filter(|image| sight.seen[**image].is_some()).count() < tree::LEAST_POSES {
        return false;
    }
    out.warnings.push(text!(
        "{refusal}. Of {stream} only the {count} images at which the robot stood are used, which are few",
        refusal = refusal,
        stream = &stream.name,
        count = kept.len()
    ));
    out.streams[i].images =
        kept.iter().map(|image| ImageFile { stamp_ns: None, ..stream.images[*image].clone() }).collect();
    sights.streams[i] = Some(sight.of_images(&kept));
    out.tracks.extend(tracks);
    true
}

/// An image in which the target was seen: its place in the stream, its time in seconds after the first image, the pose of
/// the target.
type Seen = (usize, f64, Isometry3<f64>);

fn seen(stream: &Stream, sight: &Sight, first_ns: i64) -> Vec<Seen> {
    let one = |(index, image): (usize, &ImageFile)| {
        Some((index, seconds(image.stamp_ns?, first_ns), (*sight.seen.get(index)?)?))
    };
    let mut seen: Vec<Seen> = stream.images.iter().enumerate().filter_map(one).collect();
    seen.sort_by(|a, b| a.1.total_cmp(&b.1));
    seen.dedup_by(|a, b| a.1 == b.1);
    seen
}

/// Stamps count from 1970, which leaves a float too few digits.
fn seconds(stamp_ns: i64, first_ns: i64) -> f64 {
    stamp_ns.saturating_sub(first_ns) as f64 * 1e-9
}

fn anchor_from_mount(motion: &Motion, class: Direction, first_ns: i64) -> Vec<(f64, Pose<Anchor, Mount>)> {
    motion.poses.iter().map(|(ns, pose)| (seconds(*ns, first_ns), Pose::from_isometry(class.of(pose)))).collect()
}

/// The offset under the place of the camera and the direction of the poses that explain what was seen.
fn stated(
    motion: &Motion,
    seen: &[Seen],
    sight: &Sight,
    first_ns: i64,
    settings: &Settings,
    cancel: &CancelToken,
) -> Result<ClockOffset, ClockOffsetError> {
    let about_s = settings.clock_offset_s.unwrap_or(0.0);
    let camera: Vec<(f64, Pose<Camera, Target>)> =
        seen.iter().map(|(_, time_s, pose)| (time_s + about_s, Pose::from_isometry(*pose))).collect();
    let mut stated: Vec<(f64, ClockOffset)> = Vec::new();
    let mut refusal = None;
    for class in classes(motion, settings) {
        let robot = anchor_from_mount(motion, class, first_ns);
        match clock_offset(&robot, &camera, WITHIN_S, cancel) {
            Err(why) => refusal = Some(why),
            Ok(offset) => {
                let pair = |(time_s, camera_from_target): &(f64, Pose<Camera, Target>)| {
                    let anchor_from_mount = pose_at(&robot, time_s + offset.offset_s)?;
                    Some(PosePair { anchor_from_mount, camera_from_target: *camera_from_target })
                };
                let pairs: Vec<PosePair> = camera.iter().filter_map(pair).collect();
                let pairs: Vec<PosePair> =
                    subset::spread(pairs.len(), MOST_COMPARED).into_iter().map(|i| pairs[i]).collect();
                let left = agreement(&sight.target.outer, &pairs, true).map_or(f64::INFINITY, |found| found.median_m);
                stated.push((left, ClockOffset { offset_s: offset.offset_s + about_s, ..offset }));
            }
        }
    }
    stated.sort_by(|a, b| a.0.total_cmp(&b.0));
    match (stated.as_slice(), refusal) {
        ([(_, best)], _) => Ok(*best),
        ([(left, best), (other_left, other)], _) => {
            let apart_s = (best.offset_s - other.offset_s).abs();
            if rules_out(*left, *other_left) || apart_s <= best.sigma_s.max(other.sigma_s) {
                Ok(*best)
            } else {
                Err(ClockOffsetError::Ambiguous { first_s: best.offset_s, second_s: other.offset_s })
            }
        }
        (_, Some(why)) => Err(why),
        _ => Err(ClockOffsetError::Apart { within_s: WITHIN_S }),
    }
}

/// With the camera next to the robot (eye to hand), the mount moves by the inverse of the recorded poses.
fn classes(motion: &Motion, settings: &Settings) -> Vec<Direction> {
    let direction = settings.direction.or(motion.direction.as_ref().map(|known| known.value));
    match settings.mode.zip(direction) {
        Some((mode, direction)) => vec![direction.of_mount(mode)],
        None => Direction::ALL.to_vec(),
    }
}

/// The image in every part of the recording in which the robot was slowest: the least blurred, and the least sensitive to
/// an error of the clocks.
fn slowest(seen: &[Seen], robot: &[(f64, Pose<Anchor, Mount>)], offset: &ClockOffset, distance_m: f64) -> Vec<usize> {
    let speed = |(index, time_s, _): &Seen| -> Option<(f64, usize)> {
        let at = |by_s: f64| pose_at(robot, time_s + offset.offset_s + by_s);
        let (before, after) = (at(-SPEED_S)?, at(SPEED_S)?);
        let (metres, radians) = before.distance_to(&after);
        Some((metres + radians * distance_m, *index))
    };
    let usable: Vec<(f64, usize)> = seen.iter().filter_map(speed).collect();
    let of_part = |part: &[(f64, usize)]| part.iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, index)| *index);
    usable.chunks(usable.len().div_ceil(MOST_VIEWS).max(1)).filter_map(of_part).collect()
}

fn track(motion: &Motion, stream: &Stream, offset: &ClockOffset, chosen: &[usize], first_ns: i64) -> Option<Track> {
    let robot = anchor_from_mount(motion, Direction::Forward, first_ns);
    let sample = |index: &usize| {
        let image = &stream.images[*index];
        let time_s = seconds(image.stamp_ns?, first_ns) + offset.offset_s;
        let pose = *pose_at(&robot, time_s)?.isometry();
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        Some(Sample {
            image: Some(image.shown()),
            number: None,
            place: Arc::new(text!(
                "{name} at {seconds} s",
                name = &motion.name,
                seconds = format!("{:.4}", first_ns as f64 * 1e-9 + time_s)
            )),
            numbers: Numbers::Quaternion([t.x, t.y, t.z, q.x, q.y, q.z, q.w]),
            joints: Vec::new(),
        })
    };
    let stated = Stated {
        length: Some(Known::by("ROS has metres", LengthUnit::Metre)),
        rotation: Some(Known::by("ROS has x y z w", vec![RotationForm::Xyzw])),
        direction: motion.direction.clone(),
        ..Stated::default()
    };
    let samples = chosen.iter().filter_map(sample).collect();
    let mut track = tree::track(motion.name.clone(), "robot", stated, samples).filter(|track| !track.is_still())?;
    track.role = motion.role;
    Some(track)
}

#[cfg(test)]
#[path = "timing_tests.rs"]
mod tests;
