//! The binary `handeye`: arguments, logging, exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    handeye_app::cli::main()
}
