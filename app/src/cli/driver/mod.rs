//! `handeye driver`: a conformance run of a driver, and the drivers that come with the workbench.

mod fake;
mod test;

use clap::{Args, Subcommand};

use super::Failure;

pub const EXAMPLES: &str = "Examples:
  handeye driver test \"python3 assets/drivers/template.py\" --allow-motion
  handeye driver test tcp://192.168.0.7:7000
  handeye driver fake --listen 127.0.0.1:7000";

/// Options of `handeye driver`.
#[derive(Debug, Args)]
pub struct DriverArgs {
    #[command(subcommand)]
    command: DriverCommand,
}

#[derive(Debug, Subcommand)]
enum DriverCommand {
    /// Say whether a driver keeps to the protocol, and where it does not, with the line.
    #[command(after_help = EXAMPLES)]
    Test(test::TestArgs),
    /// Be a driver with the built-in cell behind it, on standard input and output or over TCP.
    #[command(after_help = "Example:\n  handeye driver test \"handeye driver fake\" --allow-motion")]
    Fake(fake::FakeArgs),
}

pub fn run(args: &DriverArgs) -> Result<(), Failure> {
    match &args.command {
        DriverCommand::Test(args) => test::run(args),
        DriverCommand::Fake(args) => fake::run(args),
    }
}
