//! `dataset.toml`: what the folder holds and in which conventions.

use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::error::{DatasetError, DatasetProblem};
use super::joints::{JointColumns, RawArm, joint_columns};
use super::target_table::{RawTarget, TargetPoseDirection};
use super::text::line_of;
use super::value::{AngleUnit, Spanning, bad};
use handeye_estimate::handeye::Mode;
use handeye_estimate::robot_accuracy::ROBOT_ACCURACY_MM;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::observations::LENS_ACCURACY_PX;
use handeye_geometry::targets::TargetSpec;
use handeye_wording::one_line;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawConfig {
    mode: Option<Mode>,
    images: Option<Vec<String>>,
    target: RawTarget,
    robot: Option<Spanned<RawRobot>>,
    camera: Option<Spanned<RawCamera>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    poses: String,
    length_unit: LengthUnit,
    rotation: RawRotation,
    /// Needed for the conventions with angles; elsewhere it is allowed and ignored.
    angle_unit: Option<AngleUnit>,
    pose: PoseDirection,
    joints: Option<Spanned<i64>>,
    joint_unit: Option<AngleUnit>,
    arm: Option<Spanned<RawArm>>,
    tool_m: Option<Spanned<Vec<f64>>>,
    accuracy_mm: Option<Spanned<f64>>,
}

/// A longer tool is in millimetres.
pub const LONGEST_TOOL_M: f64 = 10.0;

/// The table `[robot]`.
#[derive(Debug, Clone)]
pub(super) struct RobotConfig {
    pub poses: String,
    pub length_unit: LengthUnit,
    pub rotation: RotationConvention,
    pub pose: PoseDirection,
    /// Columns of joint angles after those of the rotation, if there are any.
    pub joints: Option<JointColumns>,
    /// Position of the tool's tip in the frame of the tip, metres.
    pub tool_m: Option<[f64; 3]>,
    /// Accuracy of the robot, millimetres.
    pub accuracy_mm: Option<f64>,
}

