//! `handeye cell`: serves the built-in cell.

use std::time::Duration;

use clap::Args;
use handeye_cell::scene::{BoardPath, Scene, SceneChoice};
use handeye_server::{CellConfig, CellServer};

use crate::{Failure, out, solve};
use handeye_workbench::arguments::{ArmErrorsChoice, heading};

/// Options of `handeye cell`.
#[derive(Debug, Args)]
pub struct CellArgs {
    /// Address of the network interface to serve on. Anyone who can connect can move the arm: there is no password.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1", help_heading = heading::ACCESS)]
    bind: String,
    /// Port; 0 picks one that is free.
    #[arg(long, value_name = "PORT", default_value_t = 23000, help_heading = heading::ACCESS)]
    port: u16,
    /// Seed of everything random in the cell; the scene's own if not given.
    #[arg(long, value_name = "N", help_heading = heading::CELL)]
    seed: Option<u64>,
    #[command(flatten)]
    scene: SceneArg,
    /// Let simulated time run as fast as it can instead of like real time.
    #[arg(long, help_heading = heading::CELL)]
    fast: bool,
    /// Move the board: still, circle, figure_eight, random_walk or step; from the scene if not given.
    #[arg(long, value_name = "PATH", help_heading = heading::BOARD)]
    board_path: Option<BoardPath>,
    /// Mean speed of the board in m/s; from the scene if not given.
    #[arg(long, value_name = "SPEED", help_heading = heading::BOARD)]
    board_speed: Option<f64>,
    /// How far the path of the board reaches in m; from the scene if not given.
    #[arg(long, value_name = "SIZE", help_heading = heading::BOARD)]
    board_size: Option<f64>,
    /// Largest angle in degrees by which the board is turned on its way; from the scene if not given.
    #[arg(long, value_name = "ANGLE", help_heading = heading::BOARD)]
    board_tilt: Option<f64>,
    /// Simulated time from image to image in s; from the scene if not given.
    #[arg(long, value_name = "SECONDS", help_heading = heading::CELL)]
    time_step: Option<f64>,
    /// Leave out the functions that CoppeliaSim does not have (`handeye.*`), to try a program as it runs there.
    #[arg(long, help_heading = heading::CELL)]
    coppeliasim_only: bool,
}

impl CellArgs {
    /// The scene with the changes from the options.
    fn scene(&self) -> Result<Scene, Failure> {
        let mut scene = self.scene.load()?;
        let motion = &mut scene.board.motion;
        motion.path = self.board_path.unwrap_or(motion.path);
        motion.speed_m_s = self.board_speed.unwrap_or(motion.speed_m_s);
        motion.size_m = self.board_size.unwrap_or(motion.size_m);
        motion.tilt_deg = self.board_tilt.unwrap_or(motion.tilt_deg);
        motion.validate().map_err(|reason| Failure::unusable(anyhow::anyhow!("the motion of the board: {reason}")))?;
        scene.simulation.time_step_s = self.time_step.unwrap_or(scene.simulation.time_step_s);
        Ok(scene)
    }
}

/// The options `--scene` and `--arm-errors`.
#[derive(Debug, Args)]
pub struct SceneArg {
    /// Scene file (TOML), or the name of one that comes with the program: reference, realistic, nominal, coppeliasim, tracking,
    /// panda, xarm6; the reference scene if not given.
    #[arg(long, value_name = "FILE|NAME", help_heading = heading::CELL)]
    scene: Option<SceneChoice>,
    /// How far the links of the arm differ from those that its controller uses; from the scene if not given.
    #[arg(long, value_name = "LEVEL", value_enum, help_heading = heading::CELL)]
    arm_errors: Option<ArmErrorsChoice>,
}

impl SceneArg {
    /// Reads the scene, with the requested errors of the arm.
    pub fn load(&self) -> Result<Scene, Failure> {
        let mut scene = self.scene.clone().unwrap_or_default().load().map_err(Failure::unusable)?;
        scene.robot.arm_errors = self.arm_errors.map_or(scene.robot.arm_errors, ArmErrorsChoice::levels);
        Ok(scene)
    }

    /// Which of the options was given.
    pub fn given(&self) -> Option<&'static str> {
        let given = [("--scene", self.scene.is_some()), ("--arm-errors", self.arm_errors.is_some())];
        given.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
    }
}

/// How soon after Ctrl-C the cell ends.
const POLL: Duration = Duration::from_millis(100);

pub fn run(args: &CellArgs) -> Result<(), Failure> {
    let server = CellServer::start(CellConfig {
        seed: args.seed,
        bind: args.bind.clone(),
        port: args.port,
        real_time: args.fast.then_some(false),
        coppeliasim_only: args.coppeliasim_only,
        ..CellConfig::new(args.scene()?)
    })
    .map_err(Failure::failed)?;
    if !server.is_local() {
        // Even when quiet: the user must be warned of it.
        out::note(format_args!(
            "warning: everybody on the network who reaches {} can move the arm and see its images, and there is no \
             password; --bind 127.0.0.1 serves this machine alone",
            server.endpoint()
        ));
    }
    out::line(format_args!("listening on {}", server.endpoint()))?;
    let cancel = solve::cancel_on_ctrl_c();
    while !cancel.is_cancelled() {
        std::thread::sleep(POLL);
    }
    server.stop();
    Ok(())
}
