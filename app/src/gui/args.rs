//! `handeye gui`, as the command line has it.

use clap::Args;

use crate::cli::RerunArg;

/// Options of the workbench.
#[derive(Debug, Args, Default)]
pub struct GuiArgs {
    /// Address of a CoppeliaSim or cell; without it the built-in cell is started.
    #[arg(long, value_name = "ADDR")]
    pub connect: Option<String>,
    /// Session folder to open, or to create.
    #[arg(long, value_name = "DIR")]
    pub session: Option<std::path::PathBuf>,
    /// Where the recording goes; beside the session if not given.
    #[command(flatten)]
    pub rerun: RerunArg,
}
