//! Folds of neighbouring views.

use handeye_estimate::handeye::Mode;
use nalgebra::{Matrix3, Vector3};

use crate::sets::Set;

/// Fold of every view: the tip positions are cut across their direction of largest variance into two parts of whole folds, and
/// the parts again, until each is one fold. Sizes differ by at most one view. Views at the same place keep their order.
pub fn folds(set: &Set, count: usize) -> Vec<usize> {
    let tips: Vec<Vector3<f64>> = set
        .pairs
        .iter()
        .map(|pair| match set.mode {
            Mode::EyeInHand => pair.anchor_from_mount.translation(),
            Mode::EyeToHand => pair.anchor_from_mount.inverse().translation(),
        })
        .collect();
    let mut order: Vec<usize> = (0..tips.len()).collect();
    sort(&tips, &mut order, 0, count, count);
    let mut folds = vec![0; tips.len()];
    for fold in 0..count {
        for &view in &order[start(fold, tips.len(), count)..start(fold + 1, tips.len(), count)] {
            folds[view] = fold;
        }
    }
    folds
}

/// Where a fold starts in the order of the views.
fn start(fold: usize, views: usize, count: usize) -> usize {
    fold * views / count
}

/// Orders the views of the folds from `first` up to `end` so that every fold is a run of neighbours.
fn sort(tips: &[Vector3<f64>], order: &mut [usize], first: usize, end: usize, count: usize) {
    if end - first < 2 {
        return;
    }
    let offset = start(first, tips.len(), count);
    let along = widest(tips, &order[offset..start(end, tips.len(), count)]);
    order[offset..start(end, tips.len(), count)].sort_by(|&a, &b| tips[a].dot(&along).total_cmp(&tips[b].dot(&along)));
    let middle = first.midpoint(end);
    sort(tips, order, first, middle, count);
    sort(tips, order, middle, end, count);
}

/// Direction of the largest variance of these positions, its largest component positive.
fn widest(tips: &[Vector3<f64>], views: &[usize]) -> Vector3<f64> {
    let mean = views.iter().map(|&v| tips[v]).sum::<Vector3<f64>>() / views.len() as f64;
    let scatter: Matrix3<f64> = views.iter().map(|&v| (tips[v] - mean) * (tips[v] - mean).transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let along = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    if along[along.iamax()] < 0.0 { -along } else { along }
}
