//! A driver with the built-in cell behind it: for tests, and as an example of a driver's messages.
//!
//! It is a client of a cell as the workbench is one, of its own cell or of one that runs already. So a robot and a camera
//! can be two drivers of one cell, each with its own clock.

mod conversation;
mod stamps;

use std::io::{BufRead, Write};
use std::sync::Mutex;

use handeye_arm::ArmKind;
use handeye_geometry::frames::Base;
use nalgebra::Isometry3;

use handeye_cell::scene::{ArmSpec, RobotSpec, Scene, SceneError};
use handeye_coppeliasim::cell::{Arm, ArmKinematics, CameraFeed, CellPaths};
use handeye_coppeliasim::{BadEndpoint, ConnectionOptions, Endpoint, LinkError, SimulationState};
use handeye_server::{CellConfig, CellError, CellServer};

use super::message::{Ability, ArmMessage, CameraMessage, Hello, JointMessage, LensMessage, PROTOCOL, PoseMessage};
use conversation::Conversation;
use stamps::Stamps;

/// Simulated time from state to state \[s\]: fifty a second.
const TIME_STEP_S: f64 = 0.02;

/// The part of the cell that a fake driver provides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FakePart {
    /// Robot and camera.
    #[default]
    Both,
    /// The robot alone.
    Robot,
    /// The camera alone.
    Camera,
}

/// What a fake driver is.
#[derive(Debug, Clone)]
pub struct FakeOptions {
    /// The cell that it starts, where `connect` names none.
    pub scene: Scene,
    /// Seed of everything random in it; the scene's own if absent.
    pub seed: Option<u64>,
    /// A cell that runs already.
    pub connect: Option<Endpoint>,
    /// Robot, camera or both.
    pub part: FakePart,
    /// Start of its clock \[s\].
    pub clock_s: f64,
    /// Abilities that it reports not to have.
    pub cannot: Vec<Ability>,
}

impl FakeOptions {
    /// Robot and camera of this scene.
    pub fn new(scene: Scene) -> Self {
        Self { scene, seed: None, connect: None, part: FakePart::Both, clock_s: 0.0, cannot: Vec::new() }
    }
}

