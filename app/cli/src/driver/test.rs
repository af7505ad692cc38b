//! `handeye driver test`: for authors of drivers.

use clap::Args;
use handeye_driver::conformance::{self, ConformanceOptions};
use handeye_driver::{BadSpec, DriverSpec};

use super::python;
use crate::output::Output;
use crate::{Failure, out, solve};
use handeye_workbench::arguments::heading;

/// Options of `handeye driver test`.
#[derive(Debug, Args)]
pub struct TestArgs {
    /// The command that starts the driver, in quotes where it has arguments, or tcp://HOST:PORT where it listens.
    #[arg(value_name = "COMMAND", required_unless_present = "tcp")]
    command: Option<String>,
    /// Connect to a driver that listens there, in place of a command.
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "command", help_heading = heading::CELL)]
    tcp: Option<String>,
    /// Allow the arm to be moved: by up to 0.2 rad in one joint, or 2 cm.
    #[arg(long, help_heading = heading::CELL)]
    allow_motion: bool,
    /// Write the report as JSON to this file; `-` for standard output instead of the text.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
}

/// Prints the report. Exit code 1 if a check failed, 2 if there is no driver to test.
pub fn run(args: &TestArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let spec = spec(args).map_err(Failure::unusable)?;
    // Here, where its progress is visible: of a driver's output only errors are printed.
    python::prepare(&spec)?;
    let options = ConformanceOptions { allow_motion: args.allow_motion, ..ConformanceOptions::default() };
    let report = conformance::run(&spec, &options, &cancel).map_err(Failure::unusable)?;
    if let Some(output) = &args.json {
        let text = serde_json::to_string_pretty(&report).map_err(Failure::failed)?;
        output.write(format!("{text}\n").as_bytes())?;
    }
    if !args.json.as_ref().is_some_and(Output::is_standard) {
        out::print(&report.text())?;
    }
    if cancel.is_cancelled() {
        return Err(Failure::failed(anyhow::anyhow!("the test was cancelled")));
    }
    if report.passed { Ok(()) } else { Err(Failure::failed(anyhow::anyhow!("{spec} does not pass"))) }
}

fn spec(args: &TestArgs) -> Result<DriverSpec, BadSpec> {
    match (&args.tcp, &args.command) {
        (Some(address), _) if !address.contains("://") => format!("tcp://{address}").parse(),
        (Some(address), _) => address.parse(),
        (None, command) => command.as_deref().unwrap_or_default().parse(),
    }
}
