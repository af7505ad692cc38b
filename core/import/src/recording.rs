//! Images and series of poses as found in the files.

use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Isometry3;
use tempfile::TempDir;

pub use super::conventions::Numbers;
use super::conventions::{AngleUnit, Direction, LengthUnit, RotationForm};
use handeye_estimate::handeye::Mode;
use handeye_files::bounds::Bounds;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::targets::TargetSpec;
use handeye_pairs::clock_offset::ClockOffset;
use handeye_wording::text;
use handeye_wording::{Text, Value};

/// A recording as it was found. Nothing of it is interpreted yet: numbers are kept as they were written.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// The folder.
    pub root: PathBuf,
    /// Limits on the files that its files, and the user's choices, may name.
    pub bounds: Bounds,
    /// What was found and how it was recognised, one sentence each.
    pub beliefs: Vec<Text>,
    /// Streams of images: of one naming and one size in one folder, in natural order.
    pub streams: Vec<Stream>,
    /// Series of poses.
    pub tracks: Vec<Track>,
    /// Series of which all poses are the same: settings, or a robot that did not move.
    pub still: Vec<Track>,
    /// Joint values, which the chain of the arm converts to poses.
    pub joints: Vec<JointSeries>,
    /// Rows of numbers without names. They are joint values only where the user names the arm.
    pub rows: Vec<JointSeries>,
    /// Poses of a robot that moves, as densely as they were recorded: what images of a stream with stamps are given poses of
    /// ([`timed`](super::timed)).
    pub motions: Vec<Motion>,
    /// Poses at which a moving robot was at rest, too few to be preferred to the motion: used where its clock cannot be related
    /// to that of the images.
    pub at_rest: Vec<Track>,
    /// Offsets between clocks, where poses were assigned to images by their timestamps.
    pub clocks: Vec<Clocks>,
    /// Cameras that files describe.
    pub cameras: Vec<FoundCamera>,
    /// Targets that files describe.
    pub targets: Vec<FoundTarget>,
    /// Where the camera is mounted, when a file states it, and that file.
    pub mode: Option<FoundMode>,
    /// Where no series was found, what the files have instead, one sentence each.
    pub nothing: Vec<Text>,
    /// Warnings about the files for the user: duplicates, some that cannot be read.
    pub warnings: Vec<Text>,
    /// Folders of unpacked images; deleted with the recording.
    pub scratch: Vec<Arc<TempDir>>,
}

impl Recording {
    /// Whether the images of a stream, by its index, are photographs. Those of 16 bits of grey are depth images where there are
    /// others.
    pub fn has_photographs(&self, stream: usize) -> bool {
        let is_depth = |stream: &Stream| stream.is_depth && stream.points.is_none();
        self.streams.get(stream).is_some_and(|it| it.points.is_none())
            && (!is_depth(&self.streams[stream]) || self.streams.iter().all(is_depth))
    }

    /// The files of the images of a stream, by its place in [`streams`](Self::streams).
    pub fn image_paths(&self, stream: usize) -> Vec<PathBuf> {
        self.streams[stream].images.iter().map(|image| self.root.join(&image.path)).collect()
    }
}

/// Images of one naming in one folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    /// Value of `--set images=`.
    pub name: String,
    /// In natural order.
    pub images: Vec<ImageFile>,
    /// Width and height in pixels of all of them.
    pub size: (u32, u32),
    /// One channel of 16 bits: depth, where there are other images.
    pub is_depth: bool,
    /// In the place of images, points of the target that another program has found in each, in the order of the file; the size is
    /// (0, 0) where no file states it. `images` are then the files or entries that they are from.
    pub points: Option<Vec<Option<Vec<[f64; 2]>>>>,
}

