//! How a calibration with guidance by hand continues.

use std::sync::Arc;

use handeye_estimate::Method;
use handeye_plan::guided::by_hand::HandNext;
use handeye_plan::guided::{CHECKS, Ending};
use handeye_session::Role;

use super::command::{Command, Event};
use super::state::{ByHand, HandChoice, HandWaits};
use super::worker::HandJob;
use crate::app::context::{Context, Numbers};
use crate::capture::state::CapturePurpose;
use crate::capture::update::capture;
use crate::guided::state::{ended, options};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::state::Motion;
use crate::session::desk::SessionThreads;
use crate::shell::state::Pane;
use crate::solve::state::SolveStatus;
use crate::solve::update::{chosen_box, corners, is_asked, seen, set_method};
use crate::text::Text;
use crate::worker::threads::Workers;
use handeye_wording::text;

/// How long a robot has to rest in a good view before the capture begins \[s\]: a hand that moves past does not.
const REST_S: f64 = 0.4;
/// Views that are requested to check the answer, at most: whether the robot gets there is not known, so many are skipped.
const MOST_CHECK_VIEWS: usize = 30;
/// How far it may move meanwhile [m, rad]. The capture itself waits until robot and image have settled.
const RESTS_WITHIN: (f64, f64) = (2e-3, 0.01);

/// How far the robot has to go from where a capture was refused before another one is tried [m, rad].
const OTHER_PLACE: (f64, f64) = (0.02, 0.07);

/// Does what is wanted of guiding by hand.
pub(crate) fn apply(cx: &mut Context, command: Command) {
    match command {
        Command::Guide => guide_by_hand(cx),
        Command::SkipView => skip_view(&mut cx.model, &mut cx.desk, &mut cx.numbers),
        Command::StopGuiding => stop_guiding(&mut cx.model),
    }
}

/// Takes in the view that was chosen.
pub(crate) fn absorb(model: &mut Model, numbers: &Numbers, event: Event) {
    let Event::ViewChosen { number, choice } = event;
    view_chosen(model, numbers, number, *choice);
}

/// Guides the user from the board in view to the goal. Existing captures count; if there are none, the first is taken
/// here.
fn guide_by_hand(cx: &mut Context) {
    if cx.model.sequence_runs || cx.model.planning || cx.model.by_hand.is_some() {
        return;
    }
    let views = cx.model.document().in_use().filter(|it| corners(&cx.model, it.id).is_some()).count();
    let options = options(cx.model.view.goal.0, views);
    // What a view adds is only known for the joint estimate.
    set_method(&mut cx.model, &mut cx.desk, &mut cx.numbers, Method::Joint.name());
    cx.model.messages.is_over_in(Pane::Poses);
    let waits = if views > 0 { HandWaits::Answer } else { HandWaits::Capture };
    cx.model.by_hand = Some(Box::new(ByHand::new(options, waits, cx.model.now_s)));
    if waits == HandWaits::Capture {
        capture(&mut cx.model, &cx.workers, &mut cx.numbers, CapturePurpose::Calibrate, None);
    }
}

/// No more views.
fn stop_guiding(model: &mut Model) {
    if model.by_hand.take().is_some() {
        model.notify(Severity::Info, text!("Guiding has ended; what was captured is kept"));
    }
}

/// The user skips the wanted view.
fn skip_view(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    let Some(hand) = model.by_hand.as_deref_mut().filter(|hand| hand.waits == HandWaits::View) else { return };
    if hand.ending.is_none() {
        hand.guide.skipped();
    }
    hand.goes_on();
    guided_by_hand_step(model, desk, numbers);
}

/// Requests the next view as soon as the answer from all captures is there; checked after every event.
pub(crate) fn guided_by_hand_step(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    let waits = model.by_hand.as_ref().map(|hand| hand.waits);
    if waits == Some(HandWaits::Capture) && model.capture.is_none() {
        // The capture was refused, or never began.
        view_again(model);
    }
    let is_busy = matches!(model.solve.status, SolveStatus::Running { .. }) || model.capture.is_some();
    if waits != Some(HandWaits::Answer) || is_busy || !is_asked(model, numbers) {
        return;
    }
    let (Some(intrinsics), Some(hand)) = (model.intrinsics(), model.by_hand.as_deref()) else { return };
    if hand.checked >= CHECKS || hand.tried >= MOST_CHECK_VIEWS {
        return guiding_finished(model);
    }
    let check = hand.ending.as_ref().map(|_| (hand.tried, hand.tried.saturating_sub(hand.checked)));
    let (mut guide, elapsed_s) = (hand.guide.clone(), model.now_s - hand.began_s);
    guide.work_in(chosen_box(model));
    let solved = model.solve.solved.clone().filter(|_| model.solve.fresh);
    let document = Arc::clone(&model.session.document);
    let observations = seen(model, &document).observations;
    numbers.view += 1;
    let number = numbers.view;
    desk.choose_view(HandJob { number, guide, observations, intrinsics, solved, elapsed_s, check });
    if let Some(hand) = model.by_hand.as_deref_mut() {
        hand.waits = HandWaits::Choice;
        hand.tried += usize::from(check.is_some());
    }
}

