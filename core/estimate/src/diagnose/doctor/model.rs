//! The linear Gaussian model of pose pairs, and what hypotheses do in it.
//!
//! For view `i` let `e_i = log(C_i⁻¹ · chain_i)`, the target's pose by the chain against the one seen, both at a
//! solution that is nearly right. To first order
//!
//! `r_i = e_i + A_i x + y + B_i f + E_i a + Σ h_i θ_h`,  `r_i ~ N(0, Σ_i + robot_m² Q_i^t + robot_rad² Q_i^r)`
//!
//! with `x`, `y` the corrections of hand-eye and target, `f` those of lens and warp (with the information that the
//! corners hold on them apart from the poses), `a` the errors of the arm where its joints are known and else those of its field,
//! random effects with a level for each kind, `Σ_i` the covariance of the seen pose by corner noise, `Q_i = D_i D_iᵀ`
//! the robot's noise brought into the target's frame, and `h_i` the column of a hypothesis. The noise levels are found
//! by Fisher scoring on the restricted likelihood, under every hypothesis again. A hypothesis with `q` numbers is judged
//! by Wald's statistic `W = θᵀ Cov(θ)⁻¹ θ` against the F distribution.
//!
//! Reference: Patterson & Thompson 1971 (restricted likelihood); Cook & Weisberg 1982 (deletion of cases).

use std::cell::Cell;
use std::ops::Range;
use std::rc::Rc;

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use super::effect::Effect;
use super::views::SessionViews;
use crate::arm_fit::ArmFit;
use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::joint::chain::Chain;
use crate::handeye::joint::pose_dependent_error::{Axes, PER_FRAME, Places};
use crate::handeye::joint::{ArmErrors, LEVELS_OF_ARMS};
use crate::resolution;
use handeye_geometry::frames::Pose;
use handeye_geometry::se3;
use handeye_geometry::statistics::pooled_freedom;

/// Parts of the field, each with a level: errors of position and of orientation in the axes of the tip, and in those of the
/// base.
const FIELD_PARTS: usize = 4;
/// All kinds of random effects: those of the field, then the errors of the arm.
const PARTS: usize = FIELD_PARTS + LEVELS_OF_ARMS.len();
/// Smallest noise levels of the robot, m and rad: nothing is judged by less.
const LEAST: [f64; 2] = [resolution::PLACE_M, resolution::ANGLE_RAD];
/// Smallest levels of the random effects, m and rad: below it nothing changes now.
const LEAST_EFFECT: f64 = 1e-6;
/// Largest change of a variance in one step, as a logarithm.
const LARGEST_STEP: f64 = 2.0;
const MAX_STEPS: usize = 25;
/// Relative change of both variances that ends the search.
const SETTLED: f64 = 1e-2;
/// Number of slopes of the field that the data have to determine, in sum, for a field to be in the model. It then
/// explains about as much as a tenth of one more unknown would.
const LEAST_DETERMINED: f64 = 0.1;
/// Information on the logarithm of a variance of random effects below which it changes nothing: they then stand out of
/// the noise by a thirtieth.
const NO_EFFECT: f64 = 1e-3;

/// One view in the linear model.
#[derive(Clone)]
pub(super) struct Row {
    pub error: Vector6<f64>,
    pub by_hand_eye: Matrix6<f64>,
    pub by_robot: Matrix6<f64>,
    /// Jacobian of the residual with respect to the errors of the arm; no columns where they are not in the model.
    by_arm: DMatrix<f64>,
    camera: Matrix6<f64>,
    robot: [Matrix6<f64>; 2],
}

/// All views at a solution.
pub(super) struct Model<'a> {
    pub sight: &'a SessionViews,
    pub solution: ClosedFormSolution,
    pub rows: Vec<Row>,
    /// Places at which the pose-dependent errors of the robot are taken, where there are any.
    pub field: Option<Places>,
    /// Whether the field has a part in the axes of the base.
    in_base: bool,
    /// The arm, where its joints are known.
    arm: Option<KnownArm>,
    /// Work done with it and with models derived from it, in elements of normal equations that a view was added to: the cost of
    /// an examination, counted the same on every machine.
    work: Rc<Cell<u64>>,
}

