//! Errors of a dataset folder.

use std::path::{Path, PathBuf};

use handeye_arm::ArmError;
use handeye_arm::urdf::UrdfError;
use handeye_geometry::se3::NotARotation;
use handeye_images::ImageFileError;
use handeye_wording::Text;
use handeye_wording::text;

/// An error, with its file and row. One line of text: `FILE, row N: what, and what to do`.
///
/// The file could not be used as input: a command line ends with code 2.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[error("{place}: {problem}", place = place(file, *row))]
#[non_exhaustive]
pub struct DatasetError {
    /// The file or folder.
    pub file: PathBuf,
    /// Line as an editor counts it, from 1; `None` when the file as a whole is meant.
    pub row: Option<usize>,
    /// The error in that place.
    pub problem: DatasetProblem,
}

impl DatasetError {
    pub(super) fn new(file: &Path, row: Option<usize>, problem: DatasetProblem) -> Self {
        Self { file: file.to_path_buf(), row, problem }
    }
}

/// The place of an error on one line, whatever the file is called.
fn place(file: &Path, row: Option<usize>) -> Text {
    let name = file.display().to_string();
    let file = if name.contains(char::is_control) { format!("{name:?}") } else { name };
    match row {
        Some(row) => text!("{file}, row {row}", file = file, row = row),
        None => text!("{file}", file = file),
    }
}

