//! `handeye cell`: serves the built-in cell.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::cell::server::{CellConfig, CellServer};

use super::{Failure, solve};

/// Options of `handeye cell`.
#[derive(Debug, Args)]
pub struct CellArgs {
    /// Address of the network interface to serve on.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    bind: String,
    /// Port; 0 picks one that is free.
    #[arg(long, value_name = "PORT", default_value_t = 23000)]
    port: u16,
    /// Seed of everything random in the cell; the scene's own if not given.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    scene: SceneArg,
    /// Let simulated time run as fast as it can instead of like real time.
    #[arg(long)]
    fast: bool,
}

/// The option `--scene`.
#[derive(Debug, Args)]
pub struct SceneArg {
    /// Scene file (TOML); the reference scene if not given.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
}

impl SceneArg {
    /// Reads the scene.
    pub fn load(&self) -> Result<Scene, Failure> {
        match &self.scene {
            Some(file) => Scene::load(file),
            None => Scene::reference(),
        }
        .map_err(Failure::unusable)
    }

    /// Whether a file was named.
    pub fn is_given(&self) -> bool {
        self.scene.is_some()
    }
}

/// How soon after Ctrl-C the cell ends.
const POLL: Duration = Duration::from_millis(100);

pub fn run(args: &CellArgs) -> Result<(), Failure> {
    let server = CellServer::start(CellConfig {
        scene: args.scene.load()?,
        seed: args.seed,
        bind: args.bind.clone(),
        port: args.port,
        real_time: args.fast.then_some(false),
    })
    .map_err(Failure::failed)?;
    println!("listening on {}", server.endpoint());
    let cancel = solve::cancel_on_ctrl_c();
    while !cancel.is_cancelled() {
        std::thread::sleep(POLL);
    }
    server.stop();
    Ok(())
}
