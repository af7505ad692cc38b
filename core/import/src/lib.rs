//! Other people's recordings as data sets: images with a table, one file per pose, files of other tools.
//!
//! [`open`] recognises what is in a folder ([`Recording`]): streams of images and series of poses as they were written. The
//! target is then found in the images by the caller ([`Sight::of_corners`]). [`judge`] tries every convention that the files
//! leave unsaid, and every pairing of images and poses, against what was seen, and lists them with what they leave
//! ([`Hypothesis`]). [`plan`] and [`write`](write::write) make a dataset folder of one of them.
//!
//! Nothing is assumed in silence: what several hypotheses explain equally well is [ambiguous](Verdict::Ambiguous), and a
//! pairing that images contradict is never one that explains.
//!
//! ```no_run
//! use std::path::Path;
//!
//! let recording = handeye_import::open(Path::new("recording"))?;
//! println!("{} streams of images, {} series of poses", recording.streams.len(), recording.tracks.len());
//! # Ok::<(), handeye_import::ImportError>(())
//! ```
//!
//! SQLite, MCAP, Zstandard and bzip2 are linked here alone. Never depends on a detector: the caller finds the target.

#![warn(missing_docs)]

mod camera;
mod chain;
mod conventions;
mod error;
mod folder;
mod formats;
mod hypothesis;
mod judge;
mod naming;
mod pairing;
mod recognise;
mod recording;
mod settings;
mod sight;
mod timing;
mod value;
pub mod write;
mod xml;

#[cfg(test)]
mod golden_tests;
#[cfg(test)]
mod judge_tests;
#[cfg(test)]
mod layout_tests;
#[cfg(test)]
mod own_poses_tests;
#[cfg(test)]
mod pairs_tests;
#[cfg(test)]
mod tests;

pub use camera::chosen as chosen_camera;
pub use chain::with_arm;
pub use conventions::{AngleUnit, Direction, Euler, LengthUnit, Reading, RotationForm};
pub use error::ImportError;
pub use formats::formats;
pub use handeye_estimate::diagnose::hypotheses::Verdict;
pub use hypothesis::{Convention, Fit, Hypothesis, Source};
pub use judge::{Judgement, Sights, judge};
pub use pairing::Pairing;
pub use recognise::{open, open_within};
pub use recording::{
    Clocks, FoundCamera, FoundMode, FoundTarget, ImageFile, JointSample, JointSeries, Known, Motion, Numbers,
    Recording, Role, Sample, Stated, Stream, Track,
};
pub use settings::{KEYS, Settings};
pub use sight::{Sight, size_of_points};
pub use timing::timed;
pub use write::{Plan, plan, plan_images};
