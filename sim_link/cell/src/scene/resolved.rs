//! The truth of one run of the cell.

use std::sync::Arc;

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Sensor, Target, Tip};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_render::{BoardSurface, Imaging, Light, LightSource, PrintErrors};
use handeye_wire::axes::{sensor_from_camera, sheet_from_target};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use super::Scene;
use super::arm::ArmSpec;
use super::check::si;
use super::errors_of_arm;
use super::errors_of_robot::{RobotErrors, gaussian, stream_of};
use super::print::printed;
use super::spec::{
    CameraSpec, DepthSpec, ImageSpec, JointModeSpec, LightSpec, REFERENCE_VIEW_ANGLE_DEG, RelativeTo, SimulationSpec,
    SlipSpec, SolidSpec,
};
use handeye_arm::{Arm, ArmError, JointValues};
use handeye_geometry::se3;
use handeye_motion::BoardMotionSpec;

const CAMERA_STREAM: u64 = 1;
const BOARD_STREAM: u64 = 2;
const PRINT_STREAM: u64 = 3;

/// A scene with everything random drawn: what is true in one run.
///
/// The world is the frame [`Base`]: the one in which the controller reports tip poses.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolvedScene {
    /// Seed that it was drawn from; noise of images is to be drawn from it too.
    pub seed: u64,
    /// How simulated time runs.
    pub simulation: SimulationSpec,
    /// The lens of colour and depth.
    pub intrinsics: Intrinsics,
    /// Depth of the nearest point that is seen, metres.
    pub near_m: f64,
    /// Depth reported where nothing is seen, metres.
    pub far_m: f64,
    /// The arm, from the arm frame (`/UR5`) to the connection, with the ranges of its joints.
    pub arm: Arm,
    /// Which arm it is.
    pub arm_model: ArmSpec,
    /// Its name in the tree of objects.
    pub arm_name: String,
    /// Pose of the arm frame in the world.
    pub world_from_arm: Isometry3<f64>,
    /// Pose of the tip (`/UR5/Tip`) in the connection.
    pub connection_from_tip: Isometry3<f64>,
    /// The hand-eye transform.
    pub tip_from_camera: Pose<Tip, Camera>,
    /// Pose of the vision sensor (`/UR5/3D_camera`) in the tip: the camera in CoppeliaSim's axes.
    pub tip_from_sensor: Pose<Tip, Sensor>,
    pub base_from_target: Pose<Base, Target>,
    /// Pose of the printed sheet (`/Plane`) in the world: origin in its centre, z out of the printed side.
    pub world_from_plane: Isometry3<f64>,
    /// How the board moves from the start of the simulation on.
    pub board_motion: BoardMotionSpec,
    /// A single slip of the board.
    pub board_slip: Option<SlipSpec>,
    /// What is printed on it.
    pub target: TargetSpec,
    /// Errors of the print; `None` for an exact one.
    pub print: Option<Arc<PrintErrors>>,
    /// Size of the sheet along x and y of the plane, metres.
    pub paper_m: [f64; 2],
    /// Joint values at the start, radians; of a prismatic joint metres.
    pub start_joints: JointValues,
    /// What moves the joints.
    pub joint_mode: JointModeSpec,
    /// How far from its target a dynamic joint comes to rest at most, radians, or metres for a prismatic joint.
    pub rest_error: f64,
    /// Errors of the arm.
    pub robot_errors: RobotErrors,
    /// Imperfections of the colour image.
    pub image: ImageSpec,
    /// Imperfections of the depth image.
    pub depth: DepthSpec,
    /// Light and background.
    pub light: LightSpec,
    /// Obstacles around the arm.
    pub solids: Vec<ResolvedSolid>,
}

/// A box in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolvedSolid {
    /// Name, for messages.
    pub name: String,
    /// Pose of its centre in the world.
    pub world_from_solid: Isometry3<f64>,
    /// Lengths of its edges along its own axes, metres.
    pub size_m: [f64; 3],
    /// Colour: red, green, blue.
    pub colour: [u8; 3],
}

