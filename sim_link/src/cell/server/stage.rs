//! The objects of the built-in cell: arm, tip, camera, board and what stands around, as a scene describes them.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::cell::kinematics::{JOINTS, JointAngles, forward};
use crate::cell::render::{Finish, Shape, Solid};
use crate::cell::scene::{RelativeTo, ResolvedScene, RobotErrors, Scene};
use crate::cell::world::{Faults, Handle, Joint, Kind, Tree, VisionSensor, World, WorldError, turn_z};

/// Handles of the objects that the cell itself has to find again.
#[derive(Debug, Clone)]
pub struct Stage {
    /// `/UR5`.
    pub arm: Handle,
    /// The joints from the base to the wrist.
    pub joints: [Handle; JOINTS],
    /// The attachment point at the end of the arm.
    pub connection: Handle,
    /// `/UR5/Tip`.
    pub tip: Handle,
    /// `/UR5/3D_camera`, the colour sensor.
    pub camera: Handle,
    /// `/Plane`, the sheet with the board.
    pub plane: Handle,
    /// `plane_from_target`: where the first corner is on the sheet.
    pub plane_from_target: Isometry3<f64>,
    /// What there is to see besides the board: each solid in the frame of its object.
    pub solids: Vec<(Handle, Solid)>,
}

/// Silver of the tubes, blue of the caps, black of the tool.
const TUBE: [f32; 3] = [0.72, 0.74, 0.77];
const CAP: [f32; 3] = [0.34, 0.53, 0.70];
const TOOL: [f32; 3] = [0.16, 0.16, 0.17];

/// How far the upper arm runs beside the shoulder and the forearm beside the elbow, along the joint axes: the housings
/// of a UR5 sit side by side.
const UPPER_ARM_BESIDE_M: f64 = 0.1359;
const FOREARM_BESIDE_M: f64 = 0.0165;

/// Builds the world of a scene.
///
/// # Errors
/// None for a scene that resolves; the tree's own limits otherwise.
pub fn build(scene: &Scene, resolved: &ResolvedScene) -> Result<(World, Stage), WorldError> {
    let mut builder = Builder { tree: Tree::default(), solids: Vec::new() };
    let (arm, joints, connection) = builder.arm(resolved)?;
    let tree = &mut builder.tree;
    let dummy = || Kind::Dummy { size_m: 0.01 };
    let tip = tree.add("Tip", dummy(), Some(connection), resolved.connection_from_tip)?;
    let world_from_tip = tree.world_pose(tip, crate::cell::world::Chain::Reported)?;
    tree.add("Target", dummy(), Some(arm), resolved.world_from_arm.inv_mul(&world_from_tip))?;
    let mut colour = VisionSensor::new(resolved.intrinsics, resolved.near_m, resolved.far_m);
    let mut depth = colour.clone();
    colour.ignore_depth = true;
    depth.ignore_rgb = true;
    let sensor = |sensor| Kind::VisionSensor(Box::new(sensor));
    let camera = tree.add("3D_camera", sensor(colour), Some(tip), *resolved.tip_from_sensor.isometry())?;
    tree.add("depth", sensor(depth), Some(camera), Isometry3::identity())?;
    let plane = tree.add("Plane", Kind::Shape, None, resolved.world_from_plane)?;
    builder.gripper(connection, resolved)?;
    builder.surroundings(scene, resolved, plane)?;
    let mut world = World::default();
    world.tree = builder.tree;
    world.set_faults(Box::new(ArmFaults::new(joints, tip, resolved.robot_errors)));
    world.set_time_step(resolved.simulation.time_step_s)?;
    let plane_from_target = resolved.world_from_plane.inv_mul(resolved.base_from_target.isometry());
    let stage = Stage { arm, joints, connection, tip, camera, plane, plane_from_target, solids: builder.solids };
    Ok((world, stage))
}

struct Builder {
    tree: Tree,
    solids: Vec<(Handle, Solid)>,
}

impl Builder {
    fn arm(&mut self, resolved: &ResolvedScene) -> Result<(Handle, [Handle; JOINTS], Handle), WorldError> {
        let arm = self.tree.add("UR5", Kind::Shape, None, resolved.world_from_arm)?;
        self.tree.get_mut(arm)?.model_base = true;
        let at_zero = forward(&[0.0; JOINTS]);
        let mut joints = [0; JOINTS];
        let (mut parent, mut arm_from_parent) = (arm, Isometry3::identity());
        for (index, slot) in joints.iter_mut().enumerate() {
            let mut joint = Joint::new(resolved.joint_limits.min_rad[index], resolved.joint_limits.max_rad[index]);
            joint.set_position(resolved.start_joints[index])?;
            let parent_from_joint = arm_from_parent.inv_mul(&at_zero.arm_from_joint[index]);
            *slot = self.tree.add("joint", Kind::Joint(joint), Some(parent), parent_from_joint)?;
            parent = self.tree.add("link", Kind::Shape, Some(*slot), Isometry3::identity())?;
            arm_from_parent = at_zero.arm_from_link[index];
            let arm_from_next = at_zero.arm_from_joint.get(index + 1).unwrap_or(&at_zero.arm_from_connection);
            self.link_body(index, parent, arm_from_parent.inv_mul(arm_from_next).translation.vector);
        }
        let parent_from_connection = arm_from_parent.inv_mul(&at_zero.arm_from_connection);
        let connection = self.tree.add("connection", Kind::ForceSensor, Some(parent), parent_from_connection)?;
        let base = Shape::Cylinder { radius: 0.075, half_height: 0.025 };
        self.solids.push((arm, Solid::new(base, Isometry3::translation(0.0, 0.0, 0.01), TUBE)));
        Ok((arm, joints, connection))
    }

