//! Ranges of the numbers in a scene file.

use handeye_arm::{Arm, JointKind, JointRange, JointValues};
use handeye_geometry::camera::Intrinsics;
use nalgebra::Vector2;

use super::Scene;
use super::error::Violation;
use super::resolved::intrinsics;
use super::spec::{
    ArmErrorsSpec, BoardSpec, CameraSpec, DepthSpec, ImageSpec, LightSpec, PoseSpec, PrintSpec, RobotSpec,
    SimulationSpec, SlipSpec, SolidSpec,
};
use handeye_motion::OutOfRange;

type Check = Result<(), Violation>;

/// How far a quaternion's length may be from one: five printed digits are rounding, two are a mistake.
const QUATERNION_SLACK: f64 = 1e-3;
/// Largest image: its depth as 32-bit floats fills half of the largest message.
const MAX_PIXELS: u64 = 8_000_000;
/// Most inner corners along one side of a board.
const MAX_CORNERS: usize = 200;

/// Finds the first number that is out of its range, and gives the arm with the ranges that the scene has for its joints.
pub(super) fn check(scene: &Scene, arm: Arm) -> Result<Arm, Violation> {
    let Scene { seed: _, simulation, robot, camera, board, image, depth, light, solids } = scene;
    check_simulation(simulation)?;
    let arm = check_robot(robot, arm)?;
    check_camera(camera)?;
    check_board(board)?;
    check_image(image)?;
    check_depth(depth)?;
    check_light(light)?;
    solids.iter().enumerate().try_for_each(|(index, solid)| check_solid(&format!("solids[{index}]"), solid))?;
    Ok(arm)
}

fn violation<T>(field: &str, value: &impl ToString, need: impl Into<String>) -> Result<T, Violation> {
    Err(Violation { field: field.to_owned(), value: value.to_string(), need: need.into() })
}

fn in_range(field: &str, value: f64, low: f64, high: f64) -> Check {
    if value >= low && value <= high {
        Ok(())
    } else {
        violation(field, &value, format!("a number from {low} to {high}"))
    }
}

fn pose(field: &str, pose: &PoseSpec) -> Check {
    let PoseSpec { position_m, rotation_xyzw } = pose;
    position(&format!("{field}.position_m"), position_m)?;
    rotation(&format!("{field}.rotation_xyzw"), rotation_xyzw)
}

fn position(field: &str, value: &[f64; 3]) -> Check {
    if value.iter().all(|v| v.abs() <= 100.0) {
        Ok(())
    } else {
        violation(field, &format!("{value:?}"), "within 100 m of the origin")
    }
}

fn rotation(field: &str, value: &[f64; 4]) -> Check {
    let length = value.iter().map(|v| v * v).sum::<f64>().sqrt();
    if (length - 1.0).abs() <= QUATERNION_SLACK {
        Ok(())
    } else {
        violation(field, &format!("{value:?} of length {length}"), "a unit quaternion x, y, z, w")
    }
}

fn check_simulation(simulation: &SimulationSpec) -> Check {
    let SimulationSpec { time_step_s, real_time: _, speed_factor } = simulation;
    in_range("simulation.time_step_s", *time_step_s, 0.001, 1.0)?;
    in_range("simulation.speed_factor", *speed_factor, 0.01, 1000.0)
}

/// A value of a scene in radians, or of a prismatic joint, where it is metres already, in metres.
pub(super) fn si(kind: JointKind, value: f64) -> f64 {
    match kind {
        JointKind::Revolute => value.to_radians(),
        JointKind::Prismatic => value,
    }
}

/// One value for each joint.
fn each_joint(field: &str, values: &JointValues, arm: &Arm) -> Check {
    let count = arm.joint_count();
    if values.len() == count {
        return Ok(());
    }
    let got = format!("{values:?} of {} values", values.len());
    violation(field, &got, format!("{count} values, one for each joint of robot.model"))
}