impl Stream {
    /// Description as text.
    pub fn text(&self) -> Text {
        let (width, height) = self.size;
        let size = if self.size == (0, 0) {
            text!("no file says of which size")
        } else {
            text!("of {width}×{height} px", width = width, height = height)
        };
        if let Some(points) = &self.points {
            let views = || points.iter().flatten();
            return text!(
                "up to {most} corners of {views} images ({size}) in {name}",
                most = views().map(Vec::len).max().unwrap_or(0),
                views = views().count(),
                size = size,
                name = &self.name
            );
        }
        let ends = |(first, last): (&ImageFile, &ImageFile)| {
            text!(", {first} to {last}", first = first.shown(), last = last.shown())
        };
        text!(
            "{count} images {name} {size}{ends}{depth}",
            count = self.images.len(),
            name = &self.name,
            size = size,
            ends = self.images.first().zip(self.images.last()).map(ends).unwrap_or_default(),
            depth = if self.is_depth { text!(", 16 bits in one channel: depth") } else { Text::default() }
        )
    }
}

/// An image of a recording, as a file or out of a bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageFile {
    /// Path below the folder of the recording; absolute for one that was unpacked.
    pub path: PathBuf,
    /// The number in its name that differs from image to image.
    pub number: Option<u64>,
    /// An earlier image of the stream with the same bytes, by its index.
    pub same_as: Option<usize>,
    /// When it was taken by the camera's clock, nanoseconds; of images of a moving robot.
    pub stamp_ns: Option<i64>,
}

impl ImageFile {
    /// Its path as text.
    pub fn shown(&self) -> String {
        self.path.display().to_string()
    }
}

/// What the poses of a series belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The robot, by its name or because there is no other series.
    Robot,
    /// The target as seen by the camera.
    Target,
    /// Either.
    Unknown,
}

/// A series of poses.
#[derive(Debug, Clone)]
pub struct Track {
    /// Value of `--set poses=`.
    pub name: String,
    /// What the poses belong to.
    pub role: Role,
    /// Conventions that the file states.
    pub stated: Stated,
    /// The series of which it is another reading: the same numbers in another order.
    pub reading_of: Option<String>,
    /// In the order of the file, or of the files' numbers.
    pub samples: Vec<Sample>,
}

impl Track {
    /// Whether all its poses are the same numbers: a setting, or a robot that did not move.
    pub(crate) fn is_still(&self) -> bool {
        self.samples.windows(2).all(|pair| pair[0].numbers == pair[1].numbers)
    }

    /// Description as text.
    pub fn text(&self) -> Text {
        let joints = self.samples.iter().filter(|sample| !sample.joints.is_empty()).count();
        let kind = match self.samples.first().map(|sample| sample.numbers) {
            Some(Numbers::Angles(_)) | None => text!("six numbers"),
            Some(Numbers::Quaternion(_)) => text!("translation and quaternion"),
            Some(Numbers::Matrix(_)) => text!("matrices"),
        };
        let with =
            if joints > 0 { text!(", {count} of them with joint values", count = joints) } else { Text::default() };
        text!(
            "{count} poses in {name}: {kind}{with}",
            count = self.samples.len(),
            name = &self.name,
            kind = kind,
            with = with
        )
    }
}

/// One pose as it was written.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The image that it names.
    pub image: Option<String>,
    /// Its number in the file, or the number of its file.
    pub number: Option<u64>,
    /// Place for messages: file and row. A row that may be read in several ways has one for all of them.
    pub place: Arc<Text>,
    /// The numbers of the pose as they are written down.
    pub numbers: Numbers,
    /// Joint values next to it, in the unit of the file.
    pub joints: Vec<f64>,
}

/// A series of joint values.
#[derive(Debug, Clone)]
pub struct JointSeries {
    /// Name in messages.
    pub name: String,
    /// Names of the joints in the order of the values, where they are stated.
    pub joints: Vec<String>,
    /// Unit of the values of revolute joints, where it is stated.
    pub unit: Option<Known<AngleUnit>>,
    /// The samples in the order of the file.
    pub samples: Vec<JointSample>,
}

impl JointSeries {
    /// Description as text.
    pub(crate) fn text(&self) -> Text {
        let names = if self.joints.is_empty() { String::new() } else { format!(" ({})", self.joints.join(", ")) };
        text!(
            "{count} rows of joint values in {name}{names}: arm=… makes poses of them",
            count = self.samples.len(),
            name = &self.name,
            names = names
        )
    }
}

