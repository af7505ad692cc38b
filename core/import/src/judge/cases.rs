//! The cases to try: every series with every source, in every pairing, under every open convention.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Isometry3;

use super::Sights;
use crate::conventions::{AngleUnit, Direction, Euler, LengthUnit, Reading, RotationForm, angles_for, lengths_for};
use crate::error::{ImportError, reasons};
use crate::formats::tree::LEAST_POSES;
use crate::formats::with_poses;
use crate::hypothesis::{Hypothesis, Source};
use crate::pairing::{Pairing, pairings};
use crate::recording::{ImageFile, Numbers, Recording, Role, Sample, Stated, Track};
use crate::settings::Settings;
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::motion::NO_ROTATION_RAD;
use handeye_geometry::statistics::median;
use handeye_wording::Text;
use handeye_wording::text;

/// Targets are not seen from nearer or farther than this, metres.
const NEAREST_M: f64 = 0.03;
const FARTHEST_M: f64 = 20.0;

/// Series of the robot with a source each that are paired: all for up to sixteen series of each. Where there are more, those
/// come first whose names denote the robot and the target, and that are equally long.
const MOST_SOURCES: usize = 256;
/// Hypotheses that are tried; a recording of one robot and one camera has some hundreds.
const MOST_CASES: usize = 50_000;

/// A hypothesis as it is tried: both places of the camera that give its equations are one.
pub(super) struct Case {
    pub source: Source,
    pub robot: usize,
    pub pairing: usize,
    pub reading: Reading,
    pub target_reading: Option<(Reading, Direction)>,
    /// `anchor_from_mount` is what is written, or its inverse.
    pub class: Direction,
    /// The places of the camera and the directions that mean it.
    pub labels: Vec<(Mode, Direction)>,
    /// Difference between the angles of robot and target.
    pub unlike_rad: f64,
}

impl Case {
    /// The case of a hypothesis, without its pairing.
    pub fn of(h: &Hypothesis) -> Self {
        Self {
            source: h.source,
            robot: h.robot,
            pairing: 0,
            reading: h.reading,
            target_reading: h.target_reading,
            class: h.direction.of_mount(h.mode),
            labels: Vec::new(),
            unlike_rad: f64::INFINITY,
        }
    }
}

/// A way to pair a source with a series.
pub(super) struct Paired {
    pub source: Source,
    pub robot: usize,
    pub pairing: Pairing,
}