/// Why there is no fake driver.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FakeError {
    /// The scene is not usable.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The cell cannot be served.
    #[error(transparent)]
    Cell(#[from] CellError),
    /// The cell is not found, or its connection broke.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The cell that was started has no address that can be used.
    #[error(transparent)]
    Endpoint(#[from] BadEndpoint),
    /// The cell is not one of this project, and does not report the moment of its images.
    #[error("{endpoint} is no cell of `handeye cell`: the fake driver takes no other")]
    OtherCell {
        /// Its address.
        endpoint: Endpoint,
    },
    /// The workbench cannot be written to.
    #[error("the workbench cannot be reached: {0}")]
    Output(std::io::Error),
}

/// A fake driver. Its cell, if it has one of its own, ends with it.
#[derive(Debug)]
pub struct Fake {
    endpoint: Endpoint,
    paths: CellPaths,
    link: ConnectionOptions,
    hello: Hello,
    /// Pose of the tip on the flange, which is reported in addition to the tip; for a chain that it names.
    flange_from_tip: Option<Isometry3<f64>>,
    stamps: Mutex<Stamps>,
    _server: Option<CellServer>,
}

impl Fake {
    /// Starts its cell, or finds the one that runs.
    ///
    /// # Errors
    /// [`FakeError`].
    pub fn start(options: FakeOptions) -> Result<Self, FakeError> {
        let FakeOptions { mut scene, seed, connect, part, clock_s, cannot } = options;
        let mut chain = None;
        let (server, endpoint, paths) = if let Some(endpoint) = connect {
            (None, endpoint, CellPaths::default())
        } else {
            chain = Some(Chain::of(&scene));
            scene.simulation.time_step_s = TIME_STEP_S;
            let paths = CellPaths::below(&scene.robot.name);
            let server = CellServer::start(CellConfig { seed, ..CellConfig::new(scene) })?;
            let endpoint = server.endpoint().parse()?;
            (Some(server), endpoint, paths)
        };
        let link = if server.is_some() { ConnectionOptions::own_cell() } else { ConnectionOptions::default() };
        let mut arm = Arm::connect(&endpoint, &link, &paths)?;
        if !arm.info().is_handeye_cell {
            return Err(FakeError::OtherCell { endpoint });
        }
        if arm.sim().get_simulation_state()? != SimulationState::Running {
            arm.sim().start_simulation()?;
        }
        if chain.is_none() {
            chain = arm.kinematics()?.ok().filter(ArmKinematics::is_ur5).map(|kinematics| Chain {
                arm: ArmMessage::Name(ArmKind::Ur5Coppeliasim.name().to_owned()),
                base_from_arm: *kinematics.base_from_arm(),
                flange_from_tip: *kinematics.connection_from_tip(),
            });
        }
        let chain = chain.filter(|_| part != FakePart::Camera);
        let flange_from_tip = chain.as_ref().map(|chain| chain.flange_from_tip);
        let mut hello = hello(&mut arm, part, chain)?;
        hello.can.retain(|ability| !cannot.contains(ability));
        let stamps = Mutex::new(Stamps::new(clock_s));
        Ok(Self { endpoint, paths, link, hello, flange_from_tip, stamps, _server: server })
    }

    /// Serves one workbench until it leaves or is gone. The arm is then at rest.
    ///
    /// # Errors
    /// [`FakeError::Link`] when the cell is gone; [`FakeError::Output`].
    pub fn converse(&self, input: impl BufRead, output: impl Write + Send) -> Result<(), FakeError> {
        Conversation::new(self, output).run(input)
    }

    fn arm(&self) -> Result<Arm, LinkError> {
        Arm::connect(&self.endpoint, &self.link, &self.paths)
    }

    fn camera(&self) -> Result<CameraFeed, LinkError> {
        CameraFeed::connect(&self.endpoint, &self.link, &self.paths)
    }
}

/// The chain of the arm of the cell.
struct Chain {
    arm: ArmMessage,
    base_from_arm: Isometry3<f64>,
    flange_from_tip: Isometry3<f64>,
}

impl Chain {
    fn of(scene: &Scene) -> Self {
        let RobotSpec { model, arm, tip, .. } = &scene.robot;
        let model = match model {
            ArmSpec::Kind(kind) => ArmMessage::Name(kind.name().to_owned()),
            ArmSpec::Urdf(spec) => {
                ArmMessage::Urdf { urdf: spec.source(), base_link: spec.base.clone(), tip_link: spec.tip.clone() }
            }
        };
        Self { arm: model, base_from_arm: arm.isometry(), flange_from_tip: tip.isometry() }
    }
}

fn hello(arm: &mut Arm, part: FakePart, chain: Option<Chain>) -> Result<Hello, LinkError> {
    let (robot, camera) = (part != FakePart::Camera, part != FakePart::Robot);
    let mut can = Vec::new();
    if robot {
        can.extend([Ability::State, Ability::Joints, Ability::MoveJoints, Ability::MoveTip]);
    }
    if camera {
        can.extend([Ability::Image, Ability::Depth]);
    }
    let joints = arm.info().joints.iter().enumerate().map(|(i, joint)| JointMessage {
        name: format!("joint {}", i + 1),
        kind: joint.kind,
        min: Some(joint.range.min).filter(|min| min.is_finite()),
        max: Some(joint.range.max).filter(|max| max.is_finite()),
    });
    let joints: Vec<JointMessage> = if robot { joints.collect() } else { Vec::new() };
    let lens = arm.ground_truth()?.intrinsics;
    let optics = &arm.info().depth_optics;
    Ok(Hello {
        protocol: PROTOCOL,
        name: "fake".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        clock: "monotonic".to_owned(),
        can,
        joints,
        base_from_arm: chain.as_ref().map(|chain| PoseMessage::of::<Base, Base>(&chain.base_from_arm.into())),
        arm: chain.map(|chain| chain.arm),
        camera: camera.then_some(CameraMessage {
            width: lens.width,
            height: lens.height,
            intrinsics: Some(LensMessage {
                fx: lens.fx,
                fy: lens.fy,
                cx: lens.cx,
                cy: lens.cy,
                distortion: lens.distortion,
            }),
        }),
        depth_limits_m: camera.then_some([optics.near_m as f32, optics.far_m as f32]),
    })
}