/// An arm whose joints are known.
#[derive(Clone)]
pub(super) struct KnownArm {
    /// The errors at which the equations are linear, without their field.
    pub errors: ArmErrors,
    /// Whether the joint estimate, which weighs what arms and what sizes are likely, also estimates another size of the target.
    pub with_another_size: bool,
}

impl From<&ArmFit> for KnownArm {
    fn from(fit: &ArmFit) -> Self {
        Self { errors: fit.errors.clone().with_field(None), with_another_size: fit.others.free.scale }
    }
}

/// Variances of the robot per axis, of position (m²) and of orientation (rad²).
#[derive(Clone, Copy)]
pub(super) struct Levels {
    /// Variances of its noise, view by view.
    pub noise: [f64; 2],
    /// Variances of the pose-dependent error, at a typical place: in the axes of the tip, then in those of the base; and of the
    /// errors of its arm, angles (rad²), lengths (m²) and compliance (rad²).
    pub effects: [f64; PARTS],
}

impl Levels {
    /// A field as large as the noise, and an arm like others.
    pub fn even(noise: [f64; 2]) -> Self {
        let [angle, length, compliance] = LEVELS_OF_ARMS.map(|level| level * level);
        Self { noise, effects: [noise[0], noise[1], noise[0], noise[1], angle, length, compliance] }
    }
}

/// Which views and effects are in a fit.
#[derive(Clone, Default)]
pub(super) struct State {
    pub effects: Vec<Effect>,
    /// Outlier views.
    pub rejected: Vec<usize>,
}

/// The result of a fit.
pub(super) struct Fit {
    /// `[x (6), y (6), lens if free, slopes of the field if there is one, errors of the arm if it is known, numbers of the
    /// effects…]`
    pub theta: DVector<f64>,
    pub covariance: DMatrix<f64>,
    pub levels: Levels,
    /// Unknowns that the data determine: a random effect that follows its prior counts for less than one.
    pub determined: f64,
    /// Residual of every view, outliers included.
    pub residuals: Vec<Vector6<f64>>,
    pub weights: Vec<Matrix6<f64>>,
    /// Columns per view.
    pub designs: Vec<DMatrix<f64>>,
    /// Views in the fit.
    pub views: usize,
    /// Places of the random effects among the unknowns, in the order of their levels.
    random: [Range<usize>; PARTS],
}

impl<'a> Model<'a> {
    /// The model of the views, with its equations linear at the errors of the arm where these are known.
    pub fn new(
        sight: &'a SessionViews,
        solution: ClosedFormSolution,
        field: Option<Places>,
        arm: Option<KnownArm>,
    ) -> Self {
        let rows = sight
            .views
            .iter()
            .map(|view| {
                let tip = arm.as_ref().map(|arm| arm.errors.true_tip(&view.base_from_tip, &view.tip_from_joints));
                let base_from_tip = tip.as_ref().map_or(view.base_from_tip, |tip| {
                    Pose::from_isometry(view.base_from_tip.isometry() * tip.reported_from_true)
                });
                let chain = Chain::new(
                    sight.mode,
                    &base_from_tip,
                    &Vector6::zeros(),
                    &solution.mount_from_camera,
                    &solution.anchor_from_target,
                );
                let seen = nearer(sight, view, &chain.camera_from_target);
                let (t, r) = (chain.by_correction.fixed_columns::<3>(0), chain.by_correction.fixed_columns::<3>(3));
                let mut error = se3::log(&(seen.inverse() * chain.camera_from_target));
                let mut by_arm = DMatrix::zeros(6, 0);
                if let Some((tip, arm)) = tip.zip(arm.as_ref()) {
                    let columns = chain.by_correction * tip.by_errors;
                    // The unknowns are the errors themselves, of mean zero.
                    error -= &columns * DVector::from_column_slice(arm.errors.values());
                    by_arm = DMatrix::from_iterator(6, columns.ncols(), columns.iter().copied());
                }
                Row {
                    error,
                    by_hand_eye: chain.by_hand_eye,
                    by_robot: chain.by_correction,
                    by_arm,
                    camera: view.covariance,
                    robot: [t * t.transpose(), r * r.transpose()],
                }
            })
            .collect();
        Self { sight, solution, rows, field, in_base: false, arm, work: Rc::default() }
    }