/// Every pair of a series of the robot and a source of the target, in every pairing; and how many such pairs are left out.
pub(super) fn sources(
    recording: &Recording,
    sights: &Sights,
    settings: &Settings,
) -> Result<(Vec<Paired>, usize), ImportError> {
    let named = |name: &Option<String>, key: &str, of: Vec<&str>| match name {
        Some(name) if !of.contains(&name.as_str()) => Err(ImportError::BadChoice {
            key: key.into(),
            value: name.clone(),
            choices: if of.is_empty() { text!("there are none") } else { Text::verbatim(of.join(", ")) },
        }),
        _ => Ok(()),
    };
    let track_names: Vec<&str> = recording.tracks.iter().map(|t| t.name.as_str()).collect();
    named(&settings.poses, "poses", track_names.clone())?;
    named(&settings.target_poses, "target_poses", track_names)?;
    named(&settings.images, "images", recording.streams.iter().map(|s| s.name.as_str()).collect())?;
    let is_wanted = |name: &str, wanted: &Option<String>| wanted.as_deref().is_none_or(|wanted| wanted == name);
    let robots = |track: &Track| {
        let named = settings.poses.is_some() && is_wanted(&track.name, &settings.poses);
        named || (track.role != Role::Target && settings.poses.is_none())
    };
    let with_images = settings.target_poses.is_none() && sights.streams.iter().any(Option::is_some);
    let mut pairs: Vec<(Source, usize)> = Vec::new();
    for robot in (0..recording.tracks.len()).filter(|i| robots(&recording.tracks[*i])) {
        if with_images {
            for (i, stream) in recording.streams.iter().enumerate() {
                if sights.streams.get(i).is_some_and(Option::is_some) && is_wanted(&stream.name, &settings.images) {
                    pairs.push((Source::Stream(i), robot));
                }
            }
            continue;
        }
        for (i, target) in recording.tracks.iter().enumerate() {
            let is_target = if settings.target_poses.is_some() {
                is_wanted(&target.name, &settings.target_poses)
            } else {
                target.role != Role::Robot || settings.poses.is_some()
            };
            let is_itself = |a: &Track, b: &Track| a.reading_of.as_ref() == Some(&b.name);
            let robot_track = &recording.tracks[robot];
            let is_same = i == robot || is_itself(target, robot_track) || is_itself(robot_track, target);
            if !is_same && is_target {
                pairs.push((Source::Track(i), robot));
            }
        }
    }
    let untried = pairs.len().saturating_sub(MOST_SOURCES);
    if untried > 0 {
        pairs.sort_by_key(|(source, robot)| rarity(recording, *source, *robot));
        pairs.truncate(MOST_SOURCES);
    }
    let mut out = Vec::new();
    let mut rules = Vec::new();
    let mut still = None;
    for (source, robot) in pairs {
        let of_target;
        let images: &[ImageFile] = match source {
            Source::Stream(i) => &recording.streams[i].images,
            Source::Track(i) => {
                of_target = as_images(&recording.tracks[i]);
                &of_target
            }
        };
        let samples = &recording.tracks[robot].samples;
        let is_of_same_rows = |target: &Track| {
            target.samples.len() == samples.len() && target.samples.iter().zip(samples).all(|(a, b)| a.place == b.place)
        };
        let of_rows = matches!(source, Source::Track(i) if is_of_same_rows(&recording.tracks[i]));
        let is_in_step = |pairing: &Pairing| pairing.image_of.iter().enumerate().all(|(i, image)| *image == Some(i));
        // Two poses of one row are of one moment.
        for pairing in pairings(samples, images, LEAST_POSES).into_iter().filter(|it| !of_rows || is_in_step(it)) {
            if !moves(recording, robot, source, &pairing) {
                still = Some(robot);
                continue;
            }
            rules.push(pairing.rule.clone());
            // Pairings by content are made after the others.
            if settings.pairing.as_deref().is_none_or(|rule| rule == pairing.rule || rule == "aligned") {
                out.push(Paired { source, robot, pairing });
            }
        }
    }
    if out.is_empty() {
        if let Some(still) = recording.still.iter().find(|track| track.role != Role::Target) {
            return Err(ImportError::DidNotMove {
                folder: recording.root.clone(),
                series: still.name.clone(),
                count: still.samples.len(),
                spread_mm_deg: None,
            });
        }
        if let Some(rule) = settings.pairing.as_ref().filter(|rule| !rules.contains(rule) && !rules.is_empty()) {
            let choices = Text::verbatim(rules.join(", "));
            return Err(ImportError::BadChoice { key: "pairing".into(), value: rule.clone(), choices });
        }
        let seen = if let Some(robot) = still {
            text!(
                "with {series} there are not {need} different poses of the robot and of the target",
                series = &recording.tracks[robot].name,
                need = LEAST_POSES
            )
        } else if let (true, Some(series)) =
            (recording.tracks.iter().all(|t| t.role == Role::Target), recording.joints.first())
        {
            text!(
                "{series} has joint values alone: name the arm that they are of with arm=NAME, or its URDF file",
                series = &series.name
            )
        } else if recording.tracks.is_empty() && !recording.nothing.is_empty() {
            reasons(recording.nothing.clone())
        } else if recording.tracks.is_empty() {
            text!("no file has poses of 6, 7, 12 or 16 numbers")
        } else if with_images {
            text!("none of the series of poses has as many as images")
        } else {
            text!(
                "there are poses in {series}, and neither images in which a target was found nor poses of a target beside them",
                series = recording.tracks.iter().map(|t| t.name.as_str()).take(5).collect::<Vec<_>>().join(", ")
            )
        };
        let need = LEAST_POSES;
        return Err(ImportError::NoPoses {
            folder: recording.root.clone(),
            need,
            formats: Box::new(with_poses()),
            seen,
        });
    }
    Ok((out, untried))
}

/// How unlikely it is that a series is the robot's and a source what the camera saw, by their names and lengths.
fn rarity(recording: &Recording, source: Source, robot: usize) -> (usize, usize) {
    let robot = &recording.tracks[robot];
    let (is_named, count) = match source {
        Source::Stream(i) => (true, recording.streams[i].images.len()),
        Source::Track(i) => (recording.tracks[i].role == Role::Target, recording.tracks[i].samples.len()),
    };
    (usize::from(robot.role != Role::Robot) + usize::from(!is_named), count.abs_diff(robot.samples.len()))
}

