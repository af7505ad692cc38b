//! Results with known numbers, for tests. Feature `testing`.

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};
use serde_json::json;

use super::{
    BoardEstimate, CalibrationResult, DepthsEstimate, EstimateDetails, IntrinsicsEstimate, MethodRecord,
    OverdispersionRecord, PoseDependentErrorEstimate, PrintEstimate, Quality, ResidualDistortionEstimate,
    TargetSizeEstimate, TruthComparison, VerificationSummary, ViewRecord, ViewRecordStatus,
};
use handeye_arm::{Arm, ArmKind};
use handeye_estimate::handeye::HandEye;
use handeye_estimate::handeye::joint::{
    ArmErrors, Free, Noise, PoseDependentError, Slopes, SmallSample, arm_parameters,
};
use handeye_estimate::uncertainty::overdispersion::{Evidence, Overdispersion};
use handeye_estimate::{ArmFit, OtherEstimates};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::view_equations::DepthBias;

/// Calibration that the exports of other programs are compared with: tip to camera, 1280×720, `plumb_bob`.
pub const GOLDEN_TRANSLATION_M: [f64; 3] = [0.045, -0.032, 0.061];
/// Its rotation.
pub const GOLDEN_XYZW: [f64; 4] = [0.195832126, 0.036412615, 0.644503346, 0.738200065];

pub(crate) fn golden_pose() -> Pose<Tip, Camera> {
    Pose::from_translation_xyzw(GOLDEN_TRANSLATION_M, GOLDEN_XYZW)
}

/// Its lens.
pub fn golden_intrinsics() -> Intrinsics {
    let distortion = Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.0]);
    Intrinsics { width: 1280, height: 720, fx: 912.4, fy: 911.8, cx: 640.7, cy: 361.2, distortion }
}

/// A full eye-in-hand result.
pub fn golden() -> CalibrationResult {
    let mut result = CalibrationResult::default();
    let base_from_target = Pose::<Base, Target>::from_translation_xyzw([0.4, -0.1, 0.02], [0.0, 0.6, 0.0, -0.8]);
    let covariance = Matrix6::from_diagonal(&Vector6::new(1.6e-7, 1.6e-7, 2.5e-7, 9e-7, 9e-7, 4e-7));
    let links = HandEye::EyeInHand { tip_from_camera: golden_pose(), base_from_target };
    result.set_links(&links, Some(&covariance), None);
    result.intrinsics = Some(IntrinsicsEstimate::new(&golden_intrinsics(), Some([0.4, 0.4, 0.3, 1.0 / 3.0]), false));
    result.quality = Quality { rms_px: Some(0.31), sigma_px: Some(0.2), ..Quality::default() };
    result.methods = vec![
        MethodRecord::solved("park_martin", &golden_pose().relabel()),
        MethodRecord::failed("tsai_lenz", &"3 views are not enough"),
    ];
    let statuses =
        [ViewRecordStatus::Used, ViewRecordStatus::Excluded, ViewRecordStatus::Outlier, ViewRecordStatus::NoTarget];
    result.views = statuses
        .into_iter()
        .enumerate()
        .map(|(i, status)| ViewRecord {
            name: format!("images/{i:04}.png"),
            status,
            rms_px: Some(0.3),
            influence_mm: None,
            distance: (status == ViewRecordStatus::Outlier).then_some(3.5),
            rejected_corners: vec![4, 17],
            renumbered: status == ViewRecordStatus::Excluded,
        })
        .collect();
    let (chain, arm) = golden_arm();
    result.arm = super::ArmEstimate::new(&chain, &arm, [0.0, 0.0, 0.1]);
    result.estimate = Some(EstimateDetails {
        modelled_error_95_mm: Some(0.2),
        moved_mm: Some(1.5),
        reference_point_m: Some([0.01, -0.02, 0.45]),
        degrees_of_freedom: Some(31.5),
        region_scale: Some(0.97),
        view_sigma_px: Some(0.0),
        widening: Some(OverdispersionRecord { factor: 1.4, by: "neighbours".to_owned(), lens_factor: Some(2.0) }),
        target_size: Some(TargetSizeEstimate { true_over_stated: 1.001, sigma: 0.002, determined: true }),
        board: Some(BoardEstimate {
            warp_mm: [0.16, -0.03],
            warp_sigma_mm: Some([0.01, 0.02]),
            scale: 1.0,
            scale_sigma: None,
        }),
        robot_field: Some(PoseDependentErrorEstimate {
            origin_m: [0.4, -0.1, 0.5],
            reach_m: 0.3,
            position_slopes: [[1e-3, 0.0, -2e-3], [0.0, 5e-4, 0.0], [0.0; 3]],
            orientation_slopes_rad_per_m: [[0.0; 3], [2e-3, 0.0, 0.0], [0.0; 3]],
            position_slopes_in_base: None,
            orientation_slopes_in_base_rad_per_m: None,
            typical_mm: 0.4,
            typical_deg: 0.03,
            heldout_rms_px: Some(0.6),
        }),
        depths: Some(DepthsEstimate {
            captures: 12,
            noise_mm: 0.02,
            turned: false,
            other_probability: 0.01,
            heldout_before_px: 0.11,
            heldout_after_px: 0.1,
            accepted: true,
        }),
        print: Some(PrintEstimate {
            rms_mm: 0.05,
            x_mm: vec![0.05, -0.05],
            y_mm: vec![-0.05, 0.05],
            sigma_mm: vec![0.01, 0.02],
        }),
        residual_distortion: Some(ResidualDistortionEstimate {
            degree: 1,
            x_px: vec![0.01, -0.02, 0.03],
            y_px: vec![0.0, 0.04, -0.05],
            rms_px: 0.06,
        }),
    });
    result.findings = vec![handeye_estimate::diagnose::record::FindingRecord {
        code: "large_residual".to_owned(),
        severity: "warning".to_owned(),
        text: "The corners of view images/0001.png fit badly.".to_owned(),
        views: vec!["images/0001.png".to_owned()],
        evidence: vec![handeye_estimate::diagnose::record::EvidenceRecord {
            name: "rms".to_owned(),
            value: Some(1.5),
            unit: "px".to_owned(),
        }],
    }];
    result.verification = Some(VerificationSummary {
        captures: 3,
        rms_px: 0.25,
        centre_rms_mm: 0.125,
        orientation_rms_deg: 0.01,
        as_stated: Some(true),
        corrected: None,
    });
    result.truth = Some(TruthComparison { translation_error_mm: Some(0.2), ..TruthComparison::default() });
    "0.1.0".clone_into(&mut result.provenance.tool_version);
    result.provenance.input_sha256 = Some("00ff".repeat(16));
    result.provenance.options.insert("robust".to_owned(), json!(true));
    result
}

