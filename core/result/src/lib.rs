//! The result of a calibration as a document: what `calibrate` and `auto` write and the exporters read.
//!
//! The layout is `assets/schema/handeye-calibration-1.schema.json`. A number that is not known is `null`, never 0.
//! Lengths are metres, angles radians and quaternions x, y, z, w unless a key states otherwise; covariances are those
//! of `[tx ty tz rx ry rz]` in `T * exp(delta)`.
//!
//! ```
//! use handeye_result::CalibrationResult;
//!
//! let text = handeye_result::testing::golden().to_json()?;
//! let result = CalibrationResult::from_json(&text)?;
//! assert_eq!(result.quality.rms_px, Some(0.31));
//! # Ok::<(), handeye_result::ResultProblem>(())
//! ```
//!
//! Never depends on images or data sets.

#![warn(missing_docs)]

mod arm;
mod check;
mod estimate;
mod file;
pub mod guided_record;
mod of_calibration;
#[cfg(feature = "testing")]
pub mod testing;

use std::fmt;

use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};

use crate::guided_record::GuidedRecord;
use handeye_estimate::diagnose::record::FindingRecord;
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::verify::DepthReport;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Camera, Frame, Mount, Pose};

pub use arm::{ArmEstimate, ArmLevels, HeldOutByArm, JointErrorEstimate, Unexplained};
pub use check::BadResult;
pub use estimate::{
    BoardEstimate, DepthsEstimate, EstimateDetails, Findings, OverdispersionRecord, PoseDependentErrorEstimate,
    PrintEstimate, ResidualDistortionEstimate, TargetSizeEstimate,
};
pub use file::{ResultError, ResultProblem};
pub use of_calibration::{TARGET_OPTION, solve_options};

/// Value of `format`.
pub const FORMAT: &str = "handeye-calibration";
/// Value of `version`: the layout that is written and read here.
pub const VERSION: u32 = 1;

/// The document.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibrationResult {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// Where the camera is mounted; `None` when only intrinsics were estimated.
    pub mode: Option<Mode>,
    /// The camera on its mount: tip to camera in eye-in-hand, base to camera in eye-to-hand.
    pub hand_eye: Option<TransformEstimate>,
    /// The target: base to target in eye-in-hand, tip to target in eye-to-hand.
    pub target: Option<TransformEstimate>,
    /// The camera; `None` when the input was pose pairs.
    pub intrinsics: Option<IntrinsicsEstimate>,
    /// How good it is.
    pub quality: Quality,
    /// Results of the closed-form solvers, for comparison.
    pub methods: Vec<MethodRecord>,
    /// Status of every view.
    pub views: Vec<ViewRecord>,
    /// Details of an estimate; `None` for a closed form, and for a camera that was given.
    #[serde(default)]
    pub estimate: Option<EstimateDetails>,
    /// The errors of the robot's arm and the transforms for corrected poses; `None` where its joints are not known.
    #[serde(default)]
    pub arm: Option<ArmEstimate>,
    /// What is weak or wrong, the most severe first.
    #[serde(default)]
    pub findings: Findings,
    /// Errors on captures that never entered the fit; `None` when there are none.
    #[serde(default)]
    pub verification: Option<VerificationSummary>,
    /// Errors of the depth camera by the depths of the captures; `None` where the captures have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthSummary>,
    /// How guided capture chose its poses, where it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guided: Option<GuidedRecord>,
    /// Comparison with the truth, where a simulated cell publishes it.
    pub truth: Option<TruthComparison>,
    /// How this result was made.
    pub provenance: Provenance,
}

/// The pose of `child_frame` in `parent_frame`: `p_parent = T * p_child`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TransformEstimate {
    /// The frame it is given in.
    pub parent_frame: String,
    /// The frame whose pose it is.
    pub child_frame: String,
    /// Origin of the child in the parent, metres.
    pub translation_m: [f64; 3],
    /// Unit quaternion x, y, z, w with w ≥ 0.
    pub rotation_xyzw: [f64; 4],
    /// Covariance of `[tx ty tz rx ry rz]` in `T * exp(delta)`, metres and radians.
    pub covariance: Option<[[f64; 6]; 6]>,
}