fn check_robot(robot: &RobotSpec, chain: Arm) -> Result<Arm, Violation> {
    let RobotSpec {
        model: _,
        name,
        arm,
        tip,
        start_joints_deg,
        joint_mode: _,
        rest_error_deg,
        min_joints_deg,
        max_joints_deg,
        repeatability_mm,
        repeatability_deg,
        joint_offset_deg,
        arm_errors,
    } = robot;
    if name.is_empty() || name.len() > 100 || name.contains(|c: char| "/[]{}*?".contains(c) || c.is_control()) {
        return violation("robot.name", name, "1 to 100 characters, none of them / [ ] { } * ?");
    }
    pose("robot.arm", arm)?;
    pose("robot.tip", tip)?;
    let given = [
        ("min_joints_deg", min_joints_deg),
        ("max_joints_deg", max_joints_deg),
        ("joint_offset_deg", joint_offset_deg),
    ];
    for (field, values) in given.iter().filter_map(|(field, values)| Some((field, values.as_ref()?))) {
        each_joint(&format!("robot.{field}"), values, &chain)?;
    }
    each_joint("robot.start_joints_deg", start_joints_deg, &chain)?;
    let mut ranges: Vec<JointRange> = chain.ranges();
    for (i, (joint, range)) in chain.joints().iter().zip(&mut ranges).enumerate() {
        let farthest = match joint.kind {
            JointKind::Revolute => 720.0,
            JointKind::Prismatic => 50.0,
        };
        if let Some(low) = min_joints_deg {
            in_range(&format!("robot.min_joints_deg[{i}]"), low[i], -farthest, farthest)?;
            range.min = si(joint.kind, low[i]);
        }
        if let Some(high) = max_joints_deg {
            in_range(&format!("robot.max_joints_deg[{i}]"), high[i], -farthest, farthest)?;
            range.max = si(joint.kind, high[i]);
        }
        let unit = |value: f64| if joint.kind == JointKind::Revolute { value.to_degrees() } else { value };
        let (low, high) = (unit(range.min), unit(range.max));
        if range.min >= range.max {
            return violation(&format!("robot.max_joints_deg[{i}]"), &high, format!("above the minimum of {low}"));
        }
        let start = start_joints_deg[i];
        if !range.contains(si(joint.kind, start)) {
            let need = format!("a number from {low} to {high}, the range of `{}`", joint.name);
            return violation(&format!("robot.start_joints_deg[{i}]"), &start, need);
        }
        if let Some(offset) = joint_offset_deg {
            // An estimate of an arm's errors knows angles alone, and so do the faults of a cell.
            let most = if joint.kind == JointKind::Revolute { 10.0 } else { 0.0 };
            in_range(&format!("robot.joint_offset_deg[{i}]"), offset[i], -most, most)?;
        }
    }
    in_range("robot.rest_error_deg", *rest_error_deg, 0.0, 1.0)?;
    in_range("robot.repeatability_mm", *repeatability_mm, 0.0, 10.0)?;
    in_range("robot.repeatability_deg", *repeatability_deg, 0.0, 5.0)?;
    check_arm_errors(arm_errors)?;
    Ok(chain.with_ranges(&ranges).expect("a range for each joint, with room; both were checked"))
}

/// Above these it is another arm rather than one with errors.
fn check_arm_errors(errors: &ArmErrorsSpec) -> Check {
    let ArmErrorsSpec { angle_deg, length_mm, compliance_deg } = errors;
    in_range("robot.arm_errors.angle_deg", *angle_deg, 0.0, 2.0)?;
    in_range("robot.arm_errors.length_mm", *length_mm, 0.0, 10.0)?;
    in_range("robot.arm_errors.compliance_deg", *compliance_deg, 0.0, 2.0)
}

