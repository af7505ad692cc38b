//! Which error may be stated for a calibration.
//!
//! A covariance is true when the model is. Where the data support an explanation that the answer does not account for
//! (a board of another size, a lens that was given wrongly, a board that slipped), the error of the answer is as large
//! as that explanation would move it; that is added to the error. Where the data contradict themselves no error is
//! stated.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};

use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::handeye::joint::SmallSample;
use crate::uncertainty::quality::tip_error_95_at;
use handeye_geometry::frames::{Camera, Mount, Pose};
use handeye_geometry::{point_error, se3};

/// Which error may be stated.
#[derive(Debug, Clone, PartialEq)]
pub enum StatedUncertainty {
    /// The model explains the data: the error is that of its covariance.
    AsModelled,
    /// The data support explanations that the answer does not account for.
    Moved(Vec<Alternative>),
    /// The data contradict themselves: no error can be stated.
    Nothing,
}

/// Where the hand-eye transform would be by an explanation that the answer does not account for. Where the joints of the arm are
/// known it is that of corrected poses.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// `log(X⁻¹ X')` of the hand-eye transform `X` as it is and `X'` by the explanation, `[t; r]` in m and rad.
    pub shift: Vector6<f64>,
    /// Covariance of `X'`, right perturbation `[t; r]`.
    pub covariance: Matrix6<f64>,
}

impl Alternative {
    /// How far it moves a `point` (camera coordinates, metres), metres.
    pub(crate) fn moved_m(&self, point: &Point3<f64>) -> f64 {
        self.moved(point).norm()
    }

    fn moved(&self, point: &Point3<f64>) -> Vector3<f64> {
        let shift: Isometry3<f64> = se3::exp(&self.shift);
        shift * point - point
    }

    /// The length that the error of a `point` by the answer stays below with a probability of 95 % where this is the truth, metres:
    /// of a vector with this mean and this covariance. Its square is taken for a multiple of chi-square with the mean and the
    /// variance that it has (Patnaik 1949, "The non-central χ² and F-distributions and their applications"), which is true to 2 %.
    pub fn error_95_m(&self, law: SmallSample, point: &Point3<f64>) -> f64 {
        let (mean, covariance) = (self.moved(point), point_error::covariance(&self.covariance, point));
        // The uncertainty of the size of the errors makes them larger.
        let wider = (law.radius_95(&covariance) / SmallSample::KNOWN.radius_95(&covariance)).powi(2);
        let covariance = if wider.is_finite() { covariance * wider } else { covariance };
        let expected = mean.norm_squared() + covariance.trace();
        let variance = 2.0 * (covariance * covariance).trace() + 4.0 * mean.dot(&(covariance * mean));
        match ChiSquared::new(2.0 * expected * expected / variance) {
            Ok(chi) if variance > 0.0 => (variance / (2.0 * expected) * chi.inverse_cdf(0.95)).sqrt(),
            _ => mean.norm(),
        }
    }

    /// The same for the answer `other` where this is for the answer `own`.
    pub(crate) fn of_another(&self, own: &Pose<Mount, Camera>, other: &Pose<Mount, Camera>) -> Self {
        let shift = se3::log(&((other.inverse() * *own).isometry() * se3::exp(&self.shift)));
        Self { shift, covariance: self.covariance }
    }

    /// Mean square of the error of the answer where this is the truth, `[t; r]`.
    pub(crate) fn mean_square(&self) -> Matrix6<f64> {
        self.covariance + self.shift * self.shift.transpose()
    }
}

impl StatedUncertainty {
    /// The same for the answer `other` where this is for the answer `own`: the explanations stay at their place.
    #[must_use]
    pub(crate) fn of_another(&self, own: &Pose<Mount, Camera>, other: &Pose<Mount, Camera>) -> Self {
        let Self::Moved(alternatives) = self else { return self.clone() };
        Self::Moved(alternatives.iter().map(|alternative| alternative.of_another(own, other)).collect())
    }

    /// How far explanations that the answer does not account for would move a `point` (camera coordinates, metres),
    /// metres; of several the one that moves it farthest. Zero where there is none.
    pub fn moved_m(&self, point: &Point3<f64>) -> f64 {
        match self {
            Self::Moved(alternatives) => alternatives.iter().map(|a| a.moved_m(point)).fold(0.0, f64::max),
            Self::AsModelled | Self::Nothing => 0.0,
        }
    }

    /// The length that the error of a point in camera coordinates stays below with a probability of 95 %, metres, from
    /// the covariance `[t; r]` of the hand-eye transform (right perturbation) and the distribution of its error; `None`
    /// when nothing may be stated.
    ///
    /// An alternative adds how far it moves the point to the error that remains: that of the model, or that under the
    /// alternative where it is larger, because its effect has an uncertainty of its own.
    pub fn error_95_m(&self, covariance: &Matrix6<f64>, law: SmallSample, point: &Point3<f64>) -> Option<f64> {
        self.parts_95_m(covariance, law, point).map(|(moved_m, rest_m)| moved_m + rest_m)
    }

