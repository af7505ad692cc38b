//! `handeye export`: calibration files from a solved session or dataset, or from a result JSON.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;
use handeye_dataset::{self as dataset, Dataset};
use handeye_export::{CameraLink, ExportError, ExportInput, ExportNames, ExportView, Format};
use handeye_result::CalibrationResult;
use handeye_session::{CaptureRecord, Session};

use crate::{Failure, out, solve};
use handeye_workbench::arguments::heading;

/// Name of the result in `calibrate --out` and `export --format json`.
const EXPORTED_RESULT: &str = "calibration.json";

/// At the end of its help.
pub const EXAMPLES: &str = "Examples:
  handeye sample --out my_robot_images
  handeye calibrate my_robot_images --json result.json
  handeye export result.json --format ros_camera_info easy_handeye2 --out files";

/// Options of `handeye export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Solved session or dataset (a folder with result.json or calibration.json), or a result JSON.
    path: PathBuf,
    /// Formats to write.
    #[arg(long, required = true, num_args = 1.., value_name = "NAME", value_parser = format_names(), help_heading = heading::OUTPUT)]
    format: Vec<String>,
    /// Folder to write into.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    out: PathBuf,
    /// Name of the calibration in the files.
    #[arg(long, value_name = "NAME", help_heading = heading::NAMES)]
    name: Option<String>,
    /// Name of the camera in the files.
    #[arg(long, value_name = "NAME", help_heading = heading::NAMES)]
    camera_name: Option<String>,
    /// Name of the robot's base frame in the files.
    #[arg(long, value_name = "FRAME", help_heading = heading::NAMES)]
    base_frame: Option<String>,
    /// Name of the robot's tip frame in the files.
    #[arg(long, value_name = "FRAME", help_heading = heading::NAMES)]
    effector_frame: Option<String>,
    /// Name of the camera's optical frame in the files.
    #[arg(long, value_name = "FRAME", help_heading = heading::NAMES)]
    camera_frame: Option<String>,
    /// Name of the target's frame in the files.
    #[arg(long, value_name = "FRAME", help_heading = heading::NAMES)]
    target_frame: Option<String>,
    /// Publish where this body frame of the camera is, not the optical frame: for cameras whose driver publishes the
    /// optical frame itself. The numbers are the optical frame in the body: its origin in metres, and its rotation
    /// where it is not that of ROS REP 103.
    #[arg(long, value_name = "FRAME[:X,Y,Z[,QX,QY,QZ,QW]]", value_parser = camera_link, help_heading = heading::NAMES)]
    camera_link: Option<CameraLink>,
}

fn format_names() -> Vec<&'static str> {
    handeye_export::formats().iter().map(|f| f.name()).collect()
}

fn camera_link(text: &str) -> Result<CameraLink, String> {
    let (frame, numbers) = text.split_once(':').map_or((text, None), |(frame, numbers)| (frame, Some(numbers)));
    let mut link = CameraLink { frame: frame.to_owned(), ..CameraLink::default() };
    let Some(numbers) = numbers else { return Ok(link) };
    let number = |word: &str| word.trim().parse::<f64>().map_err(|_error| format!("{word:?} is not a number"));
    match numbers.split(',').map(number).collect::<Result<Vec<_>, _>>()?[..] {
        [x, y, z] => link.translation_m = [x, y, z],
        [x, y, z, qx, qy, qz, qw] => {
            link.translation_m = [x, y, z];
            link.rotation_xyzw = [qx, qy, qz, qw];
        }
        ref other => return Err(format!("{} numbers; x,y,z or x,y,z,qx,qy,qz,qw are needed", other.len())),
    }
    Ok(link)
}

pub fn run(args: &ExportArgs) -> Result<(), Failure> {
    let result = read_result(&args.path)?;
    let formats = args
        .format
        .iter()
        .map(|name| handeye_export::by_name(name))
        .collect::<Result<Vec<_>, _>>()
        .map_err(Failure::unusable)?;
    let names = names(args);
    let mut input = ExportInput::new(&result, &names);
    let views =
        if formats.iter().any(|format| needs_views(*format, &input)) { read_views(&args.path)? } else { vec![] };
    input.views = &views;
    let written = handeye_export::write_all(&args.out, &formats, &input)
        .map_err(|error| if error.is_bad_input() { Failure::unusable(error) } else { Failure::failed(error) })?;
    for path in written {
        out::line(path.display())?;
    }
    Ok(())
}

fn names(args: &ExportArgs) -> ExportNames {
    let mut names = ExportNames { camera_link: args.camera_link.clone(), ..ExportNames::default() };
    let given = [
        (&mut names.calibration, &args.name),
        (&mut names.camera_name, &args.camera_name),
        (&mut names.base_frame, &args.base_frame),
        (&mut names.effector_frame, &args.effector_frame),
        (&mut names.camera_frame, &args.camera_frame),
        (&mut names.target_frame, &args.target_frame),
    ];
    for (slot, value) in given {
        if let Some(value) = value {
            slot.clone_from(value);
        }
    }
    names
}

/// Whether a format needs poses of images. Most do not, and then no dataset is read.
fn needs_views(format: &dyn Format, input: &ExportInput<'_>) -> bool {
    matches!(handeye_export::preview(format, input), Err(ExportError::NeedsViews { .. }))
}

/// Images with robot poses of the session or data set that contains a result; empty if there is none.
fn read_views(path: &Path) -> Result<Vec<ExportView>, Failure> {
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(path) };
    if Session::is_session(folder) {
        let session = Session::open(folder).map_err(Failure::unusable)?;
        return Ok(session.document.in_use().filter_map(CaptureRecord::export_view).collect());
    }
    if !folder.join(dataset::DESCRIPTION).is_file() {
        return Ok(Vec::new());
    }
    let dataset = Dataset::read(folder).map_err(Failure::unusable)?;
    let view = |entry: dataset::Entry| {
        let base_from_tip = entry.base_from_tip?;
        Some(ExportView { name: entry.name, base_from_tip })
    };
    Ok(dataset.entries.into_iter().filter_map(view).collect())
}

/// The result of a session or dataset, or a result file itself.
pub fn read_result(path: &Path) -> Result<CalibrationResult, Failure> {
    let file = if path.is_dir() {
        let found = [solve::RESULT_FILE, EXPORTED_RESULT].map(|name| path.join(name)).into_iter().find(|f| f.is_file());
        found.ok_or_else(|| {
            let (folder, result) = (path.display(), path.join(solve::RESULT_FILE));
            let result = result.display();
            Failure::unusable(anyhow!(
                "{folder} has no {} and no {EXPORTED_RESULT}: run `handeye calibrate {folder} --json {result}` first",
                solve::RESULT_FILE
            ))
        })?
    } else {
        path.to_path_buf()
    };
    CalibrationResult::read(&file).map_err(Failure::unusable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_link_is_a_frame_with_an_offset_that_may_be_left_out() {
        assert_eq!(camera_link("camera_link"), Ok(CameraLink::default()));
        let moved = CameraLink { frame: "a".into(), translation_m: [0.0, 0.015, -1e-3], ..CameraLink::default() };
        assert_eq!(camera_link("a:0,0.015,-1e-3"), Ok(moved.clone()));
        assert_eq!(
            camera_link("a:0,0.015,-1e-3,0,0,0,1"),
            Ok(CameraLink { rotation_xyzw: [0.0, 0.0, 0.0, 1.0], ..moved })
        );
        for bad in ["a:", "a:1,2", "a:x,0,0", "a:0,0,0,0,0,0,1,0"] {
            assert!(camera_link(bad).is_err(), "{bad}");
        }
    }
}