impl ResolvedScene {
    /// The tip pose that the controller reports for the joint values of its encoders.
    ///
    /// # Errors
    /// [`ArmError`] for values that are not those of this arm.
    pub fn reported_tip(&self, encoders: &JointValues) -> Result<Pose<Base, Tip>, ArmError> {
        let arm_from_tip = self.arm.forward(encoders)?.isometry() * self.connection_from_tip;
        Ok(Pose::from_isometry(self.world_from_arm * arm_from_tip))
    }

    /// Where the tip really is, see [`RobotErrors`].
    ///
    /// # Errors
    /// As [`Self::reported_tip`].
    pub fn true_tip(&self, encoders: &JointValues, settled_index: u64) -> Result<Pose<Base, Tip>, ArmError> {
        let of_joints = self.joint_displacements(encoders)?;
        let settled = se3::exp(&self.robot_errors.settled(settled_index));
        let arm_from_connection = *self.arm.displaced(&of_joints)?.forward(encoders)?.isometry();
        Ok(Pose::from_isometry(self.world_from_arm * arm_from_connection * self.connection_from_tip * settled))
    }

    /// Where each joint really is with these values of the encoders, in its frame at rest turned so that the axis is z
    /// ([`handeye_arm::Joint::joint_from_axis`]): with joint offsets and link errors.
    ///
    /// # Errors
    /// As [`Self::reported_tip`].
    pub fn joint_displacements(&self, encoders: &JointValues) -> Result<Vec<Isometry3<f64>>, ArmError> {
        let down = self.world_from_arm.rotation.inverse() * -Vector3::z();
        let gravity = errors_of_arm::gravity(&self.arm, &self.connection_from_tip, &down, encoders)?;
        Ok(self.robot_errors.displacements(&gravity))
    }

    /// What its sensors do to colour and depth images.
    pub fn imaging(&self) -> Imaging {
        let (image, depth) = (&self.image, &self.depth);
        Imaging {
            sampling: image.sampling,
            blur_px: image.blur_px,
            noise_grey: image.noise_grey,
            exposure: image.exposure,
            depth_noise_m: depth.noise_mm * 1e-3,
            depth_noise_per_m2: depth.noise_mm_per_m2 * 1e-3,
            depth_offset_px: depth.offset_px,
            depth_of_nothing_m: depth.nothing_m,
        }
    }

    /// Its light, for the renderer.
    pub fn lamp(&self) -> Light {
        let LightSpec { direction, ambient, diffuse, background: _ } = self.light;
        let direction = Unit::try_new(Vector3::from(direction), 1e-12).unwrap_or_else(Vector3::z_axis);
        let source = LightSource::Directional(direction);
        Light { source, ambient: ambient as f32, diffuse: diffuse as f32 }
    }

    /// Colour of the background, where no object is seen.
    pub fn background(&self) -> [f32; 3] {
        self.light.background.map(|c| f32::from(c) / 255.0)
    }

    /// Its board, for the renderer, with its target frame at a pose in the world.
    pub fn board_at(&self, world_from_target: Isometry3<f64>) -> BoardSurface {
        let grid = self.target.grid();
        BoardSurface {
            print: self.print.clone(),
            ..BoardSurface::new(world_from_target, grid.columns, grid.rows, grid.square_m, self.paper_m)
        }
    }

    /// Where the corners were printed, in the target's frame and order.
    pub fn printed_points(&self) -> Vec<Point3<f64>> {
        let grid = self.target.grid();
        let mut points = self.target.points();
        for (index, point) in points.iter_mut().enumerate() {
            let off = |print: &Arc<PrintErrors>| print.of_corner(index % grid.columns, index / grid.columns);
            let [along_columns, along_rows] = self.print.as_ref().map_or([0.0; 2], off);
            point.x += along_columns * grid.square_m;
            point.y += along_rows * grid.square_m;
        }
        points
    }

