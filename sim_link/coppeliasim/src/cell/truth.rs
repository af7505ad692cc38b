//! The ground truth of a simulated cell, for comparison with the result of a calibration.

use ciborium::Value;
use handeye_arm::JointValues;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Sensor, Target, Tip};

use super::CellInfo;
use super::objects::CellObjects;
use crate::convert;
use crate::error::LinkError;
use crate::sim::Sim;
use handeye_wire::Reader;
use handeye_wire::axes::sensor_from_camera;

/// The function through which a cell publishes its truth; CoppeliaSim has no such function.
pub const TRUTH_FUNCTION: &str = "handeye.truth";

/// The function through which a cell reports the pass that its images show.
const MOMENT_FUNCTION: &str = "handeye.moment";

/// The truth about a simulated cell.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    /// Pose of the camera on the tip in the scene.
    pub tip_from_camera: Pose<Tip, Camera>,
    /// The target in the base; `None` when the cell does not publish where its target's origin is.
    pub base_from_target: Option<Pose<Base, Target>>,
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Whether the cell published the intrinsics itself; otherwise they follow from the sensor's settings.
    pub intrinsics_published: bool,
}

/// Whether the server has [`TRUTH_FUNCTION`], which only a cell of this project has.
pub(super) fn is_published(sim: &mut Sim) -> Result<bool, LinkError> {
    match sim.connection().call(TRUTH_FUNCTION, Vec::new()) {
        Ok(_) => Ok(true),
        Err(error @ LinkError::Remote { .. }) => Ok(!error.is_unknown_function()),
        Err(error) => Err(error),
    }
}

/// See [`super::CameraFeed::ground_truth`].
pub(super) fn read(sim: &mut Sim, objects: &CellObjects, info: &CellInfo) -> Result<GroundTruth, LinkError> {
    let published = match sim.connection().call(TRUTH_FUNCTION, Vec::new()) {
        Ok(reply) => PublishedTruth::parse(&reply.into_map(0)?)?,
        Err(error) if error.is_unknown_function() => PublishedTruth::default(),
        Err(error) => return Err(error),
    };
    let tip_from_sensor: Pose<Tip, Sensor> = sim.get_object_pose(objects.camera, objects.tip)?;
    let tip_from_camera: Pose<Tip, Camera> = tip_from_sensor * sensor_from_camera();
    Ok(GroundTruth {
        tip_from_camera: published.tip_from_camera.unwrap_or(tip_from_camera),
        base_from_target: published.base_from_target,
        intrinsics: published.intrinsics.unwrap_or_else(|| info.camera_intrinsics_nominal()),
        intrinsics_published: published.intrinsics.is_some(),
    })
}

/// What a cell publishes; every part may be absent.
///
/// It carries what a scene of CoppeliaSim cannot express: a lens with distortion, the origin of the target, a camera
/// that is not where its drawing is.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct PublishedTruth {
    pub intrinsics: Option<Intrinsics>,
    pub tip_from_camera: Option<Pose<Tip, Camera>>,
    pub base_from_target: Option<Pose<Base, Target>>,
}

impl PublishedTruth {
    /// Reads the map that [`TRUTH_FUNCTION`] returns: poses `[x y z qx qy qz qw]`, intrinsics by their names.
    ///
    /// # Errors
    /// [`LinkError::BadTruth`] when a part is there and cannot be computed with.
    pub fn parse(map: &Value) -> Result<Self, LinkError> {
        Ok(Self {
            intrinsics: map.get("intrinsics").map(intrinsics).transpose()?,
            tip_from_camera: map.get("tip_from_camera").map(|v| pose(v, "tip_from_camera")).transpose()?,
            base_from_target: map.get("base_from_target").map(|v| pose(v, "base_from_target")).transpose()?,
        })
    }
}

/// The pass that the images of a cell show.
#[derive(Debug, Clone, PartialEq)]
pub struct ShownMoment {
    pub sim_time_s: f64,
    pub joints: JointValues,
    pub base_from_tip: Pose<Base, Tip>,
    pub base_from_target: Option<Pose<Base, Target>>,
}

/// What the images show, from a cell that has [`MOMENT_FUNCTION`]; `None` when they show nothing at present.
///
/// # Errors
/// [`LinkError::BadTruth`] when a part cannot be computed with; otherwise as for any call.
pub(super) fn shown_moment(sim: &mut Sim, joint_count: usize) -> Result<Option<ShownMoment>, LinkError> {
    let map = sim.connection().call(MOMENT_FUNCTION, Vec::new())?.into_map(0)?;
    let Some(sim_time_s) = map.get("sim_time").and_then(Reader::number) else { return Ok(None) };
    let joints = map.get("joints").and_then(Reader::numbers).unwrap_or_default();
    let of_arm = JointValues::try_from(&joints[..]).ok().filter(|joints| joints.len() == joint_count);
    let joints = of_arm.ok_or_else(|| bad(format!("{} joints, and the arm has {joint_count}", joints.len())))?;
    let tip = map.get("tip").ok_or_else(|| bad("no tip"))?;
    Ok(Some(ShownMoment {
        sim_time_s,
        joints,
        base_from_tip: pose(tip, "tip")?,
        base_from_target: map.get("base_from_target").map(|v| pose(v, "base_from_target")).transpose()?,
    }))
}

fn bad(reason: impl Into<String>) -> LinkError {
    LinkError::BadTruth { reason: reason.into() }
}

fn pose<Dst, Src>(value: &Value, what: &str) -> Result<Pose<Dst, Src>, LinkError> {
    let numbers = value.numbers().unwrap_or_default();
    let seven = numbers.as_slice().try_into().map_err(|_other_length| bad(format!("{what}: not seven numbers")))?;
    convert::pose_from_seven(seven).map_err(|error| bad(format!("{what}: {error}")))
}

fn intrinsics(map: &Value) -> Result<Intrinsics, LinkError> {
    let number =
        |key: &str| map.get(key).and_then(Reader::number).ok_or_else(|| bad(format!("intrinsics: no number {key}")));
    let name = map.get("model").and_then(Reader::text).unwrap_or_default();
    let model = Distortion::from_name(name).ok_or_else(|| bad(format!("intrinsics: no lens model {name:?}")))?;
    let coefficients = map.get("distortion").and_then(Reader::numbers).unwrap_or_default();
    if coefficients.len() != model.coefficients().len() {
        return Err(bad(format!("intrinsics: {} distortion coefficients for the model {name:?}", coefficients.len())));
    }
    let intrinsics = Intrinsics {
        width: number("width")? as u32,
        height: number("height")? as u32,
        fx: number("fx")?,
        fy: number("fy")?,
        cx: number("cx")?,
        cy: number("cy")?,
        distortion: model.with_coefficients(&coefficients),
    };
    intrinsics.validate().map_err(|error| bad(error.to_string()))?;
    Ok(intrinsics)
}