impl TransformEstimate {
    /// States a pose, and its covariance where it is known.
    pub(crate) fn new<Parent: Frame, Child: Frame>(
        parent_from_child: &Pose<Parent, Child>,
        covariance: Option<&Matrix6<f64>>,
    ) -> Self {
        Self {
            parent_frame: Parent::NAME.to_owned(),
            child_frame: Child::NAME.to_owned(),
            translation_m: parent_from_child.translation().into(),
            // Adding zero turns −0, which a sign flip leaves behind, into 0.
            rotation_xyzw: parent_from_child.xyzw().map(|v| v + 0.0),
            covariance: covariance.map(|c| std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]))),
        }
    }

    /// Both links of a calibration: the hand-eye and the target.
    pub fn of_links(
        links: &HandEye,
        hand_eye_covariance: Option<&Matrix6<f64>>,
        target_covariance: Option<&Matrix6<f64>>,
    ) -> (Self, Self) {
        match links {
            HandEye::EyeInHand { tip_from_camera, base_from_target } => {
                (Self::new(tip_from_camera, hand_eye_covariance), Self::new(base_from_target, target_covariance))
            }
            HandEye::EyeToHand { base_from_camera, tip_from_target } => {
                (Self::new(base_from_camera, hand_eye_covariance), Self::new(tip_from_target, target_covariance))
            }
        }
    }

    /// The pose in the frames that the caller states; `None` when the names differ from these.
    pub fn pose<Parent: Frame, Child: Frame>(&self) -> Option<Pose<Parent, Child>> {
        let fits = self.parent_frame == Parent::NAME && self.child_frame == Child::NAME;
        fits.then(|| Pose::from_translation_xyzw(self.translation_m, self.rotation_xyzw))
    }

    /// [`TransformEstimate::covariance`] as a matrix.
    pub fn covariance_matrix(&self) -> Option<Matrix6<f64>> {
        self.covariance.map(|rows| Matrix6::from_fn(|i, j| rows[i][j]))
    }
}

/// The camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntrinsicsEstimate {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Principal point, column in pixels.
    pub cx: f64,
    /// Principal point, row in pixels.
    pub cy: f64,
    /// `none`, `brown_conrady`, `rational` or `fisheye`.
    pub model: String,
    /// Coefficients in OpenCV's order.
    pub distortion: Vec<f64>,
    /// Standard deviations; all `None` when the intrinsics were given. Without a robot 1.96 of them hold the error in 95 %
    /// of cases, whatever the corners of a view have in common.
    pub sigma: IntrinsicsSigma,
    /// Whether they were given and not estimated.
    pub fixed: bool,
}

/// Standard deviations of the pinhole parameters in pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct IntrinsicsSigma {
    /// Standard deviation of `fx`.
    pub fx: Option<f64>,
    /// Standard deviation of `fy`.
    pub fy: Option<f64>,
    /// Standard deviation of `cx`.
    pub cx: Option<f64>,
    /// Standard deviation of `cy`.
    pub cy: Option<f64>,
}

impl IntrinsicsEstimate {
    /// States intrinsics, with the standard deviations of fx, fy, cx, cy where they are known.
    pub fn new(intrinsics: &Intrinsics, sigma_px: Option<[f64; 4]>, fixed: bool) -> Self {
        let [fx, fy, cx, cy] = sigma_px.map_or([None; 4], |s| s.map(Some));
        Self {
            width: intrinsics.width,
            height: intrinsics.height,
            fx: intrinsics.fx,
            fy: intrinsics.fy,
            cx: intrinsics.cx,
            cy: intrinsics.cy,
            model: intrinsics.distortion.name().to_owned(),
            distortion: intrinsics.distortion.coefficients().to_vec(),
            sigma: IntrinsicsSigma { fx, fy, cx, cy },
            fixed,
        }
    }

    /// The camera model; `None` when the name of the model or the number of its coefficients is wrong.
    pub fn intrinsics(&self) -> Option<Intrinsics> {
        let zero = Distortion::from_name(&self.model)?;
        (zero.coefficients().len() == self.distortion.len()).then(|| Intrinsics {
            width: self.width,
            height: self.height,
            fx: self.fx,
            fy: self.fy,
            cx: self.cx,
            cy: self.cy,
            distortion: zero.with_coefficients(&self.distortion),
        })
    }
}

/// How good a calibration is. A residual shows how well the model fits, not how accurate it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Root mean square reprojection error over the corners used, pixels.
    pub rms_px: Option<f64>,
    /// Estimated noise of a corner coordinate, pixels.
    pub sigma_px: Option<f64>,
    /// Reprojection error of views that were left out of the fit, pixels.
    pub heldout_rms_px: Option<f64>,
    /// Expected error where the tool works: 95 % of the errors are below, millimetres.
    pub tip_error_95_mm: Option<f64>,
    /// Distance between a point that the camera saw and the tip of a tool that is sent there by the controller as it is: 95 % are
    /// below, millimetres; `None` where neither the errors of the arm are known nor the accuracy of the robot, where the arm does
    /// not get there, and where no error may be stated.
    #[serde(default)]
    pub reach_error_95_mm: Option<f64>,
    /// The same by corrected poses and commands; `None`, too, where the controller uses another chain.
    #[serde(default)]
    pub reach_error_corrected_95_mm: Option<f64>,
    /// Stated accuracy of the robot, where the reach error follows from that and not from the errors of its arm, millimetres.
    #[serde(default)]
    pub robot_accuracy_mm: Option<f64>,
    /// The tip of the tool that the reach error is of then, in the frame of the tip, metres; that of the errors of an arm is with
    /// these.
    #[serde(default)]
    pub robot_tool_m: Option<[f64; 3]>,
    /// Estimated noise of the robot's positions, millimetres per axis.
    pub robot_sigma_mm: Option<f64>,
    /// Estimated noise of the robot's rotations, degrees per axis.
    pub robot_sigma_deg: Option<f64>,
}

