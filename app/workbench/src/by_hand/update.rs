//! How a calibration goes on that a person is guided through.

use std::sync::Arc;

use handeye_estimate::Method;
use handeye_plan::guided::by_hand::HandNext;
use handeye_plan::guided::{CHECKS, Ending};
use handeye_session::Role;

use super::state::{ByHand, HandChoice, HandWaits};
use super::worker::HandJob;
use crate::app::App;
use crate::guided::state::{ended, options};
use crate::model::{CapturePurpose, Motion, Pane, Severity, SolveStatus};
use crate::text::Text;
use handeye_wording::text;

/// How long a robot has to stand in a good view before the capture begins \[s\]: a hand that passes by does not.
const REST_S: f64 = 0.4;
/// Views that are asked for to check the answer, at the most: whether the robot gets there is not known, so many are skipped.
const MOST_CHECK_VIEWS: usize = 30;
/// How far it may move meanwhile [m, rad]. The capture itself waits until robot and image have settled.
const RESTS_WITHIN: (f64, f64) = (2e-3, 0.01);

/// How far the robot has to go from where a capture was refused before another one is tried [m, rad].
const OTHER_PLACE: (f64, f64) = (0.02, 0.07);

impl App {
    /// Guides a person from the board in view to the goal. Captures that there are count; without any the first is taken here.
    pub(crate) fn guide_by_hand(&mut self) {
        if self.model.sequence_runs || self.model.planning || self.model.by_hand.is_some() {
            return;
        }
        let views = self.model.document().in_use().filter(|it| self.corners(it.id).is_some()).count();
        let options = options(self.model.view.goal.0, views);
        // What a view adds is known of the joint estimate alone.
        self.set_method(Method::Joint.name());
        self.model.messages.is_over_in(Pane::Poses);
        let waits = if views > 0 { HandWaits::Answer } else { HandWaits::Capture };
        self.model.by_hand = Some(Box::new(ByHand::new(options, waits, self.model.now_s)));
        if waits == HandWaits::Capture {
            self.capture(CapturePurpose::Calibrate, None);
        }
    }

    /// No more views.
    pub(crate) fn stop_guiding(&mut self) {
        if self.model.by_hand.take().is_some() {
            self.say(Severity::Info, text!("Guiding has ended; what was captured is kept"));
        }
    }

    /// A person leaves out the view that is wanted.
    pub(crate) fn skip_view(&mut self) {
        let Some(hand) = self.model.by_hand.as_deref_mut().filter(|hand| hand.waits == HandWaits::View) else { return };
        if hand.ending.is_none() {
            hand.guide.skipped();
        }
        hand.goes_on();
        self.guided_by_hand_step();
    }

    /// Asks for the next view as soon as the answer from all captures is there; looked at after every event.
    pub(crate) fn guided_by_hand_step(&mut self) {
        let waits = self.model.by_hand.as_ref().map(|hand| hand.waits);
        if waits == Some(HandWaits::Capture) && self.model.capture.is_none() {
            // The capture was refused, or never began.
            self.view_again();
        }
        let is_busy = matches!(self.model.solve.status, SolveStatus::Running { .. }) || self.model.capture.is_some();
        if waits != Some(HandWaits::Answer) || is_busy || !self.is_asked() {
            return;
        }
        let (Some(intrinsics), Some(hand)) = (self.model.intrinsics(), self.model.by_hand.as_deref()) else { return };
        if hand.checked >= CHECKS || hand.tried >= MOST_CHECK_VIEWS {
            return self.guiding_finished();
        }
        let check = hand.ending.as_ref().map(|_| (hand.tried, hand.tried.saturating_sub(hand.checked)));
        let (mut guide, elapsed_s) = (hand.guide.clone(), self.model.now_s - hand.began_s);
        guide.work_in(self.chosen_box());
        let solved = self.model.solve.solved.clone().filter(|_| self.model.solve.fresh);
        let document = Arc::clone(&self.model.session.document);
        let observations = self.seen(&document).observations;
        self.numbers.view += 1;
        let number = self.numbers.view;
        self.desk.choose_view(HandJob { number, guide, observations, intrinsics, solved, elapsed_s, check });
        if let Some(hand) = self.model.by_hand.as_deref_mut() {
            hand.waits = HandWaits::Choice;
            hand.tried += usize::from(check.is_some());
        }
    }