    /// The same with a field that has a part in the axes of the base, too; `None` where the views do not allow one.
    ///
    /// Errors near the wrist turn with the tip. Errors near the base do not: links that are too long make the arm move too
    /// far, which a field in the axes of the tip cannot follow where the tip turns, and looks like another size of the target,
    /// or like a move. An effect that is significant beyond both parts is more than that.
    pub fn with_field_in_base(&self) -> Option<Self> {
        let field = Places::for_field(self.sight.views.iter().map(|view| &view.base_from_tip))?;
        let (rows, arm, work) = (self.rows.clone(), self.arm.clone(), Rc::clone(&self.work));
        Some(Self { sight: self.sight, solution: self.solution, rows, field: Some(field), in_base: true, arm, work })
    }

    /// The same views at the solution that a fit found.
    pub fn moved(&self, fit: &Fit) -> Self {
        let step = |at: usize| Vector6::from_iterator(fit.theta.rows(at, 6).iter().copied());
        let solution = ClosedFormSolution {
            mount_from_camera: self.solution.mount_from_camera.perturbed(&step(0)),
            anchor_from_target: self.solution.anchor_from_target.perturbed(&step(6)),
        };
        let of_arm = self.arm_at()..self.effects_at();
        let arm = self.arm.as_ref().and_then(|arm| {
            let values = fit.theta.rows(of_arm.start, of_arm.len()).iter().copied().collect();
            Some(KnownArm { errors: ArmErrors::new(arm.errors.joint_count(), values)?, ..*arm })
        });
        Self { work: Rc::clone(&self.work), ..Self::new(self.sight, solution, self.field, arm) }
    }

    /// Counts the work of normal equations of this many unknowns that every view was added to.
    pub fn count_work(&self, width: usize) {
        self.work.set(self.work.get() + (self.rows.len() * width * width) as u64);
    }

    /// The work so far.
    pub fn work(&self) -> u64 {
        self.work.get()
    }

    /// Mean squared displacement of the board by a residual, as a length, metres.
    pub fn displacement_m(&self, residual: &Vector6<f64>) -> f64 {
        (residual.transpose() * self.sight.displacement * residual)[0].max(0.0).sqrt()
    }

    /// First column of the field.
    fn field_at(&self) -> usize {
        12 + if self.sight.lens_free { self.sight.lens_count() } else { 0 }
    }

    /// First column of the errors of the arm.
    fn arm_at(&self) -> usize {
        self.field_at() + self.slopes()
    }

    /// First column of the effects.
    pub fn effects_at(&self) -> usize {
        self.arm_at() + self.arm.as_ref().map_or(0, |arm| arm.errors.values().len())
    }

    /// The arm, where its joints are known.
    pub fn arm(&self) -> Option<&KnownArm> {
        self.arm.as_ref()
    }

    /// Number of random effects.
    fn random(&self) -> usize {
        self.effects_at() - self.field_at()
    }

    /// Whether a fit found that errors depend on the robot's pose: the data determine a part of the slopes.
    pub fn has_field(&self, fit: &Fit) -> bool {
        let of_field = self.parts().into_iter().zip(fit.levels.effects).take(FIELD_PARTS);
        let determined = |(part, level): (Range<usize>, f64)| {
            part.len() as f64 - part.map(|i| fit.covariance[(i, i)] / level).sum::<f64>()
        };
        of_field.map(determined).sum::<f64>() > LEAST_DETERMINED
    }

    fn slopes(&self) -> usize {
        match (&self.field, self.in_base) {
            (None, _) => 0,
            (Some(_), false) => 2 * PER_FRAME,
            (Some(_), true) => 4 * PER_FRAME,
        }
    }