/// A defect of a dataset folder.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum DatasetProblem {
    /// The file system refuses.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The folder has no description.
    #[error(
        "has no dataset.toml: name a dataset folder or a session folder, or make one of a recording with `handeye import`"
    )]
    NotADataset,
    /// Not text.
    #[error("is not UTF-8 text: save it as UTF-8")]
    NotUtf8,
    /// Far more text than any session has.
    #[error("has {bytes} bytes, at most {limit} are read")]
    FileTooLarge {
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// Not a letter of text.
    #[error("is empty: {0}")]
    Empty(&'static str),
    /// A header and nothing below it.
    #[error("has a header and no rows: {0}")]
    NoRows(&'static str),
    /// Neither images nor a table that replaces them.
    #[error("has no images (png, jpg, bmp or tif), nor has its images folder{0}")]
    NoImages(&'static str),
    /// Not TOML, an unknown key, or a word that is not one of the choices.
    #[error("{0}")]
    Toml(String),
    /// A key that this file needs.
    #[error("[{table}] needs {key}: {why}")]
    MissingKey {
        /// The table it belongs to.
        table: &'static str,
        /// The key in `dataset.toml`.
        key: &'static str,
        /// Why it is needed.
        why: &'static str,
    },
    /// A value out of range.
    #[error("{key} = {value} is not usable: it must be {want}")]
    BadValue {
        /// The key in `dataset.toml`.
        key: &'static str,
        /// The value found.
        value: String,
        /// The valid values.
        want: &'static str,
    },
    /// Two keys that exclude each other.
    #[error("{0}")]
    Conflict(&'static str),
    /// Joint angles for another arm.
    #[error("joints = {got}, but the arm of [robot.arm] has {need}")]
    JointCount {
        /// The number in `joints`.
        got: usize,
        /// Joints of the arm.
        need: usize,
    },
    /// An invalid arm.
    #[error("[robot.arm]: {0}")]
    Arm(ArmError),
    /// Or a URDF without one.
    #[error("[robot.arm]: {0}")]
    Urdf(UrdfError),
    /// A key of another kind of target.
    #[error("{key} does not belong to a target of kind {kind:?}: remove it, or check the kind")]
    ForeignKey {
        /// The key in `dataset.toml`.
        key: &'static str,
        /// The kind that is stated.
        kind: &'static str,
    },
    /// The coefficients do not fit the model.
    #[error("distortion has {got} numbers, model {model} takes {need}")]
    DistortionCount {
        /// The model.
        model: &'static str,
        /// Numbers given.
        got: usize,
        /// Numbers it takes.
        need: usize,
    },
    /// The quoting of a table is broken.
    #[error("is not a comma-separated table: {0}")]
    Csv(String),
    /// A row longer or shorter than the header.
    #[error("has {got} cells, the header has {need}: numbers have a decimal point and no comma")]
    ColumnCount {
        /// Cells in the row.
        got: usize,
        /// Cells in the header.
        need: usize,
    },
    /// A column that the table does not have.
    #[error("unknown column {name:?}: the header must be {expected}")]
    UnknownColumn {
        /// The column.
        name: String,
        /// The whole header.
        expected: String,
    },
    /// A column that is not there.
    #[error("column {name:?} is missing: the header must be {expected}")]
    MissingColumn {
        /// The column.
        name: String,
        /// The whole header.
        expected: String,
    },
    /// The right columns, but not in the order that the convention states, or one twice.
    #[error("the columns are in another order, or twice: the header must be {expected}")]
    ColumnOrder {
        /// The whole header.
        expected: String,
    },
    /// Text where a number belongs.
    #[error("{column} = {cell:?} is not a number")]
    NotANumber {
        /// Header of the column.
        column: &'static str,
        /// Contents of the cell, shortened.
        cell: String,
    },
    /// NaN or infinite.
    #[error("{column} = {cell:?} is not finite: leave out views without a pose")]
    NotFinite {
        /// Header of the column.
        column: &'static str,
        /// Contents of the cell, shortened.
        cell: String,
    },
    /// A quaternion that is not a unit quaternion.
    #[error("the quaternion has length {length:.6}, which is more than {tolerance} from 1: check the columns")]
    NotUnit {
        /// Length of the quaternion as it was read.
        length: f64,
        /// Largest deviation from 1.
        tolerance: f64,
    },
    /// A 3×3 matrix that does not rotate.
    #[error("r11…r33 is not a rotation matrix: {0}")]
    NotARotation(NotARotation),
    /// An angle too large to be in radians, or a typing error.
    #[error("{column} = {value} {unit} is more than two turns: check {key}")]
    AngleTooLarge {
        /// Header of the column.
        column: &'static str,
        /// The value as written.
        value: f64,
        /// The unit as declared.
        unit: &'static str,
        /// The key that declares it.
        key: &'static str,
    },
    /// The same image, or the same point of it, twice.
    #[error("{what} is already in row {first_row}: remove one of the two")]
    Duplicate {
        /// The duplicate.
        what: String,
        /// Row of its first occurrence.
        first_row: usize,
    },
    /// An image name that cannot be one.
    #[error("image {0:?} is not a path relative to this file")]
    BadImageName(String),
    /// The table of a session names an image outside of it.
    #[error(
        "{0:?} is not inside of the session: a session is complete in its folder, so another program has changed this file"
    )]
    OutsideSession(String),
    /// A browser has opened the data set, and it names a file that is not in what can be reached from there.
    #[error(
        "{0:?} lies outside of the folder that may be read from a browser: put it into the data set, or open it at this machine"
    )]
    OutOfReach(String),
    /// The table names an image that is not there.
    #[error("image {0:?} does not exist: names are relative to this file")]
    MissingImage(String),
    /// The image is there but of no use.
    #[error("image {name:?}: {source}")]
    BadImage {
        /// Its name in the table.
        name: String,
        /// What is wrong with it.
        source: Box<ImageFileError>,
    },
    /// Not the size of the others.
    #[error("image {name:?} is {got} px, but {others} {need} px: a data set is of one camera", got = size(*got), need = size(*need))]
    ImageSize {
        /// Its name in the table.
        name: String,
        /// Its size.
        got: (u32, u32),
        /// The expected size.
        need: (u32, u32),
        /// Where that size is from.
        others: &'static str,
    },
    /// A row about an image that the pose table does not have.
    #[error("image {name:?} has no row in {poses}")]
    NoPose {
        /// The image.
        name: String,
        /// The pose table.
        poses: String,
    },
    /// A point that the target does not have.
    #[error("the target has no point at column {column}, row {row}: it has {columns}×{rows}, counted from 0")]
    OffGrid {
        /// Column of the point.
        column: usize,
        /// Row of the point.
        row: usize,
        /// Columns of the target.
        columns: usize,
        /// Rows of the target.
        rows: usize,
    },
    /// A corner outside of the image it is stated to be in.
    #[error("({u_px}, {v_px}) is outside of the image of {of} px", of = self::size(*size))]
    OutsideImage {
        /// Column in pixels.
        u_px: f64,
        /// Row in pixels.
        v_px: f64,
        /// Size of the image.
        size: (u32, u32),
    },
}

fn size((width, height): (u32, u32)) -> String {
    format!("{width}×{height}")
}

/// Contents of a cell, short enough for a message.
pub(super) fn shown(cell: &str) -> String {
    const LONGEST: usize = 40;
    if cell.chars().count() <= LONGEST {
        return cell.to_owned();
    }
    let mut short: String = cell.chars().take(LONGEST).collect();
    short.push('…');
    short
}
