//! A calibration as the document that others read.

use std::collections::BTreeMap;

use super::{
    ArmEstimate, BoardEstimate, CalibrationResult, DepthsEstimate, EstimateDetails, IntrinsicsEstimate, MethodRecord,
    OverdispersionRecord, PoseDependentErrorEstimate, PrintEstimate, Provenance, Quality, ResidualDistortionEstimate,
    TargetSizeEstimate, ViewRecord, ViewRecordStatus,
};
use handeye_estimate::diagnose::Calibration;
use handeye_estimate::handeye::joint::{PrintErrors, ShownDistortion};
use handeye_estimate::placement::ArmOfViews;
use handeye_estimate::uncertainty::overdispersion::Evidence;
use handeye_estimate::{
    CameraFit, DepthsInFit, JointFit, Method, MethodResult, Options, ShapeEstimate, ViewResult, ViewStatus,
};
use handeye_geometry::targets::TargetSpec;

/// Key of the board that a result was made with, among the options that it depends on.
pub const TARGET_OPTION: &str = "target";

/// What a result depends on in addition to its data.
pub fn solve_options(method: Method, options: Options, target: &TargetSpec) -> BTreeMap<String, serde_json::Value> {
    let target = serde_json::to_value(target).unwrap_or_default();
    BTreeMap::from([
        ("method".to_owned(), method.name().into()),
        ("keep_outliers".to_owned(), options.keep_outliers.into()),
        ("free_scale".to_owned(), options.free_scale.into()),
        (TARGET_OPTION.to_owned(), target),
    ])
}

impl CalibrationResult {
    /// A calibration as a document. `options` are what the answer depends on in addition to the input.
    pub fn of(
        calibration: &Calibration,
        tool_version: &str,
        input_sha256: Option<String>,
        options: BTreeMap<String, serde_json::Value>,
    ) -> Self {
        let noise = calibration.joint.as_ref().map(|joint| joint.noise);
        let reach = calibration.reach_errors();
        let camera_alone = calibration.camera_fit.as_ref().filter(|_| calibration.hand_eye.is_none());
        let mut result = Self {
            intrinsics: calibration.camera.map(|c| IntrinsicsEstimate::new(&c.intrinsics, c.sigma_px, c.fixed)),
            quality: Quality {
                rms_px: calibration.rms_px,
                sigma_px: noise.map(|n| n.corner_px).or_else(|| camera_alone.and_then(|fit| fit.noise_px)),
                heldout_rms_px: calibration.joint.as_ref().and_then(|joint| joint.heldout_links_rms_px),
                tip_error_95_mm: calibration.tip_error_95_m().map(|m| m * 1e3),
                reach_error_95_mm: reach.map(|reach| reach.as_it_is_95_m * 1e3),
                reach_error_corrected_95_mm: reach.and_then(|reach| reach.corrected_95_m).map(|m| m * 1e3),
                robot_accuracy_mm: calibration.robot_accuracy().map(|robot| robot.accuracy_mm),
                robot_tool_m: calibration.robot_accuracy().map(|robot| robot.tool_m),
                robot_sigma_mm: noise.map(|n| n.robot_m * 1e3),
                robot_sigma_deg: noise.map(|n| n.robot_rad.to_degrees()),
            },
            methods: calibration.methods.iter().map(method).collect(),
            views: calibration.views.iter().map(view).collect(),
            estimate: calibration
                .joint
                .as_ref()
                .map(|joint| details(calibration, joint))
                .or_else(|| camera_alone.map(of_camera))
                .or_else(|| calibration.pose_fit?.shape.map(of_scaled_poses)),
            provenance: Provenance {
                tool_version: tool_version.to_owned(),
                input_sha256,
                options: options.into_iter().collect(),
            },
            ..Self::default()
        };
        if let Some(links) = &calibration.hand_eye {
            let covariances = calibration.link_covariances();
            let [hand_eye, target] = [covariances.map(|c| c.hand_eye), covariances.map(|c| c.target)];
            result.set_links(links, hand_eye.as_ref(), target.as_ref());
        }
        result
    }

    /// Records the arm errors that a calibration found; nothing where it found none. `of_views` is the arm in its views.
    ///
    /// False where the reported poses are not those of the arm's chain, see
    /// [`handeye_estimate::placement::Placement::arm_of_poses`]: errors found with them are not errors of the chain, and do not
    /// correct any command.
    #[must_use]
    pub fn state_arm(&mut self, calibration: &Calibration, of_views: &ArmOfViews) -> bool {
        let Some(errors) = calibration.joint.as_ref().and_then(|joint| joint.arm.as_ref()) else { return true };
        let Some(arm) = of_views.placement.arm_of_poses() else { return false };
        self.arm = ArmEstimate::new(arm, errors, of_views.tool_m);
        true
    }
}

