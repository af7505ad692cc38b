//! The information expected from a view that was not taken, by the model of a finished calibration.
//!
//! With the corners of a view linearised at the estimate, its pixel residuals are split into the six numbers that a pose of
//! its own could explain and the rest ([`super::view_block`]). The six are
//! `z = A s + A_d d + e` in units of their own noise, with the unknowns `s` that all views share, the error `d` of the
//! robot and white noise `e`. With `d ~ N(0, Σ)` their information on `s` is `Aᵀ (1 + A_d Σ A_dᵀ)⁻¹ A`; that of the rest on
//! lens and shape is `F / corner_px²`. Both are kept as rows `R` with `Rᵀ R` the information, so that a view is a change of
//! low rank.

use nalgebra::{Cholesky, DMatrix, Isometry3, Matrix6, Vector2, Vector6};

use super::arm_errors::{ArmErrors, KINDS};
use super::chain::Chain;
use super::expected_pixels::ExpectedPixels;
use super::pose_dependent_error::PoseDependentError;
use super::pose_part::whitened;
use super::variance::levels_of_effects;
use super::view_block::{Layout, PixelWeights, ViewBlock, prior_weight};
use super::{Free, Noise, SIZE_SIGMA};
use crate::Fit;
use crate::arm_fit::OtherEstimates;
use crate::handeye::{HandEye, Mode};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::observations::KnownLens;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::view_equations::{PoseEquations, ViewInput, Whitener};

/// Part of its largest diagonal entry below which a pivot is rounding.
const NO_PIVOT: f64 = 1e-12;

/// The robot's posture in a view.
#[derive(Debug, Clone)]
pub struct Posture {
    /// Tip pose as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Its joints, as [`View::tip_from_joints`]; empty where they are not known.
    pub tip_from_joints: Vec<Isometry3<f64>>,
}

impl From<Pose<Base, Tip>> for Posture {
    /// A posture whose joints are not known.
    fn from(base_from_tip: Pose<Base, Tip>) -> Self {
        Self { base_from_tip, tip_from_joints: Vec::new() }
    }
}

/// The model that a calibration ended with: the unknowns that its views share, and their noise.
#[derive(Debug, Clone)]
pub struct ViewModel {
    hand_eye: HandEye,
    intrinsics: Intrinsics,
    free: Free,
    noise: Noise,
    board: BoardPoints,
    shape: BoardShape,
    field: Option<PoseDependentError>,
    arm: Option<ArmErrors>,
    /// What is known of a free lens beforehand.
    lens: Option<KnownLens>,
    layout: Layout,
}

/// The information of a view on the unknowns that all views share.
#[derive(Debug, Clone)]
pub struct ExpectedView {
    /// `R`, with the information `Rᵀ R`; a column per unknown.
    rows: DMatrix<f64>,
}

impl ViewModel {
    /// The model of a joint estimate with a robot and a camera; `None` for any other calibration.
    pub fn new(calibration: &Fit, target: &TargetSpec) -> Option<Self> {
        let joint = calibration.joint.as_ref()?;
        let lens = joint.known_lens;
        let intrinsics = calibration.intrinsics()?;
        let free = Free { arm: false, depth: false, ..joint.free };
        let field = joint.field.clone();
        let layout = Layout {
            form: free.form().count(&intrinsics),
            field: field.as_ref().map_or(0, |field| field.slopes().len()),
            arm: [0; KINDS],
        };
        Some(Self {
            hand_eye: calibration.hand_eye?,
            intrinsics,
            free,
            noise: joint.noise,
            board: BoardPoints::new(&target.points()),
            shape: joint.shape.map_or_else(BoardShape::default, |estimate| estimate.shape),
            field,
            arm: None,
            lens,
            layout,
        })
    }