/// Whether a pairing has as many different poses of the robot, and of a target whose poses are recorded, as a recording has at
/// least: two calibrations that are printed one after the other, some of them repeated, do not count.
fn moves(recording: &Recording, robot: usize, source: Source, pairing: &Pairing) -> bool {
    let different = |track: usize, of: &mut dyn Iterator<Item = usize>| {
        let samples = &recording.tracks[track].samples;
        let mut known: Vec<&Numbers> = Vec::new();
        for numbers in of.filter_map(|i| samples.get(i)).map(|sample| &sample.numbers) {
            if !known.contains(&numbers) {
                known.push(numbers);
            }
            if known.len() >= LEAST_POSES {
                return true;
            }
        }
        false
    };
    let mut robots = pairing.image_of.iter().enumerate().filter(|(_, image)| image.is_some()).map(|(i, _)| i);
    let of_robot = different(robot, &mut robots);
    of_robot
        && match source {
            Source::Stream(_) => true,
            Source::Track(target) => different(target, &mut pairing.image_of.iter().copied().flatten()),
        }
}

/// Poses of a target replace the images that they were found in.
fn as_images(track: &Track) -> Vec<ImageFile> {
    let image = |(i, sample): (usize, &Sample)| ImageFile {
        // In the order of the series, whatever they are called.
        path: sample.image.clone().unwrap_or_else(|| format!("{:06}", i + 1)).into(),
        number: sample.number,
        same_as: None,
        stamp_ns: None,
    };
    track.samples.iter().enumerate().map(image).collect()
}

/// Largest magnitudes of lengths and of angles in a series.
fn largest(track: &Track) -> (f64, f64) {
    let mut out = (0.0f64, 0.0f64);
    for sample in &track.samples {
        let (lengths, angles): (Vec<f64>, Vec<f64>) = match &sample.numbers {
            Numbers::Angles(n) => (n[..3].to_vec(), n[3..].to_vec()),
            Numbers::Quaternion(n) => (n[..3].to_vec(), Vec::new()),
            Numbers::Matrix(m) => ((0..3).map(|i| m[(i, 3)]).collect(), Vec::new()),
        };
        out.0 = lengths.into_iter().map(f64::abs).fold(out.0, f64::max);
        out.1 = angles.into_iter().map(f64::abs).fold(out.1, f64::max);
    }
    out
}

/// Possible meanings of the numbers of a series.
fn readings(
    track: &Track,
    length: Option<LengthUnit>,
    angle: Option<AngleUnit>,
    rotation: Option<RotationForm>,
) -> Vec<Reading> {
    let Some(first) = track.samples.first() else { return Vec::new() };
    let (largest_length, largest_angle) = largest(track);
    let Stated { length: stated_length, angle: stated_angle, rotation: stated_rotation, .. } = &track.stated;
    // A person knows better than a file.
    let lengths = match (length, stated_length) {
        (Some(unit), _) => vec![unit],
        (None, Some(known)) => vec![known.value],
        (None, None) => lengths_for(largest_length),
    };
    let forms = match (rotation, stated_rotation) {
        (Some(form), _) => vec![form],
        (None, Some(known)) => known.value.clone(),
        (None, None) => RotationForm::all_for(&first.numbers),
    };
    let mut out = Vec::new();
    for form in forms {
        let angles = match (angle, stated_angle, form.has_angles()) {
            (_, _, false) => vec![AngleUnit::Radian],
            (Some(unit), ..) => vec![unit],
            (None, Some(known), true) => vec![known.value],
            (None, None, true) => angles_for(largest_angle),
        };
        for angle in angles {
            for length in &lengths {
                let reading = Reading { length: *length, angle, rotation: form };
                if reading.transform(&first.numbers).is_some() {
                    out.push(reading);
                }
            }
        }
    }
    out
}

/// The error that the robot was at rest all the time, by one of the possible meanings of its numbers.
pub(super) fn did_not_move(recording: &Recording, paired: &[Paired], settings: &Settings) -> Option<ImportError> {
    // Largest distance between two reported poses of an arm at rest.
    const AT_REST_M: f64 = 1e-3;
    let spread = |track: &Track, reading: &Reading| {
        let poses: Vec<Isometry3<f64>> = track.samples.iter().filter_map(|s| reading.transform(&s.numbers)).collect();
        let first = poses.first()?;
        let apart = |pose: &Isometry3<f64>| {
            ((pose.translation.vector - first.translation.vector).norm(), pose.rotation.angle_to(&first.rotation))
        };
        Some(poses.iter().map(apart).fold((0.0f64, 0.0f64), |all, one| (all.0.max(one.0), all.1.max(one.1))))
    };
    let robots: BTreeSet<usize> = paired.iter().map(|pair| pair.robot).collect();
    robots.into_iter().find_map(|robot| {
        let track = &recording.tracks[robot];
        let readings = readings(track, settings.length, settings.angle, settings.rotation);
        let mut spreads = readings.iter().filter_map(|reading| spread(track, reading));
        let (metres, radians) = spreads.find(|(m, rad)| *m < AT_REST_M && *rad < NO_ROTATION_RAD)?;
        Some(ImportError::DidNotMove {
            folder: recording.root.clone(),
            series: track.name.clone(),
            count: track.samples.len(),
            spread_mm_deg: Some((metres * 1e3, radians.to_degrees())),
        })
    })
}

