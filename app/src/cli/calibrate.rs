//! `handeye calibrate`: solves a session or a dataset folder.

use std::path::PathBuf;

use clap::Args;
use handeye_core::estimate::{Method, Options};

use super::gate::{self, Gate};
use super::output::Output;
use super::{Failure, RerunArg, rerun_arg, solve};
use crate::rerun_log::{Pace, RerunChoice};

/// Options of `handeye calibrate`.
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// Session or dataset folder: images, a pose table and dataset.toml.
    path: PathBuf,
    /// Write the result as JSON to this file; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Which answer: the joint estimate, or one closed form.
    #[arg(long, value_name = "NAME", default_value = "joint", value_parser = Method::names())]
    method: String,
    /// Write the result and its exports into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep views and corners that do not fit the others; without it they are left out as outliers and named.
    #[arg(long)]
    keep_outliers: bool,
    /// Estimate the true size of the target, which the robot's translations tell.
    #[arg(long)]
    free_scale: bool,
    /// Try constant offsets of the robot's joints, and take them when views held out say so. Needs joint angles.
    #[arg(long)]
    joint_offsets: bool,
    /// End with exit code 1 unless a number of the result is below a limit, such as `tip_error_95_mm<0.5`. A finding that
    /// is a problem ends with it too, whatever the numbers.
    #[arg(long, value_name = "NAME<LIMIT")]
    gate: Vec<Gate>,
    #[command(flatten)]
    rerun: RerunArg,
}

impl CalibrateArgs {
    fn options(&self) -> Options {
        Options { keep_outliers: self.keep_outliers, free_scale: self.free_scale, joint_offsets: self.joint_offsets }
    }
}

pub fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let method = Method::by_name(&args.method)
        .ok_or_else(|| Failure::unusable(anyhow::anyhow!("no method {:?}", args.method)))?;
    let cancel = solve::cancel_on_ctrl_c();
    let recorder = args.rerun.start(RerunChoice::Off, Pace::Everything, false)?;
    let solution = solve::folder(&args.path, method, args.options(), None, &cancel)?;
    let result = solution.result();
    if let Some(folder) = &args.out {
        solve::write_exports(folder, result)?;
    }
    solution.publish(args.json.as_ref())?;
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)?;
    let failures = gate::failures(&args.gate, result);
    if failures.is_empty() { Ok(()) } else { Err(Failure::failed(anyhow::anyhow!("{}", failures.join("; ")))) }
}
