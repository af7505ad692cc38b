//! A calibration as the document that others read.

use std::collections::BTreeMap;

use super::{Calibration, ViewStatus};
use crate::result::{self, CalibrationResult, IntrinsicsEstimate, Provenance, Quality};

impl Calibration {
    /// The result document. `options` are what the answer depends on besides the input.
    pub fn to_result(
        &self,
        tool_version: &str,
        input_sha256: Option<String>,
        options: BTreeMap<String, serde_json::Value>,
    ) -> CalibrationResult {
        let mut result = CalibrationResult {
            intrinsics: self
                .intrinsics
                .as_ref()
                .map(|i| IntrinsicsEstimate::new(i, self.intrinsics_sigma, self.intrinsics_fixed)),
            quality: Quality {
                rms_px: self.rms_px,
                sigma_px: self.noise.map(|n| n.corner_px),
                heldout_rms_px: self.heldout_rms_px,
                tip_error_95_mm: self.tip_error_95_m.map(|m| m * 1e3),
                robot_sigma_mm: self.noise.map(|n| n.robot_m * 1e3),
                robot_sigma_deg: self.noise.map(|n| n.robot_rad.to_degrees()),
            },
            methods: self.methods.iter().map(method).collect(),
            views: self.views.iter().map(view).collect(),
            provenance: Provenance {
                tool_version: tool_version.to_owned(),
                input_sha256,
                options: options.into_iter().collect(),
            },
            ..CalibrationResult::default()
        };
        if let Some(links) = &self.hand_eye {
            result.set_links(links, self.hand_eye_covariance.as_ref(), self.target_covariance.as_ref());
        }
        result
    }
}

fn method(method: &super::MethodResult) -> result::MethodResult {
    match &method.outcome {
        Ok(solution) => result::MethodResult::solved(method.name, &solution.mount_from_camera),
        Err(error) => result::MethodResult::failed(method.name, error),
    }
}

fn view(view: &super::ViewResult) -> result::ViewResult {
    result::ViewResult {
        name: view.name.clone(),
        status: match view.status {
            ViewStatus::Used => result::ViewStatus::Used,
            ViewStatus::Excluded => result::ViewStatus::Excluded,
            ViewStatus::NoTarget => result::ViewStatus::NoTarget,
        },
        rms_px: view.rms_px,
        influence_mm: view.influence_m.map(|m| m * 1e3),
    }
}
