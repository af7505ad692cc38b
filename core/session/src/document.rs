//! The contents of a session: plain data, without files and without history.

use std::collections::BTreeMap;
use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use super::capture_id::CaptureId;
use super::edit_error::EditError;
use handeye_arm::{ArmModel, JointKind, MAX_JOINTS};
use handeye_dataset::pose_record;
use handeye_dataset::taught_poses::{Goal, TaughtPose};
use handeye_dataset::{CameraInput, LONGEST_TOOL_M};
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::robot_accuracy::ROBOT_ACCURACY_MM;
use handeye_export::ExportView;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::observations::LENS_ACCURACY_PX;
use handeye_geometry::targets::TargetSpec;
use handeye_result::{CalibrationResult, TransformEstimate};
use handeye_wording::Text;
use handeye_wording::text;

/// The state of a session. It changes by [`super::Edit`] alone, see [`Document::apply`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// What was known when it began, with later changes.
    #[serde(flatten)]
    pub meta: SessionMeta,
    /// The captures in the order in which they were taken; a deleted one is not among them.
    pub captures: Vec<CaptureRecord>,
    /// The taught poses of all cells in the order in which they are visited. No two of a cell have the same name.
    #[serde(default)]
    pub taught: Vec<TaughtPose>,
    /// The names that exports use for frames and cameras, as the exporter understands them.
    #[serde(default)]
    pub export_names: Option<serde_json::Value>,
}

/// What is known when a session begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionMeta {
    /// When it began, as text; RFC 3339 by custom. Passed in, since nothing here reads a clock.
    pub created: String,
    /// Version of the program.
    pub tool_version: String,
    /// Where the camera is mounted.
    pub mode: Mode,
    /// The target.
    pub target: TargetSpec,
    /// Prior knowledge of the camera.
    pub camera: Option<CameraInput>,
    /// Seeds by what they are for, so that a simulated session can be made again.
    pub seeds: BTreeMap<String, u64>,
    /// The truth that a simulated cell publishes; for reports, never for a solver.
    pub ground_truth: Option<GroundTruth>,
    /// The arm, where it is known: what the joint angles of the captures belong to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmModel>,
    /// Position of the tool's tip in the frame of the tip, metres; without it a usual one is assumed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_m: Option<[f64; 3]>,
    /// Accuracy of the robot, millimetres, see [`RobotAccuracy`](handeye_estimate::robot_accuracy::RobotAccuracy).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot_accuracy_mm: Option<f64>,
    /// Kinds of the joints of an unknown arm, from the base up. Without it six revolute joints are assumed, as in
    /// sessions that were written before there were others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_kinds: Option<Vec<JointKind>>,
}

/// Ground truth of a simulated cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroundTruth {
    /// The camera on its mount.
    pub hand_eye: TransformEstimate,
    /// The target on its anchor.
    pub target: TransformEstimate,
    /// The camera.
    pub intrinsics: Option<Intrinsics>,
}

impl GroundTruth {
    /// States the truth.
    pub fn new(links: &HandEye, intrinsics: Option<Intrinsics>) -> Self {
        let (hand_eye, target) = TransformEstimate::of_links(links, None, None);
        Self { hand_eye, target, intrinsics }
    }

    /// Both links in typed frames; `None` when the names of the frames are not those of `mode`.
    pub fn links(&self, mode: Mode) -> Option<HandEye> {
        let mut result = CalibrationResult { mode: Some(mode), ..CalibrationResult::default() };
        result.hand_eye = Some(self.hand_eye.clone());
        result.target = Some(self.target.clone());
        result.links()
    }
}

/// Purpose of a capture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// It is part of the fit.
    #[default]
    Calibration,
    /// It is kept out of the fit, to check the result.
    Verification,
}

