//! `handeye.*`: what the cell offers beyond CoppeliaSim's API.

use ciborium::Value;
use handeye_core::camera::{Distortion, Intrinsics};
use handeye_core::frames::{Camera, Pose, Sensor, Tip};
use nalgebra::Isometry3;

use super::{Call, Effect, Outcome, Table, nothing, one};
use crate::axes::sensor_from_camera;
use crate::cell::scene::RobotErrors;
use crate::cell::world::{Chain, Flagged, poses};
use crate::wire;

pub(super) const FUNCTIONS: Table = &[("truth", truth), ("stop", stop), ("setBoardPose", set_board_pose)];

fn pose(pose: &Isometry3<f64>) -> Value {
    wire::floats(poses::to_numbers(pose, false))
}

/// What is true in this run, for tests and reports.
///
/// `tip_from_camera` and `base_from_target` are poses `[x y z qx qy qz qw]` in metres, the camera in OpenCV's axes, the
/// base being the world. They are where the objects are now, also after a client has moved them.
fn truth(call: &mut Call<'_>) -> Outcome {
    let (tree, stage, scene) = (&call.cell.world.tree, &call.cell.stage, &call.cell.scene);
    let tip_from_sensor = Pose::<Tip, Sensor>::from(poses::get(tree, Flagged::parse(stage.camera), stage.tip)?);
    let tip_from_camera: Pose<Tip, Camera> = tip_from_sensor * sensor_from_camera();
    let base_from_target = tree.world_pose(stage.plane, Chain::Actual)? * stage.plane_from_target;
    let grid = scene.target.grid();
    one(wire::map([
        ("tip_from_camera", pose(tip_from_camera.isometry())),
        ("base_from_target", pose(&base_from_target)),
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
