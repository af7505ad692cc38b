//! `handeye sample`: the recorded sample that comes with the program, as a data set folder.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use handeye_import::{ImportError, write};

use crate::Failure;
use handeye_workbench::arguments::heading;
use handeye_workbench::sample;

/// At the end of its help.
pub const EXAMPLES: &str = "Examples:
  handeye sample --out my_robot_images
  handeye calibrate my_robot_images";

/// Options of `handeye sample`.
#[derive(Debug, Args)]
pub struct SampleArgs {
    /// Write the dataset folder here; it must not be there yet, or be empty.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    out: PathBuf,
}

pub fn run(args: &SampleArgs) -> Result<(), Failure> {
    write::check_out(&args.out).map_err(|error| match error {
        ImportError::OutNotEmpty(folder) => Failure::unusable(anyhow!(
            "{}: is not empty: the sample is written into a new folder, name another one",
            folder.display()
        )),
        error => Failure::unusable(error),
    })?;
    sample::write(&args.out)
        .map_err(|error| Failure::failed(anyhow!("{}: cannot be written: {error}", args.out.display())))?;
    tracing::info!("wrote twelve images and the robot's poses to {}", args.out.display());
    Ok(())
}
