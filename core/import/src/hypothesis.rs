//! A way to understand a recording, and how well it explains what the camera saw.

use nalgebra::Isometry3;

use super::conventions::{Direction, Reading};
use super::formats::tree::LEAST_POSES;
use super::pairing::Pairing;
use super::recording::{Recording, Sample};
use handeye_estimate::diagnose::hypotheses::{EXPLAINED, EXPLAINED_RAD};
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_wording::Text;

/// What the poses of the target come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Source {
    /// The images of a stream, by its place in [`Recording::streams`].
    Stream(usize),
    /// A series, by its place in [`Recording::tracks`].
    Track(usize),
}

/// One way to understand a recording.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Where the target is seen.
    pub source: Source,
    /// The series of the robot's poses, by its place in [`Recording::tracks`].
    pub robot: usize,
    /// Which image, or which pose of the target, belongs to which pose of the robot.
    pub pairing: Pairing,
    /// What the robot's numbers mean.
    pub reading: Reading,
    /// Which way its poses map.
    pub direction: Direction,
    /// What the numbers of the target's poses mean, and which way they map; `None` with images.
    pub target_reading: Option<(Reading, Direction)>,
    /// Where the camera sits.
    pub mode: Mode,
    /// How well it explains the views; `None` where no solution exists.
    pub fit: Option<Fit>,
    /// Other ways to say the same poses.
    pub same_as: Vec<String>,
    /// Why it cannot be right although most views agree: an image that fits the pose of another.
    pub contradictions: Vec<Text>,
}

/// How well the hand-eye equations hold.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Median distance between where the poses put the target's outer points and where they were seen, metres.
    pub median_m: f64,
    /// It over the target's distance from the camera, which is the same in every unit.
    pub relative: f64,
    /// Median angle between both, radians.
    pub median_rad: f64,
    /// Views with a pose and the target in sight.
    pub views: usize,
    /// Poses of the series that disagree with the others, with their misfit in metres.
    pub disagreeing: Vec<(usize, f64)>,
    /// How far the camera would be from what carries it, metres.
    pub camera_at_m: f64,
    /// How far the target would be from what carries it, metres.
    pub target_at_m: f64,
}

impl Hypothesis {
    /// The pose of the robot that a sample means, metres.
    pub fn base_from_tip(&self, sample: &Sample) -> Option<Pose<Base, Tip>> {
        let written = self.reading.transform(&sample.numbers)?;
        Some(Pose::from_isometry(self.direction.of(&written)))
    }

    /// The pose of the target in the camera that a sample means, metres; `None` with images.
    pub(crate) fn camera_from_target(&self, sample: &Sample) -> Option<Isometry3<f64>> {
        let (reading, direction) = self.target_reading?;
        Some(direction.of(&reading.transform(&sample.numbers)?))
    }

    /// The series that the poses of the target come from; `None` with images.
    pub(crate) fn target_series<'a>(&self, recording: &'a Recording) -> Option<&'a str> {
        match self.source {
            Source::Track(i) => recording.tracks.get(i).map(|track| track.name.as_str()),
            Source::Stream(_) => None,
        }
    }

    /// Where the camera sits, as `--set mode=` has it.
    pub(crate) fn mode_name(&self) -> &'static str {
        match self.mode {
            Mode::EyeInHand => "eye_in_hand",
            Mode::EyeToHand => "eye_to_hand",
        }
    }

    /// The conventions as `--set` has them, and in words.
    pub fn conventions(&self, recording: &Recording) -> Vec<Convention> {
        let sample = |track: usize| recording.tracks[track].samples.first();
        let mut out = vec![Convention::new(
            "mode",
            self.mode_name(),
            match self.mode {
                Mode::EyeInHand => "the camera is on the robot",
                Mode::EyeToHand => "the camera stands beside the robot, the target is on it",
            },
        )];
        out.push(match self.direction {
            Direction::Forward => Convention::new("pose", "base_from_tip", "the tip as seen from the base"),
            Direction::Inverse => Convention::new("pose", "tip_from_base", "the base as seen from the tip"),
        });
        out.push(Convention::new("length_unit", self.reading.length.name(), "of the robot's positions"));
        if sample(self.robot).is_some_and(|s| super::RotationForm::all_for(&s.numbers).len() > 1) {
            out.push(Convention::new("rotation", self.reading.rotation.name(), self.reading.rotation.to_string()));
        }
        if self.reading.rotation.has_angles() {
            out.push(Convention::new("angle_unit", self.reading.angle.name(), "of the robot's angles"));
        }
        if let Some((reading, direction)) = &self.target_reading {
            out.push(match direction {
                Direction::Forward => {
                    Convention::new("target_pose", "camera_from_target", "the target as seen from the camera")
                }
                Direction::Inverse => {
                    Convention::new("target_pose", "target_from_camera", "the camera as seen from the target")
                }
            });
            out.push(Convention::new("target_length_unit", reading.length.name(), "of the target's positions"));
            out.push(Convention::new("target_rotation", reading.rotation.name(), reading.rotation.to_string()));
        }
        out.push(Convention::new("pairing", self.pairing.rule.clone(), self.pairing.text.clone()));
        match self.source {
            Source::Stream(i) => out.push(Convention::new("images", recording.streams[i].name.clone(), "the images")),
            Source::Track(i) => {
                out.push(Convention::new("target_poses", recording.tracks[i].name.clone(), "the target's poses"));
            }
        }
        out.push(Convention::new("poses", recording.tracks[self.robot].name.clone(), "the robot's poses"));
        out
    }

    /// Whether most views agree with it, well enough for their distance from the camera, and none says that it is wrong.
    pub fn explains(&self) -> bool {
        let is_near =
            |fit: &Fit| fit.views >= LEAST_POSES && fit.relative < EXPLAINED && fit.median_rad < EXPLAINED_RAD;
        self.contradictions.is_empty() && self.fit.as_ref().is_some_and(is_near)
    }
}

/// A convention of a hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub struct Convention {
    /// Its key in `--set`.
    pub key: &'static str,
    /// Its value there.
    pub value: String,
    /// What it means, in words.
    pub means: String,
}

impl Convention {
    fn new(key: &'static str, value: impl Into<String>, means: impl Into<String>) -> Self {
        Self { key, value: value.into(), means: means.into() }
    }
}
