//! The normal equations of one view in the unknowns that all views share and in its own pose correction.
//!
//! The shared unknowns are `[mount_from_camera (6), anchor_from_target (6), lens and shape of the target, joints, slopes of
//! the robot's field]`.
//! Blocks are kept without the noise levels, so that these can be varied cheaply.

use nalgebra::{Cholesky, Const, DMatrix, Matrix6, Matrix6xX, SMatrix, SVector, Vector3, Vector6};

use super::Noise;
use super::chain::{Chain, MAX_JOINTS};
use super::field::{self, SLOPES};
use crate::geometry::view_equations::{MAX_FORM, PoseEquations};

/// Most shared unknowns.
pub const MAX_SHARED: usize = 12 + MAX_FORM + MAX_JOINTS + SLOPES;

pub type SharedMatrix = SMatrix<f64, MAX_SHARED, MAX_SHARED>;
pub type SharedVector = SVector<f64, MAX_SHARED>;
pub type SixByShared = SMatrix<f64, 6, MAX_SHARED>;

/// Where which shared unknown is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Number of unknowns of lens and target shape.
    pub form: usize,
    /// Number of joint offsets.
    pub joints: usize,
    /// Number of slopes of the robot's field.
    pub field: usize,
}

impl Layout {
    /// First unknown of lens and shape.
    pub const FORM_AT: usize = 12;

    pub fn joints_at(self) -> usize {
        Self::FORM_AT + self.form
    }

    pub fn field_at(self) -> usize {
        self.joints_at() + self.joints
    }

    /// Number of shared unknowns.
    pub fn count(self) -> usize {
        self.field_at() + self.field
    }
}

/// Weights of the two parts of a view's residuals: inverse variances, per squared pixel.
#[derive(Debug, Clone, Copy)]
pub struct PixelWeights {
    /// Of the six numbers that a pose of the view could explain.
    pub pose: f64,
    /// Of all others.
    pub rest: f64,
}

impl PixelWeights {
    pub fn new(noise: &Noise) -> Self {
        Self { pose: (noise.corner_px.powi(2) + noise.view_px.powi(2)).recip(), rest: noise.corner_px.powi(-2) }
    }
}

/// Weight matrix of a pose correction: the inverse of its prior covariance.
pub fn prior_weight(noise: &Noise) -> Vector6<f64> {
    let (t, r) = (noise.robot_m.powi(-2), noise.robot_rad.powi(-2));
    Vector6::new(t, t, t, r, r, r)
}

/// What remains of a view's residuals once its own pose has taken up what it can: a matter of the form alone.
#[derive(Debug, Clone)]
pub struct Rest {
    /// `Jfᵀ Jf − Jfᵀ Jp (Jpᵀ Jp)⁻¹ Jpᵀ Jf`
    pub form: SMatrix<f64, MAX_FORM, MAX_FORM>,
    /// `Jfᵀ r` less the pose's part.
    pub gradient: SVector<f64, MAX_FORM>,
    /// `rᵀ r` less the pose's part, squared pixels.
    pub squared_px: f64,
}

impl Rest {
    /// Of no view.
    pub fn nothing() -> Self {
        Self { form: SMatrix::zeros(), gradient: SVector::zeros(), squared_px: 0.0 }
    }
}

/// One view, linearised: `r` are its pixel residuals, `s` the shared unknowns, `d` its correction, `p` its own pose.
///
/// The residuals are split into the six numbers that a pose of the view could explain and the rest, because errors that
/// all corners of a view share (lens, shape of the target, blur, light) look like a pose and weigh more than `n` corners
/// that err independently would say. All members but [`Self::rest`] are of the six.
#[derive(Debug, Clone)]
pub struct ViewBlock {
    /// In the view's own pose and the form.
    pub equations: PoseEquations,
    pub rest: Rest,
    /// How the pose turns with the shared unknowns; the columns of the form are zero.
    pub pose_by_shared: SixByShared,
    /// `Jdᵀ Js`
    pub cross: SixByShared,
    /// `Jdᵀ Jd`
    pub own: Matrix6<f64>,
    /// `Jsᵀ r`
    pub shared_gradient: SharedVector,
    /// `Jdᵀ r`
    pub own_gradient: Vector6<f64>,
}

