//! An interpretation of a recording, and how well it explains what the camera saw.

use nalgebra::Isometry3;

use super::conventions::{Direction, Reading};
use super::formats::tree::LEAST_POSES;
use super::pairing::Pairing;
use super::recording::{Recording, Sample};
use handeye_estimate::diagnose::hypotheses::{EXPLAINED, EXPLAINED_RAD};
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_wording::Text;

/// Source of the target's poses.
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
    /// Source of the target's poses.
    pub source: Source,
    /// The series of the robot's poses, by its place in [`Recording::tracks`].
    pub robot: usize,
    /// Which image, or which pose of the target, belongs to which pose of the robot.
    pub pairing: Pairing,
    /// Meaning of the robot's numbers.
    pub reading: Reading,
    /// Direction of its poses.
    pub direction: Direction,
    /// Meaning of the numbers of the target's poses, and their direction; `None` with images.
    pub target_reading: Option<(Reading, Direction)>,
    /// Where the camera is mounted.
    pub mode: Mode,
    /// Residuals over the views; `None` where no solution exists.
    pub fit: Option<Fit>,
    /// Other hypotheses with the same poses.
    pub same_as: Vec<String>,
    /// Why it cannot be right although most views agree: an image that fits the pose of another.
    pub contradictions: Vec<Text>,
}

/// Residuals of the hand-eye equations.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Median distance between the target's outer points by the poses and as seen, metres.
    pub median_m: f64,
    /// It over the target's distance from the camera, which is the same in every unit.
    pub relative: f64,
    /// Median angle between both, radians.
    pub median_rad: f64,
    /// Views with a pose and the target in sight.
    pub views: usize,
    /// Poses of the series that disagree with the others, with their misfit in metres.
    pub disagreeing: Vec<(usize, f64)>,
    /// Resulting distance of the camera from its mount, metres.
    pub camera_at_m: f64,
    /// Resulting distance of the target from its mount, metres.
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

    /// The place of the camera as a value of `--set mode=`.
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

    /// Whether most views agree with it, well enough for their distance from the camera, and nothing contradicts it.
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
    /// Its meaning as text.
    pub means: String,
}

impl Convention {
    fn new(key: &'static str, value: impl Into<String>, means: impl Into<String>) -> Self {
        Self { key, value: value.into(), means: means.into() }
    }
}
