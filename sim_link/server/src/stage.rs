//! The objects of the built-in cell: arm, tip, camera, board and obstacles, as a scene describes them.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use handeye_arm::{Arm, JointValues};
use handeye_cell::props;
use handeye_cell::render::{Finish, Shape, Solid};
use handeye_cell::scene::{JointModeSpec, RelativeTo, ResolvedScene, Scene, SlipSpec};
use handeye_cell::world::{
    Carrier, Chain, Faults, Handle, Joint, JointMode, Kind, Tree, VisionSensor, World, WorldError,
};
use handeye_motion::Course;

/// Handles of the objects that the cell itself has to find again.
#[derive(Debug, Clone)]
pub struct Stage {
    /// `/UR5` unless the scene calls it otherwise, whatever arm it is.
    pub arm: Handle,
    /// Its chain, from there to the connection.
    pub chain: Arm,
    /// The joints from the base to the wrist.
    pub joints: Vec<Handle>,
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
    /// Visible objects other than the board: each solid in the frame of its object.
    pub solids: Vec<(Handle, Solid)>,
}

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
    let world_from_tip = tree.world_pose(tip, Chain::Reported)?;
    tree.add("Target", dummy(), Some(arm), resolved.world_from_arm.inv_mul(&world_from_tip))?;
    let mut colour = VisionSensor::new(resolved.intrinsics, resolved.near_m, resolved.far_m);
    let mut depth = colour.clone();
    colour.ignore_depth = true;
    depth.ignore_rgb = true;
    let sensor = |sensor| Kind::VisionSensor(Box::new(sensor));
    let camera = tree.add("3D_camera", sensor(colour), Some(tip), *resolved.tip_from_sensor.isometry())?;
    tree.add("depth", sensor(depth), Some(camera), Isometry3::identity())?;
    let plane = tree.add("Plane", Kind::Shape, None, resolved.world_from_plane)?;
    let gripper = builder.tree.add("Gripper", Kind::Shape, Some(tip), Isometry3::identity())?;
    builder.solids.extend(props::gripper(&Isometry3::identity()).into_iter().map(|solid| (gripper, solid)));
    builder.stand(resolved, plane)?;
    builder.surroundings(scene, resolved, plane)?;
    let mut world = World::default();
    world.tree = builder.tree;
    world.set_faults(Box::new(CellFaults::new(joints.clone(), tip, plane, resolved.clone())));
    world.set_robot(joints.clone(), tip);
    world.carrier = Some(Carrier::new(plane, Course::new(&resolved.board_motion, resolved.seed)));
    world.set_time_step(resolved.simulation.time_step_s)?;
    let plane_from_target = resolved.world_from_plane.inv_mul(resolved.base_from_target.isometry());
    let chain = resolved.arm.clone();
    let stage = Stage { arm, chain, joints, connection, tip, camera, plane, plane_from_target, solids: builder.solids };
    Ok((world, stage))
}

struct Builder {
    tree: Tree,
    solids: Vec<(Handle, Solid)>,
}

impl Builder {
    /// The arm as the tree of the simulator has one: a joint moves along or about the z axis of its frame, and what it
    /// carries has the same axes.
    fn arm(&mut self, resolved: &ResolvedScene) -> Result<(Handle, Vec<Handle>, Handle), WorldError> {
        let arm = self.tree.add(&resolved.arm_name, Kind::Shape, None, resolved.world_from_arm)?;
        self.tree.get_mut(arm)?.model_base = true;
        let chain = &resolved.arm;
        let at_zero = chain.frames(&vec![0.0; chain.joint_count()]).ok().ok_or(WorldError::InvalidData)?;
        let mut joints = Vec::with_capacity(chain.joint_count());
        let (mut parent, mut arm_from_parent) = (arm, Isometry3::identity());
        let mut frames = vec![(parent, arm_from_parent)];
        for (index, part) in chain.joints().iter().enumerate() {
            let mut joint = Joint::of(part.kind, &part.range);
            joint.set_position(resolved.start_joints[index])?;
            joint.rest_error = resolved.rest_error;
            joint.mode = match resolved.joint_mode {
                JointModeSpec::Kinematic => JointMode::Kinematic,
                JointModeSpec::Dynamic => JointMode::Dynamic,
            };
            let axis_from_z = part.joint_from_axis();
            let parent_from_joint = arm_from_parent.inv_mul(&(at_zero.base_from_joint[index] * axis_from_z));
            let handle = self.tree.add("joint", Kind::Joint(Box::new(joint)), Some(parent), parent_from_joint)?;
            joints.push(handle);
            parent = self.tree.add("link", Kind::Shape, Some(handle), Isometry3::identity())?;
            arm_from_parent = at_zero.base_from_link[index] * axis_from_z;
            frames.push((parent, arm_from_parent));
        }
        let arm_from_connection = at_zero.base_from_flange * chain.flange_from_tip;
        let parent_from_connection = arm_from_parent.inv_mul(&arm_from_connection);
        let connection = self.tree.add("connection", Kind::ForceSensor, Some(parent), parent_from_connection)?;
        for (link, solid) in props::arm_parts(&resolved.arm_model, chain) {
            let (handle, arm_from_link) = &frames[link];
            let world_from_shape = arm_from_link.inverse() * solid.world_from_shape;
            self.solids.push((*handle, Solid { world_from_shape, ..solid }));
        }
        Ok((arm, joints, connection))
    }