impl ViewBlock {
    /// `None` when the corners of the view determine no pose. `place` is where the robot's field is taken, if there is one.
    pub fn new(
        chain: &Chain,
        mut equations: PoseEquations,
        layout: Layout,
        place: Option<&Vector3<f64>>,
    ) -> Option<Self> {
        let rest = own_pose_eliminated(&mut equations)?;
        let mut pose_by_shared = SixByShared::zeros();
        pose_by_shared.fixed_view_mut::<6, 6>(0, 0).copy_from(&chain.by_hand_eye);
        pose_by_shared.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
        for j in 0..layout.joints {
            pose_by_shared.set_column(layout.joints_at() + j, &chain.by_joints.column(j));
        }
        let d = chain.by_correction;
        if let Some(place) = place {
            pose_by_shared.columns_mut(layout.field_at(), SLOPES).copy_from(&field::columns(place, &d));
        }
        let pose_d = equations.pose * d;
        let mut cross = SixByShared::zeros();
        let mut shared_gradient = SharedVector::zeros();
        for j in 0..layout.count() {
            let column: Vector6<f64> = pose_by_shared.column(j).into_owned();
            cross.set_column(j, &(pose_d.tr_mul(&column)));
            shared_gradient[j] = column.dot(&equations.pose_gradient);
        }
        for j in 0..layout.form {
            let column: Vector6<f64> = equations.pose_by_form.column(j).into_owned();
            cross.set_column(Layout::FORM_AT + j, &d.tr_mul(&column));
            shared_gradient[Layout::FORM_AT + j] = equations.form_gradient[j];
        }
        let own = d.tr_mul(&pose_d);
        let own_gradient = d.tr_mul(&equations.pose_gradient);
        Some(Self { equations, rest, pose_by_shared, cross, own, shared_gradient, own_gradient })
    }

    pub fn corner_count(&self) -> usize {
        self.equations.corners
    }

    /// Weighted squares of all residuals.
    pub fn weighted_squares(&self, weights: PixelWeights) -> f64 {
        self.equations.squared_px * weights.pose + self.rest.squared_px * weights.rest
    }

    /// `Jpᵀ Js`: how the residuals' pose columns go with the shared unknowns.
    pub fn pose_shared(&self, layout: Layout) -> SixByShared {
        let mut out = SixByShared::zeros();
        for j in 0..layout.count() {
            let column: Vector6<f64> = self.pose_by_shared.column(j).into_owned();
            out.set_column(j, &(self.equations.pose * column));
        }
        for j in 0..layout.form {
            out.set_column(Layout::FORM_AT + j, &self.equations.pose_by_form.column(j));
        }
        out
    }

    /// Adds `Jsᵀ Js` of the pose's part to the upper triangle of a sum.
    pub fn add_shared(&self, layout: Layout, sum: &mut SharedMatrix) {
        let pose_shared = self.pose_shared(layout);
        let form = Layout::FORM_AT..layout.joints_at();
        for j in 0..layout.count() {
            for i in 0..=j {
                let both_form = form.contains(&i) && form.contains(&j);
                sum[(i, j)] += if both_form {
                    self.equations.form[(i - Layout::FORM_AT, j - Layout::FORM_AT)]
                } else if form.contains(&i) {
                    pose_shared.column(i).dot(&self.pose_by_shared.column(j))
                } else {
                    self.pose_by_shared.column(i).dot(&pose_shared.column(j))
                };
            }
        }
    }

