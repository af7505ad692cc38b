//! `session.json`: everything about a session that is not an image.

use std::collections::BTreeMap;
use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use super::error::SessionProblem;
use crate::camera::Intrinsics;
use crate::dataset::CameraInput;
use crate::frames::{Base, Pose, Tip};
use crate::handeye::{HandEye, Mode};
use crate::image_file::one_line;
use crate::json_text;
use crate::result::{CalibrationResult, TransformEstimate};
use crate::target::TargetSpec;

/// What `format` says.
pub const FORMAT: &str = "handeye-session";
/// The layout: a reader refuses another one.
pub const MAJOR_VERSION: u32 = 1;
/// Additions that an older reader may ignore.
pub const MINOR_VERSION: u32 = 0;

/// How far from 1 the length of a quaternion may be.
const UNIT_TOLERANCE: f64 = 1e-6;

/// What is known when a session begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionMeta {
    /// When it began, as text; RFC 3339 by custom. Passed in, since nothing here reads a clock.
    pub created: String,
    /// Version of the program.
    pub tool_version: String,
    /// Where the camera sits.
    pub mode: Mode,
    /// What is looked at.
    pub target: TargetSpec,
    /// What is known of the camera beforehand.
    pub camera: Option<CameraInput>,
    /// Seeds by what they are for, so that a simulated session can be made again.
    pub seeds: BTreeMap<String, u64>,
    /// The truth that a simulated cell publishes; for reports, never for a solver.
    pub ground_truth: Option<GroundTruth>,
}

/// What a simulated cell knows.
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

/// One capture as it is recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaptureRecord {
    /// The image, relative to the session: also the name of the view.
    pub image: String,
    /// The depth image, relative to the session.
    pub depth: Option<String>,
    /// Tip pose as the controller reported it.
    #[serde(with = "pose_record")]
    pub base_from_tip: Pose<Base, Tip>,
    /// Joint angles as the controller reported them, radians.
    pub joints_rad: Option<Vec<f64>>,
    /// Simulation time of the image, seconds.
    pub sim_time_s: Option<f64>,
}

/// The document. Its head is written for people and other programs; the reader checks format and version and leaves
/// the conventions, which are fixed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Document {
    format: String,
    version: String,
    #[serde(skip_deserializing)]
    conventions: Conventions,
    #[serde(flatten)]
    pub meta: SessionMeta,
    pub captures: Vec<CaptureRecord>,
}

#[derive(Debug, Clone, Serialize)]
struct Conventions {
    transforms: &'static str,
    units: &'static str,
    rotations: &'static str,
    covariances: &'static str,
    camera_axes: &'static str,
    pixels: &'static str,
    depth: &'static str,
}

impl Default for Conventions {
    fn default() -> Self {
        Self {
            transforms: "dst_from_src maps coordinates in src to coordinates in dst: p_dst = T * p_src",
            units: "metres, radians, seconds, pixels",
            rotations: "unit quaternions x y z w",
            covariances: "of [tx ty tz rx ry rz] in T * exp(delta)",
            camera_axes: "x right, y down, z forward",
            pixels: "(0, 0) is the centre of the top-left pixel",
            depth: "32-bit float TIFF, metres along the optical axis",
        }
    }
}

#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: String,
    #[serde(default)]
    version: String,
}

impl Document {
    pub fn new(meta: SessionMeta) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: format!("{MAJOR_VERSION}.{MINOR_VERSION}"),
            conventions: Conventions::default(),
            meta,
            captures: Vec::new(),
        }
    }

    pub fn to_json(&self) -> Result<String, SessionProblem> {
        json_text::pretty(self).map_err(|e| SessionProblem::Json(one_line(&e)))
    }

    /// Checks format and version alone.
    pub fn check_header(text: &str) -> Result<(), SessionProblem> {
        let header: Header = serde_json::from_str(text).map_err(|e| SessionProblem::Json(one_line(&e)))?;
        if header.format != FORMAT {
            return Err(SessionProblem::Format(header.format.chars().take(40).collect()));
        }
        let major = header.version.split('.').next().and_then(|major| major.parse::<u32>().ok());
        if major != Some(MAJOR_VERSION) {
            let found = header.version.chars().take(40).collect();
            return Err(SessionProblem::Version { found, known: MAJOR_VERSION });
        }
        Ok(())
    }

    pub fn from_json(text: &str) -> Result<Self, SessionProblem> {
        Self::check_header(text)?;
        let document: Self = serde_json::from_str(text).map_err(|e| SessionProblem::Json(one_line(&e)))?;
        document.meta.check()?;
        for (i, capture) in document.captures.iter().enumerate() {
            capture.check(&format!("captures[{i}]"))?;
            if document.captures[..i].iter().any(|other| other.image == capture.image) {
                return Err(bad(format!("captures[{i}].image"), "is there twice"));
            }
        }
        Ok(document)
    }
}

