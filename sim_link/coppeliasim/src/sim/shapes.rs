//! Shapes of the scene, and how large they are.

use nalgebra::Isometry3;

use super::{ObjectHandle, Sim};
use crate::constants;
use crate::error::LinkError;

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
    pub(crate) fn get_shapes(&mut self, base: Option<ObjectHandle>) -> Result<Vec<ObjectHandle>, LinkError> {
        self.get_objects_in_tree(base, constants::OBJECT_SHAPE)
    }

    /// The box about a shape; `None` for one whose size the server does not report.
    ///
    /// # Errors
    /// A lost connection, and any other [`LinkError`] that is not a refusal.
    pub(crate) fn get_shape_box(&mut self, shape: ObjectHandle) -> Result<Option<ShapeBox>, LinkError> {
        match self.call("sim.getShapeBB", vec![shape.to_value()]) {
            Ok(reply) => {
                let (size_m, pose) = (reply.exactly::<3>(0)?, reply.pose::<(), ()>(1)?);
                Ok(Some(ShapeBox { shape_from_middle: *pose.isometry(), size_m }))
            }
            Err(LinkError::Remote { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}
