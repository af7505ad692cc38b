//! What the images alone determine: the target's pose in every view, its precision, and how lens and target shape
//! change it.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Point3};

use crate::diagnose::hypotheses::SeenTarget;
use crate::handeye::joint::CornerWeights;
use crate::handeye::numbering::Turns;
use crate::handeye::{Mode, subset};
use crate::intrinsics::evidence::{Scatter, Score, scatter};
use crate::intrinsics::{self, Options, SeenView};
use crate::{CameraKnowledge, KnownLens, Observations, ObservedView, resolution};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::planar_pose::refine::refine;
use handeye_geometry::planar_pose::{self, PlanarPose};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3::skew;
use handeye_geometry::statistics::median;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::view_equations::{FreeParameters, PoseEquations, ViewInput, Whitener};
use handeye_wording::Text;
use handeye_wording::text;

/// A corner this many robust standard deviations from where its view puts it is wrong. Real detectors have long tails,
/// so the limit is wide.
const WRONG_SIGMAS: f64 = 10.0;
/// And at least this far, pixels: less does not move a pose of many corners.
const WRONG_PX: f64 = 1.0;
/// At most this part of a view's corners is called wrong; beyond it the view is.
const WRONG_PART: f64 = 0.2;
/// Rounds of leaving the worst corners out and fitting again.
const ROUNDS: usize = 6;
/// Steps to the pose of a view from the one without the noise that its corners share.
const MOST_STEPS: usize = 20;
/// A view whose corners are noisier than this many times the typical one is weighted by its own noise.
const NOISY: f64 = 2.0;

/// A row of the pose table, whether the target was seen in its image or not.
pub(crate) struct TableRow {
    pub name: String,
    pub base_from_tip: Option<Pose<Base, Tip>>,
}

/// One view with a robot pose and a pose of the target.
pub struct SessionView {
    pub(crate) name: String,
    /// Its row in the table of those in the fit.
    pub row: usize,
    pub(crate) base_from_tip: Pose<Base, Tip>,
    /// The target as the camera saw it.
    pub camera_from_target: Isometry3<f64>,
    /// The other pose of the target, where the corners leave it possible.
    pub(crate) alternative: Option<Isometry3<f64>>,
    /// Covariance of the target's pose by corner noise, right perturbation; zero where the pose was given.
    pub covariance: Matrix6<f64>,
    /// Jacobian of the measured pose by lens (then warp x, y): the measured pose is off by minus this.
    pub(crate) by_form: DMatrix<f64>,
    pub(crate) tip_from_joints: Vec<Isometry3<f64>>,
    /// Wrong corners, by their index in the target.
    pub(crate) wrong_corners: Vec<usize>,
    pub(crate) corners: usize,
}

/// All views as seen by the camera.
pub struct SessionViews {
    pub(crate) mode: Mode,
    /// One per view that counts.
    pub views: Vec<SessionView>,
    /// Every row of the table that is in the fit.
    pub(crate) table: Vec<TableRow>,
    /// Names of views with numbers that are not finite.
    pub(crate) not_finite: Vec<String>,
    /// The camera; `None` for poses measured elsewhere.
    pub intrinsics: Option<Intrinsics>,
    pub(crate) lens_free: bool,
    /// Noise of a corner per axis, pixels.
    pub(crate) corner_px: Option<f64>,
    /// What the corners, apart from the poses, determine of lens and warp: information and gradient in units of the
    /// noise.
    pub(crate) form_information: DMatrix<f64>,
    pub(crate) form_gradient: DVector<f64>,
    /// Degrees of freedom of the scatter of the views, on which the variances of a given lens and of a bend rest.
    pub(crate) form_freedom: f64,
    /// The target as the camera sees it.
    pub target: SeenTarget,
    /// `xiᵀ K xi` is the mean squared displacement of the target's points by a small motion `xi` of it, m².
    pub(crate) displacement: Matrix6<f64>,
}

/// A view with its row in the table.
type Row<'a> = (usize, &'a ObservedView);

struct Fit {
    corners: Corners,
    wrong: Vec<usize>,
    pose: PlanarPose,
    /// Weights of the corners: equal, unless their detector states a common covariance.
    whitener: Whitener,
    /// Variance of a corner per axis by the residuals of the view.
    variance_px2: f64,
}

impl SessionViews {
    /// Number of joints that are known in every view.
    pub(crate) fn joints(&self) -> usize {
        self.views.iter().map(|v| v.tip_from_joints.len()).min().unwrap_or(0)
    }

