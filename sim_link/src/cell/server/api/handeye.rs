//! `handeye.*`: what the cell offers beyond CoppeliaSim's API.

use ciborium::Value;
use handeye_core::camera::{Distortion, Intrinsics};
use handeye_core::frames::{Base, Camera, Pose, Sensor, Target, Tip};
use nalgebra::Isometry3;

use super::{Call, Effect, Outcome, Table, nothing, one};
use crate::cell::scene::{RobotErrors, sensor_from_camera};
use crate::cell::server::args::ApiError;
use crate::cell::server::cell::Cell;
use crate::cell::world::{Chain, Flagged, poses};
use crate::wire;

pub(super) const FUNCTIONS: Table = &[("truth", truth), ("stop", stop), ("setBoardPose", set_board_pose)];

fn pose(pose: &Isometry3<f64>) -> Value {
    wire::floats(poses::to_numbers(pose, false))
}

/// The truth as a document, which clients look for under a signal's name whatever the simulator.
#[derive(Debug, Clone, serde::Serialize)]
struct Published {
    intrinsics: Intrinsics,
    tip_from_camera: Pose<Tip, Camera>,
    base_from_target: Pose<Base, Target>,
}

impl Published {
    fn of(cell: &Cell) -> Result<Self, ApiError> {
        let (tree, stage) = (&cell.world.tree, &cell.stage);
        let tip_from_sensor = Pose::<Tip, Sensor>::from(poses::get(tree, Flagged::parse(stage.camera), stage.tip)?);
        let base_from_target = tree.world_pose(stage.plane, Chain::Actual)? * stage.plane_from_target;
        Ok(Self {
            intrinsics: cell.scene.intrinsics,
            tip_from_camera: tip_from_sensor * sensor_from_camera(),
            base_from_target: Pose::from(base_from_target),
        })
    }
}

/// Intrinsics, camera pose and target pose as TOML.
pub(super) fn published_truth(cell: &Cell) -> Result<String, ApiError> {
    toml::to_string(&Published::of(cell)?).map_err(|error| ApiError::Other(format!("{error}.")))
}

/// What is true in this run, for tests and reports.
///
/// `tip_from_camera` and `base_from_target` are poses `[x y z qx qy qz qw]` in metres, the camera in OpenCV's axes, the
/// base being the world. They are where the objects are now, also after a client has moved them.
fn truth(call: &mut Call<'_>) -> Outcome {
    let scene = &call.cell.scene;
    let published = Published::of(call.cell)?;
    let grid = scene.target.grid();
    one(wire::map([
        ("tip_from_camera", pose(published.tip_from_camera.isometry())),
        ("base_from_target", pose(published.base_from_target.isometry())),
        ("intrinsics", intrinsics(&scene.intrinsics)),
        (
            "target",
            wire::map([
                ("kind", Value::from("chessboard")),
                ("columns", Value::from(grid.columns as u64)),
                ("rows", Value::from(grid.rows as u64)),
                ("square_m", Value::Float(grid.square_m)),
            ]),
        ),
        ("robot", robot(&scene.robot_errors)),
        (
            "image",
            wire::map([
                ("noise_grey", Value::Float(scene.image.noise_grey)),
                ("blur_px", Value::Float(scene.image.blur_px)),
            ]),
        ),
        ("seed", Value::from(scene.seed)),
    ]))
}

fn intrinsics(camera: &Intrinsics) -> Value {
    let model = match camera.distortion {
        Distortion::None => "none",
        Distortion::BrownConrady(_) => "brown_conrady",
        Distortion::Rational(_) => "rational",
        Distortion::Fisheye(_) => "fisheye",
    };
    wire::map([
        ("width", Value::from(camera.width)),
        ("height", Value::from(camera.height)),
        ("fx", Value::Float(camera.fx)),
        ("fy", Value::Float(camera.fy)),
        ("cx", Value::Float(camera.cx)),
        ("cy", Value::Float(camera.cy)),
        ("model", Value::from(model)),
        ("distortion", wire::floats(camera.distortion.coefficients().iter().copied())),
    ])
}

fn robot(errors: &RobotErrors) -> Value {
    wire::map([
        ("repeatability_m", Value::Float(errors.repeatability_m)),
        ("repeatability_rad", Value::Float(errors.repeatability_rad)),
        ("joint_offset_rad", wire::floats(errors.joint_offset_rad)),
    ])
}

/// Brings every motion of every client to rest within its limits; their calls return where the robot came to rest.
fn stop(call: &mut Call<'_>) -> Outcome {
    call.effects.push(Effect::Brake);
    nothing()
}

/// Moves the board so that its target frame, as in [`truth`], has the given pose in the base. As every pose that is set
/// while a simulation runs, it is forgotten when that ends.
fn set_board_pose(call: &mut Call<'_>) -> Outcome {
    let base_from_target = poses::from_numbers(&call.args.array(0)?, false)?;
    let base_from_plane = base_from_target * call.cell.stage.plane_from_target.inverse();
    let plane = Flagged { handle: call.cell.stage.plane, joint_base: false, wxyz: false };
    poses::set(&mut call.cell.world.tree, plane, poses::HANDLE_WORLD, &base_from_plane)?;
    nothing()
}
