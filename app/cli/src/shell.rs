//! `handeye completions` and `handeye man`: what shells and the program `man` read.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::{Args, CommandFactory as _};
use clap_complete::Shell;
use handeye_workbench::arguments::heading;

use crate::{Cli, Failure, out};

/// At the end of the help of `handeye completions`.
pub const EXAMPLES: &str = "Examples:
  handeye completions bash
  handeye completions zsh";

/// Options of `handeye completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell that reads them.
    shell: Shell,
}

/// Options of `handeye man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Write the pages here: handeye.1, handeye-auto.1 and so on.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    pub out: PathBuf,
}

pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    out::bytes(completions_of(args.shell).as_bytes())
}

pub fn completions_of(shell: Shell) -> String {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "handeye", &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let written = std::fs::create_dir_all(&args.out).and_then(|()| clap_mangen::generate_to(Cli::command(), &args.out));
    written.map_err(|error| Failure::failed(anyhow!("{}: cannot be written: {error}", args.out.display())))
}
