//! Calibration files of other programs.
//!
//! Every format is one [`Format`] in [`formats`]. A file states in its first comment the direction of its transform, has
//! every digit of every number, and is read back after writing and compared: a file that differs from the result is an
//! error and is not kept. `docs/reference/exports.md` lists the formats with their readers, directions and units.
//!
//! # Example
//! ```
//! use handeye_export::{ExportInput, ExportNames, by_name, preview};
//!
//! let result = handeye_result::testing::golden();
//! let names = ExportNames::default();
//! let files = preview(by_name("static_transform_ros2")?, &ExportInput::new(&result, &names))?;
//! assert!(files[0].text.contains("static_transform_publisher"));
//! # Ok::<(), handeye_export::ExportError>(())
//! ```
//!
//! A new format is one file here, one entry in [`formats`] and one row of the documentation. Never depends on images, sessions or
//! data sets.

#![warn(missing_docs)]

mod arm_urdf;
mod colmap;
mod corrected;
mod dh_table;
mod easy_handeye;
mod easy_handeye2;
mod error;
mod ethz;
mod industrial_calibration;
mod input;
mod json;
mod kalibr;
mod matlab;
mod moveit_launch;
mod mrcal;
mod names;
mod nerfstudio;
mod opencv_yaml;
mod ros_camera_info;
mod ros_tf;
mod rotation;
mod static_transform;
mod text;
mod ur_frames;
mod ur_kinematics;
mod urdf;
mod visp;
mod xacro;
mod xml;
mod yaml;
mod zivid;

use std::fs;
use std::path::{Path, PathBuf};

use handeye_files::{atomic_file, own_folder};
use handeye_result::ResultProblem;
use handeye_wording::Text;
use handeye_wording::one_line;

pub use error::ExportError;
pub use input::{ExportInput, ExportView};
pub use names::{CameraLink, ExportNames, REP103_OPTICAL_XYZW};

/// Largest difference between a number in a result and in its export, in the unit of the file.
pub const TOLERANCE: f64 = 1e-9;

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportFile {
    /// Its name, without folder.
    pub name: String,
    /// Its content.
    pub text: String,
}

impl ExportFile {
    fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), text: text.into() }
    }
}

/// A file format of another program.
pub trait Format: Send + Sync {
    /// Name on the command line, `snake_case`.
    fn name(&self) -> &'static str;

    /// Its contents and its readers, in half a sentence.
    fn description(&self) -> Text;

    /// The files of an input that was checked; [`preview`] checks it.
    ///
    /// # Errors
    /// [`ExportError`] when the input does not have what the format needs, or has what the format cannot hold.
    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError>;

    /// Parses a file of [`Self::render`] and compares it with the input.
    ///
    /// # Errors
    /// Differences of more than [`TOLERANCE`] and missing values, as text.
    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String>;
}

/// Every format, in the order of lists.
pub fn formats() -> &'static [&'static dyn Format] {
    &[
        &json::Json,
        &ros_camera_info::RosCameraInfo,
        &opencv_yaml::OpencvYaml,
        &easy_handeye2::EasyHandeye2,
        &easy_handeye::EasyHandeye,
        &static_transform::Ros2,
        &static_transform::Ros1,
        &ros_tf::RosTf,
        &urdf::Urdf,
        &xacro::Xacro,
        &moveit_launch::MoveitLaunch,
        &kalibr::Kalibr,
        &mrcal::Mrcal,
        &visp::Visp,
        &zivid::Zivid,
        &industrial_calibration::IndustrialCalibration,
        &ethz::Ethz,
        &matlab::Matlab,
        &colmap::Colmap,
        &nerfstudio::Nerfstudio,
        &arm_urdf::ArmUrdf,
        &ur_kinematics::UrKinematics,
        &dh_table::DhTable,
    ]
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

/// The files of a format as they would be written, without writing anything.
///
/// # Errors
/// [`ExportError`] when the names or the result are not usable or the format cannot hold them: the text states why and
/// what to do.
pub fn preview(format: &dyn Format, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
    input.names.check()?;
    input.result.check().map_err(|e| ExportError::BadResult(ResultProblem::Bad(e)))?;
    format.render(input)
}

/// Writes the files of all `formats` into a folder, which is created if needed, reads every file back and compares it with
/// the result. Gives the paths written, in order. Files and links that were there are replaced, each as a whole.
///
/// # Errors
/// [`ExportError`] for the first format that cannot be written; everything is rendered before anything is written.
pub fn write_all(folder: &Path, formats: &[&dyn Format], input: &ExportInput<'_>) -> Result<Vec<PathBuf>, ExportError> {
    let mut rendered = Vec::new();
    for format in formats {
        for file in preview(*format, input)? {
            rendered.push((*format, file));
        }
    }
    let io = |file: &Path, e: std::io::Error| ExportError::Io { file: file.to_path_buf(), problem: one_line(&e) };
    own_folder::check_folder(folder).and_then(|()| fs::create_dir_all(folder)).map_err(|e| io(folder, e))?;
    let mut written = Vec::with_capacity(rendered.len());
    for (format, file) in rendered {
        let path = folder.join(&file.name);
        atomic_file::write(&path, file.text.as_bytes()).map_err(|e| io(&path, e))?;
        let text = fs::read_to_string(&path).map_err(|e| io(&path, e))?;
        format
            .compare(&ExportFile { name: file.name, text }, input)
            .map_err(|difference| ExportError::ReadBack { file: path.clone(), difference })?;
        written.push(path);
    }
    Ok(written)
}

#[cfg(test)]
mod arm_tests;
#[cfg(test)]
mod golden_tests;
#[cfg(test)]
mod property_tests;
#[cfg(test)]
mod tests;
