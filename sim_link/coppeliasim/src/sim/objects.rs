//! Objects of the scene, their poses, and joints.

use ciborium::Value;
use handeye_geometry::frames::Pose;

use super::{JointInterval, ObjectHandle, Sim};
use crate::constants;
use crate::convert::seven_from_pose;
use crate::error::LinkError;
use handeye_wire as wire;

impl Sim {
    /// The object at a path such as `/UR5/Tip`.
    ///
    /// # Errors
    /// [`LinkError::Remote`] when there is no such object.
    pub fn get_object(&mut self, path: &str) -> Result<ObjectHandle, LinkError> {
        Ok(ObjectHandle(self.call("sim.getObject", vec![Value::from(path)])?.integer(0)?))
    }

    /// The `index`-th object (from 0) that matches a path: `/UR5/joint` with 0 to 5 are the joints from the base up.
    ///
    /// # Errors
    /// [`LinkError::Remote`] when there are fewer.
    pub fn get_object_index(&mut self, path: &str, index: u32) -> Result<ObjectHandle, LinkError> {
        let options = wire::map([("index", Value::from(index))]);
        Ok(ObjectHandle(self.call("sim.getObject", vec![Value::from(path), options])?.integer(0)?))
    }

    /// The object at a path, or `None`.
    ///
    /// # Errors
    /// Any failure but the object's absence.
    pub(crate) fn find_object(&mut self, path: &str) -> Result<Option<ObjectHandle>, LinkError> {
        let options = wire::map([("noError", Value::from(true))]);
        let handle = self.call("sim.getObject", vec![Value::from(path), options])?.integer(0)?;
        Ok((handle >= 0).then_some(ObjectHandle(handle)))
    }

    /// The name of an object.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call, as everywhere here.
    pub(crate) fn get_object_alias(&mut self, object: ObjectHandle) -> Result<String, LinkError> {
        Ok(self.call("sim.getObjectAlias", vec![object.to_value()])?.text(0)?.to_owned())
    }

    /// The shortest path by which [`Self::get_object`] finds an object.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_object_path(&mut self, object: ObjectHandle) -> Result<String, LinkError> {
        let args = vec![object.to_value(), Value::from(constants::ALIAS_SHORTEST_PATH)];
        Ok(self.call("sim.getObjectAlias", args)?.text(0)?.to_owned())
    }

    /// All objects of a type (see [`crate::constants`]) in the scene, or in the tree of an object with that object
    /// itself.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_objects_in_tree(
        &mut self,
        base: Option<ObjectHandle>,
        kind: i64,
    ) -> Result<Vec<ObjectHandle>, LinkError> {
        let base = base.map_or(constants::HANDLE_SCENE, |base| base.0);
        let args = vec![Value::from(base), Value::from(kind), Value::from(0)];
        let handles = self.call("sim.getObjectsInTree", args)?.numbers(0)?;
        // Handles are whole numbers, which a float holds exactly.
        Ok(handles.into_iter().map(|handle| ObjectHandle(handle as i64)).collect())
    }

    /// The parent of an object; `None` at the top of the scene.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_object_parent(&mut self, object: ObjectHandle) -> Result<Option<ObjectHandle>, LinkError> {
        let handle = self.call("sim.getObjectParent", vec![object.to_value()])?.integer(0)?;
        Ok((handle >= 0).then_some(ObjectHandle(handle)))
    }

    /// The type of an object, see [`crate::constants`].
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_object_type(&mut self, object: ObjectHandle) -> Result<i64, LinkError> {
        self.call("sim.getObjectType", vec![object.to_value()])?.integer(0)
    }

    /// How a joint moves, see [`crate::constants`].
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_joint_type(&mut self, joint: ObjectHandle) -> Result<i64, LinkError> {
        self.call("sim.getJointType", vec![joint.to_value()])?.integer(0)
    }

    /// The pose of `object` in `frame`; the caller states which frames these are.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; [`LinkError::BadValue`] when it is not a rigid transform.
    pub fn get_object_pose<Dst, Src>(
        &mut self,
        object: ObjectHandle,
        frame: ObjectHandle,
    ) -> Result<Pose<Dst, Src>, LinkError> {
        self.call("sim.getObjectPose", vec![object.to_value(), frame.to_value()])?.pose(0)
    }

    /// Places `object` in `frame`.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn set_object_pose<Dst, Src>(
        &mut self,
        object: ObjectHandle,
        frame: ObjectHandle,
        pose: &Pose<Dst, Src>,
    ) -> Result<(), LinkError> {
        let value = wire::floats(seven_from_pose(pose));
        self.call("sim.setObjectPose", vec![object.to_value(), frame.to_value(), value]).map(drop)
    }

    /// The position of a joint (rad, or m of a prismatic joint).
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_joint_position(&mut self, joint: ObjectHandle) -> Result<f64, LinkError> {
        self.call("sim.getJointPosition", vec![joint.to_value()])?.number(0)
    }

    /// Whether a joint is moved by forces, so that only its controller can be given a target; the position of any other
    /// joint is set directly.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn is_joint_dynamic(&mut self, joint: ObjectHandle) -> Result<bool, LinkError> {
        Ok(self.call("sim.getJointMode", vec![joint.to_value()])?.integer(0)? == constants::JOINT_MODE_DYNAMIC)
    }

    /// Puts a joint at a position (rad, or m of a prismatic joint) at once. The simulator clamps to its interval.
    ///
    /// `false` if the joint stays where it is: one that a target position moves takes no other.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn set_joint_position(&mut self, joint: ObjectHandle, position: f64) -> Result<bool, LinkError> {
        let reply = self.call("sim.setJointPosition", vec![joint.to_value(), Value::Float(position)])?;
        // Servers that never refuse may also return nothing.
        Ok(reply.integer(0) != Ok(0))
    }

    /// Tells the controller of a joint where to take it (rad, or m of a prismatic joint).
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn set_joint_target_position(&mut self, joint: ObjectHandle, position: f64) -> Result<(), LinkError> {
        self.call("sim.setJointTargetPosition", vec![joint.to_value(), Value::Float(position)]).map(drop)
    }

    /// The range of a joint.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_joint_interval(&mut self, joint: ObjectHandle) -> Result<JointInterval, LinkError> {
        let reply = self.call("sim.getJointInterval", vec![joint.to_value()])?;
        // The second number is the length of the interval, not its end.
        let [min, length] = reply.exactly::<2>(1)?;
        Ok(JointInterval { cyclic: reply.boolean(0)?, min, max: min + length })
    }
}