    /// The next view is chosen, or there is none.
    pub(crate) fn view_chosen(&mut self, number: u64, choice: HandChoice) {
        let is_awaited = |hand: &&mut Box<ByHand>| hand.waits == HandWaits::Choice;
        if number != self.numbers.view {
            return;
        }
        let Some(hand) = self.model.by_hand.as_mut().filter(is_awaited) else { return };
        hand.guide = choice.guide;
        match choice.next {
            Some(HandNext::Take(wanted)) => {
                hand.wanted = Some(wanted);
                hand.judged = None;
                hand.rests = None;
                hand.waits = HandWaits::View;
            }
            Some(HandNext::End(_)) if matches!(self.model.solve.status, SolveStatus::Running { .. }) => {
                // The captures or the goal are others than those that were chosen by.
                hand.goes_on();
            }
            Some(HandNext::End(ending)) => {
                let said = ending.text();
                hand.ending = Some(ending);
                hand.goes_on();
                if !self.model.solve.fresh {
                    self.guiding_ends(Severity::Warning, said);
                }
            }
            None if hand.ending.is_some() => self.guiding_finished(),
            None => self.guiding_ends(Severity::Warning, Ending::NoStart.text()),
        }
    }

    /// Compares the newest image with the view that is wanted, and captures where it is good and the robot stands.
    pub(crate) fn look_by_hand(&mut self) {
        let now_s = self.model.now_s;
        if self.model.motion != Motion::Idle || self.model.sequence_runs {
            return;
        }
        let Some(hand) = self.model.by_hand.as_deref_mut().filter(|hand| hand.waits == HandWaits::View) else { return };
        let (Some(wanted), Some(detection)) = (&hand.wanted, &self.model.detection) else { return };
        let (seen, Some(tip)) = (detection.corners.as_ref(), detection.base_from_tip) else { return };
        hand.judged = seen.map(|corners| wanted.judge(corners, &tip));
        if hand.refused_at.is_some_and(|at| !has_left(at.distance_to(&tip))) {
            hand.rests = None;
            return;
        }
        hand.refused_at = None;
        hand.rests = match (hand.judged.is_some_and(|judged| judged.is_good), hand.rests) {
            (false, _) => None,
            (true, Some((since_s, at))) if rests(at.distance_to(&tip)) => Some((since_s, at)),
            (true, _) => Some((now_s, tip)),
        };
        let is_ready = hand.rests.is_some_and(|(since_s, _)| now_s - since_s >= REST_S);
        if !is_ready || self.model.capture.is_some() {
            return;
        }
        hand.waits = HandWaits::Capture;
        let purpose = if hand.ending.is_some() { CapturePurpose::Verify } else { CapturePurpose::Calibrate };
        self.capture(purpose, None);
    }

    /// A capture is on the disk, whoever asked for it.
    pub(crate) fn captured_by_hand(&mut self, role: Option<Role>) {
        let Some(hand) = self.model.by_hand.as_deref_mut().filter(|hand| hand.waits != HandWaits::Choice) else {
            return;
        };
        match (role, &hand.ending) {
            (Some(Role::Verification), Some(_)) => hand.checked += 1,
            (Some(Role::Calibration), None) => hand.guide.captured(),
            // What somebody took besides answers no question of the guide.
            _ => {}
        }
        hand.goes_on();
    }

    /// The capture gave nothing: the same view is still wanted, or the first one anew.
    fn view_again(&mut self) {
        let Some(hand) = self.model.by_hand.as_deref_mut() else { return };
        hand.rests = None;
        if hand.wanted.is_some() {
            hand.waits = HandWaits::View;
            hand.refused_at = self.model.detection.as_ref().and_then(|detection| detection.base_from_tip);
        } else {
            let said =
                text!("The board was not captured: bring the whole board into the image, hold still and begin again");
            self.guiding_ends(Severity::Warning, said);
        }
    }

    fn guiding_finished(&mut self) {
        let said = self.model.by_hand.as_ref().and_then(|hand| Some(ended(hand.ending.as_ref()?, hand.checked)));
        let Some((severity, said)) = said else { return };
        self.guiding_ends(severity, said);
    }

    fn guiding_ends(&mut self, severity: Severity, why: Text) {
        self.model.by_hand = None;
        match severity {
            Severity::Info => self.say(severity, why),
            _ => self.say_in(Pane::Poses, severity, why),
        }
    }
}

impl ByHand {
    /// To the answer from all captures, and the next view after it.
    fn goes_on(&mut self) {
        self.waits = HandWaits::Answer;
        self.wanted = None;
        self.judged = None;
        self.rests = None;
    }
}

/// Whether it is another place than that of a capture that was refused.
fn has_left((m, rad): (f64, f64)) -> bool {
    m > OTHER_PLACE.0 || rad > OTHER_PLACE.1
}

fn rests((m, rad): (f64, f64)) -> bool {
    m <= RESTS_WITHIN.0 && rad <= RESTS_WITHIN.1
}
