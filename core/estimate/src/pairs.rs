//! Calibration from robot and target poses alone.

use nalgebra::Point3;

use super::{
    CalibrateError, CalibratedCamera, CameraKnowledge, Fit, KnownLens, LinkCovariances, Method, Observations, Options,
    PoseFit, ShapeEstimate, ViewResult, ViewStatus, check_motion, chosen, closed_forms,
};
use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::consensus::consensus;
use crate::handeye::numbering::Turns;
use crate::handeye::pose_graph::{self, METHOD, PoseGraphSolution, misfit};
use crate::handeye::screening::{Distance, Estimator, Judged, ScreenedFit, screened};
use crate::handeye::{HandEye, HandEyeError, Mode, PosePair, scale};
use handeye_geometry::progress::{CancelToken, Work};
use handeye_geometry::targets::bent::BoardShape;

pub fn calibrate(
    observations: &Observations,
    method: Method,
    options: Options,
    work: &Work<'_>,
) -> Result<Fit, CalibrateError> {
    let mode = observations.mode.unwrap_or(Mode::EyeInHand);
    let pairs: Vec<PosePair> = observations
        .views
        .iter()
        .filter(|view| view.in_fit)
        .map(|view| match (view.base_from_tip, view.camera_from_target) {
            (Some(base_from_tip), Some(camera_from_target)) => {
                Ok(PosePair { anchor_from_mount: mode.anchor_from_mount(&base_from_tip), camera_from_target })
            }
            _ => Err(CalibrateError::NothingObserved { name: view.name.clone() }),
        })
        .collect::<Result<_, _>>()?;
    check_motion(mode, &pairs)?;
    let mut calibration = Fit {
        camera: match observations.camera {
            CameraKnowledge::Fixed(intrinsics) | CameraKnowledge::Near(KnownLens { intrinsics, .. }) => {
                Some(CalibratedCamera { intrinsics, fixed: true, sigma_px: None })
            }
            CameraKnowledge::Estimate { .. } => None,
        },
        methods: closed_forms(&pairs, work)?,
        views: observations.views.iter().map(|v| ViewResult::new(v, ViewStatus::Used)).collect(),
        ..Fit::default()
    };
    let (x, y) = match method {
        Method::ClosedForm(name) => {
            let solution = chosen(&calibration.methods, name)?;
            (solution.mount_from_camera, solution.anchor_from_target)
        }
        Method::Joint => {
            let begin = Begin::new(&pairs, &calibration, options)?;
            let fit = estimate(&pairs, &begin, &observations.target.centre(), options, work)?;
            if fit.kept.len() < pairs.len() {
                // For comparison on the same views.
                let kept: Vec<PosePair> = fit.kept.iter().map(|i| pairs[*i]).collect();
                calibration.methods = closed_forms(&kept, work)?;
            }
            let solution = &fit.solution;
            calibration.link_covariances = Some(LinkCovariances {
                hand_eye: solution.covariance.fixed_view::<6, 6>(0, 0).into_owned(),
                target: solution.covariance.fixed_view::<6, 6>(6, 6).into_owned(),
            });
            calibration.pose_fit = Some(of_solution(solution));
            let in_fit = calibration.views.iter_mut().filter(|v| v.status == ViewStatus::Used);
            for (index, (view, judged)) in in_fit.zip(&fit.judged).enumerate() {
                view.distance = Some(Distance::from(judged));
                if fit.kept.binary_search(&index).is_err() {
                    view.status = ViewStatus::Outlier;
                }
            }
            (solution.mount_from_camera, solution.anchor_from_target)
        }
    };
    if !(x.is_finite() && y.is_finite()) {
        let reason = "it diverged";
        return Err(HandEyeError::NoSolution { method: METHOD, views: pairs.len(), reason }.into());
    }
    let with_poses = calibration.views.iter_mut().filter(|v| v.status != ViewStatus::Excluded);
    for (view, pair) in with_poses.zip(&pairs) {
        view.camera_from_target = Some(x.inverse() * pair.anchor_from_mount.inverse() * y);
    }
    calibration.hand_eye = Some(HandEye::new(mode, x, y));
    Ok(calibration)
}