/// The next view is chosen, or there is none.
fn view_chosen(model: &mut Model, numbers: &Numbers, number: u64, choice: HandChoice) {
    let is_awaited = |hand: &&mut Box<ByHand>| hand.waits == HandWaits::Choice;
    if number != numbers.view {
        return;
    }
    let Some(hand) = model.by_hand.as_mut().filter(is_awaited) else { return };
    hand.guide = choice.guide;
    match choice.next {
        Some(HandNext::Take(wanted)) => {
            hand.wanted = Some(wanted);
            hand.judged = None;
            hand.rests = None;
            hand.waits = HandWaits::View;
        }
        Some(HandNext::End(_)) if matches!(model.solve.status, SolveStatus::Running { .. }) => {
            // The captures or the goal have changed since the choice.
            hand.goes_on();
        }
        Some(HandNext::End(ending)) => {
            let reported = ending.text();
            hand.ending = Some(ending);
            hand.goes_on();
            if !model.solve.fresh {
                guiding_ends(model, Severity::Warning, reported);
            }
        }
        None if hand.ending.is_some() => guiding_finished(model),
        None => guiding_ends(model, Severity::Warning, Ending::NoStart.text()),
    }
}

/// Compares the newest image with the view that is wanted, and captures where it is good and the robot is at rest.
pub(crate) fn look_by_hand(model: &mut Model, workers: &Workers, numbers: &mut Numbers) {
    let now_s = model.now_s;
    if model.motion != Motion::Idle || model.sequence_runs {
        return;
    }
    let Some(hand) = model.by_hand.as_deref_mut().filter(|hand| hand.waits == HandWaits::View) else { return };
    let (Some(wanted), Some(detection)) = (&hand.wanted, &model.detection) else { return };
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
    if !is_ready || model.capture.is_some() {
        return;
    }
    hand.waits = HandWaits::Capture;
    let purpose = if hand.ending.is_some() { CapturePurpose::Verify } else { CapturePurpose::Calibrate };
    capture(model, workers, numbers, purpose, None);
}

/// A capture is on the disk, whether the guide or the user requested it.
pub(crate) fn captured_by_hand(model: &mut Model, role: Option<Role>) {
    let Some(hand) = model.by_hand.as_deref_mut().filter(|hand| hand.waits != HandWaits::Choice) else {
        return;
    };
    match (role, &hand.ending) {
        (Some(Role::Verification), Some(_)) => hand.checked += 1,
        (Some(Role::Calibration), None) => hand.guide.captured(),
        // A capture that the user took in addition is not an answer to the guide.
        _ => {}
    }
    hand.goes_on();
}

/// The capture gave nothing: the same view is still wanted, or the first one again.
fn view_again(model: &mut Model) {
    let Some(hand) = model.by_hand.as_deref_mut() else { return };
    hand.rests = None;
    if hand.wanted.is_some() {
        hand.waits = HandWaits::View;
        hand.refused_at = model.detection.as_ref().and_then(|detection| detection.base_from_tip);
    } else {
        let reported =
            text!("The board was not captured: bring the whole board into the image, hold still and begin again");
        guiding_ends(model, Severity::Warning, reported);
    }
}

fn guiding_finished(model: &mut Model) {
    let reported = model.by_hand.as_ref().and_then(|hand| Some(ended(hand.ending.as_ref()?, hand.checked)));
    let Some((severity, reported)) = reported else { return };
    guiding_ends(model, severity, reported);
}

fn guiding_ends(model: &mut Model, severity: Severity, why: Text) {
    model.by_hand = None;
    match severity {
        Severity::Info => model.notify(severity, why),
        _ => model.notify_in(Pane::Poses, severity, why),
    }
}

impl ByHand {
    /// On to the answer from all captures, and the next view after it.
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
