//! What a simulated cell says about itself, for comparison with what a calibration found.

use handeye_core::camera::Intrinsics;
use handeye_core::frames::{Base, Camera, Pose, Target, Tip};
use serde::{Deserialize, Serialize};

use crate::client::error::LinkError;

/// Name of the string signal under which a cell publishes a [`PublishedTruth`].
pub const TRUTH_NAME: &str = "handeye.truth";

/// The truth about a simulated cell.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    /// The camera on the tip.
    pub tip_from_camera: Pose<Tip, Camera>,
    /// The target in the base; `None` when the cell does not publish where its target's origin is.
    pub base_from_target: Option<Pose<Base, Target>>,
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Whether the cell published the intrinsics itself; otherwise they follow from the sensor's settings.
    pub intrinsics_published: bool,
}

/// The document that a cell publishes, as TOML; every part may be absent.
///
/// It carries what a scene of CoppeliaSim cannot express: a lens with distortion, the origin of the target, a camera
/// that is not where its drawing is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedTruth {
    /// The camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<Intrinsics>,
    /// The camera on the tip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_from_camera: Option<Pose<Tip, Camera>>,
    /// The target in the base.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_from_target: Option<Pose<Base, Target>>,
}

impl PublishedTruth {
    /// Reads the document.
    ///
    /// # Errors
    /// [`LinkError::BadTruth`] when it is no such document or has numbers that cannot be computed with.
    pub fn parse(text: &str) -> Result<Self, LinkError> {
        let bad = |reason: String| LinkError::BadTruth { reason };
        let truth: Self = toml::from_str(text).map_err(|error| bad(error.to_string()))?;
        if let Some(intrinsics) = &truth.intrinsics {
            intrinsics.validate().map_err(|error| bad(error.to_string()))?;
        }
        let finite = truth.tip_from_camera.is_none_or(|pose| pose.is_finite())
            && truth.base_from_target.is_none_or(|pose| pose.is_finite());
        if finite { Ok(truth) } else { Err(bad("a pose is not finite".to_owned())) }
    }

    /// Writes the document.
    ///
    /// # Errors
    /// [`LinkError::BadTruth`] when a number has no TOML form.
    pub fn to_toml(&self) -> Result<String, LinkError> {
        toml::to_string(self).map_err(|error| LinkError::BadTruth { reason: error.to_string() })
    }
}