impl Quality {
    /// Whether corrected commands are expected to bring a tool nearer than the controller as it is.
    pub fn correcting_helps(&self) -> bool {
        let reach = self.reach_error_95_mm.zip(self.reach_error_corrected_95_mm);
        reach.is_some_and(|(as_it_is, corrected)| corrected < as_it_is)
    }
}

/// Result of one closed-form solver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodRecord {
    /// Name of the method, `snake_case`.
    pub name: String,
    /// Origin of the camera on its mount, metres; `None` when the method failed.
    pub translation_m: Option<[f64; 3]>,
    /// Unit quaternion x, y, z, w; `None` when the method failed.
    pub rotation_xyzw: Option<[f64; 4]>,
    /// Its status.
    pub status: MethodStatus,
}

impl MethodRecord {
    /// A method that found an answer.
    pub(crate) fn solved(name: &str, mount_from_camera: &Pose<Mount, Camera>) -> Self {
        Self {
            name: name.to_owned(),
            translation_m: Some(mount_from_camera.translation().into()),
            rotation_xyzw: Some(mount_from_camera.xyzw()),
            status: MethodStatus::Ok,
        }
    }

    /// A method without a solution.
    pub(crate) fn failed(name: &str, error: &dyn fmt::Display) -> Self {
        let status = MethodStatus::Failed(error.to_string());
        Self { name: name.to_owned(), translation_m: None, rotation_xyzw: None, status }
    }
}

/// `ok`, or why there is no solution.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum MethodStatus {
    /// There is an answer.
    Ok,
    /// Why there is no solution.
    Failed(String),
}

impl From<String> for MethodStatus {
    fn from(text: String) -> Self {
        if text == "ok" { Self::Ok } else { Self::Failed(text) }
    }
}

impl From<MethodStatus> for String {
    fn from(status: MethodStatus) -> Self {
        match status {
            MethodStatus::Ok => "ok".to_owned(),
            MethodStatus::Failed(reason) => reason,
        }
    }
}

/// Record of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewRecord {
    /// Its name in the data set.
    pub name: String,
    /// Its status.
    pub status: ViewRecordStatus,
    /// Root mean square reprojection error of its corners, pixels.
    pub rms_px: Option<f64>,
    /// How far the hand-eye translation moves without this view, millimetres.
    pub influence_mm: Option<f64>,
    /// Its distance from the prediction of the other views, divided by the outlier limit.
    #[serde(default)]
    pub distance: Option<f64>,
    /// Corners of it that were left out as outliers, by their index.
    #[serde(default, rename = "corners_aside")]
    pub rejected_corners: Vec<usize>,
    /// Whether its target was numbered from another corner than detected.
    #[serde(default)]
    pub renumbered: bool,
}

/// Status of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewRecordStatus {
    /// It is part of the fit.
    Used,
    /// A person took it out.
    Excluded,
    /// It contradicts the others and was taken out.
    Outlier,
    /// The target was not found in it.
    NoTarget,
}

/// How well the result predicts captures that never entered the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VerificationSummary {
    /// How many there are.
    pub captures: usize,
    /// Root mean square distance of their corners from where they are predicted, pixels.
    pub rms_px: f64,
    /// Root mean square distance of the middle of the target from where it is predicted, millimetres.
    pub centre_rms_mm: f64,
    /// Root mean square angle of the target from how it is predicted, degrees.
    pub orientation_rms_deg: f64,
    /// Whether these errors are no larger than the result states; `None` where it states none.
    #[serde(default)]
    pub as_stated: Option<bool>,
    /// The same from tip poses that are corrected for the errors of the arm; `None` where these are not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corrected: Option<Box<Self>>,
}

/// A depth camera against the calibrated lens: depths of the target in the captures of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthSummary {
    /// Captures with the target in their depths.
    pub captures: usize,
    /// Part of the pixels of the target that have a depth.
    pub fill: f64,
    /// Measured over expected depth, median.
    pub ratio: f64,
    /// Errors of the depths; `None` for a single capture, and for depths of another unit or another image.
    pub errors: Option<DepthErrorsSummary>,
}