    /// The same with the errors of the arm among the unknowns; `None` where the calibration does not have them, see [`Fit::arm`].
    pub fn of_arm(calibration: &Fit, target: &TargetSpec) -> Option<Self> {
        let arm = calibration.arm()?;
        let OtherEstimates { intrinsics, shape, free, .. } = arm.others.clone();
        let free = Free { depth: false, ..free };
        let layout =
            Layout { form: free.form().count(&intrinsics), field: arm.errors.slope_count(), arm: arm.errors.counts() };
        Some(Self {
            hand_eye: arm.hand_eye,
            intrinsics,
            free,
            noise: arm.noise,
            board: BoardPoints::new(&target.points()),
            shape,
            field: None,
            arm: Some(arm.errors.clone()),
            lens: calibration.joint.as_ref()?.known_lens,
            layout,
        })
    }

    /// The model of links and lens that are known, with a flat target and a robot without pose-dependent errors.
    pub fn known(
        hand_eye: HandEye,
        intrinsics: Intrinsics,
        free_lens: bool,
        noise: Noise,
        target: &TargetSpec,
    ) -> Self {
        let free = Free { intrinsics: free_lens, ..Free::default() };
        let layout = Layout { form: free.form().count(&intrinsics), field: 0, arm: [0; KINDS] };
        let board = BoardPoints::new(&target.points());
        Self {
            hand_eye,
            intrinsics,
            free,
            noise,
            board,
            shape: BoardShape::default(),
            field: None,
            arm: None,
            lens: None,
            layout,
        }
    }

    /// The same with other noise levels.
    #[must_use]
    pub fn with_noise(self, noise: Noise) -> Self {
        Self { noise, ..self }
    }

    /// Noise levels.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// Where the camera is mounted.
    pub fn mode(&self) -> Mode {
        self.hand_eye.mode()
    }

    /// Both links.
    pub fn hand_eye(&self) -> &HandEye {
        &self.hand_eye
    }

    /// The lens.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Whether the errors of the arm are among the unknowns.
    pub fn has_arm(&self) -> bool {
        self.arm.is_some()
    }

    /// Where the hand-eye transform and the errors of the arm are among the unknowns.
    pub fn hand_eye_and_arm(&self) -> impl Iterator<Item = usize> {
        (0..6).chain(self.layout.field_at()..self.layout.count())
    }

    /// Number of the unknowns that all views share.
    pub fn unknowns(&self) -> usize {
        self.layout.count()
    }

