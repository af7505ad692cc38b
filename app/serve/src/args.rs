//! `handeye serve`, as on the command line.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

use clap::Args;

use handeye_ui::GuiArgs;
use handeye_workbench::arguments::heading;

/// Options of the workbench in a browser.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// Address of this machine to listen at. With any but 127.0.0.1 the address that is printed has a key in it, without which
    /// access is refused.
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST), help_heading = heading::ACCESS)]
    pub bind: IpAddr,
    /// Port to listen at; 0 takes a free one.
    #[arg(long, default_value_t = 8600, help_heading = heading::ACCESS)]
    pub port: u16,
    /// A further folder that may be read and written from a browser, in addition to that of the sessions; can be repeated.
    #[arg(long, value_name = "DIR", help_heading = heading::ACCESS)]
    pub allow: Vec<PathBuf>,
    /// As for the window.
    #[command(flatten)]
    pub gui: GuiArgs,
}