    /// Looks at all views in the fit that have a robot pose and the target. `lens` is the camera as the corners alone show it,
    /// where that was found before. `Err` says why nothing can be tested.
    pub fn new(observations: &Observations, lens: Option<Intrinsics>) -> Result<Self, Text> {
        let Some(mode) = observations.mode else { return Err(text!("there are no robot poses")) };
        let in_fit: Vec<&ObservedView> = observations.views.iter().filter(|v| v.in_fit).collect();
        let rows = in_fit.iter().copied().enumerate();
        let (finite, broken): (Vec<Row<'_>>, Vec<Row<'_>>) = rows.partition(|(_, v)| is_finite(v));
        let not_finite = broken.iter().map(|(_, v)| v.name.clone()).collect();
        let seen: Vec<Row<'_>> = finite
            .into_iter()
            .filter(|(_, v)| v.base_from_tip.is_some() && (v.corners.is_some() || v.camera_from_target.is_some()))
            .collect();
        let seen: Vec<Row<'_>> = subset::spread(seen.len(), super::MOST_VIEWS).into_iter().map(|i| seen[i]).collect();
        let row = |view: &&ObservedView| TableRow {
            name: view.name.clone(),
            base_from_tip: view.base_from_tip.filter(Pose::is_finite),
        };
        let (outer, displacement) = board(&observations.target.points());
        let mut sight = Self {
            mode,
            views: Vec::new(),
            table: in_fit.iter().map(row).collect(),
            not_finite,
            intrinsics: None,
            lens_free: !matches!(observations.camera, CameraKnowledge::Fixed(_)),
            corner_px: None,
            form_information: DMatrix::zeros(0, 0),
            form_gradient: DVector::zeros(0),
            form_freedom: f64::INFINITY,
            // Numbered as they are: what may be numbered otherwise was renumbered before.
            target: SeenTarget { outer, turns: Turns::default(), distance_m: 0.0 },
            displacement,
        };
        if seen.iter().all(|(_, v)| v.corners.is_none()) {
            sight.lens_free = false;
            sight.take_poses(&seen);
        } else {
            let with_corners: Vec<Row<'_>> = seen.into_iter().filter(|(_, v)| v.corners.is_some()).collect();
            sight.take_corners(observations, &with_corners, lens)?;
        }
        let middle = Point3::from(outer.iter().map(|p| p.coords).sum::<nalgebra::Vector3<f64>>() / 4.0);
        let distances = sight.views.iter().map(|v| (v.camera_from_target * middle).coords.norm());
        sight.target.distance_m = median(distances).unwrap_or(0.0);
        Ok(sight)
    }

