//! The part of a calibration that is needed to predict what the camera sees.

use nalgebra::{DMatrix, Matrix6, Vector2};

use super::VerifyError;
use crate::diagnose::Calibration;
use crate::handeye::HandEye;
use crate::handeye::joint::{
    ArmErrors, CornerWeights, DepthWeight, Free, Noise, PoseDependentError, SmallSample, camera_from_target,
    corrected_base_from_tip,
};
use crate::resolution;
use crate::uncertainty::quality;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::{Corner, Corners, View};
use handeye_geometry::view_equations::{DepthBias, MeasuredDepths, ViewInput, Whitener};

/// The part of a calibration that is needed to predict.
#[derive(Debug, Clone)]
pub struct Predictor {
    /// Both rigid links.
    pub hand_eye: HandEye,
    /// The camera.
    pub intrinsics: Intrinsics,
    /// The shape of the target.
    pub shape: BoardShape,
    /// Print errors of the target's points, metres; empty where the calibration found none.
    pub print_errors_m: Vec<Vector2<f64>>,
    /// Pose-dependent errors of the robot, where the calibration found them and they are not among those of the arm.
    pub field: Option<PoseDependentError>,
    /// Errors of the robot's arm, where tip poses are corrected for them.
    pub arm: Option<ArmErrors>,
    /// Covariance of the hand-eye transform, right perturbation `[t; r]`, where it is known.
    pub hand_eye_covariance: Option<Matrix6<f64>>,
    /// How the error of the hand-eye transform is distributed in units of that covariance.
    pub small_sample: SmallSample,
    /// The uncertainty of predictions; set for a joint estimate.
    pub uncertainty: Option<Uncertainty>,
}

/// How uncertain a prediction is.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// Noise levels of robot and corners.
    pub noise: Noise,
    /// Weights of corners relative to each other, see [`JointFit::weights`](crate::JointFit::weights).
    pub weights: Option<CornerWeights>,
    /// The errors of depths and their weight; `None` where the calibration does not use them.
    pub depths: Option<(DepthBias, DepthWeight)>,
    /// What was estimated in addition to the links.
    pub free: Free,
    /// Covariance of everything that predictions share, as in
    /// [`JointSolution::covariance`](crate::handeye::joint::JointSolution::covariance).
    pub covariance: DMatrix<f64>,
}

impl Predictor {
    /// A predictor whose parameters are known exactly: a flat board of the stated size, and a robot without errors.
    /// States no uncertainty.
    pub fn known(hand_eye: HandEye, intrinsics: Intrinsics) -> Self {
        Self {
            hand_eye,
            intrinsics,
            shape: BoardShape::default(),
            print_errors_m: Vec::new(),
            field: None,
            arm: None,
            hand_eye_covariance: None,
            small_sample: SmallSample::KNOWN,
            uncertainty: None,
        }
    }

    /// Takes what it needs from a calibration.
    ///
    /// # Errors
    /// [`VerifyError::NoHandEye`], [`VerifyError::NoIntrinsics`].
    pub fn new(calibration: &Calibration) -> Result<Self, VerifyError> {
        let hand_eye = calibration.hand_eye.ok_or(VerifyError::NoHandEye)?;
        let intrinsics = calibration.intrinsics().ok_or(VerifyError::NoIntrinsics)?;
        let joint = calibration.joint.as_ref();
        let uncertainty = joint.map(|joint| Uncertainty {
            noise: joint.noise,
            weights: joint.weights,
            depths: joint.depths.as_ref().and_then(|depths| {
                let weight = depths.in_fit.weight()?;
                // What no depth camera resolves is not an error of a calibration.
                let px_per_m = weight.px_per_m.min(joint.noise.corner_px / resolution::DEPTH_M);
                Some((depths.bias, DepthWeight { px_per_m, ..weight }))
            }),
            free: joint.free,
            covariance: joint.covariance.clone(),
        });
        Ok(Self {
            hand_eye,
            intrinsics,
            shape: joint.and_then(|joint| joint.shape).map_or_else(BoardShape::default, |estimate| estimate.shape),
            print_errors_m: joint
                .and_then(|joint| joint.print.as_ref())
                .map_or_else(Vec::new, |it| it.errors_m.clone()),
            field: joint.and_then(|joint| joint.field.clone()),
            arm: None,
            hand_eye_covariance: calibration.link_covariances().map(|links| links.hand_eye),
            small_sample: joint.map_or(SmallSample::KNOWN, |joint| joint.small_sample),
            uncertainty,
        })
    }