fn check_camera(camera: &CameraSpec) -> Check {
    let CameraSpec {
        width,
        height,
        view_angle_deg,
        fx,
        fy,
        cx,
        cy,
        distortion: _,
        near_m,
        far_m,
        sensor,
        random_offset_mm,
        random_offset_deg,
    } = camera;
    for (field, value) in [("camera.width", *width), ("camera.height", *height)] {
        in_range(field, f64::from(value), 16.0, 8192.0)?;
    }
    if u64::from(*width) * u64::from(*height) > MAX_PIXELS {
        return violation(
            "camera.width",
            &format!("{width} × {height} pixels"),
            format!("at most {MAX_PIXELS} pixels"),
        );
    }
    let pinhole = [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)];
    if let Some((given, _)) = pinhole.iter().find(|(_, value)| value.is_some()) {
        if let Some((missing, _)) = pinhole.iter().find(|(_, value)| value.is_none()) {
            return violation(&format!("camera.{missing}"), &"absent", format!("given, because `{given}` is"));
        }
        if view_angle_deg.is_some() {
            return violation("camera.view_angle_deg", &"given", format!("absent, because `{given}` is given"));
        }
    }
    if let Some(angle) = view_angle_deg {
        in_range("camera.view_angle_deg", *angle, 1.0, 135.0)?;
    }
    for (name, value) in pinhole {
        let range = if name.starts_with('f') { (1.0, 1e6) } else { (-1e5, 1e5) };
        value.map_or(Ok(()), |value| in_range(&format!("camera.{name}"), value, range.0, range.1))?;
    }
    in_range("camera.near_m", *near_m, 1e-4, 10.0)?;
    in_range("camera.far_m", *far_m, 1e-3, 1000.0)?;
    if near_m >= far_m {
        return violation("camera.far_m", &far_m, format!("above near_m = {near_m}"));
    }
    pose("camera.sensor", sensor)?;
    in_range("camera.random_offset_mm", *random_offset_mm, 0.0, 100.0)?;
    in_range("camera.random_offset_deg", *random_offset_deg, 0.0, 45.0)?;
    check_lens(&intrinsics(camera))
}

/// Every pixel must see something, or the renderer has nothing to draw there.
fn check_lens(intrinsics: &Intrinsics) -> Check {
    if let Err(error) = intrinsics.validate() {
        return violation("camera.distortion", &error, "made of finite numbers");
    }
    let (right, bottom) = (f64::from(intrinsics.width) - 0.5, f64::from(intrinsics.height) - 0.5);
    for i in 0..=16 {
        let part = f64::from(i) / 16.0;
        let (u, v) = (part * (right + 0.5) - 0.5, part * (bottom + 0.5) - 0.5);
        for px in [(u, -0.5), (u, bottom), (-0.5, v), (right, v)] {
            if intrinsics.unproject(&Vector2::new(px.0, px.1)).is_err() {
                let coefficients = intrinsics.distortion.coefficients();
                let need = format!("weak enough that pixel ({}, {}) still sees a ray", px.0, px.1);
                return violation("camera.distortion", &format!("{coefficients:?}"), need);
            }
        }
    }
    Ok(())
}

fn check_board(board: &BoardSpec) -> Check {
    let BoardSpec { columns, rows, square_m, paper_m, plane, random_offset_mm, random_offset_deg, motion, slip, print } =
        board;
    for (field, value) in [("board.columns", *columns), ("board.rows", *rows)] {
        if !(2..=MAX_CORNERS).contains(&value) {
            return violation(field, &value, format!("from 2 to {MAX_CORNERS} inner corners"));
        }
    }
    in_range("board.square_m", *square_m, 1e-4, 1.0)?;
    for (axis, (count, paper)) in [(*columns, paper_m[0]), (*rows, paper_m[1])].into_iter().enumerate() {
        let printed = (count + 1) as f64 * square_m;
        in_range(&format!("board.paper_m[{axis}]"), paper, 1e-3, 100.0)?;
        // A micrometre is rounding of the product, not a sheet too small.
        if paper < printed - 1e-6 {
            let need = format!("at least {printed:.4} m: {} squares of {square_m} m", count + 1);
            return violation(&format!("board.paper_m[{axis}]"), &paper, need);
        }
    }
    pose("board.plane", plane)?;
    in_range("board.random_offset_mm", *random_offset_mm, 0.0, 1000.0)?;
    in_range("board.random_offset_deg", *random_offset_deg, 0.0, 45.0)?;
    motion.validate().map_err(|OutOfRange { name, value, need }| Violation {
        field: format!("board.motion.{name}"),
        value: value.to_string(),
        need,
    })?;
    slip.as_ref().map_or(Ok(()), check_slip)?;
    print.as_ref().map_or(Ok(()), |print| check_print(print, *square_m, paper_m))
}

