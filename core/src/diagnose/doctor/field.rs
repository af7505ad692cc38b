//! Errors of the robot that depend on where it stands: a field that is affine in the place of the tip.
//!
//! An arm whose links are not as its controller takes them to be is off by amounts that change smoothly over its
//! workspace. To first order the twist of the tip, in its own axes, is an affine function of its place in the base. The
//! constant part is taken up by the hand-eye transform and the target's pose; the eighteen slopes are random effects with
//! two variances of their own, position and orientation, which are found as those of the noise are (restricted maximum
//! likelihood). Without them a smooth error of the arm looks like a board that moved, a target of another size or a
//! wrong lens. Where the data show none, the model goes without.
//!
//! Source: Henderson 1975, "Best linear unbiased estimation and prediction under a selection model" (random effects in
//! the normal equations).

use nalgebra::{DMatrix, Matrix6, Vector3};

use super::views::SessionViews;

/// Slopes: of six errors along three axes.
pub(super) const SLOPES: usize = 18;
/// Least views. With fewer there are not twice as many numbers as unknowns and slopes, and the slopes are the noise.
const NEED: usize = 10;
/// Least spread of the places, RMS, metres: an arm that turns on the spot has no field.
const LEAST_SPREAD_M: f64 = 1e-3;

/// The places of a session's views, as the field is a function of them.
pub(super) struct Field {
    /// Of every view, in the base's axes; of mean zero and RMS one over the session.
    places: Vec<Vector3<f64>>,
}

impl Field {
    /// `None` where views are too few or the tip stays where it is.
    pub fn new(sight: &SessionViews) -> Option<Self> {
        let count = sight.views.len() as f64;
        let place = |view: &super::views::SessionView| view.base_from_tip.isometry().translation.vector;
        let mean = sight.views.iter().map(place).sum::<Vector3<f64>>() / count;
        let rms = (sight.views.iter().map(|view| (place(view) - mean).norm_squared()).sum::<f64>() / count).sqrt();
        let places = || sight.views.iter().map(|view| (place(view) - mean) / rms).collect();
        (sight.views.len() >= NEED && rms > LEAST_SPREAD_M).then(|| Self { places: places() })
    }

    /// How the residual of a view turns with the slopes, those of position first; `by_robot` turns a twist of the tip
    /// into it.
    pub fn columns(&self, view: usize, by_robot: &Matrix6<f64>) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(6, SLOPES);
        for part in [0, 3] {
            for (axis, by) in self.places[view].iter().enumerate() {
                let slopes = by_robot.fixed_columns::<3>(part) * *by;
                columns.view_mut((0, 3 * part + 3 * axis), (6, 3)).copy_from(&slopes);
            }
        }
        columns
    }
}