/// The hypotheses, as many as are tried, and how many more there are.
pub(super) fn cases(recording: &Recording, paired: &[Paired], settings: &Settings) -> (Vec<Case>, usize) {
    let (mut out, mut untried) = (Vec::new(), 0);
    let mut of_robots: BTreeMap<usize, Vec<Reading>> = BTreeMap::new();
    let mut of_targets: BTreeMap<usize, Vec<Option<(Reading, Direction)>>> = BTreeMap::new();
    for (number, pair) in paired.iter().enumerate() {
        let track = &recording.tracks[pair.robot];
        let of_robot = of_robots
            .entry(pair.robot)
            .or_insert_with(|| readings(track, settings.length, settings.angle, settings.rotation));
        let mut robot_readings = of_robot.clone();
        if matches!(pair.source, Source::Track(_)) {
            robot_readings = without_centimetres(robot_readings);
        }
        let images = vec![None];
        let target_readings: &[Option<(Reading, Direction)>] = match pair.source {
            Source::Stream(_) => &images,
            Source::Track(i) => of_targets
                .entry(i)
                .or_insert_with(|| target_readings(&recording.tracks[i], settings).into_iter().map(Some).collect()),
        };
        for class in Direction::ALL {
            let labels = labels(recording, track, class, settings);
            if labels.is_empty() {
                continue;
            }
            let count = robot_readings.len() * target_readings.len();
            if out.len() + count > MOST_CASES {
                untried += count;
                continue;
            }
            for reading in &robot_readings {
                for target_reading in target_readings {
                    out.push(Case {
                        source: pair.source,
                        robot: pair.robot,
                        pairing: number,
                        reading: *reading,
                        target_reading: *target_reading,
                        class,
                        labels: labels.clone(),
                        unlike_rad: f64::INFINITY,
                    });
                }
            }
        }
    }
    (out, untried)
}

/// When both sides are in one unit no data show which it is, and recordings of both in centimetres are not known: only
/// where it is the only unit left.
fn without_centimetres(readings: Vec<Reading>) -> Vec<Reading> {
    let is_other = |reading: &Reading| reading.length != LengthUnit::Centimetre;
    if readings.iter().any(is_other) { readings.into_iter().filter(is_other).collect() } else { readings }
}

fn target_readings(track: &Track, settings: &Settings) -> Vec<(Reading, Direction)> {
    let readings = readings(track, settings.target_length, None, settings.target_rotation);
    let mut readings = without_centimetres(readings);
    readings.retain(|reading| {
        let distances = track.samples.iter().filter_map(|s| reading.transform(&s.numbers));
        let distance_m = median(distances.map(|pose| pose.translation.vector.norm()));
        distance_m.is_some_and(|distance_m| (NEAREST_M..FARTHEST_M).contains(&distance_m))
    });
    // Poses of a target are written by programs, which have vectors, quaternions and matrices, and seldom angles.
    if readings.len() > 12 {
        let common = [RotationForm::Vector, RotationForm::Euler(Euler::RPY), RotationForm::Euler(Euler::KUKA)];
        readings.retain(|reading| common.contains(&reading.rotation));
    }
    let directions = match (settings.target_direction, &track.stated.direction) {
        (Some(direction), _) => vec![direction],
        (None, Some(known)) => vec![known.value],
        (None, None) => Direction::ALL.to_vec(),
    };
    directions.iter().flat_map(|d| readings.iter().map(move |r| (*r, *d))).collect()
}

/// The places of the camera and the directions that give these equations and that nothing rules out.
fn labels(recording: &Recording, track: &Track, class: Direction, settings: &Settings) -> Vec<(Mode, Direction)> {
    let mode = settings.mode.or(recording.mode.as_ref().map(|known| known.value));
    let allowed = |(place, direction): &(Mode, Direction)| {
        let by_mode = mode.is_none_or(|mode| mode == *place);
        let by_direction = match (settings.direction, &track.stated.direction, &track.stated.direction_in) {
            (Some(set), ..) => set == *direction,
            (None, Some(known), _) => known.value == *direction,
            (None, None, Some(known)) => known.value.contains(&(*place, *direction)),
            (None, None, None) => true,
        };
        by_mode && by_direction
    };
    [Mode::EyeInHand, Mode::EyeToHand].map(|mode| (mode, class.of_mount(mode))).into_iter().filter(allowed).collect()
}
