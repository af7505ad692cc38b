//! Serves the built-in cell until it is interrupted: `cargo run --example serve_cell -- [PORT] [SCENE FILE]`.

use std::path::Path;

use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::cell::server::{CellConfig, CellServer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let port = args.next().map_or(Ok(0), |port| port.parse())?;
    let scene = match args.next() {
        Some(file) => Scene::load(Path::new(&file))?,
        None => Scene::reference()?,
    };
    let server = CellServer::start(CellConfig { port, ..CellConfig::new(scene) })?;
    println!("listening on {}", server.endpoint());
    loop {
        std::thread::park();
    }
}
