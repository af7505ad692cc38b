//! Chooses the next view for a user who moves the robot by hand.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use handeye_estimate::Observations;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_plan::guided::Known;
use handeye_plan::guided::by_hand::{HandGuide, HandNext};

use super::state::HandChoice;
use crate::by_hand;
use crate::solve::state::Solved;
use crate::worker::link::Outlet;

/// A requested choice.
pub(crate) struct HandJob {
    pub number: u64,
    /// What chooses.
    pub guide: HandGuide,
    /// What was observed.
    pub observations: Observations,
    /// The lens with which the first views are drawn.
    pub intrinsics: Intrinsics,
    /// The answer from them, if there is one.
    pub solved: Option<Arc<Solved>>,
    /// Since the beginning \[s\].
    pub elapsed_s: f64,
    /// The number of the check and how many were skipped, if a verification view is requested.
    pub check: Option<(usize, usize)>,
}

/// Chooses and reports.
pub fn choose(job: &HandJob, cancel: &CancelToken, outlet: &Outlet) {
    let mut guide = job.guide.clone();
    let calibration = job.solved.as_ref().map(|solved| &solved.calibration);
    let known = Known { observations: &job.observations, calibration, robot: None, elapsed_s: job.elapsed_s };
    let chosen = catch_unwind(AssertUnwindSafe(|| chosen(job, &mut guide, &known, cancel)));
    let next = chosen.unwrap_or_else(|_panic| {
        // A panic must not end the thread, nor leave the user waiting.
        tracing::error!("the choice of a view failed by a defect of this program: report it");
        None
    });
    if !cancel.is_cancelled() {
        outlet.report(by_hand::Event::ViewChosen { number: job.number, choice: Box::new(HandChoice { guide, next }) });
    }
}

fn chosen(job: &HandJob, guide: &mut HandGuide, known: &Known<'_>, cancel: &CancelToken) -> Option<HandNext> {
    if let Some((index, skips)) = job.check {
        guide.check(known, index, skips, cancel).map(|wanted| HandNext::Take(Box::new(wanted)))
    } else {
        let views = job.observations.views.iter().filter(|view| view.in_fit);
        let first = views.filter_map(|view| view.corners.as_ref()).find_map(|corners| {
            planar_pose::camera_from_target(corners, &job.observations.target, &job.intrinsics).ok()
        });
        first.map(|first| guide.next(known, &first, &job.intrinsics, cancel))
    }
}