    /// The same with tip poses corrected for the errors of the arm, by the links, lens and target that belong to them. `None` where
    /// the calibration does not have them, see [`Fit::arm`](crate::Fit::arm).
    pub fn of_arm(calibration: &Calibration) -> Option<Self> {
        let (arm, reported) = (calibration.arm()?, Self::new(calibration).ok()?);
        let uncertainty = reported.uncertainty?;
        Some(Self {
            hand_eye: arm.hand_eye,
            intrinsics: arm.others.intrinsics,
            shape: arm.others.shape,
            print_errors_m: reported.print_errors_m,
            field: None,
            arm: Some(arm.errors.clone()),
            hand_eye_covariance: Some(arm.covariance.fixed_view::<6, 6>(0, 0).into_owned()),
            small_sample: arm.small_sample,
            uncertainty: Some(Uncertainty {
                noise: arm.noise,
                depths: uncertainty.depths.map(|(_, weight)| (arm.others.depth, weight)),
                free: arm.others.free,
                covariance: arm.covariance.clone(),
                ..uncertainty
            }),
        })
    }

    /// The points of the target as printed; those of another target as drawn.
    pub fn board(&self, target: &TargetSpec) -> BoardPoints {
        let drawn = BoardPoints::new(&target.points());
        if drawn.len() == self.print_errors_m.len() { drawn.displaced(&self.print_errors_m) } else { drawn }
    }

    /// The true tip pose for the pose that the robot reports in this view: with the known errors of the robot removed.
    ///
    /// # Errors
    /// [`VerifyError::NotFinite`]; [`VerifyError::NoJoints`] where the errors of the arm are known and its joints are not.
    pub(crate) fn base_from_tip(&self, view: &View) -> Result<Pose<Base, Tip>, VerifyError> {
        if !view.base_from_tip.is_finite() {
            return Err(VerifyError::NotFinite { name: view.name.clone() });
        }
        if self.arm.as_ref().is_some_and(|arm| arm.joint_count() != view.tip_from_joints.len()) {
            return Err(VerifyError::NoJoints { name: view.name.clone() });
        }
        Ok(corrected_base_from_tip(view, self.arm.as_ref(), self.field.as_ref()))
    }

    /// Pose of the camera for a tip pose.
    pub fn base_from_camera(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Camera> {
        match self.hand_eye {
            HandEye::EyeInHand { tip_from_camera, .. } => *base_from_tip * tip_from_camera,
            HandEye::EyeToHand { base_from_camera, .. } => base_from_camera,
        }
    }

    /// Pose of the board in the camera for a tip pose: the bare chain.
    pub fn camera_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Camera, Target> {
        camera_from_target(
            self.hand_eye.mode(),
            base_from_tip,
            &self.hand_eye.mount_from_camera(),
            &self.hand_eye.anchor_from_target(),
        )
    }

    /// Weights of the corners of an image.
    pub(super) fn whitener(&self, corners: &Corners) -> Whitener {
        let weights = self.uncertainty.as_ref().and_then(|uncertainty| uncertainty.weights);
        weights.map_or(Whitener::Alike, |weights| weights.whitener(corners))
    }

    /// A view through the calibrated lens, with the whitener of its corners.
    pub(super) fn view_input<'a>(
        &'a self,
        board: &'a BoardPoints,
        (corners, depth): (&'a [Corner], Option<&'a DepthPlane>),
        whitener: &'a Whitener,
    ) -> ViewInput<'a> {
        let counted = self.uncertainty.as_ref().and_then(|uncertainty| uncertainty.depths.as_ref());
        let depths = counted.zip(depth);
        ViewInput {
            intrinsics: &self.intrinsics,
            board,
            shape: &self.shape,
            corners,
            whitener,
            depths: depths.map(|((bias, weight), plane)| MeasuredDepths { plane, bias, px_per_m: weight.px_per_m }),
        }
    }

    /// The board's pose in one image, by its corners and the shape that the calibration found, from its pose as a flat
    /// board of the stated size; by its depths too, where there are some and the calibration uses them. A board that is 2 %
    /// larger than stated is 2 % farther away.
    ///
    /// `None` when that puts a corner behind the camera, or a corner is not a point of this board.
    pub fn seen(
        &self,
        board: &BoardPoints,
        (corners, depth): (&Corners, Option<&DepthPlane>),
        flat: &Pose<Camera, Target>,
    ) -> Option<Pose<Camera, Target>> {
        if corners.iter().any(|corner| corner.index >= board.len()) {
            return None;
        }
        let mut start = *flat.isometry();
        start.translation.vector *= self.shape.scale;
        let whitener = self.whitener(corners);
        quality::weighted_pose_of_view(&self.view_input(board, (corners, depth), &whitener), &start)
    }
}
