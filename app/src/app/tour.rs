//! Visiting all taught poses, with a capture at each.

use super::App;
use crate::model::{CapturePurpose, CaptureRefused, MotionOutcome, RefusalKind, Severity, StopOutcome, Tour};
use crate::text;
use crate::text::Text;

impl App {
    pub(super) fn run_tour(&mut self, purpose: Option<CapturePurpose>) {
        let names: Vec<String> = self.model.document().taught.iter().map(|pose| pose.name.clone()).collect();
        if names.is_empty() {
            self.say(Severity::Warning, text!("There are no taught poses: teach some, or take the reference poses"));
            return;
        }
        self.model.tour = Some(Tour { names, purpose, outcomes: Vec::new(), began_s: self.model.now_s });
        self.model.touring = true;
        self.next_stop();
    }

    pub(super) fn stop_tour(&mut self) {
        if self.model.touring {
            self.stop();
        }
    }

    /// Sets out for the next pose, or ends the tour.
    fn next_stop(&mut self) {
        let Some(tour) = self.model.tour.as_ref().filter(|_| self.model.touring) else { return };
        if let Some(name) = tour.current() {
            let name = name.to_owned();
            self.go_to_taught(&name);
            return;
        }
        let of = tour.names.len();
        let done = tour.outcomes.iter().filter(|outcome| **outcome == StopOutcome::Done).count();
        let took_s = self.model.now_s - tour.began_s;
        self.model.touring = false;
        let severity = if done == of { Severity::Info } else { Severity::Warning };
        let took = format!("{took_s:.0}");
        self.say(severity, text!("Tour ended: {done} of {of} poses in {took} s", done = done, of = of, took = took));
    }

    fn end_stop(&mut self, outcome: StopOutcome) {
        if let Some(tour) = &mut self.model.tour {
            tour.outcomes.push(outcome);
        }
        self.next_stop();
    }

    /// The motion of the tour has ended.
    pub(super) fn tour_moved(&mut self, outcome: &MotionOutcome) {
        let Some(tour) = &self.model.tour else { return };
        match outcome {
            MotionOutcome::Arrived => match tour.purpose {
                Some(purpose) => {
                    let name = tour.current().map(str::to_owned);
                    self.capture(purpose, name);
                }
                None => self.end_stop(StopOutcome::Done),
            },
            // A pose that cannot be reached is left out; the others can still be visited.
            MotionOutcome::Refused(why) => self.end_stop(StopOutcome::Skipped(why.clone())),
            MotionOutcome::Stopped | MotionOutcome::Failed(_) => self.break_off(),
        }
    }

    /// The capture of the tour is on the disk.
    pub(super) fn tour_captured(&mut self) {
        if self.model.touring {
            self.end_stop(StopOutcome::Done);
        }
    }

    /// There is no capture at this pose. What concerns this pose alone does not end the tour.
    pub(super) fn tour_refused(&mut self, refused: &CaptureRefused) {
        if !self.model.touring {
            return;
        }
        match refused.kind {
            RefusalKind::NoBoard | RefusalKind::Blurred | RefusalKind::TooSimilar | RefusalKind::NotSettled => {
                self.end_stop(StopOutcome::Skipped(refused.why.clone()));
            }
            RefusalKind::NoPictures | RefusalKind::Cancelled | RefusalKind::NotSaved => self.break_off(),
        }
    }

    fn break_off(&mut self) {
        self.model.touring = false;
        let text: Text = text!("The tour was broken off; what was captured is kept");
        self.say(Severity::Warning, text);
    }
}
