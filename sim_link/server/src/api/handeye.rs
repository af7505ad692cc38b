//! `handeye.*`: what the cell offers beyond CoppeliaSim's API.

use ciborium::Value;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Camera, Pose, Sensor, Tip};
use nalgebra::Isometry3;

use super::{Call, Effect, Outcome, Table, nothing, one};
use crate::args::ApiError;
use handeye_cell::scene::{BoardMotionSpec, BoardPath, RobotErrors};
use handeye_cell::world::{Chain, Flagged, poses};
use handeye_motion::Course;
use handeye_wire::axes::sensor_from_camera;
use handeye_wire::{self as wire, Reader as _};

pub(super) const FUNCTIONS: Table = &[
    ("truth", truth),
    ("moment", moment),
    ("stop", stop),
    ("setBoardPose", set_board_pose),
    ("moveBoard", move_board),
    ("showBoard", show_board),
];

fn pose(pose: &Isometry3<f64>) -> Value {
    wire::floats(poses::to_numbers(pose, false))
}

/// The ground truth of this run, for tests and reports.
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

/// The pass that the images of the colour sensor show, all of one instant: `sim_time` in seconds, `joints` in radians
/// and the pose `tip` as the controller had them, and `base_from_target`, where the board really was, hidden or not.
///
/// Values that clients set between two passes are in the next moment, as they are in the next image. The map is empty
/// while there is nothing in the images: before the first pass and after the end of a simulation. A part that a client
/// has removed from the scene is missing.
fn moment(call: &mut Call<'_>) -> Outcome {
    let (tree, stage) = (&call.cell.world.tree, &call.cell.stage);
    let Some(shown) = tree.sensor(stage.camera)?.shown() else { return one(wire::map([])) };
    let mut fields = vec![("sim_time", Value::Float(shown.time_s))];
    if let Some(reported) = &shown.reported {
        fields.push(("joints", wire::floats(reported.joints_rad.iter().copied())));
        fields.push(("tip", pose(&reported.world_from_tip)));
    }
    if let Some(world_from_plane) = shown.moment.pose(stage.plane) {
        fields.push(("base_from_target", pose(&(world_from_plane * stage.plane_from_target))));
    }
    one(wire::map(fields))
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

/// `joints` has the errors of each joint's frame, whose z is its axis: the axis' direction (a rotation vector along x and y)
/// and place (x, y), the zero, and the deflection of the joint under the largest torque of gravity.
fn robot(errors: &RobotErrors) -> Value {
    let joints = errors.joints.iter().map(|joint| {
        wire::map([
            ("tilt_rad", wire::floats(joint.tilt_rad)),
            ("shift_m", wire::floats(joint.shift_m)),
            ("zero_rad", Value::Float(joint.zero_rad)),
            ("compliance_rad", Value::Float(joint.compliance_rad)),
        ])
    });
    wire::map([
        ("repeatability_m", Value::Float(errors.repeatability_m)),
        ("repeatability_rad", Value::Float(errors.repeatability_rad)),
        ("joint_offset_rad", wire::floats(errors.joint_offset_rad.iter().copied())),
        ("joints", Value::Array(joints.collect())),
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

/// Moves the board along a path from where it is, `{path, speed_m_s, size_m, tilt_deg, seed}` with all but the path
/// optional, as in the scene file. A path under way is brought to rest meanwhile; `still` does only that. The default
/// seed is the cell's. While the simulation is stopped this applies to the next one only.
fn move_board(call: &mut Call<'_>) -> Outcome {
    const NAMES: [&str; 5] = ["path", "speed_m_s", "size_m", "tilt_deg", "seed"];
    let fields = call.args.map_or_empty(0)?;
    for (key, _) in fields.entries() {
        let key = key.text().unwrap_or_default();
        if !NAMES.contains(&key) {
            return Err(ApiError::Other(format!("there is no field {key:?}; there are {}.", NAMES.join(", "))));
        }
    }
    let path = fields.text("path")?.ok_or(ApiError::Field { problem: "missing", name: "path" })?;
    let path: BoardPath = path.parse().map_err(|error| ApiError::Other(format!("{error}.")))?;
    let usual = BoardMotionSpec::default();
    let motion = BoardMotionSpec {
        path,
        speed_m_s: fields.number("speed_m_s")?.unwrap_or(usual.speed_m_s),
        size_m: fields.number("size_m")?.unwrap_or(usual.size_m),
        tilt_deg: fields.number("tilt_deg")?.unwrap_or(usual.tilt_deg),
    };
    motion.validate().map_err(|reason| ApiError::Other(format!("{reason}.")))?;
    let seed = match fields.integer("seed")? {
        Some(seed) => u64::try_from(seed).map_err(|_negative| ApiError::Field { problem: "invalid", name: "seed" })?,
        None => call.cell.scene.seed,
    };
    if let Some(carrier) = &mut call.cell.world.carrier {
        carrier.follow(Course::new(&motion, seed));
    }
    nothing()
}

/// Hides the board from the cameras or shows it again, from the next pass on: the sheet with its print, not what holds
/// it. The end of the simulation brings back what was before its start.
fn show_board(call: &mut Call<'_>) -> Outcome {
    let is_shown = call.args.boolean(0)?;
    call.cell.world.tree.get_mut(call.cell.stage.plane)?.hidden = !is_shown;
    nothing()
}