fn details(calibration: &Calibration, joint: &JointFit) -> EstimateDetails {
    EstimateDetails {
        modelled_error_95_mm: calibration.modelled_error_95_m().map(|m| m * 1e3),
        moved_mm: calibration.moved_m().map(|m| m * 1e3),
        reference_point_m: Some(joint.reference_point.coords.into()),
        degrees_of_freedom: Some(joint.small_sample.degrees_of_freedom).filter(|v| v.is_finite()),
        region_scale: Some(joint.small_sample.scale),
        view_sigma_px: Some(joint.noise.view_px),
        widening: Some(OverdispersionRecord::from(&joint.widening)),
        board: joint.shape.map(BoardEstimate::from),
        target_size: joint.size.as_ref().map(|size| TargetSizeEstimate {
            true_over_stated: size.scale,
            sigma: size.sigma,
            determined: size.is_determined(),
        }),
        robot_field: joint
            .field
            .as_ref()
            .map(|field| PoseDependentErrorEstimate::new(field, &joint.noise, joint.heldout_rms_px)),
        print: joint.print.as_ref().map(print),
        depths: joint.depths.as_ref().map(|depths| depths_estimate(&depths.in_fit)),
        residual_distortion: joint.residual_distortion.as_ref().map(residual_distortion),
    }
}

fn depths_estimate(depths: &DepthsInFit) -> DepthsEstimate {
    DepthsEstimate {
        captures: depths.views,
        noise_mm: depths.noise_m * 1e3,
        turned: depths.weight.turned,
        other_probability: depths.other_probability,
        heldout_before_px: depths.heldout_before_px,
        heldout_after_px: depths.heldout_after_px,
        accepted: depths.accepted,
    }
}

/// The details of an estimate from poses of the target whose unit was unknown.
fn of_scaled_poses(shape: ShapeEstimate) -> EstimateDetails {
    EstimateDetails { board: Some(shape.into()), ..EstimateDetails::default() }
}

/// The details of a camera without a robot: the corners' noise is the only one, and the target's size is not seen.
fn of_camera(fit: &CameraFit) -> EstimateDetails {
    let widened = fit.times > 1.0;
    EstimateDetails {
        degrees_of_freedom: Some(fit.degrees_of_freedom),
        widening: Some(OverdispersionRecord {
            factor: fit.times.max(1.0),
            by: if widened { Evidence::Jackknife.name() } else { "none" }.to_owned(),
            lens_factor: None,
        }),
        board: fit.shape.map(BoardEstimate::from),
        ..EstimateDetails::default()
    }
}

fn print(shown: &PrintErrors) -> PrintEstimate {
    let millimetres = |axis: usize| shown.errors_m.iter().map(|error| error[axis] * 1e3).collect();
    PrintEstimate {
        rms_mm: shown.rms_m() * 1e3,
        x_mm: millimetres(0),
        y_mm: millimetres(1),
        sigma_mm: shown.sigma_m.iter().map(|m| m * 1e3).collect(),
    }
}

fn residual_distortion(shown: &ShownDistortion) -> ResidualDistortionEstimate {
    let coefficients = shown.field.coefficients();
    let (along_x, along_y) = coefficients.split_at(coefficients.len() / 2);
    ResidualDistortionEstimate {
        degree: shown.field.degree(),
        x_px: along_x.to_vec(),
        y_px: along_y.to_vec(),
        rms_px: shown.rms_px,
    }
}

impl From<ShapeEstimate> for BoardEstimate {
    fn from(estimate: ShapeEstimate) -> Self {
        Self {
            warp_mm: estimate.shape.warp_m.map(|m| m * 1e3),
            warp_sigma_mm: estimate.warp_sigma_m.map(|sigma| sigma.map(|m| m * 1e3)),
            scale: estimate.shape.scale,
            scale_sigma: estimate.scale_sigma,
        }
    }
}

fn method(method: &MethodResult) -> MethodRecord {
    match &method.outcome {
        Ok(solution) => MethodRecord::solved(method.name, &solution.mount_from_camera),
        Err(error) => MethodRecord::failed(method.name, error),
    }
}

fn view(view: &ViewResult) -> ViewRecord {
    ViewRecord {
        name: view.name.clone(),
        status: match view.status {
            ViewStatus::Used => ViewRecordStatus::Used,
            ViewStatus::Excluded => ViewRecordStatus::Excluded,
            ViewStatus::Outlier => ViewRecordStatus::Outlier,
            ViewStatus::NoTarget => ViewRecordStatus::NoTarget,
        },
        rms_px: view.rms_px,
        influence_mm: view.influence_m.map(|m| m * 1e3),
        distance: view.distance.map(|d| d.of_limit).filter(|d| d.is_finite()),
        rejected_corners: view.rejected_corners.clone(),
        renumbered: view.quarter_turns != 0,
    }
}
