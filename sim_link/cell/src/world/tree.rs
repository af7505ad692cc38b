//! The object tree: handles, names, parents, and where everything is.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::error::WorldError;
use super::handle::Handle;
use super::joint::Joint;
use super::sensor::VisionSensor;

/// First handle given out. Scripts test handles with `if handle:` and `handle == -1`, so 0 and below stay unused.
const FIRST_HANDLE: Handle = 15;

/// Objects that a world takes; clients create dummies, and memory must stay bounded.
pub(crate) const MAX_OBJECTS: usize = 10_000;

/// Nesting that a world takes, which bounds every recursion over the tree.
pub const MAX_DEPTH: usize = 128;

/// Which of the two robots a pose is read from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chain {
    /// The robot as its controller believes it to be: encoder angles through the nominal geometry.
    Reported,
    /// The robot as it really is: with joint offsets and positioning noise. This is what cameras see.
    Actual,
}

/// What an object is.
#[derive(Debug, Clone)]
pub enum Kind {
    /// A solid.
    Shape,
    Joint(Box<Joint>),
    /// A frame without extent.
    Dummy {
        /// Size of its marker in metres, kept for the client that asks.
        size_m: f64,
    },
    /// A rigid attachment point.
    ForceSensor,
    /// A camera that delivers colour, depth, or both.
    VisionSensor(Box<VisionSensor>),
}

impl Kind {
    /// The API's number for the type.
    pub fn code(&self) -> i64 {
        match self {
            Self::Shape => 0,
            Self::Joint(_) => 1,
            Self::Dummy { .. } => 4,
            Self::VisionSensor(_) => 9,
            Self::ForceSensor => 12,
        }
    }
}

/// One object of the tree.
#[derive(Debug, Clone)]
pub struct Object {
    /// Name, not unique.
    pub alias: String,
    pub kind: Kind,
    /// Whether it is the base of a model, which `:` in a path searches for.
    pub model_base: bool,
    /// Not seen by any camera from the next pass on; what hangs on it is.
    pub hidden: bool,
    parent: Option<Handle>,
    children: Vec<Handle>,
    /// Pose in the parent's frame; in the frame that moves, if the parent is a joint.
    pub(super) local: Isometry3<f64>,
    /// Where it really is in the frame that it reports: what [`Chain::Actual`] adds.
    pub displacement: Isometry3<f64>,
}

impl Object {
    /// Its parent, if it has one.
    pub fn parent(&self) -> Option<Handle> {
        self.parent
    }

    /// Its children in order.
    pub fn children(&self) -> &[Handle] {
        &self.children
    }

    /// `parent_from_object`, where a parent joint's frame is the moving one.
    pub(crate) fn local(&self) -> &Isometry3<f64> {
        &self.local
    }
}

/// All objects, in a forest under the scene.
#[derive(Debug, Clone)]
pub struct Tree {
    objects: BTreeMap<Handle, Object>,
    roots: Vec<Handle>,
    next: Handle,
}

impl Default for Tree {
    fn default() -> Self {
        Self { objects: BTreeMap::new(), roots: Vec::new(), next: FIRST_HANDLE }
    }
}

impl Tree {
    /// Adds an object under `parent` (`None`: the scene) at `parent_from_object`.
    ///
    /// # Errors
    /// A parent that does not exist, a tree that is full or nested too deeply.
    pub fn add(
        &mut self,
        alias: &str,
        kind: Kind,
        parent: Option<Handle>,
        parent_from_object: Isometry3<f64>,
    ) -> Result<Handle, WorldError> {
        if self.objects.len() >= MAX_OBJECTS {
            return Err(WorldError::TooMany { what: "objects", limit: MAX_OBJECTS });
        }
        if let Some(parent) = parent
            && self.depth(parent)? + 1 >= MAX_DEPTH
        {
            return Err(WorldError::TooMany { what: "levels of objects", limit: MAX_DEPTH });
        }
        let handle = self.next;
        self.next += 1;
        let alias = alias.to_owned();
        self.objects.insert(
            handle,
            Object {
                alias,
                kind,
                model_base: false,
                hidden: false,
                parent,
                children: Vec::new(),
                local: parent_from_object,
                displacement: Isometry3::identity(),
            },
        );
        self.siblings_mut(parent).push(handle);
        Ok(handle)
    }

