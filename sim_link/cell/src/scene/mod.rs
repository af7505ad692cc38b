//! The scene of the built-in cell: what a scene file contains, and the ground truth that follows from it and a seed.
//!
//! A scene file is TOML. Every field has a default, and the defaults together are the public UR5 hand-eye scene:
//! exact, without noise or distortion. Lengths are in metres and angles in degrees where the name does not say
//! otherwise; poses are a position and a quaternion x, y, z, w.

mod arm;
mod check;
mod error;
mod errors_of_arm;
mod errors_of_robot;
mod locate;
mod print;
mod resolved;
mod shipped;
mod spec;
#[cfg(feature = "planning")]
mod view_setup;

use std::path::Path;

use serde::{Deserialize, Serialize};

pub use arm::{ArmSpec, UrdfSpec};
pub use error::SceneError;
pub use errors_of_arm::JointError;
pub use errors_of_robot::RobotErrors;
pub use handeye_motion::{BoardMotionSpec, BoardPath, UnknownPath};
pub use resolved::{ResolvedScene, ResolvedSolid};
pub use shipped::{SceneChoice, ShippedScene};
pub use spec::{
    ArmErrorsSpec, BoardSpec, CameraSpec, DepthSpec, ImageSpec, JointModeSpec, LightSpec, PoseSpec, PrintSpec,
    RelativeTo, RobotSpec, SimulationSpec, SlipSpec, SolidSpec,
};

/// A scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// Seed of everything random in the cell, unless another is given when it starts.
    pub seed: u64,
    /// How simulated time runs.
    pub simulation: SimulationSpec,
    /// The arm.
    pub robot: RobotSpec,
    /// The RGB-D camera on the tip.
    pub camera: CameraSpec,
    /// The printed chessboard.
    pub board: BoardSpec,
    /// Imperfections of the colour image.
    pub image: ImageSpec,
    /// Imperfections of the depth image.
    pub depth: DepthSpec,
    /// Light and background.
    pub light: LightSpec,
    /// Boxes around the arm: floor, table, board stand.
    pub solids: Vec<SolidSpec>,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            seed: 1,
            simulation: SimulationSpec::default(),
            robot: RobotSpec::default(),
            camera: CameraSpec::default(),
            board: BoardSpec::default(),
            image: ImageSpec::default(),
            depth: DepthSpec::default(),
            light: LightSpec::default(),
            solids: spec::reference_solids(),
        }
    }
}

impl Scene {
    /// Reads and checks a scene file.
    ///
    /// # Errors
    /// [`SceneError`] names the file, the line and the field.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let file = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, &file, |model| model.written_in(path.parent().unwrap_or(Path::new("")))),
            Err(source) => Err(SceneError::Read { file, source }),
        }
    }

    /// Reads and checks a scene from the text of a scene file.
    ///
    /// # Errors
    /// [`SceneError`] names the line and the field.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        Self::parse(text, "scene", |_| {})
    }

    /// The public UR5 hand-eye scene: exact, without noise or distortion.
    ///
    /// # Errors
    /// None as long as the file that is built in is valid, which a test asserts.
    pub fn reference() -> Result<Self, SceneError> {
        ShippedScene::Reference.scene()
    }

    /// The same cell with the faults of a good real one: a lens, a little noise, a robot that repeats to 0.05 mm.
    ///
    /// # Errors
    /// None as long as the file that is built in is valid, which a test asserts.
    pub fn realistic() -> Result<Self, SceneError> {
        ShippedScene::Realistic.scene()
    }

    /// The reference cell with images, depth, print and arm as CoppeliaSim's own are.
    ///
    /// # Errors
    /// None as long as the file that is built in is valid, which a test asserts.
    pub fn coppeliasim() -> Result<Self, SceneError> {
        ShippedScene::Coppeliasim.scene()
    }

    /// The realistic cell with a board that moves in a circle, and images that come as fast as a camera's.
    ///
    /// # Errors
    /// None as long as the file that is built in is valid, which a test asserts.
    pub fn tracking() -> Result<Self, SceneError> {
        ShippedScene::Tracking.scene()
    }

    /// Checks every number, and draws what is random in the scene.
    ///
    /// The same scene and seed give the same truth on every machine. The draws are independent of each other: giving
    /// the camera a random offset does not move the board.
    ///
    /// # Errors
    /// [`SceneError::Field`] for a number out of its range, [`SceneError::Arm`] when there is no such arm.
    pub fn resolve(&self, seed: u64) -> Result<ResolvedScene, SceneError> {
        let arm = self.robot.model.arm().map_err(|source| SceneError::arm("scene", None, source))?;
        let arm = check::check(self, arm).map_err(|found| found.at("scene", None))?;
        Ok(resolved::resolve(self, arm, seed))
    }

    /// `find_files` resolves the files that the scene names.
    fn parse(text: &str, file: &str, find_files: impl FnOnce(&mut ArmSpec)) -> Result<Self, SceneError> {
        let mut scene: Self = toml::from_str(text).map_err(|error| SceneError::syntax(file, text, &error))?;
        find_files(&mut scene.robot.model);
        let line = || locate::line_of(text, "robot.model");
        let arm = scene.robot.model.arm().map_err(|source| SceneError::arm(file, line(), source))?;
        check::check(&scene, arm).map_err(|found| {
            let line = locate::line_of(text, &found.field);
            found.at(file, line)
        })?;
        Ok(scene)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
