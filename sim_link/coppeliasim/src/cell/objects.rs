//! Finding the parts of a cell in its scene.

use handeye_arm::MAX_JOINTS;

use super::{CellPart, CellPaths};
use crate::constants;
use crate::error::LinkError;
use crate::sim::{ObjectHandle, Sim};

/// Objects between the tip and the base, at most; more is a loop.
const LONGEST_CHAIN: usize = 64;
/// Objects that are named where one is missing, at most: each takes a call.
const MOST_LISTED: usize = 20;

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
        let tip = required(sim, paths, CellPart::Tip)?;
        let arm = optional(sim, &paths.arm)?;
        let usual = CellPaths::default();
        if arm.is_none() && !paths.arm.is_empty() && paths.arm != usual.arm {
            return Err(missing(sim, &paths.arm, CellPart::Arm));
        }
        let carriers = Carriers::of(sim, tip, arm)?;
        // The joints of that name may be those of another arm than the one whose tip was named.
        let is_tip_alone_named = paths.tip != usual.tip && paths.joints == usual.joints;
        let joints = if (carriers.reach_base || is_tip_alone_named) && !carriers.joints.is_empty() {
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
        let target = optional(sim, &paths.target)?;
        let camera = required(sim, paths, CellPart::Camera)?;
        let depth = if paths.depth.is_empty() { camera } else { required(sim, paths, CellPart::Depth)? };
        Ok(Self {
            arm,
            arm_path: paths.arm.clone(),
            joints,
            tip,
            target,
            target_path: paths.target.clone(),
            camera,
            depth,
            board: optional(sim, &paths.board)?,
        })
    }
}

/// What carries the tip.
pub(super) struct Carriers {
    /// The joints between base and tip, from the base up; without a base those between the top of the scene and the tip.
    pub joints: Vec<ObjectHandle>,
    /// Whether the chain reaches the base.
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

/// All objects with the name of the joints, in the order of the scene.
fn named_joints(sim: &mut Sim, paths: &CellPaths) -> Result<Vec<ObjectHandle>, LinkError> {
    let mut joints = Vec::new();
    while joints.len() <= MAX_JOINTS {
        let path = format!("{} [{}]", paths.joints, joints.len());
        let found = sim.get_object_index(&paths.joints, joints.len() as u32);
        match present(found)? {
            Some(joint) => joints.push(joint),
            None if joints.is_empty() => return Err(missing(sim, &path, CellPart::Joints)),
            None => break,
        }
    }
    Ok(joints)
}

/// An object that the scene may lack; an empty path names none.
fn optional(sim: &mut Sim, path: &str) -> Result<Option<ObjectHandle>, LinkError> {
    if path.is_empty() { Ok(None) } else { sim.find_object(path) }
}

/// An object that the scene has to have.
fn required(sim: &mut Sim, paths: &CellPaths, part: CellPart) -> Result<ObjectHandle, LinkError> {
    let path = paths.get(part);
    let found = sim.get_object(path);
    present(found)?.ok_or_else(|| missing(sim, path, part))
}

/// The object is absent only when the server reports that; any other refusal is an error.
fn present(found: Result<ObjectHandle, LinkError>) -> Result<Option<ObjectHandle>, LinkError> {
    match found {
        Ok(handle) => Ok((handle.0 >= 0).then_some(handle)),
        Err(error) if error.is_missing_object() => Ok(None),
        Err(error) => Err(error),
    }
}

/// With the objects of that kind which the scene has, as far as the server lists them.
fn missing(sim: &mut Sim, path: &str, part: CellPart) -> LinkError {
    let objects = sim.get_objects_in_tree(None, part.kind().0).unwrap_or_default();
    let more = objects.len().saturating_sub(MOST_LISTED);
    let paths = objects.into_iter().take(MOST_LISTED).map(|object| sim.get_object_path(object));
    let mut there: Vec<String> = paths.collect::<Result<_, _>>().unwrap_or_default();
    if more > 0 && !there.is_empty() {
        there.push(format!("and {more} more"));
    }
    LinkError::NoSuchObject { path: path.to_owned(), part, there }
}