/// The same with the camera next to the robot (eye to hand).
pub fn eye_to_hand() -> CalibrationResult {
    let mut result = golden();
    let links = HandEye::EyeToHand {
        base_from_camera: Pose::from_translation_xyzw([1.0, 0.25, 0.5], [0.5, -0.5, 0.5, -0.5]),
        tip_from_target: Pose::identity(),
    };
    result.set_links(&links, None, None);
    result
}

/// The same of poses alone.
pub fn pose_pairs_only() -> CalibrationResult {
    CalibrationResult { intrinsics: None, ..golden() }
}

/// The same of a camera without a robot.
pub fn intrinsics_only() -> CalibrationResult {
    CalibrationResult { mode: None, hand_eye: None, target: None, methods: Vec::new(), ..golden() }
}

/// An arm of six joints with errors of every kind, and the fit that found them.
pub fn golden_arm() -> (Arm, ArmFit) {
    let joints = 6;
    let count = arm_parameters(joints).len();
    let errors = ArmErrors::new(joints, (0..count).map(|k| 1e-4 * (k as f64 + 1.0)).collect()).expect("so many");
    let chain = ArmKind::Ur5e.arm();
    let base_from_target = Pose::<Base, Target>::from_translation_xyzw([0.4, -0.1, 0.02], [0.0, 0.6, 0.0, -0.8]);
    let fit = ArmFit {
        errors,
        hand_eye: HandEye::EyeInHand { tip_from_camera: golden_pose(), base_from_target },
        others: OtherEstimates {
            intrinsics: Intrinsics::pinhole(640, 480, 600.0),
            shape: BoardShape::default(),
            depth: DepthBias::default(),
            free: Free { arm: true, ..Free::default() },
        },
        covariance: DMatrix::from_diagonal_element(12 + count, 12 + count, 1e-9),
        small_sample: SmallSample { degrees_of_freedom: 30.0, scale: 1.01, ..SmallSample::KNOWN },
        noise: Noise {
            corner_px: 0.1,
            robot_m: 2e-5,
            robot_rad: 1e-4,
            link_rad: 1e-3,
            link_m: 2e-4,
            compliance_rad: 3e-4,
            ..Noise::EXACT
        },
        widening: Overdispersion { factor: 1.44, by: Some(Evidence::Neighbours), lens: 2.25, checks: Vec::new() },
        heldout_px: Some([1.0, 0.25]),
        contradicted: false,
    };
    (chain, fit)
}

/// The same with additional errors that depend on where the tip is, per 0.25 m.
pub fn golden_arm_with_a_field() -> (Arm, ArmFit) {
    let (chain, fit) = golden_arm();
    let slopes = |s: f64| Slopes {
        position: Matrix3::from_fn(|i, j| 1e-3 * (s + (3 * i + j) as f64)),
        orientation: Matrix3::from_fn(|i, j| 1e-3 * (s - (2 * i + j) as f64)),
    };
    let field = PoseDependentError::new(Vector3::new(0.4, -0.1, 0.5), 0.3, &slopes(0.5), Some(&slopes(1.5)));
    let errors = fit.errors.clone().with_field(Some(field.per(0.25)));
    let count = 12 + errors.number_count();
    let covariance = DMatrix::from_fn(count, count, |i, j| if i == j { 1e-9 * (1.0 + i as f64) } else { 1e-11 });
    (chain, ArmFit { errors, covariance, ..fit })
}