    /// A plate and a post that hold the sheet. They hang on it and go where it goes.
    fn stand(&mut self, resolved: &ResolvedScene, plane: Handle) -> Result<(), WorldError> {
        let stand = self.tree.add("Stand", Kind::Shape, Some(plane), Isometry3::identity())?;
        let solids = props::stand(resolved.base_from_target.isometry(), resolved.target.centre(), resolved.paper_m);
        self.solids.extend(solids.into_iter().map(|solid| {
            let world_from_shape = resolved.world_from_plane.inv_mul(&solid.world_from_shape);
            (stand, Solid { world_from_shape, ..solid })
        }));
        Ok(())
    }

    fn surroundings(&mut self, scene: &Scene, resolved: &ResolvedScene, plane: Handle) -> Result<(), WorldError> {
        for (spec, solid) in scene.solids.iter().zip(&resolved.solids) {
            let (parent, pose) = match spec.relative_to {
                RelativeTo::Plane => (Some(plane), resolved.world_from_plane.inv_mul(&solid.world_from_solid)),
                RelativeTo::World => (None, solid.world_from_solid),
            };
            let alias = alias(&solid.name);
            let handle = self.tree.add(&alias, Kind::Shape, parent, pose)?;
            let half_extents = Vector3::from(solid.size_m) / 2.0;
            let colour = solid.colour.map(|c| f32::from(c) / 255.0);
            let solid = Solid::new(Shape::Box { half_extents }, Isometry3::identity(), colour);
            self.solids.push((handle, solid.with_finish(finish(&alias))));
        }
        Ok(())
    }
}

/// Floors have tiles and tables have grain, so that the eye finds its way in an image.
fn finish(alias: &str) -> Finish {
    match alias {
        "Floor" => Finish::Tiles { pitch_m: 0.5, joint_m: 0.006 },
        "Table" => Finish::Wood,
        _ => Finish::Matt,
    }
}

/// `mounting plate` → `MountingPlate`: a name that is valid in a path.
fn alias(name: &str) -> String {
    name.split(|c: char| !c.is_alphanumeric())
        .flat_map(|word| {
            let mut letters = word.chars();
            letters.next().map(char::to_uppercase).into_iter().flatten().chain(letters)
        })
        .collect()
}

/// The faults of a cell as the tree takes them: of the arm joints that are elsewhere, and a displacement of the tip
/// that is another one every time the arm has come to rest; of the board that it slips.
#[derive(Debug)]
struct CellFaults {
    joints: Vec<Handle>,
    tip: Handle,
    plane: Handle,
    scene: ResolvedScene,
    /// `None` when it has happened.
    slip: Option<SlipSpec>,
    reported: Option<JointValues>,
    moving: bool,
    settled: u64,
}

impl CellFaults {
    fn new(joints: Vec<Handle>, tip: Handle, plane: Handle, scene: ResolvedScene) -> Self {
        let slip = scene.board_slip;
        Self { joints, tip, plane, scene, slip, reported: None, moving: false, settled: 0 }
    }

    /// Moves the board as a client would; like any such change it is undone at the end of the simulation.
    fn let_slip(&mut self, tree: &mut Tree) {
        let Some(slip) = self.slip.filter(|slip| self.settled >= slip.at_stop) else { return };
        self.slip = None;
        let [x, y, z] = slip.by_mm.map(|mm| mm * 1e-3);
        // A board that a client has removed slips no more.
        if let Ok(world_from_plane) = tree.world_pose(self.plane, Chain::Reported) {
            let slipped = world_from_plane * Translation3::new(x, y, z);
            let _gone = tree.set_world_pose(self.plane, &slipped).is_err();
        }
    }
}

impl Faults for CellFaults {
    fn apply(&mut self, tree: &mut Tree) {
        let value = |i: usize| tree.joint(self.joints[i]).map_or(0.0, Joint::position_rad);
        let reported = JointValues::from_fn(self.joints.len(), value);
        let moved = self.reported.is_some_and(|before| before != reported);
        if self.moving && !moved {
            self.settled += 1;
        }
        self.moving = moved;
        self.reported = Some(reported);
        // There are none for values that are not numbers, and then there is no pose either.
        let displacements = self.scene.joint_displacements(&reported).unwrap_or_default();
        for (joint, displacement) in self.joints.iter().zip(displacements) {
            if let Ok(object) = tree.get_mut(*joint) {
                object.displacement = displacement;
            }
        }
        if let Ok(tip) = tree.get_mut(self.tip) {
            tip.displacement = handeye_geometry::se3::exp(&self.scene.robot_errors.settled(self.settled));
        }
        self.let_slip(tree);
    }
}

/// A pose that no camera sees, for a board that is hidden or was removed.
pub fn out_of_sight() -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(0.0, 0.0, -1e5), UnitQuaternion::identity())
}

#[cfg(test)]
#[path = "stage_tests.rs"]
mod tests;
