//! The jackknife over single views, over blocks of them, and over halves.
//!
//! Without the views of a group the answer moves by about minus the sum of their pulls. If views are independent, the
//! squares of these sums add up to the same on average for any division into groups of the same sizes; if neighbours
//! err alike, a division that keeps neighbours together gives more.

use nalgebra::{DMatrix, SVector, Vector6};
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};

use super::linear::LinearView;
use super::permutation;
use super::{Check, Evidence};
use crate::geometry::se3;

/// Most blocks: with ten the ratio is known to a fifth.
const MOST_BLOCKS: usize = 10;
/// Views from which on the poses are divided into eight blocks instead of four.
const EIGHT_POSE_BLOCKS: usize = 24;

/// Sum of the squared pulls of single views against what the covariance makes of them.
pub fn jackknife(views: &[LinearView]) -> Check {
    let shown: f64 = views.iter().map(|v| v.pull.norm_squared()).sum();
    let promised = promised(views);
    let spread: f64 = views.iter().map(|v| (v.expected * v.expected).trace()).sum();
    let ratio = shown / promised;
    // A sum of squares with that mean and variance has about so many degrees of freedom; the noise levels it is compared
    // with come from six numbers per view less the twelve of the two poses.
    let (freedom, of_noise) = (promised * promised / spread, 6.0 * views.len() as f64 - 12.0);
    let p_value = FisherSnedecor::new(freedom, of_noise).map_or(f64::NAN, |law| law.sf(ratio));
    Check { by: Evidence::Jackknife, ratio, p_value }
}

fn promised(views: &[LinearView]) -> f64 {
    views.iter().map(|v| v.expected.trace()).sum()
}

/// Blocks in time, blocks of poses, and the stronger of the two pairs of halves.
pub fn blocks(views: &[LinearView]) -> Vec<Check> {
    let count = views.len();
    let pulls: Vec<Vector6<f64>> = views.iter().map(|v| v.pull).collect();
    let in_time: Vec<usize> = (0..count).collect();
    let blocks = ((count as f64).sqrt().round() as usize + 1).clamp(3, MOST_BLOCKS);
    let pose_blocks = if count >= EIGHT_POSE_BLOCKS { 8 } else { 4 };
    let by_pose = by_pose(views, pose_blocks);
    let promised = promised(views);
    let test = |by, order: &[usize], groups: usize| {
        let ends = ends(count, groups);
        let observed = squares(&pulls, order, &ends);
        // Two views of different groups have, summed over all pairs, minus the product of like views, so a division by
        // chance keeps this share of the single squares.
        let alike: f64 = sizes(&ends).map(|n| n * (n - 1.0)).sum::<f64>() / (count as f64 * (count as f64 - 1.0));
        let ratio = observed / (promised * (1.0 - alike));
        Check { by, ratio, p_value: permutation::p_value(count, observed, |order| squares(&pulls, order, &ends)) }
    };
    let halves = [test(Evidence::Halves, &in_time, 2), test(Evidence::Halves, &by_pose, 2)];
    // The smaller of two probabilities is half as rare as it looks.
    let stronger = if halves[0].p_value <= halves[1].p_value { halves[0] } else { halves[1] };
    vec![
        test(Evidence::TimeBlocks, &in_time, blocks),
        test(Evidence::PoseBlocks, &by_pose, pose_blocks),
        Check { p_value: (2.0 * stronger.p_value).min(1.0), ..stronger },
    ]
}

/// Where each of `groups` groups of about equal size ends.
fn ends(count: usize, groups: usize) -> Vec<usize> {
    (1..=groups).map(|g| g * count / groups).collect()
}

fn sizes(ends: &[usize]) -> impl Iterator<Item = f64> {
    let starts = std::iter::once(0).chain(ends.iter().copied());
    ends.iter().zip(starts).map(|(end, start)| (end - start) as f64)
}

/// Sum over the groups of the squared sum of their pulls.
fn squares(pulls: &[Vector6<f64>], order: &[usize], ends: &[usize]) -> f64 {
    let mut start = 0;
    let mut total = 0.0;
    for &end in ends {
        total += order[start..end].iter().map(|&i| pulls[i]).sum::<Vector6<f64>>().norm_squared();
        start = end;
    }
    total
}

/// The views in an order in which `groups` (a power of two) equal parts hold neighbouring poses: divided at the median
/// along the direction in which the poses differ most, then each half again. Position and orientation count alike, each
/// in units of its own scatter.
fn by_pose(views: &[LinearView], groups: usize) -> Vec<usize> {
    let features = features(views);
    let mut order: Vec<usize> = (0..views.len()).collect();
    let mut parts = 1;
    while parts < groups {
        let mut start = 0;
        for end in ends(views.len(), parts) {
            sort_along_widest(&features, &mut order[start..end]);
            start = end;
        }
        parts *= 2;
    }
    order
}

fn features(views: &[LinearView]) -> Vec<SVector<f64, 6>> {
    let first = views[0].base_from_tip;
    let mut out: Vec<SVector<f64, 6>> = views
        .iter()
        .map(|v| {
            let position = v.base_from_tip.translation();
            let turn = se3::rotation_vector(&(first.rotation().inverse() * v.base_from_tip.rotation()));
            SVector::from([position.x, position.y, position.z, turn.x, turn.y, turn.z])
        })
        .collect();
    let mean = out.iter().sum::<SVector<f64, 6>>() / out.len() as f64;
    for at in [0, 3] {
        let scatter: f64 = out.iter().map(|f| (f - mean).fixed_rows::<3>(at).norm_squared()).sum::<f64>().sqrt();
        for feature in &mut out {
            let mut part = feature.fixed_rows_mut::<3>(at);
            part.unscale_mut(if scatter > 0.0 { scatter } else { 1.0 });
        }
    }
    out
}

fn sort_along_widest(features: &[SVector<f64, 6>], part: &mut [usize]) {
    let mean = part.iter().map(|&i| features[i]).sum::<SVector<f64, 6>>() / part.len().max(1) as f64;
    let mut scatter = DMatrix::zeros(6, 6);
    for &i in part.iter() {
        let off = features[i] - mean;
        scatter += off * off.transpose();
    }
    let eigen = scatter.symmetric_eigen();
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    part.sort_by(|&a, &b| {
        let along = |i: usize| features[i].dot(&direction.fixed_rows::<6>(0));
        along(a).total_cmp(&along(b)).then(a.cmp(&b))
    });
}
