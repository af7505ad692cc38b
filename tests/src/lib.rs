//! Support for the end-to-end tests: where things are, and how to run them as a user does.

pub mod browser;
pub mod coppeliasim;
pub mod desktop;
pub mod hostile;
pub mod network;
pub mod process;
pub mod served;
pub mod watch;
pub mod workbench;

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use handeye_cell::scene::Scene;

pub fn workspace_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or_else(|| Path::new("."))
}

/// Makes time pass four times as fast in a cell if only the outcome counts, in passes of a fifth of a second: every pass that an
/// arm takes to its goal is an image that is drawn, sent and searched.
pub fn hurry(scene: &mut Scene) {
    scene.simulation.time_step_s = 0.2;
    scene.simulation.speed_factor = 4.0;
}

/// A file in `folder` with a shipped scene that [hurries](hurry).
///
/// # Panics
/// When the scene is not there or cannot be written.
pub fn hurried(scene: &str, folder: &Path) -> PathBuf {
    let mut read = Scene::load(&workspace_root().join(format!("assets/scenes/{scene}.toml"))).expect("a scene");
    hurry(&mut read);
    let text = toml::to_string(&read).expect("TOML");
    let file = folder.join(format!("{scene}.toml"));
    std::fs::write(&file, text).expect("written");
    file
}

/// The `handeye` binary next to the running test; `./test` and `cargo test --workspace` build it first.
pub fn handeye_binary() -> PathBuf {
    let mut folder = std::env::current_exe().unwrap_or_default();
    folder.pop();
    if folder.ends_with("deps") {
        folder.pop();
    }
    folder.join(format!("handeye{}", std::env::consts::EXE_SUFFIX))
}

/// `handeye cell` as a process of its own, on a free port; killed when dropped.
#[derive(Debug)]
pub struct CellProcess {
    child: Child,
    port: u16,
}

impl CellProcess {
    /// Starts it on any free port and waits for its line.
    pub fn start(arguments: &[&str]) -> Self {
        Self::start_on(0, arguments)
    }

    /// Starts it on a port (0 for any) and waits for its line.
    ///
    /// # Panics
    /// When it does not report that it listens.
    pub fn start_on(port: u16, arguments: &[&str]) -> Self {
        let mut child = Command::new(handeye_binary())
            .args(["cell", "--quiet", "--port", &port.to_string()])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("{}: {error}; run cargo build -p handeye_app", handeye_binary().display()));
        let mut line = String::new();
        if let Some(stdout) = child.stdout.take() {
            BufReader::new(stdout).read_line(&mut line).unwrap_or_default();
        }
        let port = line
            .trim()
            .strip_prefix("listening on tcp://")
            .and_then(|address| address.rsplit(':').next())
            .and_then(|port| port.parse().ok())
            .unwrap_or_else(|| panic!("the cell said {line:?} instead of where it listens"));
        Self { child, port }
    }

    /// Where it listens on 127.0.0.1.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Ends it at once, as a crash would.
    pub fn kill(&mut self) {
        if self.child.kill().and_then(|()| self.child.wait()).is_err() {
            eprintln!("the cell was gone already");
        }
    }
}

impl Drop for CellProcess {
    fn drop(&mut self) {
        self.kill();
    }
}
