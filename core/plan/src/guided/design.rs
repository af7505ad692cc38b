//! The error of the tip that a set of views leaves, and by how much one more lowers it.
//!
//! The criterion is the trace of the covariance of a measured point, averaged over the box where the tool works:
//! `tr(W C)` with `C` the covariance of the hand-eye transform and `W = Σ w_p J_pᵀ J_p` over points `p` of the box, where
//! `J_p` is how the point moves with the transform. A view with the rows `R` changes the covariance of all unknowns to
//! `C − C Rᵀ (1 + R C Rᵀ)⁻¹ R C`.
//!
//! # Reference
//! Fedorov 1972, "Theory of optimal experiments" (linear criteria, one view in and out); Woodbury 1950 for the update.

use nalgebra::{Cholesky, DMatrix, Matrix6, Point3, Vector3};

use handeye_estimate::handeye::joint::ExpectedView;
use handeye_geometry::point_error;
use handeye_geometry::targets::TargetSpec;

/// What views say of the unknowns, and what is asked of them.
#[derive(Debug, Clone)]
pub struct Design {
    covariance: DMatrix<f64>,
    /// `W`.
    weight: Matrix6<f64>,
}

/// `W` over a cube as large as the target about a point in camera coordinates \[m\]: its corners and its middle, each counting
/// alike.
pub fn weight_about(middle: &Point3<f64>, target: &TargetSpec) -> Matrix6<f64> {
    let half_m = 0.5 * target.extent().max();
    let signs = [-half_m, half_m];
    let corners = signs.iter().flat_map(|&x| signs.iter().flat_map(move |&y| signs.map(|z| Vector3::new(x, y, z))));
    let points: Vec<Point3<f64>> = corners.chain([Vector3::zeros()]).map(|offset| middle + offset).collect();
    weight_over(&points)
}

/// `W` over points in camera coordinates \[m\], each counting alike.
pub fn weight_over(points: &[Point3<f64>]) -> Matrix6<f64> {
    let sum: Matrix6<f64> = points.iter().map(point_error::by_hand_eye).map(|j| j.tr_mul(&j)).sum();
    sum / points.len().max(1) as f64
}

impl Design {
    /// Of what is known beforehand and some views; `None` where that leaves an unknown free.
    pub fn new<'a>(
        prior: DMatrix<f64>,
        views: impl IntoIterator<Item = &'a ExpectedView>,
        weight: Matrix6<f64>,
    ) -> Option<Self> {
        let information = views.into_iter().fold(prior, |sum, view| sum + view.information());
        // Unknowns differ by many orders, so the inverse is taken in units of each.
        let n = information.nrows();
        let scale: Vec<f64> = (0..n).map(|i| information[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        let scaled = |matrix: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
        let covariance = scaled(&Cholesky::new(scaled(&information))?.inverse());
        Some(Self { covariance, weight })
    }

    /// Covariance of all unknowns.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// The root mean square of the tip's error over the box, metres.
    pub fn error_m(&self) -> f64 {
        self.mean_square().max(0.0).sqrt()
    }

    /// The same with one more view.
    pub fn error_with_m(&self, view: &ExpectedView) -> f64 {
        (self.mean_square() - self.taken_by(view)).max(0.0).sqrt()
    }

    /// With one more view.
    #[must_use]
    pub fn with(&self, view: &ExpectedView) -> Self {
        let rows = view.rows();
        let mut through = rows * &self.covariance;
        if let Some(factor) = seen(rows, &through) {
            factor.l_dirty().solve_lower_triangular_mut(&mut through);
            return Self { covariance: &self.covariance - through.tr_mul(&through), weight: self.weight };
        }
        self.clone()
    }

    /// Of what the two diagonal parts of the criterion lost since `before`, the part of the rotation of the camera, 0 to 1.
    pub fn rotation_part_of_gain(&self, before: &Self) -> f64 {
        let gain = |at: usize| {
            let of = |design: &Self| {
                let weight = design.weight.fixed_view::<3, 3>(at, at).into_owned();
                weight.component_mul(&design.covariance.fixed_view::<3, 3>(at, at)).sum()
            };
            (of(before) - of(self)).max(0.0)
        };
        let (position, rotation) = (gain(0), gain(3));
        if position + rotation > 0.0 { rotation / (position + rotation) } else { 0.0 }
    }

    fn mean_square(&self) -> f64 {
        self.weight.component_mul(&self.covariance.fixed_view::<6, 6>(0, 0)).sum()
    }

    /// By how much a view lowers the mean square.
    fn taken_by(&self, view: &ExpectedView) -> f64 {
        let rows = view.rows();
        let through = rows * &self.covariance;
        let Some(factor) = seen(rows, &through) else { return 0.0 };
        let mut of_link = through.columns(0, 6).into_owned();
        factor.l_dirty().solve_lower_triangular_mut(&mut of_link);
        self.weight.component_mul(&of_link.tr_mul(&of_link)).sum()
    }
}

/// The factor of `1 + R C Rᵀ`, from `R` and `R C`.
fn seen(rows: &DMatrix<f64>, through: &DMatrix<f64>) -> Option<Cholesky<f64, nalgebra::Dyn>> {
    let mut seen = through * rows.transpose();
    for i in 0..seen.nrows() {
        seen[(i, i)] += 1.0;
    }
    Cholesky::new(seen)
}