    /// The body of a link in its own frame: z along its joint, the next joint's origin at `next`.
    fn link_body(&mut self, index: usize, link: Handle, next: Vector3<f64>) {
        let up = |z: f64| Vector3::new(0.0, 0.0, z);
        let pieces: Vec<(Vector3<f64>, Vector3<f64>, f64, [f32; 3])> = match index {
            0 => vec![(up(0.02), next, 0.060, TUBE)],
            1 => vec![
                (up(0.0), up(UPPER_ARM_BESIDE_M), 0.058, CAP),
                (up(UPPER_ARM_BESIDE_M), next + up(UPPER_ARM_BESIDE_M), 0.050, TUBE),
            ],
            2 => vec![
                (up(FOREARM_BESIDE_M), up(UPPER_ARM_BESIDE_M), 0.048, CAP),
                (up(FOREARM_BESIDE_M), next + up(FOREARM_BESIDE_M), 0.040, TUBE),
            ],
            3 => vec![(up(FOREARM_BESIDE_M), next, 0.040, CAP)],
            4 => vec![(up(0.0), next, 0.039, TUBE)],
            // The flange ends flat, so it stops short by the radius of its rounding.
            _ => vec![(up(0.0), next - next.normalize() * 0.036, 0.036, CAP)],
        };
        for (from, to, radius, colour) in pieces {
            let shape = Shape::Capsule { a: Point3::from(from), b: Point3::from(to), radius };
            self.solids.push((link, Solid::new(shape, Isometry3::identity(), colour).with_finish(Finish::Satin)));
        }
    }

    /// A coupling and two fingers that close around the tip.
    fn gripper(&mut self, connection: Handle, resolved: &ResolvedScene) -> Result<(), WorldError> {
        const COUPLING_M: f64 = 0.012;
        let gripper = self.tree.add("Gripper", Kind::Shape, Some(connection), Isometry3::identity())?;
        let coupling = Shape::Cylinder { radius: 0.030, half_height: COUPLING_M / 2.0 };
        self.solids.push((gripper, Solid::new(coupling, Isometry3::translation(0.0, 0.0, COUPLING_M / 2.0), TOOL)));
        let reach = resolved.connection_from_tip.translation.vector.z.max(COUPLING_M) + 0.02;
        for side in [-1.0, 1.0] {
            let half_extents = Vector3::new(0.005, 0.004, (reach - COUPLING_M) / 2.0);
            let pose = Isometry3::translation(0.0, side * 0.018, f64::midpoint(reach, COUPLING_M));
            self.solids.push((gripper, Solid::new(Shape::Box { half_extents }, pose, TOOL)));
        }
        Ok(())
    }

    fn surroundings(&mut self, scene: &Scene, resolved: &ResolvedScene, plane: Handle) -> Result<(), WorldError> {
        for (spec, solid) in scene.solids.iter().zip(&resolved.solids) {
            let (parent, pose) = match spec.relative_to {
                RelativeTo::Plane => (Some(plane), resolved.world_from_plane.inv_mul(&solid.world_from_solid)),
                RelativeTo::World => (None, solid.world_from_solid),
            };
            let handle = self.tree.add(&alias(&solid.name), Kind::Shape, parent, pose)?;
            let half_extents = Vector3::from(solid.size_m) / 2.0;
            let colour = solid.colour.map(|c| f32::from(c) / 255.0);
            let solid = Solid::new(Shape::Box { half_extents }, Isometry3::identity(), colour);
            self.solids.push((handle, solid));
        }
        Ok(())
    }
}

/// `mounting plate` → `MountingPlate`: a name that can stand in a path.
fn alias(name: &str) -> String {
    name.split(|c: char| !c.is_alphanumeric())
        .flat_map(|word| {
            let mut letters = word.chars();
            letters.next().map(char::to_uppercase).into_iter().flatten().chain(letters)
        })
        .collect()
}

/// The errors of the arm as the tree takes them: constant joint offsets, and a displacement of the tip that is another
/// one every time the arm has come to rest.
#[derive(Debug)]
struct ArmFaults {
    joints: [Handle; JOINTS],
    tip: Handle,
    errors: RobotErrors,
    reported: Option<JointAngles>,
    moving: bool,
    settled: u64,
}

impl ArmFaults {
    fn new(joints: [Handle; JOINTS], tip: Handle, errors: RobotErrors) -> Self {
        Self { joints, tip, errors, reported: None, moving: false, settled: 0 }
    }
}

impl Faults for ArmFaults {
    fn apply(&mut self, tree: &mut Tree) {
        let reported = self.joints.map(|joint| tree.joint(joint).map_or(0.0, Joint::position_rad));
        let moved = self.reported.is_some_and(|before| before != reported);
        if self.moving && !moved {
            self.settled += 1;
        }
        self.moving = moved;
        self.reported = Some(reported);
        for (joint, offset_rad) in self.joints.iter().zip(self.errors.joint_offset_rad) {
            if let Ok(object) = tree.get_mut(*joint) {
                object.displacement = turn_z(offset_rad);
            }
        }
        if let Ok(tip) = tree.get_mut(self.tip) {
            tip.displacement = handeye_core::se3::exp(&self.errors.settled(self.settled));
        }
    }
}

/// A pose that no camera sees, for the board of a world from which it was removed.
pub fn out_of_sight() -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(0.0, 0.0, -1e5), UnitQuaternion::identity())
}

#[cfg(test)]
#[path = "stage_tests.rs"]
mod tests;