    /// `tr(Jsᵀ Js C)`: the expected squares of the residuals that shared unknowns of covariance `C` cause.
    pub fn shared_trace(&self, layout: Layout, covariance: &DMatrix<f64>) -> f64 {
        let mut matrix = SharedMatrix::zeros();
        self.add_shared(layout, &mut matrix);
        add_form(layout, &self.rest.form, 1.0, &mut matrix);
        let n = layout.count();
        (0..n)
            .map(|j| {
                let above: f64 = (0..j).map(|i| 2.0 * matrix[(i, j)] * covariance[(i, j)]).sum();
                above + matrix[(j, j)] * covariance[(j, j)]
            })
            .sum()
    }

    /// What the view says about the shared unknowns once its correction is eliminated, and the gradient that goes with it
    /// at a correction; `None` when the correction is undetermined.
    pub fn information(
        &self,
        layout: Layout,
        noise: &Noise,
        correction: &Vector6<f64>,
    ) -> Option<(DMatrix<f64>, SharedVector)> {
        let weights = PixelWeights::new(noise);
        let own = Own::new(self, layout.count(), correction, weights.pose, &prior_weight(noise), 0.0)?;
        let mut matrix = SharedMatrix::zeros();
        self.add_shared(layout, &mut matrix);
        matrix *= weights.pose;
        add_form(layout, &self.rest.form, weights.rest, &mut matrix);
        let mut gradient = self.shared_gradient * weights.pose;
        add_form_gradient(layout, &self.rest.gradient, weights.rest, &mut gradient);
        own.take_from(layout.count(), &mut matrix, &mut gradient);
        let n = layout.count();
        Some((DMatrix::from_fn(n, n, |i, j| matrix[(i.min(j), i.max(j))]), gradient))
    }
}

/// Adds a multiple of a matrix of the form to the upper triangle of one of the shared unknowns.
pub fn add_form(layout: Layout, form: &SMatrix<f64, MAX_FORM, MAX_FORM>, weight: f64, sum: &mut SharedMatrix) {
    for j in 0..layout.form {
        for i in 0..=j {
            sum[(Layout::FORM_AT + i, Layout::FORM_AT + j)] += form[(i, j)] * weight;
        }
    }
}

/// Adds a multiple of a gradient of the form to one of the shared unknowns.
pub fn add_form_gradient(layout: Layout, form: &SVector<f64, MAX_FORM>, weight: f64, sum: &mut SharedVector) {
    for i in 0..layout.form {
        sum[Layout::FORM_AT + i] += form[i] * weight;
    }
}

/// Leaves in the equations what a pose of the view could explain, and returns the rest.
pub fn own_pose_eliminated(equations: &mut PoseEquations) -> Option<Rest> {
    let factor = Cholesky::new(equations.pose)?;
    let solved_form = factor.solve(&equations.pose_by_form);
    let form = equations.pose_by_form.tr_mul(&solved_form);
    let gradient = solved_form.tr_mul(&equations.pose_gradient);
    let squared_px = equations.pose_gradient.dot(&factor.solve(&equations.pose_gradient));
    let rest = Rest {
        form: equations.form - form,
        gradient: equations.form_gradient - gradient,
        squared_px: (equations.squared_px - squared_px).max(0.0),
    };
    (equations.form, equations.form_gradient, equations.squared_px) = (form, gradient, squared_px);
    Some(rest)
}

/// One view's correction, ready to be eliminated.
pub struct Own {
    pub factor: Cholesky<f64, Const<6>>,
    /// Weighted `Jdᵀ Js` times the inverse of the lower factor.
    pub whitened: SixByShared,
    /// The weighted gradient, whitened alike.
    pub whitened_gradient: Vector6<f64>,
}

