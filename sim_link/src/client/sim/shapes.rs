//! Shapes of the scene, and how large they are.

use ciborium::Value;
use nalgebra::{Isometry3, Point3};

use super::{ObjectHandle, Sim};
use crate::client::constants;
use crate::client::error::LinkError;

/// The box about a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShapeBox {
    /// Pose of its middle in the frame of the shape.
    pub shape_from_middle: Isometry3<f64>,
    /// Lengths of its edges, metres.
    pub size_m: [f64; 3],
}

impl Sim {
    /// All shapes of the scene, or of the tree of an object with that object itself.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn get_shapes(&mut self, base: Option<ObjectHandle>) -> Result<Vec<ObjectHandle>, LinkError> {
        self.get_objects_in_tree(base, constants::OBJECT_SHAPE)
    }

    /// The box about a shape; `None` from a server that does not tell.
    ///
    /// CoppeliaSim from 4.7 on gives size and pose by `sim.getShapeBB`. Where that is missing, or gives the size alone as in
    /// 4.5 and 4.6, where a box lies along the axes of its shape, the corners are asked for one by one by
    /// `sim.getObjectFloatParam`, which all versions from 4.5 to 4.10 have.
    ///
    /// # Errors
    /// A lost connection, and any other [`LinkError`] that is no refusal.
    pub(crate) fn get_shape_box(&mut self, shape: ObjectHandle) -> Result<Option<ShapeBox>, LinkError> {
        match self.call("sim.getShapeBB", vec![shape.to_value()]) {
            Ok(reply) if reply.values().len() >= 2 => {
                if let (Ok(size_m), Ok(pose)) = (reply.exactly::<3>(0), reply.pose::<(), ()>(1)) {
                    return Ok(Some(ShapeBox { shape_from_middle: *pose.isometry(), size_m }));
                }
            }
            Ok(_size_alone) => {}
            Err(LinkError::Remote { .. }) => {}
            Err(error) => return Err(error),
        }
        let mut corners = [Point3::origin(); 2];
        for (corner, parameters) in corners.iter_mut().zip([constants::BOUNDS_MIN, constants::BOUNDS_MAX]) {
            for (axis, parameter) in parameters.into_iter().enumerate() {
                let args = vec![shape.to_value(), Value::from(parameter)];
                corner[axis] = match self.call("sim.getObjectFloatParam", args) {
                    Ok(reply) => match reply.number(0) {
                        Ok(value) => value,
                        Err(_nothing) => return Ok(None),
                    },
                    Err(LinkError::Remote { .. }) => return Ok(None),
                    Err(error) => return Err(error),
                };
            }
        }
        let [min, max] = corners;
        let size = max - min;
        let shape_from_middle = Isometry3::from(nalgebra::center(&min, &max).coords);
        Ok(Some(ShapeBox { shape_from_middle, size_m: size.into() }))
    }
}