    fn design(&self, index: usize, state: &State, width: usize) -> DMatrix<f64> {
        let (row, view) = (&self.rows[index], &self.sight.views[index]);
        let mut design = DMatrix::zeros(6, width);
        design.view_mut((0, 0), (6, 6)).copy_from(&row.by_hand_eye);
        design.view_mut((0, 6), (6, 6)).fill_with_identity();
        let mut at = 12;
        if self.sight.lens_free {
            let lens = self.sight.lens_count();
            design.view_mut((0, at), (6, lens)).copy_from(&view.by_form.columns(0, lens));
            at += lens;
        }
        if let Some(places) = &self.field {
            let field = places.at(&view.base_from_tip);
            for axes in [Axes::Tip, Axes::Base].into_iter().take(if self.in_base { 2 } else { 1 }) {
                let columns = field.columns(&[axes], &row.by_robot);
                design.view_mut((0, at), (6, columns.ncols())).copy_from(&columns);
                at += columns.ncols();
            }
        }
        design.view_mut((0, at), row.by_arm.shape()).copy_from(&row.by_arm);
        at += row.by_arm.ncols();
        for effect in &state.effects {
            let columns = effect.columns(self, index);
            design.view_mut((0, at), (6, columns.ncols())).copy_from(&columns);
            at += columns.ncols();
        }
        design
    }

    fn width(&self, state: &State) -> usize {
        self.effects_at() + state.effects.iter().map(|e| e.numbers(self.sight.lens_count())).sum::<usize>()
    }

    /// Places of the form's columns among the unknowns.
    fn form_places(&self, state: &State) -> Vec<(usize, usize)> {
        let lens = self.sight.lens_count();
        let mut places: Vec<(usize, usize)> =
            if self.sight.lens_free { (0..lens).map(|i| (12 + i, i)).collect() } else { Vec::new() };
        let mut at = self.effects_at();
        for effect in &state.effects {
            places.extend(effect.form_columns(lens).into_iter().enumerate().map(|(k, i)| (at + k, i)));
            at += effect.numbers(lens);
        }
        places
    }

    /// Adds the information of the corners on lens and warp apart from the poses.
    fn add_form(&self, state: &State, normal: &mut DMatrix<f64>, right: &mut DVector<f64>) {
        let places = self.form_places(state);
        for &(i, a) in &places {
            right[i] -= self.sight.form_gradient[a];
            for &(j, b) in &places {
                normal[(i, j)] += self.sight.form_information[(a, b)];
            }
        }
    }

    /// Noise levels and unknowns of a state. `None` when the views leave something open.
    pub fn fit(&self, state: &State, start: Levels) -> Option<Fit> {
        let width = self.width(state);
        let inside: Vec<usize> = (0..self.rows.len()).filter(|i| !state.rejected.contains(i)).collect();
        if 6 * inside.len() <= width - self.random() {
            return None;
        }
        let designs: Vec<DMatrix<f64>> = (0..self.rows.len()).map(|i| self.design(i, state, width)).collect();
        let least: [f64; 2 + PARTS] = std::array::from_fn(|k| LEAST.get(k).copied().unwrap_or(LEAST_EFFECT).powi(2));
        let mut levels = Levels {
            noise: std::array::from_fn(|k| start.noise[k].max(least[k])),
            effects: std::array::from_fn(|k| start.effects[k].max(least[LEAST.len() + k])),
        };
        for step in 0..=MAX_STEPS {
            self.count_work(width);
            let solved = self.solve(state, &inside, &designs, levels)?;
            if step == MAX_STEPS {
                return Some(self.finished(solved, levels, designs, &inside));
            }
            let of_noise = self.scoring(&inside, &designs, &solved, levels.noise);
            let of_effects = self.scoring_of_effects(&solved, levels.effects);
            let mut settled = true;
            let changes = of_noise.into_iter().chain(of_effects);
            for ((v, least), c) in levels.noise.iter_mut().chain(&mut levels.effects).zip(least).zip(changes) {
                settled &= c.abs() < SETTLED || (c < 0.0 && *v <= least);
                *v = (*v * c.exp()).max(least);
            }
            if settled {
                return Some(self.finished(solved, levels, designs, &inside));
            }
        }
        None
    }

