//! The error that a calibration promises and that goals refer to: how near a tool arrives where the arm is known, else how near a
//! point is measured.

use nalgebra::{DMatrix, Vector3};

use super::Calibration;
use super::findings::FindingOptions;
use crate::corrected_arm::CorrectedArm;
use crate::placement::ArmOfViews;
use crate::reach_error::{Reach, ReachErrors, Seen};
use crate::robot_accuracy::{ReachByAccuracy, RobotAccuracy};
use crate::stated_uncertainty::StatedUncertainty;
use crate::uncertainty::quality::TipBox;
use crate::{Fit, ViewStatus};
use handeye_geometry::targets::TargetSpec;

/// The error that a goal refers to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Promised {
    /// 95 % of errors are below, metres.
    pub error_m: f64,
    /// The part of it that no view lowers, as far as it is known, metres.
    pub least_m: f64,
    /// What the error is of.
    pub of: Promise,
}

/// What a promise is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Promise {
    /// A point that the camera measures: nothing is known about the arm.
    Point,
    /// A tool that is sent to such a point, by commands as they are.
    Reach,
    /// The same by a robot of which only the stated accuracy is known.
    ReachByAccuracy,
    /// The same by corrected commands.
    ReachCorrected,
}

impl Promised {
    /// What a goal refers to, from what a tool arrives within by commands as they are and by corrected ones and from the expected
    /// error of a measured point, metres: commands as they are where these meet the goal, corrected ones else if they are better; a
    /// point where nothing is known about a tool.
    pub fn of(goal_m: f64, as_it_is_m: Option<f64>, corrected_m: Option<f64>, point_m: Option<f64>) -> Option<Self> {
        let Some(as_it_is) = as_it_is_m else {
            return point_m.map(|error_m| Self { error_m, least_m: 0.0, of: Promise::Point });
        };
        let corrected = corrected_m.filter(|corrected| as_it_is > goal_m && *corrected < as_it_is);
        Some(match corrected {
            Some(error_m) => Self { error_m, least_m: 0.0, of: Promise::ReachCorrected },
            None => Self { error_m: as_it_is, least_m: 0.0, of: Promise::Reach },
        })
    }

    /// The same where what a tool arrives within follows from the stated accuracy of the robot.
    #[must_use]
    pub fn by_accuracy(self, is_so: bool) -> Self {
        let of = if is_so && self.of == Promise::Reach { Promise::ReachByAccuracy } else { self.of };
        Self { of, ..self }
    }
}

impl Calibration {
    /// How near a tool arrives, at points of the target where it was seen; `None` where neither the arm is known nor how accurate
    /// the robot is, and where no error may be stated. An arm whose errors are contradicted by views left out is not known.
    ///
    /// Findings that the answer does not account for add how far they would move the answer.
    pub fn reach_errors(&self) -> Option<ReachErrors> {
        let at = self.joint.as_ref()?.reference_point;
        Some(self.reach_at_target?.moved_by(self.stated.moved_m(&at)))
    }

    /// The error of a measured point where the camera saw the target by the poses that the robot reports, 95 %, metres: the
    /// relation between images and poses does not depend on where the arm really is.
    pub fn error_by_poses_95_m(&self) -> Option<f64> {
        let joint = self.joint.as_ref()?;
        self.stated.error_95_m(self.hand_eye_covariance()?, joint.small_sample, &joint.reference_point)
    }

    /// Length of the tool of [`Self::reach_errors`], metres.
    pub fn tool_length_m(&self) -> Option<f64> {
        let by_accuracy = self.robot_accuracy().map(|accuracy| Vector3::from(accuracy.tool_m).norm());
        self.reach.as_ref().map(Reach::tool_length_m).or(by_accuracy)
    }

    /// What was stated about the robot, where [`Self::reach_errors`] uses it: joints, where they are known, give more.
    pub fn robot_accuracy(&self) -> Option<&RobotAccuracy> {
        self.reach_by_accuracy.as_ref().map(ReachByAccuracy::accuracy)
    }

    /// The error that a goal \[m\] refers to, see [`Promised::of`]. In a box it is that of its worst point: for a tool with a
    /// camera next to the robot, for a measured point with one on the arm. `None` where nothing may be stated, or the arm reaches
    /// no point of the box.
    pub fn promised(&self, goal_m: f64, tool_box: Option<&TipBox>) -> Option<Promised> {
        let reach = match tool_box {
            None => self.reach_errors(),
            Some(tool_box) if self.is_known_eye_to_hand() => Some(self.reach_in(tool_box)?),
            Some(_) => None,
        };
        let point_m = match tool_box {
            None => self.tip_error_95_m(),
            Some(tool_box) => {
                let errors = tool_box.corners_and_middle().map(|point| self.error_95_m(&point));
                errors.into_iter().collect::<Option<Vec<f64>>>().and_then(|all| all.into_iter().reduce(f64::max))
            }
        };
        let as_it_is_m = reach.map(|reach| reach.as_it_is_95_m);
        let promised = Promised::of(goal_m, as_it_is_m, reach.and_then(|reach| reach.corrected_95_m), point_m)?;
        let promised = promised.by_accuracy(self.robot_accuracy().is_some());
        let least_m = reach.map_or(0.0, |reach| match promised.of {
            Promise::Point => 0.0,
            Promise::Reach | Promise::ReachByAccuracy => reach.as_it_is_least_95_m,
            Promise::ReachCorrected => reach.repeatability_95_m.unwrap_or(0.0),
        });
        Some(Promised { least_m, ..promised })
    }

