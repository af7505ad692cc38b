//! A start where the unit of the target poses is unknown.
//!
//! The rotations do not depend on it, so those of both links come from a closed form. The rest is linear: with the
//! rotations `R_i` of `anchor_from_mount`, `R_x` of `mount_from_camera` and the translations `t_i` and `c_i` of both poses
//! of a view, `R_i t_x + s R_i R_x c_i − t_y = −t_i` in the two translations and the scale `s`.
//!
//! Small sets of views are solved this way and the answer is taken that most views agree with, because a wrong view may
//! have any scale.
//!
//! # Reference
//! Andreff, Horaud & Espiau 2001, "Robot hand-eye calibration using structure-from-motion", IJRR 20; Fischler & Bolles 1981,
//! "Random sample consensus".

use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::closed_form::{ClosedForm as _, ClosedFormSolution, ParkMartin};
use super::draw::Draw;
use super::pose_graph::misfit;
use super::{PosePair, subset};
use handeye_geometry::frames::Pose;

/// Sets that are tried, and views in each: with three in ten views wrong one set in eight is clean.
const TRIALS: usize = 60;
const SET: usize = 6;
/// Part of the views that the answer has to agree with.
const AGREEING: f64 = 0.7;
/// Translation and two rotations.
const UNKNOWNS: usize = 7;

/// Both links and the scale that most views agree with; `None` where no set of views determines them, or the scale is
/// not positive and finite.
pub fn start(pairs: &[PosePair]) -> Option<(ClosedFormSolution, f64)> {
    let chosen: Vec<PosePair> = subset::spread(pairs.len(), subset::MOST_VIEWS).into_iter().map(|i| pairs[i]).collect();
    let mut draw = Draw::new(0x9e37_79b9_7f4a_7c15);
    let sets = (0..TRIALS).map(|_| draw.distinct(chosen.len(), SET)).collect::<Vec<_>>();
    let of_sets = sets.iter().filter_map(|set| linear(&set.iter().map(|i| chosen[*i]).collect::<Vec<_>>()));
    linear(&chosen)
        .into_iter()
        .chain(of_sets)
        .map(|candidate| (disagreement(&chosen, &candidate), candidate))
        .filter(|(disagreement, _)| disagreement.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

fn linear(pairs: &[PosePair]) -> Option<(ClosedFormSolution, f64)> {
    let x = ParkMartin.solve(pairs).ok()?.mount_from_camera.rotation();
    let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    let mut right = SVector::<f64, UNKNOWNS>::zeros();
    let mut turns = Matrix3::zeros();
    for pair in pairs {
        let robot = pair.anchor_from_mount.rotation();
        let seen = &pair.camera_from_target;
        let mut rows = SMatrix::<f64, 3, UNKNOWNS>::zeros();
        rows.fixed_view_mut::<3, 3>(0, 0).copy_from(robot.to_rotation_matrix().matrix());
        rows.fixed_view_mut::<3, 1>(0, 3).copy_from(&(robot * (x * seen.translation())));
        rows.fixed_view_mut::<3, 3>(0, 4).copy_from(&-Matrix3::identity());
        normal += rows.transpose() * rows;
        right -= rows.transpose() * pair.anchor_from_mount.translation();
        turns += (robot * x * seen.rotation()).to_rotation_matrix().matrix();
    }
    let found = normal.cholesky()?.solve(&right);
    let translation = |at: usize| Vector3::new(found[at], found[at + 1], found[at + 2]);
    let scale = found[3];
    let y = UnitQuaternion::from_matrix(&turns);
    let solution = ClosedFormSolution {
        mount_from_camera: Pose::from_isometry(Isometry3::from_parts(translation(0).into(), x)),
        anchor_from_target: Pose::from_isometry(Isometry3::from_parts(translation(4).into(), y)),
    };
    (scale.is_finite() && scale > 0.0).then_some((solution, scale))
}

/// Sum over the nearest part of the views, a radian counted as a metre.
fn disagreement(pairs: &[PosePair], (solution, scale): &(ClosedFormSolution, f64)) -> f64 {
    let mut each: Vec<f64> = pairs.iter().map(|pair| misfit(pair, solution, *scale)).collect();
    each.sort_by(f64::total_cmp);
    let agreeing = (AGREEING * each.len() as f64).ceil() as usize;
    each[..agreeing.min(each.len())].iter().sum()
}