/// Poses of a robot that moves.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Value of `--set poses=` for the series that is made from it.
    pub name: String,
    /// What the poses belong to.
    pub role: Role,
    /// Direction of the poses, where it is known.
    pub direction: Option<Known<Direction>>,
    /// Time on the robot's clock in nanoseconds, increasing, and pose in metres.
    pub poses: Arc<Vec<(i64, Isometry3<f64>)>>,
}

/// Offset between the clock of a camera and that of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Clocks {
    /// Name of the series of images.
    pub images: String,
    /// The robot's poses.
    pub poses: String,
    /// Added to timestamps of the images to convert them to the robot's clock.
    pub offset: ClockOffset,
    /// Number of images used.
    pub count: usize,
}

impl Clocks {
    /// The offset as text.
    pub fn text(&self) -> Text {
        let (offset_ms, sigma_ms) = (self.offset.offset_s * 1e3, self.offset.sigma_s * 1e3);
        // Two digits of the standard deviation, and no more of the offset.
        let decimals = (1.0 - sigma_ms.max(1e-6).log10().floor()).clamp(0.0, 6.0) as usize;
        text!(
            "{offset} ± {sigma} ms are added to the stamps of {count} images {images} to convert them to the clock of {poses}",
            offset = format!("{offset_ms:.decimals$}"),
            sigma = format!("{sigma_ms:.decimals$}"),
            count = self.count,
            images = &self.images,
            poses = &self.poses
        )
    }
}

/// The joint values of one pose.
#[derive(Debug, Clone)]
pub struct JointSample {
    /// The image that they name.
    pub image: Option<String>,
    /// Their number in the file, or the number of their file.
    pub number: Option<u64>,
    /// Place for messages.
    pub place: Arc<Text>,
    /// The joint values of a row, in the unit of the file.
    pub values: Vec<f64>,
}

/// Conventions of a series that a file states, and how they are known. `None`: not stated.
#[derive(Debug, Clone, Default)]
pub struct Stated {
    /// The unit of positions.
    pub length: Option<Known<LengthUnit>>,
    /// The unit of angles.
    pub angle: Option<Known<AngleUnit>>,
    /// Conventions of rotations that are still possible.
    pub rotation: Option<Known<Vec<RotationForm>>>,
    /// Direction of the poses.
    pub direction: Option<Known<Direction>>,
    /// Direction for each place of the camera, where one follows from the other.
    pub direction_in: Option<Known<[(Mode, Direction); 2]>>,
}

/// A fact and why it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Known<T> {
    /// The fact.
    pub value: T,
    /// Source of the fact.
    pub why: String,
}

impl<T> Known<T> {
    /// A fact with its source.
    pub(crate) fn by(why: impl Into<String>, value: T) -> Self {
        Self { value, why: why.into() }
    }
}

/// Where the camera is mounted, as a file states it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundMode {
    /// Eye in hand or eye to hand.
    pub value: Mode,
    /// The key in the file that states it.
    pub key: &'static str,
    /// The file that states it.
    pub file: String,
}

impl FoundMode {
    /// Source of the fact.
    pub(crate) fn why(&self) -> Text {
        text!("{key} in {file}", key = self.key, file = &self.file)
    }
}

/// A target that a file describes.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundTarget {
    /// The target with its sizes in metres.
    pub target: TargetSpec,
    /// The file that describes it.
    pub file: String,
    /// It is a tag and the file does not state its id: that is read from the images.
    pub is_id_open: bool,
}

impl FoundTarget {
    /// Description as text.
    pub(crate) fn text(&self) -> Text {
        let open = if self.is_id_open { text!(", which number of its family is not said") } else { Text::default() };
        text!("a target in {file}: {target}{open}", file = &self.file, target = self.target.text(), open = open)
    }
}

/// A camera that a file describes.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundCamera {
    /// The file, as `--set camera=` names it.
    pub name: String,
    /// The intrinsics. Width and height are 0 where the file does not state them.
    pub intrinsics: Intrinsics,
    /// Kind of file.
    pub why: &'static str,
}

impl FoundCamera {
    /// Description as text.
    pub(crate) fn text(&self) -> Text {
        text!("a camera in {file}: {why}", file = &self.name, why = Value::phrase(self.why))
    }
}
