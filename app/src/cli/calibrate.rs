//! `handeye calibrate`: solves a session or a dataset folder.

use std::path::PathBuf;

use clap::Args;
use handeye_core::calibrate::Method;

use super::{Failure, report, solve};

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
}

pub fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let method = Method::by_name(&args.method)
        .ok_or_else(|| Failure::unusable(anyhow::anyhow!("no method {:?}", args.method)))?;
    let result = solve::folder(&args.path, method)?;
    if let Some(folder) = &args.out {
        solve::write_exports(folder, &result)?;
    }
    match &args.json {
        Some(file) if file.as_os_str() == "-" => {
            println!("{}", result.to_json().map_err(Failure::failed)?);
            return Ok(());
        }
        Some(file) => result.write(file).map_err(Failure::failed)?,
        None => {}
    }
    print!("{}", report::text(&result));
    Ok(())
}