    /// The target as the camera sees it from a true tip pose.
    pub fn camera_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Camera, Target> {
        (*base_from_tip * self.tip_from_camera).inverse() * self.base_from_target
    }
}

/// Draws the random parts of a scene that has been checked.
pub(super) fn resolve(scene: &Scene, arm: Arm, seed: u64) -> ResolvedScene {
    let Scene { seed: _, simulation, robot, camera, board, image, depth, light, solids } = scene;
    let tip_from_camera = camera_on_tip(camera, seed);
    let world_from_plane = board.plane.isometry()
        * handeye_geometry::se3::exp(&gaussian(
            seed,
            BOARD_STREAM,
            board.random_offset_mm * 1e-3,
            board.random_offset_deg.to_radians(),
        ));
    let target = TargetSpec::Chessboard(Grid { columns: board.columns, rows: board.rows, square_m: board.square_m });
    ResolvedScene {
        seed,
        simulation: *simulation,
        intrinsics: intrinsics(camera),
        near_m: camera.near_m,
        far_m: camera.far_m,
        world_from_arm: robot.arm.isometry(),
        connection_from_tip: robot.tip.isometry(),
        tip_from_camera,
        tip_from_sensor: tip_from_camera * sensor_from_camera().inverse(),
        base_from_target: Pose::from_isometry(world_from_plane * sheet_from_target(&target)),
        world_from_plane,
        board_motion: board.motion,
        board_slip: board.slip,
        print: board.print.map(|print| Arc::new(printed(&print, board, &mut stream_of(seed, PRINT_STREAM)))),
        target,
        paper_m: board.paper_m,
        start_joints: JointValues::from_fn(arm.joint_count(), |i| si(arm.joints()[i].kind, robot.start_joints_deg[i])),
        joint_mode: robot.joint_mode,
        rest_error: robot.rest_error_deg.to_radians(),
        robot_errors: RobotErrors::new(robot, &arm, seed),
        arm,
        arm_model: robot.model.clone(),
        arm_name: robot.name.clone(),
        image: *image,
        depth: *depth,
        light: *light,
        solids: solids.iter().map(|solid| place(solid, &world_from_plane)).collect(),
    }
}

fn camera_on_tip(camera: &CameraSpec, seed: u64) -> Pose<Tip, Camera> {
    let nominal = Pose::<Tip, Sensor>::from_isometry(camera.sensor.isometry()) * sensor_from_camera();
    let (sigma_m, sigma_rad) = (camera.random_offset_mm * 1e-3, camera.random_offset_deg.to_radians());
    nominal.perturbed(&gaussian(seed, CAMERA_STREAM, sigma_m, sigma_rad))
}

/// The lens of a camera whose numbers may still be out of range.
pub(super) fn intrinsics(camera: &CameraSpec) -> Intrinsics {
    let CameraSpec { width, height, view_angle_deg, fx, fy, cx, cy, distortion, .. } = *camera;
    let angle_deg = view_angle_deg.unwrap_or(REFERENCE_VIEW_ANGLE_DEG);
    let by_angle = Intrinsics::from_view_angle(width, height, angle_deg.to_radians());
    Intrinsics {
        fx: fx.unwrap_or(by_angle.fx),
        fy: fy.unwrap_or(by_angle.fy),
        cx: cx.unwrap_or(by_angle.cx),
        cy: cy.unwrap_or(by_angle.cy),
        distortion,
        ..by_angle
    }
}

fn place(solid: &SolidSpec, world_from_plane: &Isometry3<f64>) -> ResolvedSolid {
    let SolidSpec { name, size_m, position_m, rotation_xyzw, relative_to, colour } = solid;
    let pose = super::PoseSpec { position_m: *position_m, rotation_xyzw: *rotation_xyzw }.isometry();
    let world_from_solid = match relative_to {
        RelativeTo::World => pose,
        RelativeTo::Plane => world_from_plane * pose,
    };
    ResolvedSolid { name: name.clone(), world_from_solid, size_m: *size_m, colour: *colour }
}