/// One capture as it is recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaptureRecord {
    /// Id of the capture.
    // Sessions of version 1.0 have none; their reader fills it in, see `session_file`.
    #[serde(default = "CaptureId::none")]
    pub id: CaptureId,
    /// The image, relative to the session: also the name of the view.
    pub image: String,
    /// The depth image, relative to the session.
    pub depth: Option<String>,
    /// Tip pose as the controller reported it; `None` where there is no robot. Either all captures of a session have one, or
    /// none.
    #[serde(default, with = "pose_record::optional", skip_serializing_if = "Option::is_none")]
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// Joint angles as the controller reported them, radians.
    pub joints_rad: Option<Vec<f64>>,
    /// Simulation time of the image, seconds.
    pub sim_time_s: Option<f64>,
    /// Whether it is for the calibration or for verification.
    #[serde(default)]
    pub role: Role,
    /// Whether the user excluded it.
    #[serde(default)]
    pub excluded: bool,
    /// Number of frames that the image is the mean of.
    #[serde(default = "one")]
    pub frames: u32,
    /// Noise of a corner of this image along one axis, pixels (one sigma), where it was measured.
    #[serde(default)]
    pub corner_noise_px: Option<f64>,
    /// How long the arm had been at rest when the image was taken, seconds.
    #[serde(default)]
    pub settled_s: Option<f64>,
    /// The taught pose at which it was taken.
    #[serde(default)]
    pub pose_name: Option<String>,
}

fn one() -> u32 {
    1
}

impl CaptureRecord {
    /// A capture with only its image and, where there is a robot, where the tip was.
    pub fn new(id: CaptureId, image: String, base_from_tip: impl Into<Option<Pose<Base, Tip>>>) -> Self {
        Self {
            id,
            image,
            depth: None,
            base_from_tip: base_from_tip.into(),
            joints_rad: None,
            sim_time_s: None,
            role: Role::Calibration,
            excluded: false,
            frames: 1,
            corner_noise_px: None,
            settled_s: None,
            pose_name: None,
        }
    }
}

impl Document {
    /// A session without captures.
    pub fn new(meta: SessionMeta) -> Self {
        Self { meta, captures: Vec::new(), taught: Vec::new(), export_names: None }
    }

    /// A capture by its number.
    pub fn capture(&self, id: CaptureId) -> Option<&CaptureRecord> {
        self.captures.iter().find(|capture| capture.id == id)
    }

    /// The captures that a calibration is fitted to: neither excluded nor kept for verification.
    pub fn in_use(&self) -> impl Iterator<Item = &CaptureRecord> {
        self.captures.iter().filter(|capture| capture.is_in_use())
    }

    /// Where the camera is mounted; `None` where there is no robot, and the camera by itself is calibrated.
    pub fn mode(&self) -> Option<Mode> {
        let has_robot = self.captures.first().is_none_or(|capture| capture.base_from_tip.is_some());
        has_robot.then_some(self.meta.mode)
    }

    /// Refuses a capture with a pose of the robot among others without one, and the reverse.
    pub(super) fn check_robot(&self, capture: &CaptureRecord) -> Result<(), EditError> {
        let refuse = |what: Text| Err(EditError::bad(capture.named(), what));
        match (self.mode(), capture.base_from_tip) {
            _ if self.captures.is_empty() => Ok(()),
            (Some(_), None) => refuse(text!("has no pose of the robot, and the others have one: begin a new session")),
            (None, Some(_)) => refuse(text!("has a pose of the robot, and the others have none: begin a new session")),
            (Some(_), Some(_)) | (None, None) => Ok(()),
        }
    }

    /// Checks everything that the types do not ensure.
    ///
    /// # Errors
    /// [`EditError`] names the first value that a session must not have.
    pub(super) fn check(&self) -> Result<(), EditError> {
        self.meta.check()?;
        for (i, capture) in self.captures.iter().enumerate() {
            capture.check()?;
            if self.captures[..i].iter().any(|other| other.id == capture.id) {
                return Err(EditError::UsedNumber(capture.id));
            }
            if self.captures[..i].iter().any(|other| other.image == capture.image) {
                let at = text!("the image {image}", image = format!("{:?}", capture.image));
                return Err(EditError::bad(at, text!("is there twice")));
            }
            self.check_robot(capture)?;
        }
        check_taught(&self.taught)
    }
}