    fn weight(&self, index: usize, robot: [f64; 2]) -> Option<Matrix6<f64>> {
        let row = &self.rows[index];
        (row.camera + row.robot[0] * robot[0] + row.robot[1] * robot[1]).try_inverse()
    }

    fn solve(&self, state: &State, inside: &[usize], designs: &[DMatrix<f64>], levels: Levels) -> Option<Solution> {
        let width = designs.first()?.ncols();
        let weights: Vec<Matrix6<f64>> =
            (0..self.rows.len()).map(|i| self.weight(i, levels.noise)).collect::<Option<_>>()?;
        let mut normal = DMatrix::zeros(width, width);
        let mut right = DVector::zeros(width);
        for &i in inside {
            let weighted = weights[i] * &designs[i];
            normal.gemm_tr(1.0, &designs[i], &weighted, 1.0);
            right.gemv_tr(-1.0, &weighted, &self.rows[i].error, 1.0);
        }
        self.add_form(state, &mut normal, &mut right);
        for (part, level) in self.parts().into_iter().zip(levels.effects) {
            part.for_each(|i| normal[(i, i)] += level.recip());
        }
        let covariance = inverse(&normal)?;
        let theta = &covariance * &right;
        theta.iter().all(|v| v.is_finite()).then_some(Solution { weights, covariance, theta })
    }

    /// Places of the random effects among the unknowns, in the order of their levels.
    fn parts(&self) -> [Range<usize>; PARTS] {
        let (first, end) = (self.field_at(), self.arm_at());
        let of_arm = self.arm.as_ref().map_or([0; PARTS - FIELD_PARTS], |arm| arm.errors.counts());
        let mut at = end;
        std::array::from_fn(|k| {
            let Some(kind) = k.checked_sub(FIELD_PARTS) else {
                let slope = |k: usize| (first + k * PER_FRAME).min(end);
                return slope(k)..slope(k + 1);
            };
            let part = at..at + of_arm[kind];
            at = part.end;
            part
        })
    }

    /// Logarithmic step of the variances of the random effects: Fisher scoring on the restricted likelihood, in which
    /// `Zᵀ P Z = (1 - C / v) / v` for effects with the variance `v` and the covariance `C` after the fit.
    fn scoring_of_effects(&self, solved: &Solution, levels: [f64; PARTS]) -> [f64; PARTS] {
        let parts = self.parts();
        let mut gradient = nalgebra::SVector::<f64, PARTS>::zeros();
        let mut information = nalgebra::SMatrix::<f64, PARTS, PARTS>::zeros();
        for (k, part) in parts.iter().enumerate() {
            for (l, other) in parts.iter().enumerate() {
                let mut known = DMatrix::zeros(part.len(), other.len());
                if k == l {
                    known.fill_with_identity();
                }
                let within = (levels[k] * levels[l]).sqrt();
                known -= solved.covariance.view((part.start, other.start), known.shape()) / within;
                if k == l {
                    let squares = solved.theta.rows(part.start, part.len()).norm_squared();
                    gradient[k] = 0.5 * (squares / levels[k] - known.trace());
                }
                information[(k, l)] = 0.5 * known.norm_squared();
            }
        }
        for k in 0..PARTS {
            // An effect that does not show beyond the noise counts as zero.
            if information[(k, k)] < NO_EFFECT {
                information.fill_row(k, 0.0);
                information.fill_column(k, 0.0);
                (gradient[k], information[(k, k)]) = (0.0, 1.0);
            }
            // Axes of tip and base are the same where the tip hardly turns: the data then do not determine which it is.
            information[(k, k)] *= 1.0 + 1e-3;
        }
        let step = information.try_inverse().map_or_else(|| gradient * 0.0, |inverse| inverse * gradient);
        std::array::from_fn(|k| step[k].clamp(-LARGEST_STEP, LARGEST_STEP))
    }

