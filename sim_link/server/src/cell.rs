//! The built-in cell as the functions of the API see it.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use ciborium::Value;

use super::cameras::Cameras;
use super::stage::{self, Stage};
use handeye_cell::scene::{ResolvedScene, Scene, SceneError};
use handeye_cell::world::{World, WorldError};

/// Signals and custom data that are kept, and the longest of them.
pub const MAX_SIGNALS: usize = 256;
/// Longest signal in bytes.
pub const MAX_SIGNAL_BYTES: usize = 64 << 10;

/// Log lines that are kept.
const MAX_LOG: usize = 200;

/// Why a cell cannot be built.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum BuildError {
    /// The scene is not usable.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene has more objects than a world takes.
    #[error("the scene does not fit: {why}", why = .0.to_string())]
    World(#[from] WorldError),
}

/// World, cameras, truth and settings.
#[derive(Debug)]
pub struct Cell {
    /// The objects and the simulation.
    pub world: World,
    /// Handles of the objects.
    pub stage: Stage,
    /// Images of the vision sensors.
    pub cameras: Cameras,
    /// The ground truth of this run.
    pub scene: ResolvedScene,
    /// The server's clock at the current call: time since it was started.
    pub now: Duration,
    /// Whether a pass takes as long as it simulates.
    pub real_time: bool,
    /// Simulated seconds per real second, where time is real.
    pub speed_factor: f64,
    /// Values that clients leave for each other.
    pub signals: BTreeMap<String, Value>,
    /// `sim.intparam_idle_fps`, which scripts set; nothing here sleeps between requests.
    pub idle_fps: i64,
    /// Latest log lines of the clients.
    pub log: VecDeque<String>,
}

impl Cell {
    /// The cell of a scene. `seed` and `real_time` override those of the scene.
    ///
    /// # Errors
    /// [`BuildError`], for scenes that are out of range.
    pub fn new(scene: &Scene, seed: Option<u64>, real_time: Option<bool>) -> Result<Self, BuildError> {
        let resolved = scene.resolve(seed.unwrap_or(scene.seed))?;
        let (world, stage) = stage::build(scene, &resolved)?;
        Ok(Self {
            world,
            stage,
            cameras: Cameras::new(&resolved),
            now: Duration::ZERO,
            real_time: real_time.unwrap_or(resolved.simulation.real_time),
            speed_factor: resolved.simulation.speed_factor,
            signals: BTreeMap::new(),
            idle_fps: 8,
            log: VecDeque::new(),
            scene: resolved,
        })
    }

    /// Keeps a line that a client logged.
    pub fn add_log(&mut self, line: String) {
        if self.log.len() == MAX_LOG {
            self.log.pop_front();
        }
        self.log.push_back(line);
    }
}
