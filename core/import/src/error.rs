//! Why a recording cannot be imported.

use std::path::{Path, PathBuf};

use handeye_files::budget::Spent;
use handeye_pairs::clock_offset::ClockOffsetError;
use handeye_wording::Text;
use handeye_wording::text;

/// Why a recording cannot be read or a data set not be written. One line each: what, where, and what to do.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ImportError {
    /// The file system refuses.
    #[error("{file}: cannot be read: {why}", file = file.display())]
    Unreadable {
        /// The file or folder.
        file: PathBuf,
        /// The error of the operating system.
        why: String,
    },
    /// More than any recording has.
    #[error("{file}: {what}: at most {limit} are read; name the folder of one recording", file = file.display())]
    TooMuch {
        /// The file or folder.
        file: PathBuf,
        /// What exceeds the limit.
        what: &'static str,
        /// The limit.
        limit: u64,
    },
    /// It takes more time, or unpacks to more, than a person has allowed.
    #[error("{file}: {why}{allowing}", file = file.display(), allowing = allowing(*why))]
    Stopped {
        /// The folder or file.
        file: PathBuf,
        /// Why it was stopped.
        why: Spent,
    },
    /// It is a data set or a session already.
    #[error("{file} is a data set or a session already: solve it with `handeye calibrate`", file = .0.display())]
    AlreadyADataset(PathBuf),
    /// There is nothing that could be robot poses.
    #[error(
        "{folder}: no series of at least {need} poses was found ({formats} are read): {seen}",
        folder = folder.display(),
        formats = formats.as_ref()
    )]
    NoPoses {
        /// The folder that was read.
        folder: PathBuf,
        /// How many poses a calibration needs.
        need: usize,
        /// The formats with poses that are read.
        formats: Box<Text>,
        /// What was found instead, as text.
        seen: Text,
    },
    /// The robot was at one place all the time.
    #[error(
        "{folder}: the robot did not move: the {count} poses of {series} are {alike}; a calibration needs poses that are turned by 30° or more \
         about two different axes",
        folder = folder.display(),
        alike = alike(*spread_mm_deg)
    )]
    DidNotMove {
        /// The folder that was read.
        folder: PathBuf,
        /// The robot's poses.
        series: String,
        /// Number of poses.
        count: usize,
        /// Largest difference between them, millimetres and degrees; `None` where their numbers are the same.
        spread_mm_deg: Option<(f64, f64)>,
    },
    /// No way to put the files together has views to solve with.
    #[error(
        "{folder}: no pairing has {need} views with a pose of the robot and the target in sight, turned differently: look at the \
         target, at `images` and at `poses`",
        folder = folder.display()
    )]
    NoViews {
        /// The folder that was read.
        folder: PathBuf,
        /// How many views a solution needs.
        need: usize,
    },
    /// Poses cannot be made of joint values.
    #[error("arm = {arm:?}: {why}")]
    Arm {
        /// The arm as it was named.
        arm: String,
        /// What is wrong.
        why: Text,
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
    /// An invalid choice.
    #[error("{key} = {value:?} is not a choice here: {choices}")]
    BadChoice {
        /// The convention that was set.
        key: String,
        /// The given value.
        value: String,
        /// The valid values.
        choices: Text,
    },
    /// What was chosen excludes everything.
    #[error("nothing is left to try with {0}: these choices exclude each other, or the recording does not have them")]
    NothingLeft(&'static str),
    /// The folder to write is there and has something in it.
    #[error("{file}: is not empty: an import is written into a new folder, name another one", file = .0.display())]
    OutNotEmpty(PathBuf),
    /// It could not be written.
    #[error("{file}: cannot be written: {why}", file = file.display())]
    Unwritable {
        /// The file that could not be written.
        file: PathBuf,
        /// The error of the operating system.
        why: String,
    },
}

impl ImportError {
    pub(super) fn stopped(file: &Path, why: Spent) -> Self {
        Self::Stopped { file: file.to_path_buf(), why }
    }
}

/// Several reasons as one.
pub(super) fn reasons(all: Vec<Text>) -> Text {
    let joined = all.into_iter().reduce(|first, next| text!("{first}; {next}", first = first, next = next));
    joined.unwrap_or_default()
}

/// What to do about it.
fn allowing(why: Spent) -> Text {
    match why {
        Spent::Cancelled => Text::default(),
        Spent::Time(_) => {
            text!(": name the folder or file of one recording, or allow more time with --time SECONDS")
        }
        Spent::Unpacked(_) => text!(": unpack them yourself, or allow more with --unpack GIB"),
    }
}

fn alike(spread_mm_deg: Option<(f64, f64)>) -> Text {
    spread_mm_deg.map_or_else(
        || text!("all the same"),
        |(mm, deg)| text!("the same within {mm} mm and {deg}°", mm = format!("{mm:.2}"), deg = format!("{deg:.2}")),
    )
}