    /// The two parts of that error: how far the explanation that makes it largest would move the point, and what remains.
    pub(crate) fn parts_95_m(
        &self,
        covariance: &Matrix6<f64>,
        law: SmallSample,
        point: &Point3<f64>,
    ) -> Option<(f64, f64)> {
        let modelled = tip_error_95_at(covariance, law, point);
        match self {
            Self::AsModelled => Some((0.0, modelled)),
            Self::Nothing => None,
            Self::Moved(alternatives) => {
                let under =
                    |a: &Alternative| (a.moved_m(point), tip_error_95_at(&a.covariance, law, point).max(modelled));
                let larger = |a: (f64, f64), b: (f64, f64)| if b.0 + b.1 > a.0 + a.1 { b } else { a };
                Some(alternatives.iter().map(under).fold((0.0, modelled), larger))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn isotropic(sigma_m: f64) -> Matrix6<f64> {
        Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)) * sigma_m * sigma_m
    }

    /// Compared with drawn vectors.
    #[test]
    fn the_error_under_an_alternative_is_that_of_a_vector_with_a_mean() {
        use crate::handeye::draw::Draw;
        let point = Point3::new(0.0, 0.0, 0.5);
        for (axes, mean) in [
            ([1.0, 1.0, 1.0], 0.0),
            ([1.0, 1.0, 1.0], 1.0),
            ([1.0, 0.1, 0.1], 1.0),
            ([0.3, 1.0, 0.1], 2.0),
            ([1.0, 0.1, 0.1], 5.0),
            ([0.2, 0.2, 1.0], 10.0),
        ] {
            let mut random = Draw::new(7);
            let mut lengths: Vec<f64> = (0..40_000)
                .map(|_| Vector3::from_fn(|i, _| axes[i] * random.normal() + if i == 0 { mean } else { 0.0 }).norm())
                .collect();
            lengths.sort_by(f64::total_cmp);
            let drawn_m = lengths[38_000] * 1e-3;
            let [x, y, z] = axes.map(|axis| axis * axis * 1e-6);
            let alternative = Alternative {
                shift: Vector6::new(mean * 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0),
                covariance: Matrix6::from_diagonal(&Vector6::new(x, y, z, 0.0, 0.0, 0.0)),
            };
            let ratio = alternative.error_95_m(SmallSample::KNOWN, &point) / drawn_m;
            // Chi-square is within 2 %, and this many draws within 1 %.
            assert!((0.97..1.03).contains(&ratio), "{axes:?} {mean}: {ratio}");
        }
        let nothing = Alternative { shift: Vector6::zeros(), covariance: Matrix6::zeros() };
        assert_eq!(nothing.error_95_m(SmallSample::KNOWN, &point), 0.0);
    }

    #[test]
    fn an_alternative_adds_what_it_moves_and_the_worst_of_several_counts() {
        let point = Point3::new(0.0, 0.0, 0.5);
        let along = |shift: Vector6<f64>, sigma_m| Alternative { shift, covariance: isotropic(sigma_m) };
        // A turn of 0.02 rad about x moves the point by a centimetre, a shift along x by three millimetres.
        let turned = along(Vector6::new(0.0, 0.0, 0.0, 0.02, 0.0, 0.0), 1e-5);
        let moved = along(Vector6::new(3e-3, 0.0, 0.0, 0.0, 0.0, 0.0), 1e-3);
        let error =
            |claim: &StatedUncertainty| claim.error_95_m(&isotropic(1e-4), SmallSample::KNOWN, &point).expect("stated");
        let (plain, wide) = (2.795e-4, 2.795e-3);
        assert!((error(&StatedUncertainty::AsModelled) - plain).abs() < 1e-6);
        assert!((error(&StatedUncertainty::Moved(vec![turned.clone()])) - (0.01 + plain)).abs() < 2e-6);
        assert!((error(&StatedUncertainty::Moved(vec![moved.clone()])) - (3e-3 + wide)).abs() < 2e-6);
        let both = StatedUncertainty::Moved(vec![moved, turned]);
        assert!((error(&both) - (0.01 + plain)).abs() < 2e-6);
        assert!((both.moved_m(&point) - 0.01).abs() < 1e-6);
        let (moved, rest) = both.parts_95_m(&isotropic(1e-4), SmallSample::KNOWN, &point).expect("stated");
        assert!((moved - 0.01).abs() < 1e-6 && moved + rest == error(&both), "the parts are those of one explanation");
        assert!(StatedUncertainty::Nothing.error_95_m(&isotropic(1e-4), SmallSample::KNOWN, &point).is_none());
    }
}