impl SessionMeta {
    /// Checks what the types do not ensure.
    pub(super) fn check(&self) -> Result<(), EditError> {
        self.target.check().map_err(|why| bad("target", text!("cannot be: {why}", why = why)))?;
        if let Some(Err(why)) = self.arm.as_ref().map(ArmModel::arm) {
            return Err(bad("arm", text!("is of no use: {why}", why = why)));
        }
        if self.tool_m.iter().flatten().any(|metres| !(-LONGEST_TOOL_M..=LONGEST_TOOL_M).contains(metres)) {
            return Err(bad("tool_m", text!("is not finite, or longer than {most} m", most = LONGEST_TOOL_M)));
        }
        if self.robot_accuracy_mm.is_some_and(|mm| !ROBOT_ACCURACY_MM.contains(&mm)) {
            return Err(bad("robot_accuracy_mm", text!("is not between 0.001 and 100 mm")));
        }
        if self.joint_kinds.as_ref().is_some_and(|kinds| kinds.is_empty() || kinds.len() > MAX_JOINTS) {
            return Err(bad("joint_kinds", text!("has no joints, or more than an arm has")));
        }
        let Some(camera) = &self.camera else { return Ok(()) };
        if camera.fixed && camera.intrinsics.is_none() {
            return Err(bad("camera", text!("is fixed and has no intrinsics")));
        }
        if camera.accuracy_px.is_some_and(|px| !camera.fixed || !LENS_ACCURACY_PX.contains(&px)) {
            return Err(bad(
                "camera.accuracy_px",
                text!("is of intrinsics that are estimated, or not between 0.001 and 1000 px"),
            ));
        }
        match camera.intrinsics.map(|k| k.validate()) {
            Some(Err(why)) => Err(bad("camera.intrinsics", why.into())),
            _ => Ok(()),
        }
    }
}

impl CaptureRecord {
    /// The capture as an image with its robot pose, for an export; `None` where there is no robot.
    pub fn export_view(&self) -> Option<ExportView> {
        Some(ExportView { name: self.image.clone(), base_from_tip: self.base_from_tip? })
    }

    /// Whether it is used in the fit of a calibration.
    pub fn is_in_use(&self) -> bool {
        !self.excluded && self.role == Role::Calibration
    }

    /// Its files, relative to the session.
    pub(crate) fn files(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.image.as_str()).chain(self.depth.as_deref())
    }

    /// It in a sentence.
    pub(super) fn named(&self) -> Text {
        text!("capture {id} ({image})", id = self.id, image = &self.image)
    }

    pub(super) fn check(&self) -> Result<(), EditError> {
        let refuse = |what: Text| Err(EditError::bad(self.named(), what));
        if self.id == CaptureId::none() {
            return refuse(text!("has no number: numbers begin at 1"));
        }
        if !self.files().all(stays_inside) {
            return refuse(text!("names a file that is not inside of the session"));
        }
        if !self.base_from_tip.is_none_or(|pose| pose.is_finite()) {
            return refuse(text!("has a tip pose that is not finite"));
        }
        let measured = [self.corner_noise_px, self.settled_s];
        if !measured.iter().flatten().all(|v| v.is_finite() && *v >= 0.0) {
            return refuse(text!("has a corner_noise_px or settled_s that is negative or not finite"));
        }
        if !self.joints_rad.iter().flatten().chain(&self.sim_time_s).all(|v| v.is_finite()) {
            return refuse(text!("has a joint angle or a time that is not finite"));
        }
        if self.frames == 0 {
            return refuse(text!("is the mean of no frames"));
        }
        Ok(())
    }
}

/// Requirements of a file of taught poses, so that the poses of every cell can be written to one.
pub(super) fn check_taught(poses: &[TaughtPose]) -> Result<(), EditError> {
    for (i, pose) in poses.iter().enumerate() {
        let before = || poses[..i].iter().filter(|other| other.is_of(pose.cell.as_ref()));
        let refuse = |what: Text| {
            let at = text!("taught pose {name}", name = format!("{:?}", pose.name));
            Err(EditError::bad(at, what))
        };
        if pose.name.trim().is_empty() {
            return refuse(text!("has an empty name"));
        }
        if before().any(|other| other.name == pose.name) {
            return Err(EditError::SamePoseName(pose.name.clone()));
        }
        match &pose.goal {
            Goal::Tip(base_from_tip) if !base_from_tip.is_finite() => return refuse(text!("is not finite")),
            Goal::Joints(joints) if !joints.iter().all(|v| v.is_finite()) => return refuse(text!("is not finite")),
            Goal::Joints(joints) if joints.is_empty() || before().any(|other| other.joints_differ(joints.len())) => {
                return refuse(text!("has another number of joint angles than the poses before, or none"));
            }
            Goal::Tip(_) | Goal::Joints(_) => {}
        }
    }
    Ok(())
}

/// Files of a session are written and copied by the names in its document, which others may have written.
fn stays_inside(name: &str) -> bool {
    !name.is_empty() && Path::new(name).components().all(|c| matches!(c, Component::Normal(_)))
}

/// A field of the document, which has one name in every language.
fn bad(at: &str, what: Text) -> EditError {
    EditError::bad(Text::verbatim(at), what)
}
