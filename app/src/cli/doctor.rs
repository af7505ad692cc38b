//! `handeye doctor`: what is wrong with a session or a dataset folder.

use std::path::{Path, PathBuf};

use clap::Args;
use handeye_core::atomic_file;
use handeye_core::calibrate::{CalibrateError, Method, calibrate};
use handeye_core::dataset::Dataset;
use handeye_core::doctor::{Diagnosis, diagnose};
use handeye_core::findings::FindingOptions;
use handeye_core::handeye::HandEyeError;
use handeye_core::session::Session;

use super::{Failure, solve};

/// Options of `handeye doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Session or dataset folder: images, a pose table and dataset.toml.
    path: PathBuf,
    /// Write the diagnosis as JSON to this file; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// The expected error to reach, millimetres (95 %).
    #[arg(long, value_name = "MM")]
    goal: Option<f64>,
}

/// Prints the diagnosis. A session that is ill is an answer, not a failure: the exit code is 0.
pub fn run(args: &DoctorArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let dataset = Dataset::read(&args.path).map_err(Failure::unusable)?;
    let mut observations = solve::observations(&dataset, &cancel)?;
    if Session::is_session(&args.path) {
        let session = Session::open(&args.path).map_err(Failure::unusable)?;
        solve::add_excluded(&session.document, &mut observations);
    }
    let calibration = match calibrate(&observations, Method::Joint, &cancel) {
        Ok(calibration) => Some(calibration),
        Err(CalibrateError::HandEye(HandEyeError::Cancelled)) => {
            return Err(Failure::failed(CalibrateError::HandEye(HandEyeError::Cancelled)));
        }
        // Why there is none is what the diagnosis is about.
        Err(error) => {
            tracing::warn!("no calibration: {error}");
            None
        }
    };
    let options = FindingOptions { goal_mm: args.goal };
    let diagnosis = diagnose(&observations, calibration.as_ref(), &options, &cancel);
    if cancel.is_cancelled() {
        return Err(Failure::failed(HandEyeError::Cancelled));
    }
    match &args.json {
        Some(file) if file.as_os_str() == "-" => println!("{}", json(&diagnosis)?),
        Some(file) => {
            write(file, &json(&diagnosis)?)?;
            print!("{}", diagnosis.report());
        }
        None => print!("{}", diagnosis.report()),
    }
    Ok(())
}

fn json(diagnosis: &Diagnosis) -> Result<String, Failure> {
    serde_json::to_string_pretty(diagnosis).map_err(Failure::failed)
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    atomic_file::write(file, format!("{text}\n").as_bytes())
        .map_err(|error| Failure::failed(anyhow::anyhow!("cannot write {}: {error}", file.display())))
}
