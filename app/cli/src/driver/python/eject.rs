//! `handeye driver eject`: a driver as a file, to be modified.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use clap::builder::PossibleValuesParser;

use super::files::ALL;
use super::script::Needs;
use crate::{Failure, out};
use handeye_workbench::arguments::heading;

/// Options of `handeye driver eject`.
#[derive(Debug, Args)]
pub struct EjectArgs {
    #[arg(value_name = "DRIVER", value_parser = PossibleValuesParser::new(ALL.iter().map(|driver| driver.name)))]
    driver: String,
    /// Write the files here; those that are there already are not overwritten.
    #[arg(long, value_name = "DIR", default_value = ".", help_heading = heading::OUTPUT)]
    out: PathBuf,
    /// Overwrite files that are there.
    #[arg(long, help_heading = heading::OUTPUT)]
    overwrite: bool,
}

/// Writes the driver and what it shares with others.
pub fn eject(args: &EjectArgs) -> Result<(), Failure> {
    let Some(driver) = ALL.iter().find(|driver| driver.name == args.driver) else { return Ok(()) };
    let files: Vec<_> = driver.files().map(|(file, source)| (args.out.join(file), source)).collect();
    // The shared one often exists already for another driver.
    let is_in_the_way =
        |path: &PathBuf, source: &str| std::fs::read(path).is_ok_and(|bytes| bytes != source.as_bytes());
    if let Some((path, _)) = files.iter().find(|(path, source)| !args.overwrite && is_in_the_way(path, source)) {
        let path = path.display();
        return Err(Failure::unusable(anyhow!(
            "{path} is there and differs: --out names another folder, --overwrite replaces it"
        )));
    }
    let failed = |path: &PathBuf, error: std::io::Error| {
        Failure::failed(anyhow!("{}: cannot be written: {error}", path.display()))
    };
    std::fs::create_dir_all(&args.out).map_err(|error| failed(&args.out, error))?;
    for (path, source) in &files {
        std::fs::write(path, source).map_err(|error| failed(path, error))?;
        out::line(format_args!("{}", path.display()))?;
    }
    let packages: Vec<_> = Needs::of(driver.source).map(|needs| needs.dependencies).unwrap_or_default();
    let quoted: Vec<_> = packages.iter().map(|package| format!("\"{package}\"")).collect();
    tracing::info!(
        "to run it: python3 -m venv env && env/bin/pip install {}; then the command env/bin/python {}, with its options, is a driver",
        quoted.join(" "),
        files[0].0.display()
    );
    Ok(())
}