/// A pixel of the picture or an error of a corner that is a good part of a square leaves no chessboard.
fn check_print(print: &PrintSpec, square_m: f64, paper_m: &[f64; 2]) -> Check {
    let PrintSpec { bitmap_px, white_mm, smooth_mm } = print;
    for (axis, (pixels, paper)) in bitmap_px.iter().flatten().zip(paper_m).enumerate() {
        let fewest = (4.0 * paper / square_m).ceil();
        in_range(&format!("board.print.bitmap_px[{axis}]"), f64::from(*pixels), fewest, 100_000.0)?;
    }
    let most_mm = 20.0 * square_m;
    in_range("board.print.white_mm", *white_mm, 0.0, most_mm)?;
    in_range("board.print.smooth_mm", *smooth_mm, 0.0, most_mm)
}

fn check_slip(slip: &SlipSpec) -> Check {
    let SlipSpec { at_stop, by_mm } = slip;
    if *at_stop == 0 {
        return violation("board.slip.at_stop", at_stop, "a whole number from 1");
    }
    by_mm.iter().enumerate().try_for_each(|(axis, mm)| in_range(&format!("board.slip.by_mm[{axis}]"), *mm, -1e3, 1e3))
}

fn check_image(image: &ImageSpec) -> Check {
    let ImageSpec { sampling: _, noise_grey, blur_px, exposure } = image;
    in_range("image.noise_grey", *noise_grey, 0.0, 64.0)?;
    in_range("image.blur_px", *blur_px, 0.0, 10.0)?;
    in_range("image.exposure", *exposure, 0.01, 100.0)
}

fn check_depth(depth: &DepthSpec) -> Check {
    let DepthSpec { noise_mm, noise_mm_per_m2, offset_px, nothing_m } = depth;
    in_range("depth.noise_mm", *noise_mm, 0.0, 1000.0)?;
    in_range("depth.noise_mm_per_m2", *noise_mm_per_m2, 0.0, 1000.0)?;
    in_range("depth.offset_px", *offset_px, 0.0, 10.0)?;
    nothing_m.map_or(Ok(()), |metres| in_range("depth.nothing_m", metres, 0.0, 10_000.0))
}

fn check_light(light: &LightSpec) -> Check {
    let LightSpec { direction, ambient, diffuse, background: _ } = light;
    let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 1e-6) {
        return violation("light.direction", &format!("{direction:?}"), "a direction: not zero, finite");
    }
    in_range("light.ambient", *ambient, 0.0, 10.0)?;
    in_range("light.diffuse", *diffuse, 0.0, 10.0)
}

fn check_solid(field: &str, solid: &SolidSpec) -> Check {
    let SolidSpec { name: _, size_m, position_m, rotation_xyzw, relative_to: _, colour: _ } = solid;
    for (axis, size) in size_m.iter().enumerate() {
        in_range(&format!("{field}.size_m[{axis}]"), *size, 1e-4, 100.0)?;
    }
    position(&format!("{field}.position_m"), position_m)?;
    rotation(&format!("{field}.rotation_xyzw"), rotation_xyzw)
}
