//! Calibration files of other programs.
//!
//! Every format is one [`Format`] in [`formats`]. A file says in its first comment which way its transform goes, has
//! every digit of every number, and is read back after writing and compared: a file that does not say what the result
//! says is an error and not a file.

mod easy_handeye2;
mod json;
mod opencv_yaml;
mod ros_camera_info;
mod yaml;

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::atomic_file;
use crate::camera::Intrinsics;
use crate::handeye::Mode;
use crate::image_file::one_line;
use crate::result::{CalibrationResult, ResultProblem, TransformEstimate};

/// Largest difference between a number in a result and in its export, in the unit of the file.
pub const TOLERANCE: f64 = 1e-9;

/// Names that a result does not know and the files of other programs want.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ExportNames {
    /// Name of the calibration where a format has one; also the name of its file.
    pub calibration: String,
    /// Name of the camera.
    pub camera_name: String,
    /// The robot's base.
    pub base_frame: String,
    /// The robot's tip.
    pub effector_frame: String,
    /// The camera in optical axes: x right, y down, z forward.
    pub camera_frame: String,
    /// The calibration target.
    pub target_frame: String,
}

impl Default for ExportNames {
    /// The names that ROS drivers and robot descriptions use.
    fn default() -> Self {
        Self {
            calibration: "my_cell".into(),
            camera_name: "camera_color".into(),
            base_frame: "base_link".into(),
            effector_frame: "tool0".into(),
            camera_frame: "camera_color_optical_frame".into(),
            target_frame: "board".into(),
        }
    }
}

impl ExportNames {
    /// Checks that every name can stand in every format: letters, digits and `_ - . /`, beginning with a letter, a
    /// digit, `_` or `/`.
    ///
    /// # Errors
    /// [`ExportError::BadName`] names the first that cannot.
    pub fn check(&self) -> Result<(), ExportError> {
        let names = [
            ("calibration", &self.calibration),
            ("camera", &self.camera_name),
            ("base frame", &self.base_frame),
            ("effector frame", &self.effector_frame),
            ("camera frame", &self.camera_frame),
            ("target frame", &self.target_frame),
        ];
        for (what, name) in names {
            let is_plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c));
            let starts_well = name.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/');
            // The calibration's name is also the name of a file.
            let is_path = what == "calibration" && name.contains('/');
            if !is_plain || !starts_well || is_path {
                return Err(ExportError::BadName { what, name: name.chars().take(40).collect() });
            }
        }
        Ok(())
    }
}

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportFile {
    /// Its name, without folder.
    pub name: String,
    /// Its content.
    pub text: String,
}

/// A file format of another program.
pub trait Format: Send + Sync {
    /// Name on the command line, `snake_case`.
    fn name(&self) -> &'static str;

    /// What it is and who reads it, in half a sentence.
    fn description(&self) -> &'static str;

    /// The files of a result that was checked, with names that were checked.
    ///
    /// # Errors
    /// [`ExportError`] when the result does not have what the format needs.
    fn render(&self, result: &CalibrationResult, names: &ExportNames) -> Result<Vec<ExportFile>, ExportError>;

    /// Parses the text of a file of [`Self::render`] and compares it with the result.
    ///
    /// # Errors
    /// What differs by more than [`TOLERANCE`] or cannot be found, as text.
    fn compare(&self, text: &str, result: &CalibrationResult, names: &ExportNames) -> Result<(), String>;
}

/// Every format, in the order of lists.
pub fn formats() -> &'static [&'static dyn Format] {
    &[&json::Json, &ros_camera_info::RosCameraInfo, &opencv_yaml::OpencvYaml, &easy_handeye2::EasyHandeye2]
}

/// The format of that name.
///
/// # Errors
/// [`ExportError::UnknownFormat`] lists the names there are.
pub fn by_name(name: &str) -> Result<&'static dyn Format, ExportError> {
    formats().iter().copied().find(|f| f.name() == name).ok_or_else(|| ExportError::UnknownFormat {
        name: name.chars().take(40).collect(),
        known: formats().iter().map(|f| f.name()).collect::<Vec<_>>().join(", "),
    })
}

/// Writes the files of all `formats` into a folder, which is made where there is none, reads every file back and
/// compares it with the result. Gives the paths written, in order. Files that were there are replaced, each as a whole.
///
/// # Errors
/// [`ExportError`] for the first format that cannot be written; everything is rendered before anything is written.
pub fn write_all(
    folder: &Path,
    formats: &[&dyn Format],
    result: &CalibrationResult,
    names: &ExportNames,
) -> Result<Vec<PathBuf>, ExportError> {
    names.check()?;
    result.check().map_err(|e| ExportError::BadResult(ResultProblem::Bad(e)))?;
    let mut rendered = Vec::new();
    for format in formats {
        for file in format.render(result, names)? {
            rendered.push((*format, file));
        }
    }
    let io = |file: &Path, e: std::io::Error| ExportError::Io { file: file.to_path_buf(), problem: one_line(&e) };
    fs::create_dir_all(folder).map_err(|e| io(folder, e))?;
    let mut written = Vec::with_capacity(rendered.len());
    for (format, file) in rendered {
        let path = folder.join(&file.name);
        atomic_file::write(&path, file.text.as_bytes()).map_err(|e| io(&path, e))?;
        let read = fs::read_to_string(&path).map_err(|e| io(&path, e))?;
        format
            .compare(&read, result, names)
            .map_err(|difference| ExportError::ReadBack { file: path.clone(), difference })?;
        written.push(path);
    }
    Ok(written)
}

