//! Whether the board is at rest, so that an arm that follows it is at rest as well.
//!
//! The estimated pose of the board differs from image to image by more than the board moves, most of all when the arm
//! moves: an arm that follows every difference moves by its own errors. So a board stays at rest until an image differs
//! from its pose by more than two images of the same pose differ by chance; and one that moved is at rest again once it has
//! moved no farther than that for a while.

use std::collections::VecDeque;

use nalgebra::{Matrix6, Vector3};

use super::{Estimate, Update};
use handeye_geometry::se3;

/// Squared distance of two images of one place, in standard deviations, that chance exceeds in one of a thousand:
/// chi-square with six degrees of freedom.
const MOVED: f64 = 22.46;
/// And in one of twenty.
const NEAR: f64 = 12.59;
/// How long \[s\] a board has to stay near one place to be at rest there: one that moves by less than a standard
/// deviation in this time can as well be followed in steps.
const STAYS_S: f64 = 0.5;

/// Whether the board is at rest, and where.
#[derive(Debug, Clone, Default)]
pub struct Rest {
    at: Option<Estimate>,
    /// Estimates of the last [`STAYS_S`].
    before: VecDeque<Estimate>,
}

impl Rest {
    /// Takes in what an image has brought; one without the board changes nothing.
    pub fn see(&mut self, update: &Update) {
        let (Some(estimate), Some(seen)) = (&update.estimate, &update.seen) else { return };
        let of_image = update.with_depth.as_ref().map_or(&seen.covariance, |both| &both.covariance);
        if self.before.back().is_some_and(|last| last.time_s > estimate.time_s) {
            *self = Self::default();
        }
        match &self.at {
            Some(at) if apart_squared(at, estimate, of_image) <= MOVED => return,
            Some(_) => *self = Self::default(),
            None => {}
        }
        self.before.push_back(estimate.clone());
        let until_s = estimate.time_s - STAYS_S;
        while self.before.get(1).is_some_and(|second| second.time_s <= until_s) {
            self.before.pop_front();
        }
        let Some(first) = self.before.front().filter(|first| first.time_s <= until_s) else { return };
        if apart_squared(first, estimate, of_image) <= NEAR {
            let (velocity_m_s, angular_velocity_rad_s) = (Vector3::zeros(), Vector3::zeros());
            self.at = Some(Estimate { velocity_m_s, angular_velocity_rad_s, ..estimate.clone() });
            self.before.clear();
        }
    }

    /// Pose of the board at rest; `None` while it moves, and before that is known.
    pub fn at(&self) -> Option<&Estimate> {
        self.at.as_ref()
    }
}

/// Squared distance of two estimates in standard deviations of the difference of two images.
fn apart_squared(a: &Estimate, b: &Estimate, of_image: &Matrix6<f64>) -> f64 {
    let way = se3::log((a.base_from_target.inverse() * b.base_from_target).isometry());
    (of_image * 2.0).cholesky().map_or(f64::INFINITY, |factor| way.dot(&factor.solve(&way)))
}

#[cfg(test)]
#[path = "rest_tests.rs"]
mod tests;