    fn take_poses(&mut self, seen: &[Row<'_>]) {
        for (row, view) in seen {
            let (Some(base_from_tip), Some(pose)) = (view.base_from_tip, view.camera_from_target) else { continue };
            self.views.push(SessionView {
                name: view.name.clone(),
                row: *row,
                base_from_tip,
                camera_from_target: *pose.isometry(),
                alternative: None,
                covariance: Matrix6::zeros(),
                by_form: DMatrix::zeros(6, 0),
                tip_from_joints: view.tip_from_joints.clone(),
                wrong_corners: Vec::new(),
                corners: 0,
            });
        }
    }

    fn take_corners(
        &mut self,
        observations: &Observations,
        seen: &[Row<'_>],
        lens: Option<Intrinsics>,
    ) -> Result<(), Text> {
        let all: Vec<Corners> = seen.iter().map(|(_, v)| v.corners.clone().unwrap_or_default()).collect();
        let mut camera = lens.map_or_else(|| camera_of(observations, &all), Ok)?;
        let mut fits = fit_all(&all, &observations.target, &camera);
        if self.lens_free && lens.is_none() && fits.iter().flatten().any(|f| !f.wrong.is_empty()) {
            let kept: Vec<Corners> = fits.iter().flatten().map(|f| f.corners.clone()).collect();
            camera = camera_of(observations, &kept)?;
            fits = fit_all(&all, &observations.target, &camera);
        }
        self.intrinsics = Some(camera);
        let points = BoardPoints::new(&observations.target.points());
        with_what_corners_share(&mut fits, &camera, &points);
        let free = FreeParameters { lens: true, warp: true, ..FreeParameters::default() };
        let count = free.count(&camera);
        let variances = fits.iter().flatten().map(|fit| fit.variance_px2);
        let Some(typical) = median(variances) else {
            return Err(text!("the target's pose could not be found in any view"));
        };
        // Nothing is judged by less.
        let typical = typical.max(resolution::CORNER_PX.powi(2));
        self.corner_px = Some(typical.sqrt());
        let mut scores = Vec::with_capacity(seen.len());
        for ((row, view), fit) in seen.iter().zip(fits) {
            let (Some(fit), Some(base_from_tip)) = (fit, view.base_from_tip) else { continue };
            let pose = *fit.pose.best.camera_from_target.isometry();
            let seen = ViewInput {
                intrinsics: &camera,
                board: &points,
                shape: &BoardShape::FLAT,
                corners: &fit.corners,
                whitener: &fit.whitener,
                depths: None,
            };
            let Ok(equations) = PoseEquations::new(&seen, &pose, free) else { continue };
            let Some(inverse) = equations.pose.try_inverse() else { continue };
            let own = fit.variance_px2;
            let variance = if own > NOISY * NOISY * typical { own } else { typical };
            let by_pose = equations.pose_by_form.columns(0, count).into_owned();
            let by_form = inverse * &by_pose;
            let information = equations.form.view((0, 0), (count, count)) - by_pose.transpose() * &by_form;
            let gradient = equations.form_gradient.rows(0, count) - by_form.transpose() * equations.pose_gradient;
            scores.push(Score { information: information / variance, gradient: gradient / variance });
            let possible = fit.pose.possible_alternative(fit.corners.len(), variance.sqrt());
            self.views.push(SessionView {
                name: view.name.clone(),
                row: *row,
                base_from_tip,
                camera_from_target: pose,
                alternative: possible.map(|a| *a.camera_from_target.isometry()),
                covariance: inverse * resolution::pose_variance_px2(variance, fit.corners.len()),
                by_form: DMatrix::from_iterator(6, count, by_form.iter().copied()),
                tip_from_joints: view.tip_from_joints.clone(),
                wrong_corners: fit.wrong,
                corners: view.corners.as_ref().map_or(0, |corners| corners.len()),
            });
        }
        self.take_form(&scores, count);
        if let CameraKnowledge::Near(known) = observations.camera {
            // The equations are linear at the lens given, which what is known of it pulls to.
            let information = known.information();
            let mut of_lens = self.form_information.view_mut((0, 0), information.shape());
            of_lens += information;
        }
        Ok(())
    }

    /// Sums the information of all views on the form. Corners of one view have common errors (blur, an inaccurate print), so
    /// their information on a given lens is reduced by as much as the views scatter more than with independent corners.
    fn take_form(&mut self, scores: &[Score], count: usize) {
        self.form_information = scores.iter().fold(DMatrix::zeros(count, count), |sum, score| sum + &score.information);
        self.form_gradient = scores.iter().fold(DVector::zeros(count), |sum, score| sum + &score.gradient);
        if self.lens_free {
            return;
        }
        if let Some(scatter) = pinhole_scatter(scores) {
            let times = scatter.ratio.max(1.0);
            self.form_information /= times;
            self.form_gradient /= times;
            self.form_freedom = scatter.degrees_of_freedom;
        }
    }

    /// Number of lens parameters among the form's; the two warps follow.
    pub(crate) fn lens_count(&self) -> usize {
        self.intrinsics.as_ref().map_or(0, Intrinsics::parameter_count)
    }
}

/// Scatter of the views' estimates of focal lengths and centre, the rest of the lens as given; `None` where they do not
/// determine them.
fn pinhole_scatter(scores: &[Score]) -> Option<Scatter> {
    const PINHOLE: usize = 4;
    let of_pinhole = |score: &Score| Score {
        information: score.information.view((0, 0), (PINHOLE, PINHOLE)).into_owned(),
        gradient: score.gradient.rows(0, PINHOLE).into_owned(),
    };
    let scores: Vec<Score> = scores.iter().map(of_pinhole).collect();
    let information = scores.iter().fold(DMatrix::zeros(PINHOLE, PINHOLE), |sum, score| sum + &score.information);
    let gradient = scores.iter().fold(DVector::zeros(PINHOLE), |sum, score| sum + &score.gradient);
    let covariance = super::model::inverse(&information)?;
    let step = -(&covariance * gradient);
    scatter(&scores, &covariance, &step, (0, PINHOLE))
}

impl Fit {
    fn new(corners: Corners, wrong: Vec<usize>, pose: PlanarPose) -> Self {
        let variance_px2 = pose.sigma_px(corners.len()).powi(2);
        Self { corners, wrong, pose, whitener: Whitener::Alike, variance_px2 }
    }
}

/// Fits poses again where a detector states a common covariance of the corners of a view, as those of hard edges do: with a board
/// along the pixels the residuals do not show how far all of it may be off.
fn with_what_corners_share(fits: &mut [Option<Fit>], camera: &Intrinsics, points: &BoardPoints) {
    let stated = fits.iter().flatten().filter(|fit| fit.corners.covariance().is_some());
    let Some(weights) = CornerWeights::stated(stated.flat_map(|fit| fit.corners.iter())) else { return };
    for fit in fits.iter_mut().flatten().filter(|fit| fit.corners.covariance().is_some()) {
        let whitener = weights.whitener(&fit.corners);
        let seen = ViewInput {
            intrinsics: camera,
            board: points,
            shape: &BoardShape::FLAT,
            corners: &fit.corners,
            whitener: &whitener,
            depths: None,
        };
        let Some(minimum) = refine(&seen, fit.pose.best.camera_from_target.isometry(), MOST_STEPS) else { continue };
        let spare = (2 * fit.corners.len()).saturating_sub(6).max(1);
        fit.pose.best.camera_from_target = Pose::from_isometry(minimum.pose);
        (fit.whitener, fit.variance_px2) = (whitener, minimum.squared_px / spare as f64);
    }
}

fn is_finite(view: &ObservedView) -> bool {
    view.base_from_tip.is_none_or(|p| p.is_finite())
        && view.camera_from_target.is_none_or(|p| p.is_finite())
        && view.corners.iter().flatten().all(|c| c.px.iter().all(|v| v.is_finite()))
}

/// Four outer points of a target and how motions displace its points.
fn board(points: &[Point3<f64>]) -> ([Point3<f64>; 4], Matrix6<f64>) {
    let range = |axis: usize| {
        let values = points.iter().map(|p| p[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let ((x0, x1), (y0, y1)) = if points.is_empty() { ((0.0, 0.0), (0.0, 0.0)) } else { (range(0), range(1)) };
    let outer = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| Point3::new(x, y, 0.0));
    let mut displacement = Matrix6::zeros();
    for point in points {
        let mut by_motion = nalgebra::SMatrix::<f64, 3, 6>::zeros();
        by_motion.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        by_motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&point.coords));
        displacement += by_motion.transpose() * by_motion / points.len() as f64;
    }
    (outer, displacement)
}

/// The camera given, or found from the corners alone: the robot may be what is wrong.
fn camera_of(observations: &Observations, views: &[Corners]) -> Result<Intrinsics, Text> {
    match observations.camera {
        CameraKnowledge::Fixed(intrinsics) | CameraKnowledge::Near(KnownLens { intrinsics, .. }) => Ok(intrinsics),
        CameraKnowledge::Estimate { model, start } => {
            let chosen = subset::spread(views.len(), subset::MOST_VIEWS);
            let chosen: Vec<SeenView<'_>> = chosen.into_iter().map(|i| SeenView::unweighted(&views[i])).collect();
            let options = Options { start, ..Options::new(model) };
            let (target, size) = (&observations.target, observations.image_size);
            intrinsics::solve(&chosen, target, size, &options, &CancelToken::default())
                .map(|found| found.intrinsics)
                .map_err(|error| text!("the camera could not be calibrated: {error}", error = error))
        }
    }
}

fn fit_all(views: &[Corners], target: &TargetSpec, camera: &Intrinsics) -> Vec<Option<Fit>> {
    let solve = |corners: &[Corner]| planar_pose::solve(corners, target, camera).ok();
    let mut fits: Vec<Option<Fit>> =
        views.iter().map(|corners| Some(Fit::new(corners.clone(), Vec::new(), solve(corners)?))).collect();
    let Some(typical) = median(fits.iter().flatten().map(|f| f.pose.best.rms_px)) else {
        return fits;
    };
    let limit = (WRONG_SIGMAS * typical / std::f64::consts::SQRT_2).max(WRONG_PX);
    let points = target.points();
    for fit in fits.iter_mut().flatten() {
        reject_wrong(fit, limit, &points, camera, &solve);
    }
    fits
}

/// Leaves the worst corners of a view out until none is beyond the limit. A view with too many of them is left whole: it
/// is wrong as such.
fn reject_wrong(
    fit: &mut Fit,
    limit_px: f64,
    points: &[Point3<f64>],
    camera: &Intrinsics,
    solve: &impl Fn(&[Corner]) -> Option<PlanarPose>,
) {
    let most = (WRONG_PART * fit.corners.len() as f64) as usize;
    let (mut corners, mut wrong, mut pose) = (fit.corners.to_vec(), Vec::new(), fit.pose);
    for _ in 0..ROUNDS {
        let chain = pose.best.camera_from_target;
        let off = |c: &Corner| {
            points
                .get(c.index)
                .and_then(|p| camera.project(&(chain.isometry() * p)).ok())
                .map_or(f64::INFINITY, |px| (px - c.px).norm())
        };
        let worst = corners.iter().map(&off).fold(0.0, f64::max);
        if worst <= limit_px {
            if !wrong.is_empty() {
                *fit = Fit::new(corners.into(), wrong, pose);
            }
            return;
        }
        // One wrong corner drags its neighbours: only those near the worst go.
        let (kept, gone): (Vec<Corner>, Vec<Corner>) =
            corners.iter().copied().partition(|c| off(c) <= limit_px.max(0.5 * worst));
        wrong.extend(gone.iter().map(|c| c.index));
        if wrong.len() > most {
            return;
        }
        let Some(next) = solve(&kept) else { return };
        (corners, pose) = (kept, next);
    }
}
