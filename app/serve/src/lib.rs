//! The workbench in a browser: the window is drawn here, and pages show it (protocol: docs/reference/browser.md).
//!
//! One thread owns egui's context and the [`Window`](handeye_ui::Window), as for a desktop window ([`host`]). What it
//! has drawn is a [`frame::Frame`]: triangles in chunks, and textures. Every page has a connection of its own
//! ([`socket`]), which sends what changed since the frame that this page has ([`difference`]); a slow page gets fewer
//! frames and does not delay others. The user's input at a page comes back through the [`hub`], which knows which page
//! drives.

mod access;
mod archive;
mod args;
mod chunks;
mod difference;
mod frame;
mod guesses;
mod host;
mod hub;
mod input;
mod memory;
mod reading;
mod site;
mod socket;
mod textures;
mod upload;

use std::net::SocketAddr;
use std::sync::Arc;

use anyhow::Context as _;
use axum::Router;

use handeye_http::door::{Door, Limits};
use handeye_ui::opening::{Begin, Opening};
use handeye_ui::signals::Signals;
use handeye_workbench::app::{InBrowser, Reach};

use access::Access;
pub use args::ServeArgs;
use host::Host;
use hub::Hub;
use site::Site;

/// Threads for connections of browsers.
const THREADS: usize = 2;

/// Limits for browsers. A page has one connection that lasts and a few for files.
const LIMITS: Limits = Limits {
    connections: 64,
    idle: std::time::Duration::from_secs(10),
    stalled: std::time::Duration::from_secs(30),
    // An upload of a recording has to arrive within this time.
    answer: std::time::Duration::from_mins(10),
};

/// Serves the workbench until it is requested to end, after `begin` with its application, and the recording next to it.
/// `announce` receives the address, once it can be opened.
///
/// # Errors
/// When the port is taken or the address does not belong to this machine, and as for the window.
pub fn run(args: ServeArgs, begin: Begin, recording: Router, announce: impl FnOnce(&str)) -> anyhow::Result<()> {
    let ServeArgs { bind, port, allow, gui } = args;
    let opening = Opening::read(gui, begin)?;
    let address = SocketAddr::new(bind, port);
    let access = Access::of(bind)?;
    let mut folders = vec![opening.sessions()];
    folders.extend(opening.session().map(std::path::Path::to_path_buf));
    folders.extend(allow);
    let reach = Reach::new(folders).with_uploads(upload::folder(&opening.sessions())).with_drivers(opening.drivers());
    let shown = InBrowser { reach, stop: Arc::default() };

    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(THREADS)
        .thread_name("browsers")
        .enable_all()
        .build()
        .context("there are no threads to serve from")?;
    let (hub, wakes) = Hub::new(Arc::clone(&shown.stop));
    let hub = Arc::new(hub);
    let site = Site::new(access, Arc::clone(&hub), shown.clone(), &opening.sessions());
    let site = Arc::new(site);
    let door = Door::at(address, runtime.handle(), LIMITS, Arc::clone(&site).routes(recording))
        .with_context(|| format!("cannot listen at {address}"))?;
    let signals = Signals::listen();
    let host = Host::open(opening, shown, Arc::clone(&hub), wakes, signals)?;
    announce(&site.url(door.address()));
    host.run();
    drop(door);
    runtime.shutdown_background();
    Ok(())
}
