//! The obstacles around the arm, from the scene; and the arm among them, as its motions are checked.

use std::collections::HashSet;

use handeye_geometry::frames::{Base, Camera, Pose, Tip};
use handeye_plan::{self as planning, Contact, Guard, Obstacle, Surroundings};
use nalgebra::{Isometry3, Point3};

use super::Arm;
use super::hold::Held;
use super::reach::ArmKinematics;
use crate::error::LinkError;
use crate::sim::{ObjectHandle, Sim};

/// Boxes that are kept at most, the nearest to the foot of the arm.
const MOST_BOXES: usize = 500;
/// Most shapes that are read: each takes a few calls.
const MOST_SHAPES: usize = 2000;
/// Boxes that are farther from the foot of the arm \[m\] are out of reach of every arm on a table.
const FARTHEST_M: f64 = 3.0;
/// A box that contains this point above the foot of the arm \[m\] must be hollow, as the arm is in it.
const ABOVE_FOOT_M: f64 = 0.05;

/// Free space that jogs, motions to a goal and following keep, metres: less than planned views, because a person looks on and
/// means to come near.
const HAND_CLEARANCE_M: f64 = 0.01;

/// The obstacles of a scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneObstacles {
    /// The obstacles that are not attached to the board.
    pub around: Surroundings,
    /// What holds the board and moves with it: where it was when the scene was read.
    pub on_board: Vec<Obstacle>,
}

impl SceneObstacles {
    /// All of them, for planning with a board at rest.
    pub fn all(&self) -> Surroundings {
        self.around.clone().and(Surroundings::of(self.on_board.clone()))
    }
}

/// The arm among the obstacles around it.
#[derive(Debug, Clone, PartialEq)]
pub struct Among {
    /// The arm, with what is on its tip.
    pub arm: planning::Arm,
    /// The obstacles.
    pub around: Surroundings,
    /// Free space that its motions keep, metres; where the arm is nearer already, no less than there is.
    pub clearance_m: f64,
}

impl Among {
    /// For a motion from these joint values on.
    pub fn guard(&self, joints: &[f64]) -> Guard<'_> {
        Guard::from(&self.arm, &self.around, joints, self.clearance_m)
    }

    /// For places from which a motion is to keep the whole free space.
    pub(crate) fn strict(&self) -> Guard<'_> {
        Guard::strict(&self.arm, &self.around, self.clearance_m)
    }

    /// The contact of a motion from one configuration straight in joint space to another.
    pub(super) fn contact(&self, from: &[f64], to: &[f64]) -> Option<Contact> {
        let guard = self.guard(from);
        guard.contact(to).or_else(|| guard.contact_on_path(from, to))
    }
}

impl ArmKinematics {
    /// The arm among the obstacles around it, as a person drives it: with a centimetre of free space. Where the camera is on
    /// its tip is not always known; it is then taken to be at the tip.
    pub fn among(&self, around: Surroundings, tip_from_camera: Option<&Pose<Tip, Camera>>) -> Among {
        let camera = tip_from_camera.map_or_else(Isometry3::identity, |pose| *pose.isometry());
        Among { arm: self.as_planned(camera), around, clearance_m: HAND_CLEARANCE_M }
    }
}

impl Arm {
    /// From now on jogs, motions of the joints or along a line and following end before they touch an obstacle; `None`
    /// where these are not known.
    pub fn keep_clear(&mut self, among: Option<Among>) {
        self.among = among.map(std::sync::Arc::new);
    }

