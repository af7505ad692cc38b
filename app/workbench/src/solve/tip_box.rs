//! The expected error over a box of the workspace.

use handeye_estimate::ViewStatus;
use handeye_estimate::handeye::HandEye;
use handeye_estimate::uncertainty::quality::{self, BoxError, TipBox};
use handeye_geometry::frames::{Base, Camera, Pose};
use handeye_geometry::point_error;
use handeye_session::Document;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::solve::state::Solved;

/// Half a side of the box that is judged before one is chosen \[m\].
const HALF_SIDE_M: f64 = 0.1;

/// A box, its sides along the axes of the base.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorkBox {
    /// One corner, in the base \[m\].
    pub from_m: [f64; 3],
    /// The opposite one, in the base \[m\].
    pub to_m: [f64; 3],
}

/// The box and how well points in it are measured.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BoxState {
    /// The chosen box; `None` for the one about the target.
    pub chosen: Option<WorkBox>,
    /// The box that is judged and the error over it; `None` while no uncertainty is stated.
    pub judged: Option<(WorkBox, BoxError)>,
}

/// The expected error (95 %) over a box; without one, over the box about where the target was seen. `None` where the
/// calibration states no uncertainty.
pub fn judge_box(chosen: Option<WorkBox>, solved: &Solved, document: &Document) -> Option<(WorkBox, BoxError)> {
    let calibration = &solved.calibration;
    // Stated everywhere or nowhere.
    calibration.tip_error_95_m()?;
    let work_box = match chosen {
        Some(chosen) => chosen,
        None => about_target(&calibration.hand_eye?, solved, document)?,
    };
    let error_95_m = |point: &Point3<f64>| calibration.error_95_m(point).unwrap_or(f64::INFINITY);
    let error = quality::tip_error_95_over(error_95_m, &in_camera(&work_box, solved, document)?);
    Some((work_box, error))
}

/// Where the camera sees a box. `None` where the calibration has no covariance.
///
/// A camera on the tip sees the box from many places, and the error of a point depends on where it is in the camera. The
/// capture that counts is the one from which the centre of the box is known worst.
pub fn in_camera(work_box: &WorkBox, solved: &Solved, document: &Document) -> Option<TipBox> {
    let covariance = *solved.calibration.hand_eye_covariance()?;
    let (from, to) = (Point3::from(work_box.from_m), Point3::from(work_box.to_m));
    let middle = nalgebra::center(&from, &to);
    let variance = |camera_from_base: &Pose<Camera, Base>| {
        point_error::covariance(&covariance, &(camera_from_base.isometry() * middle)).trace()
    };
    let places = views_of_base(&solved.calibration.hand_eye?, solved, document);
    let worst = places.into_iter().max_by(|a, b| variance(a).total_cmp(&variance(b)))?;
    Some(TipBox::in_base(from, to, &worst))
}

/// From where the base was seen by the captures of the fit; once for a camera that is fixed.
fn views_of_base(hand_eye: &HandEye, solved: &Solved, document: &Document) -> Vec<Pose<Camera, Base>> {
    match *hand_eye {
        HandEye::EyeToHand { base_from_camera, .. } => vec![base_from_camera.inverse()],
        HandEye::EyeInHand { tip_from_camera, .. } => {
            let used = solved.captures.iter().zip(&solved.calibration.views);
            let used = used.filter(|(_, view)| view.status == ViewStatus::Used);
            used.filter_map(|(id, _)| document.capture(*id))
                .filter_map(|record| Some((record.base_from_tip? * tip_from_camera).inverse()))
                .collect()
        }
    }
}

fn about_target(hand_eye: &HandEye, solved: &Solved, document: &Document) -> Option<WorkBox> {
    let middle = match hand_eye {
        HandEye::EyeInHand { base_from_target, .. } => base_from_target.isometry() * document.meta.target.centre(),
        HandEye::EyeToHand { base_from_camera, .. } => {
            base_from_camera.isometry() * solved.calibration.joint.as_ref()?.reference_point
        }
    };
    let at = |half_side_m: f64| [middle.x + half_side_m, middle.y + half_side_m, middle.z + half_side_m];
    Some(WorkBox { from_m: at(-HALF_SIDE_M), to_m: at(HALF_SIDE_M) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::sample;

    #[test]
    fn the_box_is_about_the_target_until_another_is_chosen_and_worse_farther_away() {
        let model = sample::solved();
        let solved = model.solve.current().expect("solved");
        let (about, near) = judge_box(None, solved, model.document()).expect("a joint estimate");
        let HandEye::EyeInHand { base_from_target, .. } = solved.calibration.hand_eye.expect("a hand-eye") else {
            panic!("the camera is on the tip")
        };
        let middle = base_from_target.isometry() * model.document().meta.target.centre();
        for axis in 0..3 {
            assert!((0.5 * (about.from_m[axis] + about.to_m[axis]) - middle[axis]).abs() < 1e-12);
            assert!((about.to_m[axis] - about.from_m[axis] - 0.2).abs() < 1e-12);
        }
        assert!(near.mean_m > 0.0 && near.worst_m > near.mean_m, "{near:?}");
        let swapped = WorkBox { from_m: about.to_m, to_m: about.from_m };
        let (kept, same) = judge_box(Some(swapped), solved, model.document()).expect("a joint estimate");
        assert_eq!(kept, swapped);
        assert!((same.worst_m - near.worst_m).abs() < 1e-9 && (same.mean_m - near.mean_m).abs() < 1e-9);
        // An error of the rotation grows with the distance.
        let far = WorkBox { from_m: about.from_m.map(|m| m - 2.0), to_m: about.to_m.map(|m| m - 2.0) };
        let (_, far) = judge_box(Some(far), solved, model.document()).expect("a joint estimate");
        assert!(far.mean_m > near.worst_m, "{far:?} {near:?}");
    }

    #[test]
    fn a_calibration_without_uncertainty_judges_no_box() {
        let model = sample::solved();
        let mut solved = Solved::clone(model.solve.current().expect("solved"));
        solved.calibration.joint = None;
        assert!(judge_box(None, &solved, model.document()).is_none());
    }
}
