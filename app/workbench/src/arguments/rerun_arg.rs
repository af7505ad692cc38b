//! The option `--rerun` of every command that has something to show.

use clap::Args;

use super::heading;
use crate::rerun_log::RerunChoice;

/// The option `--rerun`.
#[derive(Debug, Clone, Default, Args)]
pub struct RerunArg {
    /// Show it in Rerun: in the native viewer (spawn), in a browser (web), or in a viewer that runs (connect URL); or
    /// record it into a file (save FILE), or not at all (off).
    // One value: the second word is joined to the first before anything is parsed, see `joined`.
    #[arg(long, value_name = "spawn|web|connect URL|save FILE|off", value_parser = RerunChoice::parse, help_heading = heading::OUTPUT)]
    rerun: Option<RerunChoice>,
}

impl RerunArg {
    /// What was asked for, or else what the command does by itself.
    pub fn choice(&self, otherwise: RerunChoice) -> RerunChoice {
        self.rerun.clone().unwrap_or(otherwise)
    }

    /// What was asked for.
    pub fn asked(&self) -> Option<&RerunChoice> {
        self.rerun.as_ref()
    }
}