/// Why a result was not exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// No format of that name.
    #[error("unknown export format {name:?}: choose from {known}")]
    UnknownFormat {
        /// The name.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A result with intrinsics alone, for a format with a transform.
    #[error(
        "{format} is about a hand-eye transform, and this result has none: export {alternative}, or calibrate with robot poses"
    )]
    NeedsHandEye {
        /// The format.
        format: &'static str,
        /// What can be exported instead.
        alternative: &'static str,
    },
    /// A result of pose pairs, for a format with a camera.
    #[error(
        "{format} is about a camera's intrinsics, and this result has none: export {alternative}, or calibrate from images"
    )]
    NeedsIntrinsics {
        /// The format.
        format: &'static str,
        /// What can be exported instead.
        alternative: &'static str,
    },
    /// A name that some format cannot hold.
    #[error("{what} {name:?} cannot be used as a name: letters, digits and _ - . / are allowed")]
    BadName {
        /// Which name.
        what: &'static str,
        /// What it is.
        name: String,
    },
    /// A result that must not be.
    #[error("the result cannot be exported: {0}")]
    BadResult(ResultProblem),
    /// The file system says no.
    #[error("{}: cannot be written: {problem}", file.display())]
    Io {
        /// The file or folder.
        file: PathBuf,
        /// What the system says.
        problem: String,
    },
    /// The file does not say what the result says: a defect of this program.
    #[error("{}: reads back differently: {difference}; please report this", file.display())]
    ReadBack {
        /// The file.
        file: PathBuf,
        /// What differs.
        difference: String,
    },
}

impl ExportError {
    /// Whether the input is at fault and not this machine or program: exit code 2.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Io { .. } | Self::ReadBack { .. })
    }
}

/// The hand-eye of a result in the names of the export.
struct NamedTransform<'a> {
    mode: Mode,
    parent: &'a str,
    child: &'a str,
    estimate: &'a TransformEstimate,
}

impl<'a> NamedTransform<'a> {
    fn of(result: &'a CalibrationResult, names: &'a ExportNames) -> Option<Self> {
        let mode = result.mode?;
        let parent = match mode {
            Mode::EyeInHand => &names.effector_frame,
            Mode::EyeToHand => &names.base_frame,
        };
        Some(Self { mode, parent, child: &names.camera_frame, estimate: result.hand_eye.as_ref()? })
    }

    /// Unit quaternion x, y, z, w with w ≥ 0, whatever the result holds.
    fn xyzw(&self) -> [f64; 4] {
        crate::frames::Pose::<crate::frames::Mount, crate::frames::Camera>::from_translation_xyzw(
            self.estimate.translation_m,
            self.estimate.rotation_xyzw,
        )
        .xyzw()
    }
}

/// The comment that a transform starts with: which way, units, and what made it.
fn transform_comment(transform: &NamedTransform<'_>, result: &CalibrationResult) -> String {
    format!(
        "# T_{0}_{1}: a point p in {1} is T * p in {0}. Metres; quaternion x y z w, no Euler angles. {2}",
        transform.parent,
        transform.child,
        made_by(result)
    )
}

fn made_by(result: &CalibrationResult) -> String {
    // Free text must not end the comment that it stands in.
    fn plain(text: &str) -> String {
        text.chars().filter(char::is_ascii_graphic).take(64).collect()
    }
    let provenance = &result.provenance;
    let input = provenance.input_sha256.as_deref().map_or("unknown".to_owned(), plain);
    format!("Made by handeye {}, input sha256 {input}.", plain(&provenance.tool_version))
}

/// The intrinsics of a result that was checked.
fn intrinsics_of(result: &CalibrationResult) -> Option<Intrinsics> {
    result.intrinsics.as_ref().and_then(crate::result::IntrinsicsEstimate::intrinsics)
}

/// A number with every digit that it has, and a decimal point or exponent so that no reader takes it for an integer.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    // YAML 1.1 knows an exponent only behind a decimal point and with a sign.
    match text.split_once('e') {
        None => text,
        Some((digits, exponent)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{digits}{point}e{sign}{exponent}")
        }
    }
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ")
}

/// A number with its key.
fn entry(indent: usize, key: &str, value: f64) -> String {
    format!("{:indent$}{key}: {}\n", "", number(value))
}

/// A name that YAML takes for nothing but text: `on`, `1e3` and `null` would be something else.
fn quoted(name: &str) -> String {
    const WORDS: [&str; 10] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan"];
    let is_word = WORDS.contains(&name.to_ascii_lowercase().as_str());
    let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '/');
    if is_plain && !is_word { name.to_owned() } else { format!("\"{name}\"") }
}

fn compare_numbers(what: &str, got: &[f64], expected: &[f64]) -> Result<(), String> {
    let same = got.len() == expected.len() && got.iter().zip(expected).all(|(a, b)| (a - b).abs() <= TOLERANCE);
    if same { Ok(()) } else { Err(format!("{what} is {got:?}, not {expected:?}")) }
}

fn compare_text(what: &str, got: &str, expected: &str) -> Result<(), String> {
    if got == expected { Ok(()) } else { Err(format!("{what} is {got:?}, not {expected:?}")) }
}

#[cfg(test)]
mod tests;
