//! Connections to a cell over the remote API; starts the built-in cell when it is the one to connect to.

mod error;
mod motion;

use std::sync::{Mutex, PoisonError};

use handeye_cell::scene::{ArmErrorsSpec, Scene, SceneChoice};
use handeye_coppeliasim::cell::{self, Arm, CameraFeed, CellInfo, CellPaths};
use handeye_coppeliasim::{BadEndpoint, CancelToken, ConnectionOptions, Endpoint, LinkError, Sim, SimulationState};
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::targets::TargetSpec;
use handeye_server::{CellConfig, CellServer};

use error::{check, check_arm, port_error};
use motion::RemoteMotion;
pub use motion::end_of_following;
pub(crate) use motion::{contact_text, no_views};

use crate::port::{CameraPort, Cell, Connected, ControlPort, MotionPort, Newest, PortError, RawFrame};
use crate::{CellFacts, RobotState, Simulation};

/// A cell over the remote API: the built-in one, which it starts, or one that runs.
pub struct RemoteCell {
    cell: Server,
    /// Paths of its objects.
    paths: CellPaths,
    /// The built-in cell, once started. It ends with this connector.
    server: Mutex<Option<CellServer>>,
}

enum Server {
    /// Started by this program; with other errors of the arm than the scene has, where they are given.
    BuiltIn(SceneChoice, Option<ArmErrorsSpec>),
    /// The same, started by who holds the cell, and never started again.
    Own(CellServer),
    /// There already.
    At(String),
}

impl RemoteCell {
    /// To the built-in cell with a scene, and with other errors of the arm where they are given; it is started when it is first
    /// connected to.
    pub(crate) fn built_in(scene: SceneChoice, arm_errors: Option<ArmErrorsSpec>) -> Self {
        Self { cell: Server::BuiltIn(scene, arm_errors), paths: CellPaths::default(), server: Mutex::new(None) }
    }

    /// To a built-in cell that was started for this connection only. It ends with this.
    pub fn own(server: CellServer, objects: CellPaths) -> Self {
        Self { cell: Server::Own(server), paths: objects, server: Mutex::new(None) }
    }

    /// To the server at an address, with the cell's objects at `objects`.
    pub fn at(address: String, objects: CellPaths) -> Self {
        Self { cell: Server::At(address), paths: objects, server: Mutex::new(None) }
    }

    /// The address to connect to. Starts the built-in cell when that is needed; the other workers wait for the first.
    fn endpoint(&self) -> Result<Endpoint, PortError> {
        let address = match &self.cell {
            Server::At(address) => address.clone(),
            Server::Own(server) => server.endpoint(),
            Server::BuiltIn(scene, arm_errors) => {
                let mut server = self.server.lock().unwrap_or_else(PoisonError::into_inner);
                match server.as_ref() {
                    Some(server) => server.endpoint(),
                    None => server.insert(start_built_in(scene, *arm_errors)?).endpoint(),
                }
            }
        };
        address.parse().map_err(|error: BadEndpoint| PortError::Hopeless(error.into()))
    }

    /// Makes one connection.
    fn connect<Half>(
        &self,
        shutdown: &CancelToken,
        half: impl FnOnce(&Endpoint, &ConnectionOptions, &CellPaths) -> Result<Half, LinkError>,
    ) -> Result<Half, PortError> {
        let endpoint = self.endpoint()?;
        let usual = match &self.cell {
            Server::BuiltIn(..) | Server::Own(_) => ConnectionOptions::own_cell(),
            Server::At(_) => ConnectionOptions::default(),
        };
        let options = ConnectionOptions { shutdown: shutdown.clone(), ..usual };
        let connected = half(&endpoint, &options, &self.paths);
        if let (Err(LinkError::OwnCellEnded { .. }), Server::BuiltIn(..)) = (&connected, &self.cell) {
            self.give_up_server(&endpoint);
        }
        connected.map_err(port_error)
    }

    /// A built-in cell that cannot be reached has died: the next try starts another one.
    fn give_up_server(&self, endpoint: &Endpoint) {
        let mut server = self.server.lock().unwrap_or_else(PoisonError::into_inner);
        if server.as_ref().is_some_and(|server| server.endpoint() == endpoint.to_string()) {
            tracing::error!(%endpoint, "the built-in cell does not answer and is started again");
            *server = None;
        }
    }

    fn connected<Port>(&self, port: Port, info: &CellInfo) -> Connected<Port> {
        Connected { port, address: info.endpoint.to_string(), server: self.describe(info) }
    }

    fn describe(&self, info: &CellInfo) -> String {
        if matches!(self.cell, Server::BuiltIn(..) | Server::Own(_)) {
            return "built-in cell".to_owned();
        }
        if info.is_handeye_cell {
            return "Handeye cell".to_owned();
        }
        match info.program_version {
            1.. => format!("CoppeliaSim {}", cell::version_name(info.program_version)),
            _ => "remote API server".to_owned(),
        }
    }
}