impl Own {
    /// Of a view with `n` shared unknowns.
    pub fn new(
        block: &ViewBlock,
        n: usize,
        correction: &Vector6<f64>,
        weight: f64,
        prior: &Vector6<f64>,
        damping: f64,
    ) -> Option<Self> {
        let mut own = block.own * weight + Matrix6::from_diagonal(prior);
        for i in 0..6 {
            own[(i, i)] *= 1.0 + damping;
        }
        let factor = Cholesky::new(own)?;
        let mut gradient = block.own_gradient * weight + prior.component_mul(correction);
        forward(factor.l_dirty(), gradient.as_mut_slice());
        let mut whitened = SixByShared::zeros();
        let columns = whitened.as_mut_slice().chunks_exact_mut(6).zip(block.cross.as_slice().chunks_exact(6));
        for (column, cross) in columns.take(n) {
            for (to, from) in column.iter_mut().zip(cross) {
                *to = from * weight;
            }
            forward(factor.l_dirty(), column);
        }
        Some(Self { factor, whitened, whitened_gradient: gradient })
    }

    /// Takes from the upper triangle and the gradient of the shared unknowns what the correction takes up.
    pub fn take_from(&self, n: usize, matrix: &mut SharedMatrix, gradient: &mut SharedVector) {
        let columns = self.whitened.as_slice();
        for j in 0..n {
            let b = &columns[6 * j..6 * j + 6];
            gradient[j] -= dot6(b, self.whitened_gradient.as_slice());
            for i in 0..=j {
                matrix[(i, j)] -= dot6(&columns[6 * i..6 * i + 6], b);
            }
        }
    }

    /// Other columns, weighted and times those of the correction, times the inverse of the lower factor.
    pub fn whiten(&self, mut cross: Matrix6xX<f64>) -> Matrix6xX<f64> {
        for column in cross.as_mut_slice().chunks_exact_mut(6) {
            forward(self.factor.l_dirty(), column);
        }
        cross
    }

    /// The step of the correction that goes with a shared step.
    pub fn step(&self, shared: &SharedVector) -> Vector6<f64> {
        let mut out = -(self.whitened_gradient + self.whitened * shared);
        self.backward(&mut out);
        out
    }

    /// How the correction follows each of `n` shared unknowns, with the opposite sign.
    pub fn follows(&self, n: usize) -> SixByShared {
        let mut follows = self.whitened;
        for column in follows.as_mut_slice().chunks_exact_mut(6).take(n) {
            backward(self.factor.l_dirty(), column);
        }
        follows
    }

    /// The variances of the correction when the shared unknowns have the covariance `shared`.
    pub fn variances(&self, shared: &DMatrix<f64>) -> Vector6<f64> {
        let n = shared.nrows();
        let mut variances = self.factor.inverse().diagonal();
        let follows = self.follows(n);
        for j in 0..n {
            let mut through = Vector6::zeros();
            for i in 0..n {
                through += follows.column(i) * shared[(i, j)];
            }
            variances += through.component_mul(&follows.column(j));
        }
        variances
    }

    /// How much a full step of the correction lowers the quadratic cost.
    pub fn decrease(&self) -> f64 {
        self.whitened_gradient.norm_squared()
    }

    pub fn log_determinant(&self) -> f64 {
        self.factor.l_dirty().diagonal().iter().map(|p| 2.0 * p.ln()).sum()
    }

    fn backward(&self, v: &mut Vector6<f64>) {
        backward(self.factor.l_dirty(), v.as_mut_slice());
    }
}

fn dot6(a: &[f64], b: &[f64]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}

/// Solves `L x = v` in place.
fn forward(l: &Matrix6<f64>, v: &mut [f64]) {
    for i in 0..6 {
        let mut sum = v[i];
        for j in 0..i {
            sum -= l[(i, j)] * v[j];
        }
        v[i] = sum / l[(i, i)];
    }
}

/// Solves `Lᵀ x = v` in place.
fn backward(l: &Matrix6<f64>, v: &mut [f64]) {
    for i in (0..6).rev() {
        let mut sum = v[i];
        for j in i + 1..6 {
            sum -= l[(j, i)] * v[j];
        }
        v[i] = sum / l[(i, i)];
    }
}
