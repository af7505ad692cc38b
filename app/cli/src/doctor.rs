//! `handeye doctor`: what is wrong with a session or a dataset folder.

use std::path::PathBuf;

use clap::Args;
use handeye_estimate::diagnose::calibrate_with;
use handeye_estimate::diagnose::doctor::{Detail, diagnose};
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::handeye::HandEyeError;
use handeye_estimate::{CalibrateError, Method, Options};
use handeye_session::SessionObservations;

use super::output::Output;
use crate::{Failure, out, solve};
use handeye_workbench::arguments::heading;

/// Options of `handeye doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Session or dataset folder: images, a pose table and dataset.toml.
    path: PathBuf,
    /// Write the diagnosis as JSON to this file; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
    /// The error to reach, millimetres (95 %), as for `handeye auto`.
    #[arg(long, value_name = "MM", help_heading = heading::ESTIMATE)]
    goal: Option<f64>,
    /// List every hypothesis that was tested, with what it explains.
    #[arg(long, help_heading = heading::OUTPUT)]
    all: bool,
}

/// Prints the diagnosis. A faulty session is an answer, not a failure: the exit code is 0.
pub fn run(args: &DoctorArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let SessionObservations { observations, arm, robot_accuracy, .. } = solve::read(&args.path, &cancel)?.seen;
    let wanted = FindingOptions::with_goal_mm(args.goal).with_arm(arm.as_ref()).with_robot_accuracy(robot_accuracy);
    let diagnosis = match calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &cancel) {
        Ok(calibration) => calibration.into_diagnosis(),
        Err(error @ CalibrateError::HandEye(HandEyeError::Cancelled)) => return Err(Failure::failed(error)),
        // Why there is none is the subject of the diagnosis.
        Err(error) => {
            tracing::warn!("no calibration: {error}");
            diagnose(&observations, &wanted, &cancel)
        }
    };
    if cancel.is_cancelled() {
        return Err(Failure::failed(HandEyeError::Cancelled));
    }
    if let Some(output) = &args.json {
        let text = serde_json::to_string_pretty(&diagnosis).map_err(Failure::failed)?;
        output.write(format!("{text}\n").as_bytes())?;
    }
    if args.json.as_ref().is_some_and(Output::is_standard) {
        return Ok(());
    }
    out::print(&diagnosis.report(if args.all { Detail::All } else { Detail::Found }))
}
