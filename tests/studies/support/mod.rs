//! The cell of the public reference scene, for images and timings.

use handeye_cell::render::{BoardSurface, Light, RenderScene, props};
use handeye_geometry::camera::Intrinsics;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Point and direction of each joint axis at zero, in the base frame of the UR5.
const AXES: [([f64; 3], [f64; 3]); 6] = [
    ([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.0, 0.0, 0.07455], [-1.0, 0.0, 0.0]),
    ([0.0, 0.0, 0.49965], [-1.0, 0.0, 0.0]),
    ([0.0, 0.0, 0.8918], [-1.0, 0.0, 0.0]),
    ([-0.110, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.0, 0.0, 0.98655], [-1.0, 0.0, 0.0]),
];

/// The Kinect-like sensor: 640 × 480 pixels, 57 degrees.
pub fn sensor() -> Intrinsics {
    Intrinsics::from_view_angle(640, 480, 57f64.to_radians())
}

fn motion(joints: &[f64; 6], link: usize) -> Isometry3<f64> {
    AXES.iter().zip(joints).take(link).fold(Isometry3::identity(), |so_far, ((point, axis), angle)| {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(*axis) * *angle);
        so_far * rotation_about_point(rotation, Point3::from(*point))
    })
}

fn rotation_about_point(rotation: UnitQuaternion<f64>, point: Point3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(point.coords - rotation * point.coords), rotation)
}

fn world_from_base() -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, 0.025)
}

/// Pose of the tip at some joint angles in degrees.
pub fn world_from_tip(joints_deg: &[f64; 6]) -> Isometry3<f64> {
    let columns = [Vector3::z(), Vector3::y(), -Vector3::x()];
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_basis_unchecked(&columns));
    let connection = Isometry3::from_parts(Translation3::new(-0.18495, 0.0, 0.98655), rotation);
    let joints = joints_deg.map(f64::to_radians);
    world_from_base() * motion(&joints, 6) * connection * Translation3::new(0.0, 0.0, 0.017)
}

/// Camera on the tip, as in the reference scene.
pub fn camera_on_tip(joints_deg: &[f64; 6]) -> Isometry3<f64> {
    let tip_from_camera = Isometry3::new(Vector3::new(0.05, 0.0, 0.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
    world_from_tip(joints_deg) * tip_from_camera
}

/// A camera at `eye` that looks at `goal`, upright.
pub fn looking_at(eye: Point3<f64>, goal: Point3<f64>) -> Isometry3<f64> {
    let forward = (goal - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let columns = [right, forward.cross(&right), forward];
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_basis_unchecked(&columns));
    Isometry3::from_parts(Translation3::from(eye), rotation)
}

/// The board of the reference scene: upright, facing +y.
pub fn world_from_target() -> Isometry3<f64> {
    // x of the target to the left of someone who looks along +y, y down, z away from the viewer along -y.
    let columns = [-Vector3::x(), -Vector3::z(), -Vector3::y()];
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_basis_unchecked(&columns));
    let middle = Vector3::new(-0.125, -0.4, 0.802);
    Isometry3::from_parts(Translation3::from(middle - rotation * Vector3::new(0.0675, 0.045, 0.0)), rotation)
}

/// Arm, gripper, board on its stand, table and floor.
pub fn scene(joints_deg: &[f64; 6], world_from_camera: Isometry3<f64>) -> RenderScene {
    let joints = joints_deg.map(f64::to_radians);
    let paper_m = [0.20, 0.15];
    let mut solids = vec![props::floor()];
    solids.extend(props::table(Point3::new(-0.125, -0.52, 0.70), [1.0, 0.6]));
    solids.extend(props::ur5(&world_from_base(), |link| motion(&joints, link)));
    solids.extend(props::gripper(&world_from_tip(joints_deg)));
    solids.extend(props::stand(&world_from_target(), Point3::new(0.0675, 0.045, 0.0), paper_m));
    RenderScene {
        world_from_camera,
        board: BoardSurface::new(world_from_target(), 10, 7, 0.015, paper_m),
        solids,
        light: Light::default(),
        background: [0.80, 0.84, 0.88],
    }
}