    /// The obstacles of the scene: a box about each shape, where it is now; those attached to the board separately. Excluded are
    /// the arm with all that is attached to it, the board itself, and boxes around the foot of the arm, for example of a cage:
    /// their inside is not known, and they are named in the log. The 500 nearest within 3 m of the foot of the arm are kept; of
    /// more than 2,000 shapes the rest is left out, which is logged. A camera next to the robot counts as any other shape. A shape
    /// whose size the server does not report is left out, which is logged.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn surroundings(&mut self, kinematics: &ArmKinematics) -> Result<SceneObstacles, LinkError> {
        let held = Held::acquire(&mut self.sim)?;
        let (arm, board) = (self.objects.arm.or_else(|| self.objects.joints.first().copied()), self.objects.board);
        let found = read(&mut self.sim, arm, board, kinematics);
        held.release(&mut self.sim, found)
    }
}

fn read(
    sim: &mut Sim,
    arm: Option<ObjectHandle>,
    board: Option<ObjectHandle>,
    kinematics: &ArmKinematics,
) -> Result<SceneObstacles, LinkError> {
    let shapes = sim.get_shapes(None)?;
    let mut own: HashSet<ObjectHandle> = board.into_iter().collect();
    if let Some(arm) = arm {
        own.extend(sim.get_shapes(Some(arm))?);
    }
    let on_board: HashSet<ObjectHandle> = match board {
        Some(board) => sim.get_shapes(Some(board))?.into_iter().collect(),
        None => HashSet::new(),
    };
    let shapes: Vec<ObjectHandle> = shapes.into_iter().filter(|shape| !own.contains(shape)).collect();
    if shapes.len() > MOST_SHAPES {
        tracing::warn!("the scene has {} shapes: the arm is kept clear of the first {MOST_SHAPES} only", shapes.len());
    }
    let foot = kinematics.base_from_arm() * Point3::new(0.0, 0.0, ABOVE_FOOT_M);
    let below_foot = kinematics.base_from_arm() * Point3::new(0.0, 0.0, -ABOVE_FOOT_M);
    let mut is_hollow = false;
    let mut boxes: Vec<(f64, bool, Obstacle)> = Vec::new();
    for shape in shapes.into_iter().take(MOST_SHAPES) {
        let Some(found) = sim.get_shape_box(shape)? else {
            tracing::warn!(
                "the simulator does not tell how large the shape {} is: the arm is not kept clear of it",
                shape.0
            );
            continue;
        };
        let base_from_shape = *sim.get_object_pose::<Base, Base>(shape, ObjectHandle::WORLD)?.isometry();
        if found.size_m.iter().any(|edge_m| !edge_m.is_finite()) || found.size_m.iter().all(|edge_m| *edge_m <= 0.0) {
            continue;
        }
        let name = sim.get_object_alias(shape)?;
        let size_m = found.size_m.map(|edge_m| edge_m.max(0.0));
        let obstacle = Obstacle::new(name, base_from_shape * found.shape_from_middle, size_m);
        let distance_m = obstacle.distance_to(&foot);
        if distance_m < 0.0 {
            is_hollow = true;
            tracing::warn!(
                "the arm stands in the box about {:?}, which is taken for hollow: the arm is not kept clear of it",
                obstacle.name
            );
        } else if distance_m <= FARTHEST_M {
            boxes.push((distance_m, on_board.contains(&shape), obstacle));
        }
    }
    boxes.sort_by(|a, b| a.0.total_cmp(&b.0));
    if boxes.len() > MOST_BOXES {
        tracing::warn!("{} boxes stand around: the arm is kept clear of the {MOST_BOXES} nearest", boxes.len());
        boxes.truncate(MOST_BOXES);
    }
    let stands_on = boxes.iter().any(|(_, _, obstacle)| obstacle.distance_to(&below_foot) <= ABOVE_FOOT_M);
    let mut obstacles_found = SceneObstacles::default();
    if is_hollow || !stands_on {
        // What the arm is mounted on is not among the boxes: its plane is used instead.
        obstacles_found.around = kinematics.plane();
    }
    for (_, is_on_board, obstacle) in boxes {
        if is_on_board {
            obstacles_found.on_board.push(obstacle);
        } else {
            obstacles_found.around.obstacles.push(obstacle);
        }
    }
    Ok(obstacles_found)
}