/// Rotation convention of a pose table's rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RotationConvention {
    QuaternionXyzw,
    QuaternionWxyz,
    RotationVector(AngleUnit),
    /// Roll, pitch and yaw about the fixed axes, R = Rz·Ry·Rx.
    Rpy(AngleUnit),
    Matrix,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum LengthUnit {
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "mm")]
    Millimetre,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawRotation {
    QuaternionXyzw,
    QuaternionWxyz,
    RotationVector,
    Rpy,
    Matrix,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PoseDirection {
    BaseFromTip,
    TipFromBase,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    fixed: bool,
    accuracy_px: Option<Spanned<f64>>,
    width: Option<Spanned<i64>>,
    height: Option<Spanned<i64>>,
    fx: Option<Spanned<f64>>,
    fy: Option<Spanned<f64>>,
    cx: Option<Spanned<f64>>,
    cy: Option<Spanned<f64>>,
    model: Option<ModelName>,
    distortion: Option<Spanned<Vec<f64>>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ModelName {
    None,
    BrownConrady,
    Rational,
    Fisheye,
}

impl ModelName {
    fn zero(self) -> Distortion {
        match self {
            Self::None => Distortion::None,
            Self::BrownConrady => Distortion::BrownConrady([0.0; 5]),
            Self::Rational => Distortion::Rational([0.0; 8]),
            Self::Fisheye => Distortion::Fisheye([0.0; 4]),
        }
    }
}

/// Contents of `dataset.toml`, checked.
#[derive(Debug, Clone)]
pub(super) struct Config {
    pub mode: Option<Mode>,
    /// Without a robot, the images to use; `None`: all of the folder.
    pub images: Option<Vec<String>>,
    pub target: TargetSpec,
    pub corners: Option<String>,
    pub target_poses: Option<String>,
    pub target_pose: TargetPoseDirection,
    pub robot: Option<RobotConfig>,
    pub camera: Option<CameraConfig>,
}

/// The table `[camera]`, before the size of the images is known.
#[derive(Debug, Clone)]
pub(super) struct CameraConfig {
    pub fixed: bool,
    pub accuracy_px: Option<f64>,
    pub size: Option<(u32, u32)>,
    /// Model, with the coefficients where they are given.
    pub distortion: Distortion,
    /// fx fy cx cy.
    pub pinhole: Option<[f64; 4]>,
    pub row: usize,
}

impl CameraConfig {
    pub fn intrinsics(&self, (width, height): (u32, u32)) -> Option<Intrinsics> {
        let [fx, fy, cx, cy] = self.pinhole?;
        Some(Intrinsics { width, height, fx, fy, cx, cy, distortion: self.distortion })
    }
}

impl Config {
    pub fn parse(file: &Path, text: &str) -> Result<Self, DatasetError> {
        let at = |span: std::ops::Range<usize>, problem| {
            DatasetError::new(file, Some(line_of(text.as_bytes(), span.start)), problem)
        };
        let toml_error = |e: &toml::de::Error| {
            let row = e.span().map(|span| line_of(text.as_bytes(), span.start));
            DatasetError::new(file, row, DatasetProblem::Toml(one_line(&e.message())))
        };
        if text.trim().is_empty() {
            let why = "describe the target, the robot and the camera";
            return Err(DatasetError::new(file, None, DatasetProblem::Empty(why)));
        }
        let raw: RawConfig = toml::from_str(text).map_err(|e| toml_error(&e))?;
        let target = raw.target.spec().map_err(|(span, problem)| at(span, problem))?;
        let camera = raw
            .camera
            .as_ref()
            .map(|c| camera_config(c, line_of(text.as_bytes(), c.span().start)))
            .transpose()
            .map_err(|(span, problem)| at(span, problem))?;
        let whole_file = |problem| DatasetError::new(file, None, problem);
        let robot = raw.robot.as_ref().map(robot_config).transpose().map_err(|(span, problem)| at(span, problem))?;
        if raw.target.pose.is_some() && raw.target.poses.is_none() {
            return Err(whole_file(DatasetProblem::Conflict(
                "[target] has pose, which says what its table of poses states, but no poses: name the table, or remove pose",
            )));
        }
        let config = Self {
            mode: raw.mode,
            images: raw.images,
            target,
            corners: raw.target.corners,
            target_poses: raw.target.poses,
            target_pose: raw.target.pose.unwrap_or_default(),
            robot,
            camera,
        };
        config.check_together().map_err(whole_file)?;
        Ok(config)
    }

    fn check_together(&self) -> Result<(), DatasetProblem> {
        if self.corners.is_some() && self.target_poses.is_some() {
            return Err(DatasetProblem::Conflict(
                "[target] has both corners and poses: keep corners, from which the poses follow",
            ));
        }
        if self.robot.is_some() && self.mode.is_none() {
            return Err(DatasetProblem::Conflict(
                "mode is missing: write mode = \"eye_in_hand\" or \"eye_to_hand\" above [target]",
            ));
        }
        if self.robot.is_some() && self.images.is_some() {
            return Err(DatasetProblem::Conflict(
                "images names those of a camera without a robot: with [robot] its pose table names them",
            ));
        }
        if self.corners.is_some() && self.images.is_some() {
            return Err(DatasetProblem::Conflict("the table of corners names the images: remove images or corners"));
        }
        if self.robot.is_none() && self.target_poses.is_some() {
            return Err(DatasetProblem::Conflict("[target] poses need the robot's: add [robot]"));
        }
        Ok(())
    }
}

fn robot_config(raw: &Spanned<RawRobot>) -> Result<RobotConfig, Spanning> {
    let whole = raw.span();
    let raw = raw.get_ref();
    let angle_unit = || {
        let why = "rotation_vector and rpy are angles, \"rad\" or \"deg\"";
        let missing = DatasetProblem::MissingKey { table: "robot", key: "angle_unit", why };
        raw.angle_unit.ok_or_else(|| (whole.clone(), missing))
    };
    let rotation = match raw.rotation {
        RawRotation::QuaternionXyzw => RotationConvention::QuaternionXyzw,
        RawRotation::QuaternionWxyz => RotationConvention::QuaternionWxyz,
        RawRotation::RotationVector => RotationConvention::RotationVector(angle_unit()?),
        RawRotation::Rpy => RotationConvention::Rpy(angle_unit()?),
        RawRotation::Matrix => RotationConvention::Matrix,
    };
    let joints = joint_columns(raw.joints.as_ref(), raw.joint_unit, raw.arm.as_ref(), whole.clone())?;
    let tool_m = raw.tool_m.as_ref().map(tool).transpose()?;
    let accuracy_mm = raw.accuracy_mm.as_ref().map(robot_accuracy).transpose()?;
    let (poses, length_unit, pose) = (raw.poses.clone(), raw.length_unit, raw.pose);
    Ok(RobotConfig { poses, length_unit, rotation, pose, joints, tool_m, accuracy_mm })
}

fn tool(raw: &Spanned<Vec<f64>>) -> Result<[f64; 3], Spanning> {
    let place = <[f64; 3]>::try_from(raw.get_ref().as_slice()).ok();
    let place = place.filter(|place| place.iter().all(|metres| metres.abs() <= LONGEST_TOOL_M));
    place.ok_or_else(|| {
        let (value, want) = (format!("{:?}", raw.get_ref()), "three numbers x, y, z in metres, none beyond 10 m");
        (raw.span(), DatasetProblem::BadValue { key: "tool_m", value, want })
    })
}

fn robot_accuracy(raw: &Spanned<f64>) -> Result<f64, Spanning> {
    let want = "a number of millimetres between 0.001 and 100, the root mean square of what the robot is off";
    if ROBOT_ACCURACY_MM.contains(raw.get_ref()) { Ok(*raw.get_ref()) } else { Err(bad(raw, "accuracy_mm", want)) }
}

fn camera_config(raw: &Spanned<RawCamera>, row: usize) -> Result<CameraConfig, Spanning> {
    let camera = raw.get_ref();
    let missing = |key, why| (raw.span(), DatasetProblem::MissingKey { table: "camera", key, why });
    let size = match (&camera.width, &camera.height) {
        (Some(width), Some(height)) => Some((pixels("width", width)?, pixels("height", height)?)),
        (None, None) => None,
        (None, Some(_)) => return Err(missing("width", "height is given")),
        (Some(_), None) => return Err(missing("height", "width is given")),
    };
    let pinhole = match [&camera.fx, &camera.fy, &camera.cx, &camera.cy] {
        [None, None, None, None] if camera.fixed => {
            return Err(missing("fx", "fixed = true says that fx fy cx cy are known; fixed = false estimates them"));
        }
        [None, None, None, None] => None,
        given => Some(pinhole(given).map_err(|problem| match problem {
            PinholeProblem::Missing(key) => missing(key, "fx fy cx cy come together"),
            PinholeProblem::Bad(spanning) => spanning,
        })?),
    };
    if camera.fixed && camera.model.is_none() {
        return Err(missing("model", "fixed = true: \"none\", \"brown_conrady\", \"rational\" or \"fisheye\""));
    }
    let accuracy_px = camera.accuracy_px.as_ref().map(|value| accuracy(value, camera.fixed)).transpose()?;
    let model = match (camera.model, &camera.distortion) {
        (Some(model), _) => model,
        (None, None) => ModelName::BrownConrady,
        (None, Some(_)) => return Err(missing("model", "distortion is given, and its meaning depends on the model")),
    };
    let distortion = distortion(model, camera)?;
    if pinhole.is_none() && camera.distortion.is_some() && !distortion.coefficients().is_empty() {
        return Err(missing("fx", "distortion is given, and is worth nothing without fx fy cx cy"));
    }
    Ok(CameraConfig { fixed: camera.fixed, accuracy_px, size, distortion, pinhole, row })
}

fn accuracy(value: &Spanned<f64>, is_fixed: bool) -> Result<f64, Spanning> {
    let px = *value.get_ref();
    if !is_fixed {
        return Err(bad(value, "accuracy_px", "fixed = true beside it: what is estimated has an accuracy of its own"));
    }
    let want = "a number of pixels between 0.001 and 1000; an exact lens has none";
    if LENS_ACCURACY_PX.contains(&px) { Ok(px) } else { Err(bad(value, "accuracy_px", want)) }
}

enum PinholeProblem {
    Missing(&'static str),
    Bad(Spanning),
}

fn pinhole(given: [&Option<Spanned<f64>>; 4]) -> Result<[f64; 4], PinholeProblem> {
    let mut values = [0.0; 4];
    let keys = ["fx", "fy", "cx", "cy"];
    for ((value, key), slot) in given.into_iter().zip(keys).zip(&mut values) {
        let value = value.as_ref().ok_or(PinholeProblem::Missing(key))?;
        *slot = *value.get_ref();
        let is_focal = key.starts_with('f');
        if !slot.is_finite() || (is_focal && *slot <= 0.0) {
            let want = if is_focal { "a positive number of pixels" } else { "a finite number of pixels" };
            return Err(PinholeProblem::Bad(bad(value, key, want)));
        }
    }
    Ok(values)
}

fn distortion(model: ModelName, camera: &RawCamera) -> Result<Distortion, Spanning> {
    let zero = model.zero();
    let Some(given) = &camera.distortion else {
        let need = zero.coefficients().len();
        if camera.fixed && need > 0 {
            let key = "distortion";
            let why = "fixed = true says that it is known; a lens without any has model = \"none\"";
            let span = camera.fx.as_ref().map_or(0..0, Spanned::span);
            return Err((span, DatasetProblem::MissingKey { table: "camera", key, why }));
        }
        return Ok(zero);
    };
    let values = given.get_ref();
    if values.len() != zero.coefficients().len() {
        let problem =
            DatasetProblem::DistortionCount { model: zero.name(), got: values.len(), need: zero.coefficients().len() };
        return Err((given.span(), problem));
    }
    if let Some(value) = values.iter().find(|v| !v.is_finite()) {
        let problem = DatasetProblem::BadValue { key: "distortion", value: value.to_string(), want: "finite numbers" };
        return Err((given.span(), problem));
    }
    Ok(zero.with_coefficients(values))
}

fn pixels(key: &'static str, value: &Spanned<i64>) -> Result<u32, Spanning> {
    match u32::try_from(*value.get_ref()) {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(bad(value, key, "a positive number of pixels")),
    }
}