    /// How the distance that a tool arrives within by corrected commands depends on what is not known, see [`Reach::weight`].
    /// `None` where the arm is not known or reaches too few points, and where no commands are corrected.
    pub fn reach_weight(&self, tool_box: Option<&TipBox>) -> Option<DMatrix<f64>> {
        let points = tool_box.map(TipBox::corners_and_middle);
        let reach = self.reach.as_ref().filter(|reach| points.is_none() || reach.is_eye_to_hand())?;
        self.reach_at_target?.corrected_95_m?;
        reach.weight(points.as_ref().map(|points| &points[..]))
    }

    /// Whether it is known how near a tool arrives at points of a camera next to the robot.
    fn is_known_eye_to_hand(&self) -> bool {
        let is_eye_to_hand = |by_accuracy: &ReachByAccuracy| by_accuracy.is_eye_to_hand();
        self.reach.as_ref().map_or(self.reach_by_accuracy.as_ref().is_some_and(is_eye_to_hand), Reach::is_eye_to_hand)
    }

    fn reach_in(&self, tool_box: &TipBox) -> Option<ReachErrors> {
        let points = tool_box.corners_and_middle();
        let moved_m = points.iter().map(|point| self.stated.moved_m(point)).fold(0.0, f64::max);
        let errors = match (&self.reach, &self.reach_by_accuracy) {
            (Some(reach), _) => reach.at_points(&points),
            (None, by_accuracy) => by_accuracy.as_ref()?.at_points(&points),
        };
        Some(errors?.moved_by(moved_m))
    }
}

/// The tool and the arm of a fit whose views are known; `None` where these give no error of reach.
pub(super) fn reach(fit: &Fit, of_views: &ArmOfViews, target: &TargetSpec) -> Option<Reach> {
    let errors = fit.arm()?;
    let placement = &of_views.placement;
    let arm = CorrectedArm::new(placement.arm.clone(), errors)?.with_tool(of_views.tool_m.into());
    let seen = fit.views.iter().zip(&of_views.joints_rad).filter_map(|(view, joints_rad)| {
        let camera_from_target = view.camera_from_target.filter(|_| view.status == ViewStatus::Used)?;
        Some(Seen { joints_rad: joints_rad.clone()?, camera_from_target })
    });
    let is_its_own = placement.arm_of_poses().is_some();
    Reach::new((&arm, errors), fit.hand_eye.as_ref()?, seen.collect(), target, is_its_own)
}

/// The robot of a calibration where only its accuracy is known, and how near a tool arrives at the target; `None` where its arm is
/// known, and where no error may be stated.
pub(super) fn reach_by_accuracy(
    calibration: &Calibration,
    wanted: &FindingOptions<'_>,
    target: &TargetSpec,
) -> Option<(ReachByAccuracy, ReachErrors)> {
    let is_asked = calibration.reach.is_none() && calibration.stated != StatedUncertainty::Nothing;
    let accuracy = wanted.robot_accuracy.as_ref().filter(|_| is_asked)?;
    let joint = calibration.joint.as_ref()?;
    let of_hand_eye = (calibration.hand_eye.as_ref()?, calibration.hand_eye_covariance()?, joint.small_sample);
    let used = calibration.views.iter().filter(|view| view.status == ViewStatus::Used);
    let views = used.filter_map(|view| view.camera_from_target).collect();
    // The uncorrected controller has the pose-dependent error as well.
    let noise = joint.noise;
    let [field_m, field_rad] = if joint.field.is_some() { [noise.field_m, noise.field_rad] } else { [0.0; 2] };
    let shown = [noise.robot_m.hypot(field_m), noise.robot_rad.hypot(field_rad)];
    let by_accuracy = ReachByAccuracy::new(accuracy, shown, of_hand_eye, views, target)?;
    let at_target = by_accuracy.at_target()?;
    Some((by_accuracy, at_target))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_is_asked_of_the_way_that_will_be_used() {
        let of = |goal_m, as_it_is, corrected, point| {
            Promised::of(goal_m, as_it_is, corrected, point).map(|promised| (promised.error_m, promised.of))
        };
        assert_eq!(of(1.0, Some(0.9), Some(0.1), Some(0.5)), Some((0.9, Promise::Reach)), "as it is it is good enough");
        assert_eq!(of(0.8, Some(0.9), Some(0.1), Some(0.5)), Some((0.1, Promise::ReachCorrected)));
        assert_eq!(of(0.8, Some(0.9), Some(1.1), Some(0.5)), Some((0.9, Promise::Reach)), "no correction helps");
        assert_eq!(of(0.8, Some(0.9), None, Some(0.5)), Some((0.9, Promise::Reach)), "none is known");
        assert_eq!(of(0.8, None, None, Some(0.5)), Some((0.5, Promise::Point)));
        assert_eq!(of(0.8, None, None, None), None);
    }
}
