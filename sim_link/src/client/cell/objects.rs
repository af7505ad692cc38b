//! Finding the parts of a cell in its scene.

use handeye_core::geometry::arm::MAX_JOINTS;

use super::CellPaths;
use crate::client::constants;
use crate::client::error::LinkError;
use crate::client::sim::{ObjectHandle, Sim};

/// Objects between the tip and the base, at most; more is a loop.
const LONGEST_CHAIN: usize = 64;

/// Handles of the cell's objects.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellObjects {
    pub arm: Option<ObjectHandle>,
    pub arm_path: String,
    /// From the base up.
    pub joints: Vec<ObjectHandle>,
    pub tip: ObjectHandle,
    pub target: Option<ObjectHandle>,
    pub target_path: String,
    pub camera: ObjectHandle,
    pub depth: ObjectHandle,
    pub board: Option<ObjectHandle>,
}

impl CellObjects {
    pub fn find(sim: &mut Sim, paths: &CellPaths) -> Result<Self, LinkError> {
        let tip = named(sim.get_object(&paths.tip), &paths.tip, "tip")?;
        let arm = sim.find_object(&paths.arm)?;
        let carriers = Carriers::of(sim, tip, arm)?;
        let joints = if carriers.reach_base && !carriers.joints.is_empty() {
            carriers.joints
        } else {
            match named_joints(sim, paths) {
                Err(LinkError::NoSuchObject { .. }) if !carriers.joints.is_empty() => carriers.joints,
                named => named?,
            }
        };
        if joints.len() > MAX_JOINTS {
            return Err(LinkError::TooManyJoints { count: joints.len() });
        }
        Ok(Self {
            arm,
            arm_path: paths.arm.clone(),
            joints,
            tip,
            target: sim.find_object(&paths.target)?,
            target_path: paths.target.clone(),
            camera: named(sim.get_object(&paths.camera), &paths.camera, "colour sensor")?,
            depth: named(sim.get_object(&paths.depth), &paths.depth, "depth sensor")?,
            board: sim.find_object(&paths.board)?,
        })
    }
}

/// What carries the tip.
pub(super) struct Carriers {
    /// The joints between base and tip, from the base up; without a base those between the top of the scene and the tip.
    pub joints: Vec<ObjectHandle>,
    /// Whether the base was met.
    pub reach_base: bool,
}

impl Carriers {
    /// Walks from the tip to the base.
    pub fn of(sim: &mut Sim, tip: ObjectHandle, base: Option<ObjectHandle>) -> Result<Self, LinkError> {
        let mut joints = Vec::new();
        let mut object = tip;
        let mut reach_base = false;
        for _ in 0..LONGEST_CHAIN {
            let Some(parent) = sim.get_object_parent(object)? else { break };
            if Some(parent) == base {
                reach_base = true;
                break;
            }
            if sim.get_object_type(parent)? == constants::OBJECT_JOINT {
                joints.push(parent);
            }
            object = parent;
        }
        joints.reverse();
        Ok(Self { joints, reach_base })
    }
}

/// All that bear the name of the joints, in the order of the scene.
fn named_joints(sim: &mut Sim, paths: &CellPaths) -> Result<Vec<ObjectHandle>, LinkError> {
    let mut joints = Vec::new();
    while joints.len() <= MAX_JOINTS {
        let path = format!("{} [{}]", paths.joints, joints.len());
        let found = sim.get_object_index(&paths.joints, joints.len() as u32);
        match named(found, &path, "joint of the arm") {
            Ok(joint) => joints.push(joint),
            Err(LinkError::NoSuchObject { .. }) if !joints.is_empty() => break,
            Err(error) => return Err(error),
        }
    }
    Ok(joints)
}

/// An object that the scene has to have. Only when the server says that there is none it is so; another refusal is the
/// server's to explain.
fn named(found: Result<ObjectHandle, LinkError>, path: &str, what: &'static str) -> Result<ObjectHandle, LinkError> {
    match found {
        Ok(handle) if handle.0 >= 0 => Ok(handle),
        Ok(_) => Err(LinkError::NoSuchObject { path: path.to_owned(), what }),
        Err(error) if error.is_missing_object() => Err(LinkError::NoSuchObject { path: path.to_owned(), what }),
        Err(error) => Err(error),
    }
}
