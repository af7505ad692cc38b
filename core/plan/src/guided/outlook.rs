//! How many views are still to be taken.

use super::choose::Plan;
use super::{Guide, IN_A_ROW, Known, LEAST_VIEWS, used_views};

impl Guide {
    /// Views that are expected to lead to the goal, those that are planned first; 0 where it is reached. `None` where no error
    /// may be stated, and where the goal takes more views than are allowed. Refers to the last [`Guide::next`].
    ///
    /// Within the plan the error falls as planned, beyond it with the square root of the number of views. The noise levels
    /// are those estimated now: with few views they may be off by half.
    pub fn views_left(&self, known: &Known<'_>, plan: &Plan) -> Option<usize> {
        let ratio = self.judged?.ratio_to(self.options.goal_m)?;
        let views = used_views(known.observations, known.fit()).len();
        let by_error = if ratio >= 1.0 { 0 } else { views_to(ratio, views, plan)? };
        // One answer that is good enough may be chance.
        let left = by_error.max(LEAST_VIEWS.saturating_sub(views)) + IN_A_ROW - 1;
        (views + left <= self.options.most_views).then_some(left)
    }
}

/// Views until the error is this fraction of the present one.
fn views_to(ratio: f64, views: usize, plan: &Plan) -> Option<usize> {
    if let Some(index) = plan.proposals.iter().position(|proposal| proposal.error_ratio <= ratio) {
        return Some(index + 1);
    }
    let last = plan.proposals.last()?.error_ratio;
    let planned = views + plan.proposals.len();
    let needed = (planned as f64 * (last / ratio).powi(2)).ceil();
    // Such a large number is more than allowed in any case.
    (needed < 1e6).then(|| needed as usize - views)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guided::choose::Proposal;
    use crate::guided::design::Part;
    use handeye_geometry::frames::Pose;

    fn plan(ratios: &[f64]) -> Plan {
        let proposal = |&error_ratio: &f64| Proposal {
            base_from_tip: Pose::identity(),
            camera_from_target: Pose::identity(),
            joints: None,
            travel_s: 1.0,
            error_ratio,
            part: Part::Position,
        };
        Plan { proposals: ratios.iter().map(proposal).collect(), best_ratio: 1.0, candidates: 9 }
    }

    #[test]
    fn within_the_plan_it_is_the_plan_that_says_and_beyond_it_the_root_of_the_number() {
        let ahead = plan(&[0.9, 0.8, 0.7]);
        assert_eq!(views_to(0.85, 9, &ahead), Some(2));
        // Twelve views have 0.7; half of that takes four times as many.
        assert_eq!(views_to(0.35, 9, &ahead), Some(48 - 9));
        assert_eq!(views_to(0.0, 9, &ahead), None, "an error of nothing is never reached");
        assert_eq!(views_to(0.5, 9, &plan(&[])), None);
    }
}