/// Errors of depths; standard deviations are of one depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthErrorsSummary {
    /// Measured minus expected depth at a distance of [`Self::at_mm`], millimetres.
    pub offset_mm: f64,
    /// Its standard deviation.
    pub offset_sigma_mm: f64,
    /// Mean distance of the target, millimetres.
    pub at_mm: f64,
    /// Relative scale error of the depth; `None` for less than six captures.
    pub scale: Option<f64>,
    /// Its standard deviation.
    pub scale_sigma: Option<f64>,
    /// Offset of the depth of a slanted surface, as the change of depth over this many pixels; `None` for less than six
    /// captures.
    pub slope_px: Option<f64>,
    /// Its standard deviation.
    pub slope_sigma_px: Option<f64>,
    /// Rotation of the target by its depths, about the camera's x and y, degrees.
    pub tilt_deg: [f64; 2],
    /// Standard deviations of both.
    pub tilt_sigma_deg: [f64; 2],
    /// Scatter of single depths about the plane of a capture, millimetres.
    pub noise_mm: f64,
    /// Scatter of the captures about offset, scale and slope, millimetres.
    pub between_mm: f64,
}

impl From<&DepthReport> for DepthSummary {
    fn from(report: &DepthReport) -> Self {
        let DepthReport { captures, fill, ratio, ref errors } = *report;
        let errors = errors.as_ref().map(|errors| DepthErrorsSummary {
            offset_mm: errors.offset_m.value * 1e3,
            offset_sigma_mm: errors.offset_m.sigma * 1e3,
            at_mm: errors.at_m * 1e3,
            scale: errors.scale.map(|scale| scale.value),
            scale_sigma: errors.scale.map(|scale| scale.sigma),
            slope_px: errors.slope_px.map(|slope| slope.value),
            slope_sigma_px: errors.slope_px.map(|slope| slope.sigma),
            tilt_deg: errors.tilt_rad.map(|tilt| tilt.value.to_degrees()),
            tilt_sigma_deg: errors.tilt_rad.map(|tilt| tilt.sigma.to_degrees()),
            noise_mm: errors.noise_m * 1e3,
            between_mm: errors.between_m * 1e3,
        });
        Self { captures, fill, ratio, errors }
    }
}

/// How far the result is from the truth of a simulated cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct TruthComparison {
    /// Distance of the hand-eye translations, millimetres.
    pub translation_error_mm: Option<f64>,
    /// Angle between the hand-eye rotations, degrees.
    pub rotation_error_deg: Option<f64>,
    /// Relative error of the focal length, percent.
    pub focal_error_percent: Option<f64>,
}

/// How a result was made, so that it can be reproduced.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub tool_version: String,
    /// `handeye_dataset::Dataset::input_sha256`.
    pub input_sha256: Option<String>,
    /// Every option that the result depends on.
    pub options: serde_json::Map<String, serde_json::Value>,
}

impl Default for CalibrationResult {
    /// Nothing is known yet.
    fn default() -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            mode: None,
            hand_eye: None,
            target: None,
            intrinsics: None,
            quality: Quality::default(),
            methods: Vec::new(),
            views: Vec::new(),
            estimate: None,
            arm: None,
            findings: Vec::new(),
            verification: None,
            depth: None,
            guided: None,
            truth: None,
            provenance: Provenance::default(),
        }
    }
}

impl CalibrationResult {
    /// The first finding because of which the answer is not to be used; `None` when there is none.
    pub fn problem(&self) -> Option<&FindingRecord> {
        self.findings.iter().find(|finding| finding.severity == "problem")
    }

    /// States the mode and both links, with their covariances where they are known.
    pub fn set_links(
        &mut self,
        links: &HandEye,
        hand_eye_covariance: Option<&Matrix6<f64>>,
        target_covariance: Option<&Matrix6<f64>>,
    ) {
        self.mode = Some(links.mode());
        let (hand_eye, target) = TransformEstimate::of_links(links, hand_eye_covariance, target_covariance);
        self.hand_eye = Some(hand_eye);
        self.target = Some(target);
    }

    /// Both links in typed frames; `None` when one is not there.
    pub fn links(&self) -> Option<HandEye> {
        let (hand_eye, target) = (self.hand_eye.as_ref()?, self.target.as_ref()?);
        Some(match self.mode? {
            Mode::EyeInHand => {
                HandEye::EyeInHand { tip_from_camera: hand_eye.pose()?, base_from_target: target.pose()? }
            }
            Mode::EyeToHand => {
                HandEye::EyeToHand { base_from_camera: hand_eye.pose()?, tip_from_target: target.pose()? }
            }
        })
    }
}

#[cfg(test)]
pub(crate) mod tests;
