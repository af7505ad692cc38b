//! Why a recording cannot be imported.

use std::path::PathBuf;

use crate::estimate::clock_offset::ClockOffsetError;

/// Why a recording cannot be read or a data set not be written. One line each: what, where, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file system says no.
    #[error("{}: cannot be read: {why}", file.display())]
    Unreadable {
        /// The file or folder.
        file: PathBuf,
        /// What the system says.
        why: String,
    },
    /// More than any recording has.
    #[error("{}: {what}: at most {limit} are read; name the folder of one recording", file.display())]
    TooMuch {
        /// The file or folder.
        file: PathBuf,
        /// What there is too much of.
        what: &'static str,
        /// What is read.
        limit: u64,
    },
    /// It is a data set or a session already.
    #[error("{} is a data set or a session already: solve it with `handeye calibrate`", .0.display())]
    AlreadyADataset(PathBuf),
    /// There is nothing that could be robot poses.
    #[error(
        "{}: no series of at least {need} poses was found (tables, JSON, YAML, XML, npz and bags of ROS are read): {seen}",
        folder.display()
    )]
    NoPoses {
        /// The folder.
        folder: PathBuf,
        /// How many poses a calibration needs.
        need: usize,
        /// What was found instead.
        seen: String,
    },
    /// The robot was at one place all the time.
    #[error(
        "{}: the robot did not move: the {count} poses of {series} are {}; a calibration needs poses that are turned by 30° or more \
         about two different axes",
        folder.display(),
        alike(*spread_mm_deg)
    )]
    DidNotMove {
        /// The folder.
        folder: PathBuf,
        /// The robot's poses.
        series: String,
        /// How many they are.
        count: usize,
        /// How far they are apart at the most, millimetres and degrees; `None` where their numbers are the same.
        spread_mm_deg: Option<(f64, f64)>,
    },
    /// No way to put the files together has views to solve with.
    #[error(
        "{}: no pairing has {need} views with a pose of the robot and the target in sight, turned differently: look at the \
         target, at `images` and at `poses`",
        folder.display()
    )]
    NoViews {
        /// The folder.
        folder: PathBuf,
        /// How many views a solution needs.
        need: usize,
    },
    /// Poses cannot be made of joint values.
    #[error("arm = {arm:?}: {why}")]
    Arm {
        /// As it was named.
        arm: String,
        /// What is wrong.
        why: String,
    },
    /// Images of a moving robot have stamps of a clock that cannot be related to the robot's.
    #[error("the images {images} were taken while {poses} moved, and their clocks cannot be related: {why}")]
    Clocks {
        /// The stream of images.
        images: String,
        /// The robot's poses.
        poses: String,
        /// Why not.
        why: ClockOffsetError,
    },
    /// A choice that is none.
    #[error("{key} = {value:?} is not a choice here: {choices}")]
    BadChoice {
        /// The key.
        key: String,
        /// What was given.
        value: String,
        /// What may be given.
        choices: String,
    },
    /// What was chosen excludes everything.
    #[error("nothing is left to try with {0}: these choices exclude each other, or the recording does not have them")]
    NothingLeft(String),
    /// The folder to write is there and has something in it.
    #[error("{}: is not empty: an import is written into a new folder, name another one", .0.display())]
    OutNotEmpty(PathBuf),
    /// It could not be written.
    #[error("{}: cannot be written: {why}", file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        why: String,
    },
}

fn alike(spread_mm_deg: Option<(f64, f64)>) -> String {
    spread_mm_deg.map_or_else(|| "all the same".into(), |(mm, deg)| format!("the same within {mm:.2} mm and {deg:.2}°"))
}