fn of_solution(solution: &PoseGraphSolution) -> PoseFit {
    let shape = BoardShape { scale: solution.scale, ..BoardShape::FLAT };
    let scaled = |sigma| ShapeEstimate { shape, warp_sigma_m: None, scale_sigma: Some(sigma) };
    let levels = solution.levels;
    PoseFit { sigma_m: levels.position_m, sigma_rad: levels.rotation_rad(), shape: solution.scale_sigma.map(scaled) }
}

/// Where the estimate begins.
struct Begin {
    solution: ClosedFormSolution,
    /// Scale of the target poses; `None` when their unit is known.
    scale: Option<f64>,
}

impl Begin {
    fn new(pairs: &[PosePair], calibration: &Fit, options: Options) -> Result<Self, HandEyeError> {
        let none = |reason| HandEyeError::NoSolution { method: METHOD, views: pairs.len(), reason };
        if options.free_scale {
            let (solution, scale) = scale::start(pairs)
                .ok_or_else(|| none("the robot's translations tell no scale of the target poses"))?;
            return Ok(Self { solution, scale: Some(scale) });
        }
        let methods = &calibration.methods;
        let candidates: Vec<_> = methods.iter().filter_map(|m| m.outcome.clone().ok()).collect();
        let of_view = |solution: &ClosedFormSolution, view: usize, _| misfit(&pairs[view], solution, 1.0);
        let found = consensus(pairs, &candidates, &Turns::default(), of_view).ok_or_else(|| {
            let first = methods.iter().find_map(|m| m.outcome.clone().err());
            first.unwrap_or_else(|| none("no closed form gave a finite answer"))
        })?;
        Ok(Self { solution: found.solution, scale: None })
    }
}

fn estimate(
    pairs: &[PosePair],
    begin: &Begin,
    middle: &Point3<f64>,
    options: Options,
    work: &Work<'_>,
) -> Result<ScreenedFit<PoseGraphSolution>, HandEyeError> {
    let estimator = OfPairs { pairs, begin, middle, cancel: work.cancel };
    if options.keep_outliers {
        let kept: Vec<usize> = (0..pairs.len()).collect();
        let solution = estimator.fit(&kept, None)?;
        let judged = estimator.judge(&solution, &kept)?;
        return Ok(ScreenedFit { solution, kept, judged });
    }
    let of_pair = |pair| misfit(pair, &begin.solution, begin.scale.unwrap_or(1.0));
    screened(&estimator, &pairs.iter().map(of_pair).collect::<Vec<_>>())
}

struct OfPairs<'a> {
    pairs: &'a [PosePair],
    begin: &'a Begin,
    middle: &'a Point3<f64>,
    cancel: &'a CancelToken,
}

impl Estimator for OfPairs<'_> {
    type Solution = PoseGraphSolution;

    fn fit(&self, kept: &[usize], near: Option<&PoseGraphSolution>) -> Result<PoseGraphSolution, HandEyeError> {
        if self.cancel.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let chosen: Vec<PosePair> = kept.iter().map(|i| self.pairs[*i]).collect();
        let start = near.map_or(self.begin.solution, |near| ClosedFormSolution {
            mount_from_camera: near.mount_from_camera,
            anchor_from_target: near.anchor_from_target,
        });
        match self.begin.scale {
            None => pose_graph::refine(&chosen, &start),
            Some(scale) => pose_graph::refine_scaled(&chosen, &start, near.map_or(scale, |near| near.scale)),
        }
    }

    fn judge(&self, solution: &PoseGraphSolution, kept: &[usize]) -> Result<Vec<Judged>, HandEyeError> {
        Ok(solution.judge(self.pairs, kept, self.middle))
    }
}

#[cfg(test)]
#[path = "pairs_tests.rs"]
mod tests;
