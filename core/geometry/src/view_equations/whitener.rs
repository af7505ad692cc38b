//! Weights of the residuals of the corners of a view.

use std::sync::Arc;

use nalgebra::{DMatrix, Matrix2};

use crate::targets::corner_covariance::CornerCovariance;

/// Weights of the residuals of the corners of a view.
#[derive(Debug, Clone, Default)]
pub enum Whitener {
    /// All equal.
    #[default]
    Alike,
    /// One matrix `W` per corner, whose residual counts as `W r`.
    Each(Vec<Matrix2<f64>>),
    /// Corners whose errors are not independent: weights by the covariance of all of them.
    Together {
        /// The covariance of the corners, in their order.
        covariance: Arc<CornerCovariance>,
        /// The variance of a whitened number, squared pixels.
        unit_px2: f64,
    },
}

impl Whitener {
    /// Number of corners that it is for; `None` for any number.
    pub fn corners(&self) -> Option<usize> {
        match self {
            Self::Alike => None,
            Self::Each(all) => Some(all.len()),
            Self::Together { covariance, .. } => Some(covariance.len()),
        }
    }

    /// The matrix of corner `i` alone, where it has one.
    pub fn of(&self, i: usize) -> Option<&Matrix2<f64>> {
        match self {
            Self::Each(all) => all.get(i),
            Self::Alike | Self::Together { .. } => None,
        }
    }

    /// Rows of all corners, x and y of each in turn, that are not whitened one by one; `None` where they are.
    pub(crate) fn together(&self, rows: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        match self {
            Self::Together { covariance, unit_px2 } => Some(covariance.whitened(rows, *unit_px2)),
            Self::Alike | Self::Each(_) => None,
        }
    }
}
