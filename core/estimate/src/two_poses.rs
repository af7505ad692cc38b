//! Which of the two poses of a flat target a view has, by the chain of all views.
//!
//! The corners of a small, distant, little tilted target leave two poses possible, and the one that fits them better is the
//! wrong one in up to a third of such views ([`planar_pose`]). The chain of the robot and the other views resolves this.

use crate::handeye::PosePair;
use crate::handeye::closed_form::ClosedFormSolution;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::planar_pose;

/// Takes the other pose of every view where the chain is nearer to it; returns whether there was any.
pub(super) fn take_agreeing(
    pairs: &mut [PosePair],
    alternatives: &mut [Option<Pose<Camera, Target>>],
    chain: &ClosedFormSolution,
) -> bool {
    let mut changed = false;
    for (pair, alternative) in pairs.iter_mut().zip(alternatives) {
        let expected = chain.mount_from_camera.inverse() * pair.anchor_from_mount.inverse() * chain.anchor_from_target;
        if let Some(other) = alternative
            && planar_pose::is_nearer(other, &pair.camera_from_target, &expected)
        {
            std::mem::swap(other, &mut pair.camera_from_target);
            changed = true;
        }
    }
    changed
}

#[cfg(test)]
mod tests {
    use crate::handeye::Mode;
    use crate::handeye::joint::Noise;
    use crate::{CameraKnowledge, Method, Observations, ObservedView, ViewStatus, fit};
    use handeye_geometry::planar_pose::{Solution, solve};
    use handeye_geometry::progress::CancelToken;
    use handeye_simulate::session::{REALISTIC, SMALL_TARGET, SmallTarget, camera, small_target_trial};

    #[test]
    fn good_views_whose_corners_fit_the_wrong_pose_better_are_not_called_outliers() {
        let how = SmallTarget { farthest_m: 0.8, tilt_deg: 15.0 };
        let noise = Noise { corner_px: 0.2, ..REALISTIC };
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let (mut deceptive, mut called) = (0, 0);
            for seed in 0..15 {
                let trial = small_target_trial(mode, 15, &noise, how, seed);
                let observations = Observations {
                    mode: Some(mode),
                    target: SMALL_TARGET,
                    image_size: (640, 480),
                    camera: CameraKnowledge::Fixed(camera()),
                    views: trial.views.iter().map(ObservedView::from).collect(),
                };
                let found = fit(&observations, Method::Joint, &CancelToken::default()).expect("solves");
                for ((view, truth), result) in trial.views.iter().zip(&trial.true_camera_from_target).zip(&found.views)
                {
                    let pose = solve(&view.corners, &SMALL_TARGET, &camera()).expect("a pose");
                    let off = |s: &Solution| s.camera_from_target.rotation().angle_to(&truth.rotation());
                    if pose.alternative.is_some_and(|other| off(&other) < off(&pose.best)) {
                        deceptive += 1;
                        called += usize::from(result.status == ViewStatus::Outlier);
                    }
                }
            }
            assert!(deceptive > 15, "the scene does not test what it should: {deceptive}");
            // Judged by the pose that fits the corners better, half of them were. What is left is noise of a pose that
            // is not Gaussian: it is linearised, and near a view square on the tilt is strongly nonlinear.
            assert!(called * 5 <= deceptive, "{called} of {deceptive}");
        }
    }
}
