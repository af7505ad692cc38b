//! The residuals of a view, split into the part that a pose of the view could explain and the rest.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Matrix6xX, Vector6};

use handeye_geometry::view_equations::PoseEquations;

/// What remains of a view's residuals once its own pose has absorbed what it can: this depends on the form alone.
#[derive(Debug, Clone)]
pub struct Rest {
    /// `Jfᵀ Jf − Jfᵀ Jp (Jpᵀ Jp)⁻¹ Jpᵀ Jf`
    pub form: DMatrix<f64>,
    /// `Jfᵀ r` less the pose's part.
    pub gradient: DVector<f64>,
    /// `rᵀ r` less the pose's part, squared pixels.
    pub squared_px: f64,
}

impl Rest {
    /// The rest of no view, with this many unknowns of the form.
    pub fn nothing(form: usize) -> Self {
        Self { form: DMatrix::zeros(form, form), gradient: DVector::zeros(form), squared_px: 0.0 }
    }

    /// Adds the rest of another view.
    pub fn add(&mut self, other: &Self) {
        self.form += &other.form;
        self.gradient += &other.gradient;
        self.squared_px += other.squared_px;
    }
}

/// The six numbers of a view that a pose of it could explain, with `L Lᵀ = Jpᵀ Jp`.
pub struct PosePart {
    /// `L`
    pub root: Matrix6<f64>,
    /// `L⁻¹ Jpᵀ Jf`
    pub by_form: Matrix6xX<f64>,
    /// `L⁻¹ Jpᵀ r`, pixels.
    pub residual: Vector6<f64>,
}

/// Splits the equations into what a pose of the view could explain and the rest; `None` when the corners of the view
/// determine no pose.
pub fn split(equations: &PoseEquations) -> Option<(PosePart, Rest)> {
    let root = Cholesky::new(equations.pose)?.l();
    let by_form = whitened(&root, equations.pose_by_form.clone());
    let mut residual = equations.pose_gradient;
    forward(&root, residual.as_mut_slice());
    let rest = Rest {
        form: &equations.form - by_form.tr_mul(&by_form),
        gradient: &equations.form_gradient - by_form.tr_mul(&residual),
        squared_px: (equations.squared_px - residual.norm_squared()).max(0.0),
    };
    Some((PosePart { root, by_form, residual }, rest))
}

/// Columns times the inverse of a lower factor.
pub fn whitened(root: &Matrix6<f64>, mut columns: Matrix6xX<f64>) -> Matrix6xX<f64> {
    columns.as_mut_slice().chunks_exact_mut(6).for_each(|column| forward(root, column));
    columns
}

/// Solves `L x = v` in place.
pub fn forward(l: &Matrix6<f64>, v: &mut [f64]) {
    for i in 0..6 {
        let mut sum = v[i];
        for j in 0..i {
            sum -= l[(i, j)] * v[j];
        }
        v[i] = sum / l[(i, i)];
    }
}
