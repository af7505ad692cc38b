//! Effects on all corners that the data showed and a fit includes, see [`super::effects`].

use nalgebra::DMatrix;

use super::effects::Effect;
use super::print_errors::{self, PrintErrors};
use super::residual_distortion::{self, ShownDistortion};
use super::{JointProblem, JointSolution};
use crate::handeye::HandEyeError;
use handeye_geometry::camera::residual_distortion::functions;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::BoardPoints;

/// Effects that are in a model.
#[derive(Clone, Copy, Default)]
pub struct ShownEffects<'a> {
    /// Displacements of the points of the target from their drawing.
    pub print: Option<&'a PrintErrors>,
    /// Residual distortion of the lens beyond its model.
    pub distortion: Option<&'a ShownDistortion>,
}

impl ShownEffects<'_> {
    /// These effects, and the prior of their coefficients as an information matrix; `None` where that is singular. `board` has the
    /// errors of the print.
    pub(crate) fn beforehand(self, board: &BoardPoints) -> Option<(Vec<Effect>, DMatrix<f64>)> {
        let (mut effects, mut parts) = (Vec::new(), Vec::new());
        if let Some(print) = self.print {
            effects.push(Effect::Print);
            parts.push(print.prior_information(board)?);
        }
        if let Some(ShownDistortion { field, level_px, .. }) = self.distortion {
            effects.push(Effect::Distortion(field.degree()));
            let count = 2 * functions(field.degree());
            parts.push(DMatrix::from_diagonal_element(count, count, level_px.powi(-2)));
        }
        let count = parts.iter().map(DMatrix::nrows).sum();
        let mut prior = DMatrix::zeros(count, count);
        let mut at = 0;
        for part in parts {
            prior.view_mut((at, at), part.shape()).copy_from(&part);
            at += part.nrows();
        }
        Some((effects, prior))
    }

    /// A solution with them, with their uncertainty in its covariance, and the standard deviations of the errors of the print.
    ///
    /// # Errors
    /// [`HandEyeError::Cancelled`]; [`HandEyeError::NoSolution`] when the solution is not one of the problem.
    pub(crate) fn with_their_error(
        self,
        problem: &JointProblem<'_>,
        mut solution: JointSolution,
        cancel: &CancelToken,
    ) -> Result<(JointSolution, Vec<f64>), HandEyeError> {
        let mut sigma_m = Vec::new();
        if let Some(print) = self.print {
            (solution, sigma_m) = print_errors::with_its_error(problem, solution, print, cancel)?;
        }
        if let Some(distortion) = self.distortion {
            solution = residual_distortion::with_its_error(problem, solution, distortion, cancel)?;
        }
        Ok((solution, sigma_m))
    }
}