    /// What is known of the unknowns without any view: for the slopes of the robot's field and the errors of the arm their levels;
    /// for the rest so little that any few views determine more, but enough that every matrix is regular.
    pub fn prior(&self) -> DMatrix<f64> {
        let mut sigma = vec![1.0; self.unknowns()];
        if self.free.intrinsics {
            let focal_px = self.intrinsics.fx;
            for (k, value) in sigma[Layout::FORM_AT..].iter_mut().take(self.intrinsics.parameter_count()).enumerate() {
                *value = if k < 4 { focal_px } else { 10.0 };
            }
        }
        if self.free.scale {
            sigma[Layout::FORM_AT + self.free.form().scale_at(&self.intrinsics)] = SIZE_SIGMA;
        }
        for (places, level) in self.layout.effects().into_iter().zip(levels_of_effects(&self.noise)) {
            sigma[places].fill(level);
        }
        let mut prior = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(
            sigma.len(),
            sigma.iter().map(|sigma| sigma.max(f64::MIN_POSITIVE.sqrt()).powi(-2)),
        ));
        if let Some(known) = self.lens.filter(|_| self.free.intrinsics) {
            let information = known.information();
            let mut of_lens = prior.view_mut((Layout::FORM_AT, Layout::FORM_AT), information.shape());
            of_lens += information;
        }
        prior
    }

    /// The pose of the target in a view, and the equations of the view at it; `None` where `corners`, by their index, do
    /// not determine a pose, or are not in front of the camera.
    fn block(&self, posture: &Posture, corners: &[usize]) -> Option<ViewBlock> {
        let chain = self.chain(posture);
        // Where the corners were found does not matter for their information.
        let corners: Vec<Corner> = corners.iter().map(|&index| Corner::new(index, Vector2::zeros())).collect();
        let seen = ViewInput {
            intrinsics: &self.intrinsics,
            board: &self.board,
            shape: &self.shape,
            corners: &corners,
            whitener: &Whitener::Alike,
            depths: None,
        };
        let equations = PoseEquations::new(&seen, &chain.camera_from_target, self.free.form()).ok()?;
        let field = self.field.as_ref().map(|field| (field, &posture.base_from_tip));
        ViewBlock::new(&chain, &equations, self.layout, field)
    }

    fn chain(&self, posture: &Posture) -> Chain {
        let Posture { base_from_tip, tip_from_joints } = posture;
        let by_field = self.field.as_ref().map_or_else(Vector6::zeros, |field| field.correction(base_from_tip));
        let view =
            View { tip_from_joints: tip_from_joints.clone(), ..View::new(String::new(), *base_from_tip, Vec::new()) };
        let (mount, anchor) = (self.hand_eye.mount_from_camera(), self.hand_eye.anchor_from_target());
        Chain::with_arm(self.mode(), &view, self.arm.as_ref(), &by_field, &mount, &anchor)
    }

    /// Where the target is in a view.
    pub fn camera_from_target(&self, posture: &Posture) -> Pose<Camera, Target> {
        Pose::from_isometry(self.chain(posture).camera_from_target)
    }

    /// The tip pose at which the target would be seen like this, without its field and the errors of its arm.
    pub fn base_from_tip(&self, camera_from_target: &Pose<Camera, Target>) -> Pose<Base, Tip> {
        self.hand_eye.base_from_tip(camera_from_target)
    }

    /// The information of a view in which the corners with these indices are found; `None` where they do not determine a pose or
    /// are not in front of the camera. A view whose joints are not known has no information on the errors of the arm.
    pub fn expected(&self, posture: &Posture, corners: &[usize]) -> Option<ExpectedView> {
        let block = self.block(posture, corners)?;
        let weights = PixelWeights::new(&self.noise);
        let n = self.unknowns();
        let by_robot = block.by_correction * weights.pose.sqrt();
        let spread = Matrix6::from_diagonal(&prior_weight(&self.noise).map(f64::recip));
        let noise = Cholesky::new(Matrix6::identity() + by_robot * spread * by_robot.transpose())?.l();
        let of_pose = whitened(&noise, block.by_shared.transpose() * weights.pose.sqrt());
        let rest = block.rest.form * weights.rest;
        let rest = half_root(rest);
        let mut rows = DMatrix::zeros(6 + rest.nrows(), n);
        rows.rows_mut(0, 6).copy_from(&of_pose);
        rows.view_mut((6, Layout::FORM_AT), rest.shape()).copy_from(&rest);
        Some(ExpectedView { rows })
    }

    /// Where the points of the target are expected in a view, with shared unknowns of that covariance.
    pub fn pixels<'a>(&'a self, posture: &Posture, covariance: &'a DMatrix<f64>) -> ExpectedPixels<'a> {
        let lens = if self.free.intrinsics { self.intrinsics.parameter_count() } else { 0 };
        let field = self.field.as_ref().map(|field| (field, &posture.base_from_tip));
        let chain = self.chain(posture);
        ExpectedPixels::new(&self.intrinsics, &chain, (self.layout, lens), field, &self.noise, covariance)
    }
}

impl ExpectedView {
    /// `R`, with the information `Rᵀ R`.
    pub fn rows(&self) -> &DMatrix<f64> {
        &self.rows
    }

    /// Its information on the unknowns, an inverse covariance.
    pub fn information(&self) -> DMatrix<f64> {
        self.rows.tr_mul(&self.rows)
    }
}

/// `R` with `Rᵀ R` a matrix that is positive semidefinite except for rounding, without the rows that are zero.
fn half_root(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].max(0.0)).collect();
    let mut rows: Vec<nalgebra::RowDVector<f64>> = Vec::with_capacity(n);
    for i in 0..n {
        let pivot = matrix[(i, i)];
        // A direction that the ones before already determine, or without any information.
        if pivot <= NO_PIVOT * scale[i] || pivot <= 0.0 {
            continue;
        }
        let row = matrix.row(i) / pivot.sqrt();
        matrix -= row.tr_mul(&row);
        rows.push(row);
    }
    if rows.is_empty() { DMatrix::zeros(0, n) } else { DMatrix::from_rows(&rows) }
}

#[cfg(test)]
#[path = "expected_view_tests.rs"]
mod tests;
