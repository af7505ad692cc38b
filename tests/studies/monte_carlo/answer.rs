//! The project's answers to a trial: the only place where the study uses the estimator.

use handeye_estimate::handeye::PosePair;
use handeye_estimate::handeye::closed_form::{self, ClosedFormSolution};
use handeye_estimate::handeye::joint::{self, Free, JointProblem, JointStart, Noise, SmallSample};
use handeye_estimate::intrinsics::{self, Options, SeenView};
use handeye_estimate::uncertainty::quality;
use handeye_estimate::{self as estimate, CameraKnowledge, Method, Observations, ObservedView, ViewStatus};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Camera, Mount, Pose};
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::testing::BOARD;
use nalgebra::{Matrix6, Point3};

use super::scene::Trial;

/// Noise levels of an exact robot, as given to an estimator that weights by their inverse: a nanometre and a
/// nanoradian.
const EXACT: f64 = 1e-9;
/// Residual \[px\] at which a corner counts as simply wrong when the closed forms are ranked.
const CAP_PX: f64 = 50.0;

/// An estimate with everything that it reports about itself.
pub struct Answer {
    pub mount_from_camera: Pose<Mount, Camera>,
    pub covariance: Matrix6<f64>,
    /// How the error is distributed in units of the covariance.
    pub small_sample: SmallSample,
    pub noise: Noise,
    /// Views that were excluded as outliers.
    pub outliers: usize,
    pub tip_error_95_m: f64,
    /// Where that error is stated, camera coordinates.
    pub reference_point: Point3<f64>,
}

/// Lens, closed forms and start of one trial.
pub struct Start {
    lens: Intrinsics,
    /// In the order of [`closed_form::all`]; `None` where a method failed.
    pub closed_forms: Vec<Option<ClosedFormSolution>>,
    best: ClosedFormSolution,
}

/// Does what a user of OpenCV does: the lens from the corners when it is unknown, PnP, and every closed form.
pub fn start(trial: &Trial) -> Result<Start, String> {
    let size = (trial.intrinsics.width, trial.intrinsics.height);
    let lens = if trial.cell.free_intrinsics {
        let seen: Vec<_> = trial.views.iter().map(|v| SeenView::unweighted(&v.corners)).collect();
        let options = Options::new(Distortion::BrownConrady([0.0; 5]));
        intrinsics::solve(&seen, &BOARD, size, &options, &CancelToken::default()).map_err(|e| e.to_string())?.intrinsics
    } else {
        trial.intrinsics
    };
    let pairs = trial
        .views
        .iter()
        .map(|view| {
            let pose =
                planar_pose::solve(&view.corners, &BOARD, &lens).map_err(|e| e.to_string())?.best.camera_from_target;
            let anchor_from_mount = trial.cell.mode.anchor_from_mount(&view.base_from_tip);
            Ok(PosePair { anchor_from_mount, camera_from_target: pose })
        })
        .collect::<Result<Vec<_>, String>>()?;
    let closed_forms: Vec<_> = closed_form::all().iter().map(|method| method.solve(&pairs).ok()).collect();
    let best = closed_forms
        .iter()
        .flatten()
        .min_by(|a, b| misfit(trial, &lens, a).total_cmp(&misfit(trial, &lens, b)))
        .copied()
        .ok_or_else(|| "no closed form has an answer".to_owned())?;
    Ok(Start { lens, closed_forms, best })
}

/// Sum of squared residuals of the bare chain, capped.
fn misfit(trial: &Trial, lens: &Intrinsics, solution: &ClosedFormSolution) -> f64 {
    let of_view = |view: &handeye_geometry::targets::observation::View| {
        let chain = joint::camera_from_target(
            trial.cell.mode,
            &view.base_from_tip,
            &solution.mount_from_camera,
            &solution.anchor_from_target,
        );
        let residual = |c: &handeye_geometry::targets::observation::Corner| {
            lens.project(&(chain.isometry() * trial.points[c.index])).map_or(CAP_PX, |px| (px - c.px).norm())
        };
        view.corners.iter().map(|c| residual(c).min(CAP_PX).powi(2)).sum::<f64>()
    };
    trial.views.iter().map(of_view).sum()
}

/// The joint estimate, with the noise levels given or to be estimated.
pub fn joint(trial: &Trial, start: &Start, noise_given: bool) -> Result<Answer, String> {
    let true_noise = trial.cell.noise;
    let noise = noise_given.then_some(Noise {
        robot_m: true_noise.robot_m.max(EXACT),
        robot_rad: true_noise.robot_rad.max(EXACT),
        ..true_noise
    });
    let board = BoardPoints::new(&trial.points);
    let problem = JointProblem {
        free: Free { intrinsics: trial.cell.free_intrinsics, ..Free::default() },
        noise,
        ..JointProblem::new(trial.cell.mode, &board, &trial.views)
    };
    let from = JointStart {
        mount_from_camera: start.best.mount_from_camera,
        anchor_from_target: start.best.anchor_from_target,
        intrinsics: start.lens,
        shape: BoardShape::default(),
        noise: None,
    };
    let solution = joint::estimate(&problem, &from, &CancelToken::default()).map_err(|e| e.to_string())?;
    Ok(Answer {
        mount_from_camera: solution.hand_eye.mount_from_camera(),
        covariance: solution.hand_eye_covariance(),
        small_sample: solution.small_sample,
        noise: solution.noise,
        outliers: 0,
        tip_error_95_m: quality::tip_error_95_m(&solution),
        reference_point: solution.reference_point,
    })
}

/// The whole path of the product, from observed corners: includes the handling of grossly wrong views.
pub fn product(trial: &Trial) -> Result<Answer, String> {
    let camera = if trial.cell.free_intrinsics {
        CameraKnowledge::Estimate { model: Distortion::BrownConrady([0.0; 5]), start: None }
    } else {
        CameraKnowledge::Fixed(trial.intrinsics)
    };
    let observations = Observations {
        mode: Some(trial.cell.mode),
        target: BOARD,
        image_size: (trial.intrinsics.width, trial.intrinsics.height),
        camera,
        views: trial.views.iter().map(ObservedView::from).collect(),
    };
    let found = estimate::fit(&observations, Method::Joint, &CancelToken::default()).map_err(|e| e.to_string())?;
    let missing = || "the calibration has no hand-eye transform".to_owned();
    let joint = found.joint.as_ref().ok_or_else(missing)?;
    let covariance = *found.hand_eye_covariance().ok_or_else(missing)?;
    Ok(Answer {
        mount_from_camera: found.hand_eye.ok_or_else(missing)?.mount_from_camera(),
        covariance,
        small_sample: joint.small_sample,
        noise: joint.noise,
        outliers: found.views.iter().filter(|view| view.status == ViewStatus::Outlier).count(),
        tip_error_95_m: quality::tip_error_95_at(&covariance, joint.small_sample, &joint.reference_point),
        reference_point: joint.reference_point,
    })
}
