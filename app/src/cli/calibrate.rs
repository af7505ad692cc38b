//! `handeye calibrate`: solves a session or a dataset folder.

use std::path::PathBuf;

use clap::Args;
use handeye_core::calibrate::Method;

use super::{Failure, RerunArg, report, rerun_arg, solve};
use crate::rerun_log::{Pace, RerunChoice};

/// Options of `handeye calibrate`.
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// Session or dataset folder: images, a pose table and dataset.toml.
    path: PathBuf,
    /// Write the result as JSON to this file; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Which answer: the joint estimate, or one closed form.
    #[arg(long, value_name = "NAME", default_value = "joint", value_parser = Method::names())]
    method: String,
    /// Write the result and its exports into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    rerun: RerunArg,
}

pub fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let method = Method::by_name(&args.method)
        .ok_or_else(|| Failure::unusable(anyhow::anyhow!("no method {:?}", args.method)))?;
    let cancel = solve::cancel_on_ctrl_c();
    let recorder = args.rerun.start(RerunChoice::Off, Pace::Everything, false)?;
    let solution = solve::folder(&args.path, method, None, &cancel)?;
    let result = solution.result();
    if let Some(folder) = &args.out {
        solve::write_exports(folder, result)?;
    }
    match &args.json {
        Some(file) if file.as_os_str() == "-" => {
            println!("{}", result.to_json().map_err(Failure::failed)?);
        }
        Some(file) => {
            result.write(file).map_err(Failure::failed)?;
            print!("{}", report::text(result));
        }
        None => print!("{}", report::text(result)),
    }
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)
}