    fn residual(&self, index: usize, design: &DMatrix<f64>, theta: &DVector<f64>) -> Vector6<f64> {
        let by_unknowns = design * theta;
        self.rows[index].error + Vector6::from_iterator(by_unknowns.iter().copied())
    }

    /// Logarithmic step of both variances.
    fn scoring(&self, inside: &[usize], designs: &[DMatrix<f64>], solved: &Solution, robot: [f64; 2]) -> [f64; 2] {
        let mut gradient = [0.0; 2];
        let mut information = nalgebra::Matrix2::zeros();
        for &i in inside {
            let weight = &solved.weights[i];
            let weighted_residual = weight * self.residual(i, &designs[i], &solved.theta);
            let weighted = weight * &designs[i];
            let shared = &weighted * &solved.covariance * weighted.transpose();
            let by_level = [0, 1].map(|j| weight * self.rows[i].robot[j]);
            for j in 0..2 {
                let q = &self.rows[i].robot[j];
                let squares = (weighted_residual.transpose() * q * weighted_residual)[0];
                let expected = by_level[j].trace() - (shared * q).trace();
                gradient[j] += 0.5 * (squares - expected);
                for k in 0..2 {
                    information[(j, k)] += 0.5 * (by_level[j] * by_level[k]).trace();
                }
            }
        }
        let mut scaled = nalgebra::Vector2::zeros();
        for j in 0..2 {
            scaled[j] = gradient[j] * robot[j];
            for k in 0..2 {
                information[(j, k)] *= robot[j] * robot[k];
            }
            // A level that does not show has no information; it then goes down slowly.
            information[(j, j)] += 1e-6;
        }
        let step = information.try_inverse().map_or_else(|| scaled * 0.1, |inverse| inverse * scaled);
        [0, 1].map(|j: usize| step[j].clamp(-LARGEST_STEP, LARGEST_STEP))
    }

    fn finished(&self, solved: Solution, levels: Levels, designs: Vec<DMatrix<f64>>, inside: &[usize]) -> Fit {
        let Solution { weights, covariance, theta } = solved;
        let parts = self.parts().into_iter().zip(levels.effects);
        let by_prior: f64 = parts.map(|(part, level)| part.map(|i| covariance[(i, i)] / level).sum::<f64>()).sum();
        let determined = theta.len() as f64 - by_prior;
        let residuals = designs.iter().enumerate().map(|(i, design)| self.residual(i, design, &theta)).collect();
        let (views, random) = (inside.len(), self.parts());
        Fit { theta, covariance, levels, determined, residuals, weights, designs, views, random }
    }
}

struct Solution {
    weights: Vec<Matrix6<f64>>,
    covariance: DMatrix<f64>,
    theta: DVector<f64>,
}

/// The pose seen, or its mirrored twin where the corners do not distinguish them and the chain does.
fn nearer(
    sight: &SessionViews,
    view: &super::views::SessionView,
    chain: &nalgebra::Isometry3<f64>,
) -> nalgebra::Isometry3<f64> {
    let off = |pose: &nalgebra::Isometry3<f64>| {
        crate::diagnose::hypotheses::agreement::misfit(&sight.target.outer, chain, pose)
    };
    match &view.alternative {
        Some(other) if off(other) < off(&view.camera_from_target) => *other,
        _ => view.camera_from_target,
    }
}

/// Inverse of a positive definite matrix of unlike units; `None` when it is singular.
pub(super) fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = matrix.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { f64::NAN });
    let n = matrix.nrows();
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    if scaled.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let cholesky = scaled.cholesky()?;
    // The diagonal is one, so a pivot near the rounding means that columns depend on each other.
    if cholesky.l_dirty().diagonal().min() < 1e-7 {
        return None;
    }
    let inverse = cholesky.inverse();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

impl Fit {
    /// Whether the errors of an arm are among the unknowns.
    pub fn has_arm(&self) -> bool {
        self.random[FIELD_PARTS..].iter().any(|part| !part.is_empty())
    }

