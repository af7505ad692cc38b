//! Sessions of the cell without images: views as a person without a plan would choose them, with the cell's
//! kinematics and lens, its robot's errors, and corners with Gaussian noise where a detector would find them.
//!
//! A session costs a few milliseconds, so that hundreds of them can be judged. One thing may be wrong with it, a
//! [`Fault`]; what is recorded never says so.

mod fault;

use std::fmt::Write as _;
use std::path::Path;

use handeye_arm::{ArmError, ArmModel, JointValues};
use handeye_dataset::write::Joints;
use handeye_dataset::{self as dataset, CameraInput, write};
use handeye_estimate::handeye::Mode;
use handeye_estimate::placement::{JointView, PlacementError, place_checked};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::{Corner, View};
use nalgebra::{Point3, Vector2};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::scene::{ResolvedScene, Scene, SceneError};
use handeye_plan::{PlanError, PlannedView, ViewOptions, ViewSetup, random_poses_looking_at};

pub use fault::{Fault, UnknownFault};

/// Random numbers of the corners, apart from those of a scene.
const CORNER_STREAM: u64 = 3;
/// Image border that stays free of corners, pixels: room for the noise.
const BORDER_PX: f64 = 1.0;

/// Why a session could not be recorded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The scene is not usable.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The cell leaves too few views.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The fault is of a view that there is not.
    #[error("the fault is in view {view} and there are {views}: record more views")]
    NoSuchView {
        /// The view, counted from 1.
        view: usize,
        /// How many there are.
        views: usize,
    },
    /// The fault is of a joint that the arm has not.
    #[error("the fault is in joint {joint} and the arm has {joints}: name another joint")]
    NoSuchJoint {
        /// The joint, counted from 1.
        joint: usize,
        /// How many there are.
        joints: usize,
    },
    /// The values of the joints are not those of the arm.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The files could not be written.
    #[error("{path}: {source}")]
    Write {
        /// The file or folder.
        path: String,
        /// What the file system says.
        source: std::io::Error,
    },
}

/// What to record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionOptions {
    /// How many views.
    pub views: usize,
    /// Noise of a corner per axis, pixels (one sigma).
    pub corner_px: f64,
    /// Seed of everything: scene, views, noise.
    pub seed: u64,
    /// What is wrong.
    pub fault: Option<Fault>,
    /// From where the board is looked at; count and seed are those of the session.
    pub look: ViewOptions,
}

impl Default for SessionOptions {
    fn default() -> Self {
        Self { views: 20, corner_px: 0.1, seed: 1, fault: None, look: ViewOptions::default() }
    }
}

/// One view as it is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedView {
    /// Name of the image that there is not.
    pub name: String,
    /// The tip pose as it stands in the record.
    pub base_from_tip: Pose<Base, Tip>,
    /// The joint values as the encoders showed them, radians; of a prismatic joint metres.
    pub joints_rad: JointValues,
    /// What a detector would have found.
    pub corners: Vec<Corner>,
}

/// A session and the truth about it.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedSession {
    /// The views in order.
    pub views: Vec<RecordedView>,
    /// The target as it is stated.
    pub target: TargetSpec,
    /// What is true; with a fault in the board, as it was in the first view.
    pub truth: ResolvedScene,
}

/// Records a session of a scene, camera on the tip.
///
/// # Errors
/// [`RecordError`]; the scene's when it has no room for the fault.
pub fn record(scene: &Scene, options: &SessionOptions) -> Result<RecordedSession, RecordError> {
    let SessionOptions { views: count, corner_px, seed, fault, look } = *options;
    if let Some(view) = fault.and_then(Fault::view).filter(|view| !(1..=count).contains(view)) {
        return Err(RecordError::NoSuchView { view, views: count });
    }
    let stated = scene.resolve(seed)?;
    let (target, joints) = (stated.target, stated.arm.joint_count());
    if let Some(Fault::JointOffset { joint, .. }) = fault
        && !(1..=joints).contains(&joint)
    {
        return Err(RecordError::NoSuchJoint { joint, joints });
    }
    let mut faulty = scene.clone();
    if let Some(fault) = fault {
        fault.change_scene(&mut faulty);
    }
    let truth = faulty.resolve(seed)?;
    let planned = random_poses_looking_at(&ViewSetup::from(&truth), &ViewOptions { count, seed, ..look })?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(CORNER_STREAM);
    let mut views = Vec::with_capacity(count);
    let mut before = truth.start_joints;
    for (index, PlannedView { joints, .. }) in planned.into_iter().enumerate() {
        // Each is captured after a move.
        let stop = index as u64 + 1;
        let moment = Moment { truth: &truth, view: index + 1, before, encoders: joints };
        let seen_at = fault.map_or(Ok(joints), |fault| fault.encoders_of_image(&moment))?;
        let slip = fault.map_or_else(nalgebra::Isometry3::identity, |fault| fault.slip(&moment));
        let base_from_target = Pose::from_isometry(
            truth.world_from_plane * slip * truth.world_from_plane.inv_mul(truth.base_from_target.isometry()),
        );
        let shown = ResolvedScene { base_from_target, ..truth.clone() };
        let corners = corners(&shown, &shown.true_tip(&seen_at, stop)?, corner_px, &mut rng);
        let reported = truth.reported_tip(&joints)?;
        views.push(RecordedView {
            name: format!("images/{:04}.png", index + 1),
            base_from_tip: fault.map_or(reported, |fault| fault.written(&reported)),
            joints_rad: joints,
            corners,
        });
        before = joints;
    }
    Ok(RecordedSession { views, target, truth })
}