impl Cell for RemoteCell {
    fn control(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn ControlPort>>, PortError> {
        let arm = self.connect(shutdown, Arm::connect)?;
        let info = arm.info().clone();
        Ok(self.connected(Box::new(RemoteControl { arm }), &info))
    }

    fn camera(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn CameraPort>>, PortError> {
        let feed = self.connect(shutdown, CameraFeed::connect)?;
        let info = feed.info().clone();
        Ok(self.connected(Box::new(RemoteCamera { feed }), &info))
    }

    fn motion(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn MotionPort>>, PortError> {
        let arm = self.connect(shutdown, Arm::connect)?;
        let info = arm.info().clone();
        Ok(self.connected(Box::new(RemoteMotion::new(arm).map_err(port_error)?), &info))
    }
}

struct RemoteControl {
    arm: Arm,
}

impl ControlPort for RemoteControl {
    fn facts(&mut self) -> Result<CellFacts, PortError> {
        let kinematics = self.arm.kinematics().map_err(port_error)?;
        let truth = match self.arm.ground_truth() {
            Ok(truth) => Some(truth),
            Err(error) if error.is_connection_loss() => return Err(port_error(error)),
            // Only compared with; a cell without it is a cell all the same.
            Err(error) => {
                tracing::warn!(%error, "what the cell says of itself cannot be used");
                None
            }
        };
        Ok(CellFacts::new(self.arm.info(), kinematics.ok().as_ref(), truth.as_ref()))
    }

    fn state(&mut self) -> Result<Option<RobotState>, PortError> {
        check_arm(&mut self.arm)?;
        let read = |arm: &mut Arm| {
            Ok(RobotState {
                base_from_tip: arm.base_from_tip()?,
                joints_rad: arm.joint_values()?,
                sim_time_s: arm.sim().get_simulation_time()?,
                simulation: match arm.sim().get_simulation_state()? {
                    SimulationState::Stopped => Simulation::Stopped,
                    SimulationState::Paused => Simulation::Paused,
                    SimulationState::Running => Simulation::Running,
                },
                is_armed: true,
            })
        };
        read(&mut self.arm).map(Some).map_err(port_error)
    }

    fn start_simulation(&mut self) -> Result<(), PortError> {
        self.arm.sim().start_simulation().map_err(port_error)
    }

    fn renew(&mut self) -> Result<(), PortError> {
        renew(self.arm.sim())
    }

    fn stop_simulation(&mut self) -> Result<(), PortError> {
        self.arm.sim().stop_simulation_and_wait().map_err(port_error)
    }

    fn base_from_board(&mut self, target: &TargetSpec) -> Result<Option<Pose<Base, Target>>, PortError> {
        self.arm.base_from_board(target).map_err(port_error)
    }

    fn stop(&mut self) -> Result<(), PortError> {
        self.arm.stop().map_err(port_error)
    }

    fn move_board(&mut self, motion: &cell::BoardMotion) -> Result<(), PortError> {
        self.arm.move_board(motion).map_err(port_error)
    }

    fn hide_board(&mut self, hidden: bool) -> Result<(), PortError> {
        self.arm.show_board(!hidden).map_err(port_error)
    }
}

struct RemoteCamera {
    feed: CameraFeed,
}

impl CameraPort for RemoteCamera {
    fn newest(&mut self, seen_s: Option<f64>) -> Result<Newest, PortError> {
        check(self.feed.sim().connection())?;
        // Cheap to ask for, and images of a time that has been seen are not fetched again.
        if seen_s == Some(self.feed.sim().get_simulation_time().map_err(port_error)?) {
            return Ok(Newest::Same);
        }
        let frame = match self.feed.grab() {
            Ok(frame) => frame,
            // A machine under load is late; the next frame may be complete, and the one that waits for it has a time
            // limit.
            Err(error @ LinkError::MixedInstants { .. }) => {
                tracing::debug!(%error, "an image is left out");
                return Ok(Newest::Awaited);
            }
            Err(error) => return Err(port_error(error)),
        };
        Ok(Newest::Frame(Box::new(RawFrame {
            rgb: frame.rgb,
            depth: Some(frame.depth),
            sim_time_s: frame.sim_time_s,
            image_age_s: frame.image_age_s,
            base_from_tip: Some(frame.base_from_tip),
            no_pose: None,
            joints_rad: frame.joints,
            base_from_target_true: frame.base_from_target_true,
            clocks: None,
        })))
    }

    fn renew(&mut self) -> Result<(), PortError> {
        renew(self.feed.sim())
    }

    fn depth_limits_m(&self) -> [f32; 2] {
        let optics = &self.feed.info().depth_optics;
        [optics.near_m as f32, optics.far_m as f32]
    }
}

/// Another connection, which is there once something was asked over it.
fn renew(sim: &mut Sim) -> Result<(), PortError> {
    sim.connection().renew();
    sim.get_simulation_time().map(drop).map_err(port_error)
}

fn start_built_in(scene: &SceneChoice, arm_errors: Option<ArmErrorsSpec>) -> Result<CellServer, PortError> {
    let scene = scene_with(scene, arm_errors)?;
    CellServer::start(CellConfig::new(scene)).map_err(|error| PortError::Hopeless(error.into()))
}

fn scene_with(scene: &SceneChoice, arm_errors: Option<ArmErrorsSpec>) -> Result<Scene, PortError> {
    let mut scene = scene.load().map_err(|error| PortError::Hopeless(error.into()))?;
    scene.robot.arm_errors = arm_errors.unwrap_or(scene.robot.arm_errors);
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use handeye_cell::scene::ShippedScene;

    use super::*;

    #[test]
    fn errors_of_the_arm_that_are_given_take_the_place_of_the_scene_s() {
        for (scene, given, expected) in [
            (ShippedScene::Nominal, None, ArmErrorsSpec::NOMINAL),
            (ShippedScene::Nominal, Some(ArmErrorsSpec::NONE), ArmErrorsSpec::NONE),
            (ShippedScene::Panda, None, ArmErrorsSpec::NONE),
            (ShippedScene::Panda, Some(ArmErrorsSpec::NOMINAL), ArmErrorsSpec::NOMINAL),
        ] {
            let started = scene_with(&SceneChoice::Shipped(scene), given).expect("it is shipped");
            assert_eq!(started.robot.arm_errors, expected, "{scene:?}");
        }
    }
}