    /// The object with this handle.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub fn get(&self, handle: Handle) -> Result<&Object, WorldError> {
        self.objects.get(&handle).ok_or(WorldError::NoSuchObject)
    }

    /// The object with this handle, to change.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub fn get_mut(&mut self, handle: Handle) -> Result<&mut Object, WorldError> {
        self.objects.get_mut(&handle).ok_or(WorldError::NoSuchObject)
    }

    /// Whether the handle names an object.
    pub fn contains(&self, handle: Handle) -> bool {
        self.objects.contains_key(&handle)
    }

    /// Every object in the order of creation.
    pub fn iter(&self) -> impl Iterator<Item = (Handle, &Object)> {
        self.objects.iter().map(|(&handle, object)| (handle, object))
    }

    /// Every object in the order of creation, to change.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (Handle, &mut Object)> {
        self.objects.iter_mut().map(|(&handle, object)| (handle, object))
    }

    /// Objects directly under the scene.
    pub fn roots(&self) -> &[Handle] {
        &self.roots
    }

    /// The joint with this handle.
    ///
    /// # Errors
    /// No such object, or not a joint.
    pub fn joint(&self, handle: Handle) -> Result<&Joint, WorldError> {
        match &self.get(handle)?.kind {
            Kind::Joint(joint) => Ok(joint),
            _ => Err(WorldError::NotAJoint),
        }
    }

    /// The joint with this handle, to change.
    ///
    /// # Errors
    /// No such object, or not a joint.
    pub fn joint_mut(&mut self, handle: Handle) -> Result<&mut Joint, WorldError> {
        match &mut self.get_mut(handle)?.kind {
            Kind::Joint(joint) => Ok(joint),
            _ => Err(WorldError::NotAJoint),
        }
    }

    /// The vision sensor with this handle.
    ///
    /// # Errors
    /// No such object, or not a vision sensor.
    pub fn sensor(&self, handle: Handle) -> Result<&VisionSensor, WorldError> {
        match &self.get(handle)?.kind {
            Kind::VisionSensor(sensor) => Ok(sensor),
            _ => Err(WorldError::NotAVisionSensor),
        }
    }

    /// Removes an object; its children go to its parent and stay where they are in the world.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub fn remove(&mut self, handle: Handle) -> Result<(), WorldError> {
        let (parent, children) = {
            let object = self.get(handle)?;
            (object.parent, object.children.clone())
        };
        for child in children {
            self.set_parent(child, parent, true)?;
        }
        self.siblings_mut(parent).retain(|&sibling| sibling != handle);
        self.objects.remove(&handle);
        Ok(())
    }

    /// Hangs an object under another parent (`None`: the scene), keeping its world pose if `in_place`.
    ///
    /// # Errors
    /// Objects that do not exist, an object under itself, nesting past [`MAX_DEPTH`].
    pub fn set_parent(&mut self, handle: Handle, parent: Option<Handle>, in_place: bool) -> Result<(), WorldError> {
        let old = self.get(handle)?.parent;
        let mut ancestor = parent;
        while let Some(above) = ancestor {
            if above == handle {
                return Err(WorldError::CyclicParent);
            }
            ancestor = self.get(above)?.parent;
        }
        let depth = parent.map_or(Ok(0), |parent| self.depth(parent).map(|depth| depth + 1))?;
        if depth + self.height(handle) >= MAX_DEPTH {
            return Err(WorldError::TooMany { what: "levels of objects", limit: MAX_DEPTH });
        }
        let world = self.world_pose(handle, Chain::Reported)?;
        self.siblings_mut(old).retain(|&sibling| sibling != handle);
        self.siblings_mut(parent).push(handle);
        self.get_mut(handle)?.parent = parent;
        if in_place { self.set_world_pose(handle, &world) } else { Ok(()) }
    }

    /// Where an object is: `world_from_object`. For a joint this is its base frame, which does not turn with it.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub fn world_pose(&self, handle: Handle, chain: Chain) -> Result<Isometry3<f64>, WorldError> {
        let object = self.get(handle)?;
        let mut pose = placed(object, chain);
        let mut above = object.parent;
        while let Some(parent) = above {
            let object = self.get(parent)?;
            pose = placed(object, chain) * turn(object) * pose;
            above = object.parent;
        }
        Ok(pose)
    }

    /// As [`Self::world_pose`], but for a joint the frame that turns with it, in which its children live.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub(crate) fn moving_pose(&self, handle: Handle, chain: Chain) -> Result<Isometry3<f64>, WorldError> {
        Ok(self.world_pose(handle, chain)? * turn(self.get(handle)?))
    }

    /// Puts an object to `world_from_object`; whatever hangs on it comes along.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub fn set_world_pose(&mut self, handle: Handle, world_from_object: &Isometry3<f64>) -> Result<(), WorldError> {
        let world_from_parent = match self.get(handle)?.parent {
            Some(parent) => self.moving_pose(parent, Chain::Reported)?,
            None => Isometry3::identity(),
        };
        let mut local = world_from_parent.inv_mul(world_from_object);
        // Scripts set poses in loops, relative to themselves; without this the norm would drift away.
        local.rotation.renormalize();
        self.get_mut(handle)?.local = local;
        Ok(())
    }

    /// The objects of a subtree, breadth first, base included.
    ///
    /// # Errors
    /// [`WorldError::NoSuchObject`].
    pub fn subtree(&self, base: Handle) -> Result<Vec<Handle>, WorldError> {
        self.get(base)?;
        Ok(self.breadth_first(vec![base]))
    }

    /// The objects under `level`, breadth first, `level` included.
    pub fn breadth_first(&self, level: Vec<Handle>) -> Vec<Handle> {
        let mut all = level;
        let mut next = 0;
        while let Some(&handle) = all.get(next) {
            if let Some(object) = self.objects.get(&handle) {
                all.extend_from_slice(&object.children);
            }
            next += 1;
        }
        all
    }

    /// Ancestors of an object, nearest first.
    pub fn ancestors(&self, handle: Handle) -> impl Iterator<Item = Handle> + '_ {
        std::iter::successors(self.parent_of(handle), |&above| self.parent_of(above))
    }

    /// The children of `parent`; of the scene for `None`.
    pub(crate) fn level(&self, parent: Option<Handle>) -> &[Handle] {
        match parent {
            None => &self.roots,
            Some(parent) => self.objects.get(&parent).map_or(&[], |object| &object.children),
        }
    }

    fn parent_of(&self, handle: Handle) -> Option<Handle> {
        self.objects.get(&handle)?.parent
    }

    fn depth(&self, handle: Handle) -> Result<usize, WorldError> {
        self.get(handle)?;
        Ok(self.ancestors(handle).count())
    }

    fn height(&self, handle: Handle) -> usize {
        let mut level = vec![handle];
        let mut height = 0;
        loop {
            level = level.iter().flat_map(|&handle| self.level(Some(handle)).iter().copied()).collect();
            if level.is_empty() {
                return height;
            }
            height += 1;
        }
    }

    fn siblings_mut(&mut self, parent: Option<Handle>) -> &mut Vec<Handle> {
        match parent.and_then(|parent| self.objects.get_mut(&parent)) {
            Some(object) => &mut object.children,
            None => &mut self.roots,
        }
    }
}

/// An object in its parent's frame, as the robot believes or as it is.
fn placed(object: &Object, chain: Chain) -> Isometry3<f64> {
    match chain {
        Chain::Reported => object.local,
        Chain::Actual => object.local * object.displacement,
    }
}

/// Transform from a joint's base frame to its children.
fn turn(object: &Object) -> Isometry3<f64> {
    match &object.kind {
        Kind::Joint(joint) => joint.motion(joint.position_rad()),
        _ => Isometry3::identity(),
    }
}

/// A rotation about z.
pub fn turn_z(angle_rad: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
    Isometry3::from_parts(Translation3::identity(), rotation)
}

#[cfg(test)]
#[path = "tree_tests.rs"]
mod tests;
