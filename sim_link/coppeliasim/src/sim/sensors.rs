//! Vision sensors.

use ciborium::Value;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use image::RgbImage;

use super::{ObjectHandle, Sim};
use crate::constants::{
    DEPTH_IN_METRES, HANDLE_ALL_EXCEPT_EXPLICIT, VISION_FAR_CLIPPING, VISION_NEAR_CLIPPING, VISION_PERSPECTIVE,
    VISION_PERSPECTIVE_ANGLE,
};
use crate::convert;
use crate::error::LinkError;

/// How a perspective vision sensor sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorOptics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Opening angle along the larger image side (rad).
    pub view_angle_rad: f64,
    /// Near clipping plane (m).
    pub near_m: f64,
    /// Far clipping plane (m).
    pub far_m: f64,
}

impl SensorOptics {
    /// The ideal pinhole camera that the sensor renders.
    pub(crate) fn intrinsics(&self) -> Intrinsics {
        Intrinsics::from_view_angle(self.width, self.height, self.view_angle_rad)
    }
}

impl Sim {
    /// The colour image of a vision sensor, row 0 on top, as of when it was handled last: at the end of a pass, or in
    /// [`Self::handle_vision_sensors`].
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; [`LinkError::BadValue`] when buffer and size do not fit.
    pub(crate) fn get_vision_sensor_image(&mut self, sensor: ObjectHandle) -> Result<RgbImage, LinkError> {
        let reply = self.call("sim.getVisionSensorImg", vec![sensor.to_value()])?;
        let (width, height) = reply.resolution(1)?;
        reply.checked(convert::rgb_from_bytes(reply.blob(0)?, width, height))
    }

    /// The depth image of a vision sensor in metres, row 0 on top, as of when it was handled last: at the end of a pass, or in
    /// [`Self::handle_vision_sensors`].
    ///
    /// # Errors
    /// As [`Self::get_vision_sensor_image`].
    pub(crate) fn get_vision_sensor_depth(&mut self, sensor: ObjectHandle) -> Result<DepthImage, LinkError> {
        let args = vec![sensor.to_value(), Value::from(DEPTH_IN_METRES)];
        let reply = self.call("sim.getVisionSensorDepth", args)?;
        let (width, height) = reply.resolution(1)?;
        reply.checked(convert::depth_from_bytes(reply.blob(0)?, width, height))
    }

    /// Width and height of a vision sensor's images in pixels.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_vision_sensor_resolution(&mut self, sensor: ObjectHandle) -> Result<(u32, u32), LinkError> {
        self.call("sim.getVisionSensorRes", vec![sensor.to_value()])?.resolution(0)
    }

    /// Size, opening angle and clipping planes of a vision sensor.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; [`LinkError::UnexpectedReply`] when the object is not a perspective vision sensor.
    pub(crate) fn get_sensor_optics(&mut self, sensor: ObjectHandle) -> Result<SensorOptics, LinkError> {
        let (width, height) = self.get_vision_sensor_resolution(sensor)?;
        let perspective = self.call("sim.getObjectInt32Param", parameter(sensor, VISION_PERSPECTIVE));
        // A server may not know this one parameter; only a definite no counts.
        if perspective.is_ok_and(|reply| reply.integer(0) == Ok(0)) {
            return Err(LinkError::UnexpectedReply {
                call: "sim.getObjectInt32Param".to_owned(),
                expected: "a perspective vision sensor".to_owned(),
                got: "an orthographic one".to_owned(),
            });
        }
        let mut float =
            |id| self.call("sim.getObjectFloatParam", parameter(sensor, id)).and_then(|reply| reply.number(0));
        Ok(SensorOptics {
            width,
            height,
            view_angle_rad: float(VISION_PERSPECTIVE_ANGLE)?,
            near_m: float(VISION_NEAR_CLIPPING)?,
            far_m: float(VISION_FAR_CLIPPING)?,
        })
    }

    /// Has every sensor that the simulation handles take its image now, and not only at the end of the pass: joints and
    /// objects that were moved since are in the images then.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn handle_vision_sensors(&mut self) -> Result<(), LinkError> {
        self.call("sim.handleVisionSensor", vec![Value::from(HANDLE_ALL_EXCEPT_EXPLICIT)]).map(drop)
    }
}

fn parameter(sensor: ObjectHandle, id: i64) -> Vec<Value> {
    vec![sensor.to_value(), Value::from(id)]
}