    /// Unknowns.
    pub fn width(&self) -> usize {
        self.theta.len()
    }

    /// Degrees of freedom of the noise levels, taken with care: position and orientation share the numbers.
    fn freedom_of_noise(&self) -> f64 {
        (0.5 * (6.0 * self.views as f64 - self.determined)).max(1.0)
    }

    /// Degrees of freedom of the variance of some unknowns. The part due to random effects is proportional to their variance, which
    /// is estimated only from those that the data determine: at most nine slopes in each part of a field, however many views there
    /// are. The rest is the noise's.
    pub fn freedom(&self, at: usize, count: usize) -> f64 {
        let covariance = self.covariance.view((at, at), (count, count)).into_owned();
        let by_effects = |part: &Range<usize>| self.covariance.view((at, part.start), (count, part.len())).into_owned();
        self.pooled(&covariance, by_effects)
    }

    /// The same for the distance of a view that is not in the fit from what is expected of it.
    pub fn freedom_of_view(&self, view: usize) -> Option<f64> {
        let design = &self.designs[view];
        let own = self.weights[view].try_inverse()?;
        let shared = design * &self.covariance * design.transpose();
        let by_effects = |part: &Range<usize>| design * self.covariance.columns(part.start, part.len());
        Some(self.pooled(&DMatrix::from_fn(6, 6, |i, j| own[(i, j)] + shared[(i, j)]), by_effects))
    }

    /// Degrees of freedom by a covariance, and the covariance of its numbers with some of the random effects: the derivative of
    /// the covariance `C` by the log of the variance `v` of these is `C_s C_sᵀ / v`.
    fn pooled(&self, covariance: &DMatrix<f64>, by_effects: impl Fn(&Range<usize>) -> DMatrix<f64>) -> f64 {
        let Some(inverse) = inverse(covariance) else { return self.freedom_of_noise() };
        let random = self.random.iter().zip(self.levels.effects).filter(|(part, _)| !part.is_empty());
        let of_effects = random.map(|(part, level)| {
            let with = by_effects(part);
            let share = (&inverse * &with).dot(&with) / (level * covariance.nrows() as f64);
            let known = part.len() as f64 - part.clone().map(|i| self.covariance[(i, i)]).sum::<f64>() / level;
            (share, known)
        });
        let of_effects: Vec<(f64, f64)> = of_effects.collect();
        let of_noise = 1.0 - of_effects.iter().map(|(share, _)| share).sum::<f64>();
        pooled_freedom(of_effects.into_iter().chain([(of_noise, self.freedom_of_noise())]))
    }

    /// Wald's statistic of `count` unknowns from `at`.
    pub fn wald(&self, at: usize, count: usize) -> Option<f64> {
        let theta = self.theta.rows(at, count).into_owned();
        let information = inverse(&self.covariance.view((at, at), (count, count)).into_owned())?;
        Some(theta.dot(&(information * &theta)))
    }

    /// Wald's statistic of the residuals of views that are not in the fit, by their covariance.
    pub fn wald_of_views(&self, views: &[usize]) -> Option<f64> {
        let n = 6 * views.len();
        let mut covariance = DMatrix::zeros(n, n);
        let mut stacked = DVector::zeros(n);
        for (a, &i) in views.iter().enumerate() {
            stacked.rows_mut(6 * a, 6).copy_from(&self.residuals[i]);
            let own = self.weights[i].try_inverse()?;
            for (b, &j) in views.iter().enumerate() {
                let shared = &self.designs[i] * &self.covariance * self.designs[j].transpose();
                let mut block = covariance.view_mut((6 * a, 6 * b), (6, 6));
                block.copy_from(&shared);
                if a == b {
                    block += own;
                }
            }
        }
        Some(stacked.dot(&(inverse(&covariance)? * &stacked)))
    }

    /// Noise of the robot per axis, metres and radians.
    pub fn robot_sigma(&self) -> (f64, f64) {
        (self.levels.noise[0].sqrt(), self.levels.noise[1].sqrt())
    }
}
