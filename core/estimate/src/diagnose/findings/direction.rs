//! The direction of the answer that the views leave weakest, by eigen-analysis of its information.
//!
//! The covariance of the hand-eye transform is taken to the place where the board was seen and brought to one unit: a
//! turn counts by its effect on a point at the board's distance. Its largest eigenvalue belongs to the weakest direction,
//! its smallest to the best. What views determine follows from `(R − 1) t = …`: turns about axes across a direction
//! determine the camera's place along it, and turns about axes across an axis determine the camera's turn about it.

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector3};

use super::{Finding, FindingCode, Severity};
use crate::diagnose::Calibration;
use handeye_geometry::se3::skew;
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Ratio of weakest to best from which it is worth reporting: views on a wide cone leave a factor of three or four.
const UNEVEN: f64 = 5.0;
/// Largest standard deviation of the weakest direction, metres at the board, that is for information and not advice:
/// below it a calibration is good enough for most work.
const MATTERS_M: f64 = 5e-4;

pub fn finding(calibration: &Calibration) -> Option<Finding> {
    let (covariance, point) = (calibration.hand_eye_covariance()?, calibration.joint.as_ref()?.reference_point);
    let distance_m = point.coords.norm();
    // A point at the board moves by t + phi × p; a turn counts with the distance.
    let mut at_board = Matrix6::zeros();
    at_board.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    at_board.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&point.coords));
    at_board.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * distance_m));
    let moved = at_board * covariance * at_board.transpose();
    if !moved.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(0.5 * (moved + moved.transpose()));
    let (weakest, best) = (eigen.eigenvalues.imax(), eigen.eigenvalues.min().max(0.0));
    let sigma_m = eigen.eigenvalues[weakest].max(0.0).sqrt();
    let ratio = sigma_m / best.sqrt().max(1e-9);
    if ratio < UNEVEN {
        return None;
    }
    let vector = eigen.eigenvectors.column(weakest);
    let (shift, turn) = (vector.fixed_rows::<3>(0).into_owned(), vector.fixed_rows::<3>(3).into_owned());
    let is_turn = turn.norm() > shift.norm();
    let axis = if is_turn { turn } else { shift }.normalize();
    let axis = axis * axis[axis.iamax()].signum();
    let sigma_mm = sigma_m * 1e3;
    let (what, size) = if is_turn {
        let sigma_deg = (sigma_m * turn.norm() / distance_m).to_degrees();
        (
            text!("the camera's turn about {axis}", axis = named(&axis)),
            text!("±{deg}°, which is {mm} mm at the board", deg = shown(sigma_deg, 4), mm = shown(sigma_mm, 3)),
        )
    } else {
        (
            text!("the position of what it sees along {axis}", axis = named(&axis)),
            Text::verbatim(format!("±{sigma_mm:.3} mm")),
        )
    };
    let text = text!(
        "The weakest direction of the answer is {what}: {size} (one standard deviation), {ratio} times the best. Add views \
         turned by 30° and more to both sides about {across}.",
        what = what,
        size = size,
        ratio = format!("{ratio:.0}"),
        across = across(&axis)
    );
    let severity = if sigma_m > MATTERS_M { Severity::Advice } else { Severity::Info };
    let finding = Finding::new(FindingCode::WeakDirection, severity, text);
    let finding = finding.with("weakest_sigma", sigma_mm, "mm").with("weakest_over_best", ratio, "");
    Some(finding.with("camera_axis_x", axis.x, "").with("camera_axis_y", axis.y, "").with("camera_axis_z", axis.z, ""))
}

/// A direction in camera axes in words.
fn named(axis: &Vector3<f64>) -> Text {
    // Within 25° of an axis of the camera one word is near enough to act on.
    if axis.amax() < 0.9 {
        let axis = format!("[{:.2} {:.2} {:.2}]", axis.x, axis.y, axis.z);
        return text!("the axis {axis} of the camera", axis = axis);
    }
    match axis.iamax() {
        0 => text!("the camera's x axis (right)"),
        1 => text!("the camera's y axis (down)"),
        _ => text!("the camera's line of sight"),
    }
}

/// The camera axes across a direction.
fn across(axis: &Vector3<f64>) -> Text {
    match axis.iamax() {
        0 => text!("the camera's y axis and its line of sight"),
        1 => text!("the camera's x axis and its line of sight"),
        _ => text!("the camera's x and y axes"),
    }
}