impl SessionMeta {
    /// Checks what the types do not say.
    pub(super) fn check(&self) -> Result<(), SessionProblem> {
        let grid = self.target.grid();
        if grid.columns < 3 || grid.rows < 3 || !(grid.square_m.is_finite() && grid.square_m > 0.0) {
            return Err(bad("target", "needs at least 3 columns and rows and a positive square_m"));
        }
        let Some(camera) = &self.camera else { return Ok(()) };
        if camera.fixed && camera.intrinsics.is_none() {
            return Err(bad("camera", "is fixed and has no intrinsics"));
        }
        match camera.intrinsics.map(|k| k.validate()) {
            Some(Err(e)) => Err(bad("camera.intrinsics", &one_line(&e))),
            _ => Ok(()),
        }
    }
}

impl CaptureRecord {
    pub(super) fn check(&self, at: &str) -> Result<(), SessionProblem> {
        for (key, name) in [("image", Some(&self.image)), ("depth", self.depth.as_ref())] {
            if name.is_some_and(|name| !stays_inside(name)) {
                return Err(bad(format!("{at}.{key}"), "is not a path inside of the session"));
            }
        }
        if !self.base_from_tip.is_finite() {
            return Err(bad(format!("{at}.base_from_tip"), "is not finite"));
        }
        let joints = self.joints_rad.iter().flatten();
        if !joints.chain(self.sim_time_s.as_ref()).all(|v| v.is_finite()) {
            return Err(bad(format!("{at}.joints_rad or sim_time_s"), "is not finite"));
        }
        Ok(())
    }
}

/// Files of a session are removed and replaced by the names in its document, which others may have written.
fn stays_inside(name: &str) -> bool {
    !name.is_empty() && Path::new(name).components().all(|c| matches!(c, Component::Normal(_)))
}

pub(super) fn bad(at: impl Into<String>, what: &str) -> SessionProblem {
    SessionProblem::Bad { at: at.into(), what: what.to_owned() }
}

/// A pose with named keys; the quaternion is kept bit for bit when it has unit length.
mod pose_record {
    use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::UNIT_TOLERANCE;
    use crate::frames::Pose;

    #[derive(Serialize, Deserialize)]
    struct Record {
        translation_m: [f64; 3],
        rotation_xyzw: [f64; 4],
    }

    pub fn serialize<Dst, Src, S: Serializer>(pose: &Pose<Dst, Src>, serializer: S) -> Result<S::Ok, S::Error> {
        Record { translation_m: pose.translation().into(), rotation_xyzw: pose.xyzw() }.serialize(serializer)
    }

    pub fn deserialize<'de, Dst, Src, D: Deserializer<'de>>(deserializer: D) -> Result<Pose<Dst, Src>, D::Error> {
        let Record { translation_m, rotation_xyzw: [x, y, z, w] } = Record::deserialize(deserializer)?;
        let q = Quaternion::new(w, x, y, z);
        // Written so that NaN is refused as well.
        if (q.norm() - 1.0).abs() <= UNIT_TOLERANCE {
            let rotation = UnitQuaternion::new_unchecked(q);
            return Ok(Pose::from_isometry(Isometry3::from_parts(Translation3::from(translation_m), rotation)));
        }
        Err(D::Error::custom(format!("rotation_xyzw has length {} and is not a unit quaternion", q.norm())))
    }
}
