//! The error of the tip that a set of views leaves, and by how much one more lowers it.
//!
//! The criterion is the trace of the covariance of a measured point, averaged over the box where the tool works:
//! `tr(W C)` with `C` the covariance of the hand-eye transform and `W = Σ w_p J_pᵀ J_p` over points `p` of the box, where
//! `J_p` is the Jacobian of the point by the transform. With an arm whose errors are among the unknowns it is the covariance of
//! the distance from the tip of a tool to such a point, by corrected commands, which depends on those errors too. A view with the
//! rows `R` changes the covariance of all unknowns to `C − C Rᵀ (1 + R C Rᵀ)⁻¹ R C`.
//!
//! # Reference
//! Fedorov 1972, "Theory of optimal experiments" (linear criteria, one view in and out); Woodbury 1950 for the update.

use nalgebra::{Cholesky, DMatrix, Matrix6, Point3, Vector3};

use handeye_estimate::handeye::joint::ExpectedView;
use handeye_geometry::point_error;
use handeye_geometry::targets::TargetSpec;

/// The information of views on the unknowns, and the criterion for them.
#[derive(Debug, Clone)]
pub struct Design {
    covariance: DMatrix<f64>,
    weight: Weight,
}

/// `W`, over the unknowns that count.
#[derive(Debug, Clone)]
pub struct Weight {
    /// Their places: the hand-eye transform, and the errors of the arm where these are in the criterion.
    places: Vec<usize>,
    of: DMatrix<f64>,
}

impl From<Matrix6<f64>> for Weight {
    /// The weight of the hand-eye transform alone.
    fn from(of: Matrix6<f64>) -> Self {
        Self { places: (0..6).collect(), of: DMatrix::from_iterator(6, 6, of.iter().copied()) }
    }
}

impl Weight {
    /// The weight of a tool that is sent to a point, see [`Reach::weight`](handeye_estimate::reach_error::Reach::weight), with
    /// the hand-eye transform and the errors of the arm in these places.
    pub(crate) fn of_reach(places: impl Iterator<Item = usize>, of: DMatrix<f64>) -> Self {
        Self { places: places.collect(), of }
    }

    fn mean_square(&self, covariance: &DMatrix<f64>) -> f64 {
        let counted = covariance.select_rows(&self.places).select_columns(&self.places);
        self.of.component_mul(&counted).sum()
    }
}

/// The part of the answer that a view determines most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Position of the camera.
    Position,
    /// Orientation of the camera.
    Rotation,
    /// The errors of the arm.
    Arm,
}

/// `W` over a cube as large as the target around a point in camera coordinates \[m\]: its corners and its middle, with equal
/// weights.
pub fn weight_about(middle: &Point3<f64>, target: &TargetSpec) -> Matrix6<f64> {
    let half_m = 0.5 * target.extent().max();
    let signs = [-half_m, half_m];
    let corners = signs.iter().flat_map(|&x| signs.iter().flat_map(move |&y| signs.map(|z| Vector3::new(x, y, z))));
    let points: Vec<Point3<f64>> = corners.chain([Vector3::zeros()]).map(|offset| middle + offset).collect();
    weight_over(&points)
}

/// `W` over points in camera coordinates \[m\], with equal weights.
pub(crate) fn weight_over(points: &[Point3<f64>]) -> Matrix6<f64> {
    let sum: Matrix6<f64> = points.iter().map(point_error::by_hand_eye).map(|j| j.tr_mul(&j)).sum();
    sum / points.len().max(1) as f64
}

impl Design {
    /// The design by prior knowledge and some views; `None` where that leaves an unknown free.
    pub fn new<'a>(
        prior: DMatrix<f64>,
        views: impl IntoIterator<Item = &'a ExpectedView>,
        weight: impl Into<Weight>,
    ) -> Option<Self> {
        let information = views.into_iter().fold(prior, |sum, view| sum + view.information());
        // Unknowns differ by many orders, so the inverse is taken in units of each.
        let n = information.nrows();
        let scale: Vec<f64> = (0..n).map(|i| information[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        let scaled = |matrix: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
        let covariance = scaled(&Cholesky::new(scaled(&information))?.inverse());
        Some(Self { covariance, weight: weight.into() })
    }

    /// Covariance of all unknowns.
    pub(crate) fn covariance(&self) -> &DMatrix<f64> {
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

    /// The design with one more view.
    #[must_use]
    pub fn with(&self, view: &ExpectedView) -> Self {
        let rows = view.rows();
        let mut through = rows * &self.covariance;
        if let Some(factor) = seen(rows, &through) {
            factor.l_dirty().solve_lower_triangular_mut(&mut through);
            return Self { covariance: &self.covariance - through.tr_mul(&through), weight: self.weight.clone() };
        }
        self.clone()
    }

    /// Of the diagonal parts of the criterion the one that lost most since `before`; cross terms are in none.
    pub(crate) fn part_of_gain(&self, before: &Self) -> Part {
        let gain = |places: std::ops::Range<usize>| {
            let of = |design: &Self| {
                let Weight { places: all, of } = &design.weight;
                let pairs = places.clone().flat_map(|i| places.clone().map(move |j| (i, j)));
                pairs.map(|(i, j)| of[(i, j)] * design.covariance[(all[i], all[j])]).sum::<f64>()
            };
            of(before) - of(self)
        };
        let count = self.weight.places.len();
        let of_arm = (count > 6).then(|| (Part::Arm, gain(6..count)));
        let parts = [(Part::Position, gain(0..3)), (Part::Rotation, gain(3..6))].into_iter().chain(of_arm);
        parts.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(Part::Position, |(part, _)| part)
    }

    fn mean_square(&self) -> f64 {
        self.weight.mean_square(&self.covariance)
    }

    /// Decrease of the mean square by a view.
    fn taken_by(&self, view: &ExpectedView) -> f64 {
        let rows = view.rows();
        let through = rows * &self.covariance;
        let Some(factor) = seen(rows, &through) else { return 0.0 };
        let mut counted = through.select_columns(&self.weight.places);
        factor.l_dirty().solve_lower_triangular_mut(&mut counted);
        self.weight.of.component_mul(&counted.tr_mul(&counted)).sum()
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
