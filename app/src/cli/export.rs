//! `handeye export`: calibration files from a solved session or a result JSON.

use std::path::{Path, PathBuf};

use clap::Args;
use handeye_core::export::{self, ExportNames};
use handeye_core::result::CalibrationResult;

use super::{Failure, solve};

/// Options of `handeye export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Solved session (a folder with result.json), or a result JSON.
    path: PathBuf,
    /// Formats to write.
    #[arg(long, required = true, num_args = 1.., value_name = "NAME", value_parser = format_names())]
    format: Vec<String>,
    /// Folder to write into.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Name of the calibration in the files.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Name of the robot's base frame in the files.
    #[arg(long, value_name = "FRAME")]
    base_frame: Option<String>,
    /// Name of the robot's tip frame in the files.
    #[arg(long, value_name = "FRAME")]
    effector_frame: Option<String>,
    /// Name of the camera's optical frame in the files.
    #[arg(long, value_name = "FRAME")]
    camera_frame: Option<String>,
}

fn format_names() -> Vec<&'static str> {
    export::formats().iter().map(|f| f.name()).collect()
}

pub fn run(args: &ExportArgs) -> Result<(), Failure> {
    let result = read_result(&args.path)?;
    let formats = args
        .format
        .iter()
        .map(|name| export::by_name(name))
        .collect::<Result<Vec<_>, _>>()
        .map_err(Failure::unusable)?;
    let mut names = ExportNames::default();
    let given = [
        (&mut names.calibration, &args.name),
        (&mut names.base_frame, &args.base_frame),
        (&mut names.effector_frame, &args.effector_frame),
        (&mut names.camera_frame, &args.camera_frame),
    ];
    for (slot, value) in given {
        if let Some(value) = value {
            slot.clone_from(value);
        }
    }
    let written = export::write_all(&args.out, &formats, &result, &names)
        .map_err(|error| if error.is_bad_input() { Failure::unusable(error) } else { Failure::failed(error) })?;
    for path in written {
        println!("{}", path.display());
    }
    Ok(())
}

/// The result of a session, or a result file itself.
fn read_result(path: &Path) -> Result<CalibrationResult, Failure> {
    let file = if path.is_dir() { path.join(solve::RESULT_FILE) } else { path.to_path_buf() };
    if path.is_dir() && !file.exists() {
        return Err(Failure::unusable(anyhow::anyhow!(
            "{} has no {}: run `handeye calibrate {} --out {}` first",
            path.display(),
            solve::RESULT_FILE,
            path.display(),
            path.display()
        )));
    }
    CalibrationResult::read(&file).map_err(Failure::unusable)
}