/// The moment of a view, for a fault.
struct Moment<'a> {
    truth: &'a ResolvedScene,
    /// Which view, counted from 1.
    view: usize,
    /// Where the arm came from.
    before: JointValues,
    /// Where it stands.
    encoders: JointValues,
}

fn corners(scene: &ResolvedScene, true_tip: &Pose<Base, Tip>, sigma_px: f64, rng: &mut ChaCha8Rng) -> Vec<Corner> {
    let camera_from_target = scene.camera_from_target(true_tip);
    let (width, height) = (f64::from(scene.intrinsics.width), f64::from(scene.intrinsics.height));
    let mut noise = || -> f64 { StandardNormal.sample(rng) };
    scene
        .target
        .points()
        .iter()
        .enumerate()
        .filter_map(|(index, point): (usize, &Point3<f64>)| {
            // Drawn for every point, so that the others stay as they are when one is out of sight.
            let error = Vector2::new(noise(), noise()) * sigma_px;
            let px = scene.intrinsics.project(&(camera_from_target.isometry() * point)).ok()? + error;
            let inside = px.x > BORDER_PX - 0.5
                && px.y > BORDER_PX - 0.5
                && px.x < width - 0.5 - BORDER_PX
                && px.y < height - 0.5 - BORDER_PX;
            inside.then_some(Corner::new(index, px))
        })
        .collect()
}

impl RecordedSession {
    /// The views as an estimator takes them, with how the tip moves with each joint.
    ///
    /// # Errors
    /// [`PlacementError`] when the record's poses and joint angles do not fit each other, as with poses turned over.
    pub fn views(&self) -> Result<Vec<View>, PlacementError> {
        let joint_views: Vec<JointView<'_>> = self
            .views
            .iter()
            .map(|view| JointView { base_from_tip: view.base_from_tip, joints_rad: &view.joints_rad })
            .collect();
        let (_, twists) = place_checked(&self.truth.arm, &joint_views)?;
        Ok(self
            .views
            .iter()
            .zip(twists)
            .map(|(view, tip_by_joint)| {
                let RecordedView { name, base_from_tip, corners, .. } = view.clone();
                View { tip_by_joint, ..View::new(name, base_from_tip, corners) }
            })
            .collect())
    }

    /// Writes a dataset folder: `dataset.toml`, `poses.csv`, with joint values of an arm that data sets have a name for, and
    /// `corners.csv`. The intrinsics in it are the
    /// true ones, to be taken as they are when `camera_is_known`, as a start otherwise.
    ///
    /// # Errors
    /// [`RecordError::Write`] names the file.
    pub fn write_dataset(&self, folder: &Path, camera_is_known: bool) -> Result<(), RecordError> {
        let failed = |path: &Path, source| RecordError::Write { path: path.display().to_string(), source };
        std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
        let intrinsics = self.truth.intrinsics;
        let arm = self.truth.arm_model.kind().map(ArmModel::Kind);
        let camera = CameraInput { fixed: camera_is_known, intrinsics: Some(intrinsics), model: intrinsics.distortion };
        let description =
            write::description(Mode::EyeInHand, &self.target, Some(&camera), arm.as_ref().map(Joints::Of)).replacen(
                "[target]\n",
                "[target]\ncorners = \"corners.csv\"\n",
                1,
            );
        let poses = match &arm {
            Some(_) => {
                let rows =
                    self.views.iter().map(|view| (view.name.as_str(), &view.base_from_tip, &view.joints_rad[..]));
                write::pose_table_with_joints(self.truth.arm.joint_count(), rows)
            }
            None => write::pose_table(self.views.iter().map(|view| (view.name.as_str(), &view.base_from_tip))),
        };
        for (name, text) in
            [(dataset::DESCRIPTION, description), (write::POSE_TABLE, poses), ("corners.csv", self.corner_table())]
        {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|e| failed(&path, e))?;
        }
        Ok(())
    }

    fn corner_table(&self) -> String {
        let columns = self.target.grid().columns;
        let mut text = String::from("image,column,row,u,v\n");
        for view in &self.views {
            for Corner { index, px, .. } in &view.corners {
                // Writing to a string cannot fail.
                let _ok = writeln!(text, "{},{},{},{},{}", view.name, index % columns, index / columns, px.x, px.y);
            }
        }
        text
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
