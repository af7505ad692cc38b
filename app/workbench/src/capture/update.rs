//! Captures.

use handeye_capture::Wait;
use handeye_session::CaptureId;

use super::command::{Command, Event};
use crate::app::{Context, Numbers};
use crate::by_hand::update::captured_by_hand;
use crate::capture::CaptureRequest;
use crate::connect::update::forget_typed_pose;
use crate::model::{CapturePurpose, CaptureRefused, CaptureUnderWay, CaptureWait, Model, Pane, Severity};
use crate::taught::sequence::{break_off, sequence_captured, sequence_refused};
use crate::worker::{VisionTask, Workers};
use handeye_wording::text;

/// Does what the user wants with captures.
pub(crate) fn apply(model: &mut Model, workers: &Workers, numbers: &mut Numbers, command: Command) {
    match command {
        Command::Take(purpose) => capture(model, workers, numbers, purpose, None),
        Command::Cancel => cancel_capture(model, workers),
        Command::SetOptions(options) => model.view.capture = options,
    }
}

/// Takes in the progress of a capture.
pub(crate) fn absorb(cx: &mut Context, event: Event) {
    match event {
        Event::Waits { number, wait } => capture_waits(&mut cx.model, number, wait),
        Event::Refused { number, refused } => capture_refused(cx, number, refused),
        Event::Captured { number, id } => {
            captured(cx, number, id);
            forget_typed_pose(&mut cx.model, &cx.workers);
        }
    }
}

/// Takes a capture as soon as robot and image have settled.
pub(crate) fn capture(
    model: &mut Model,
    workers: &Workers,
    numbers: &mut Numbers,
    purpose: CapturePurpose,
    pose_name: Option<String>,
) {
    if model.capture.is_some() {
        // Pressing twice must not take two captures.
        return;
    }
    if refuses_without_robot(model) {
        return;
    }
    numbers.capture += 1;
    let number = numbers.capture;
    let options = model.view.capture;
    let request = CaptureRequest::new(number, purpose, options, pose_name, model.document());
    let asked = workers.ask_vision(VisionTask::Capture(request));
    if asked.is_ok() {
        let since_s = model.now_s;
        model.capture = Some(CaptureUnderWay { number, purpose, wait: CaptureWait::Images(Wait::ForImage), since_s });
        model.refused = None;
    }
    let has_begun = asked.is_ok();
    model.notify_if_refused(text!("There is no capture"), asked);
    if !has_begun && model.sequence_runs {
        break_off(model, None);
    }
}

/// Whether nothing can be captured into this session, which is reported.
pub(crate) fn refuses_without_robot(model: &mut Model) -> bool {
    let refuses = model.document().mode().is_none();
    if refuses {
        let why = text!("This session has images without a robot: begin a new session for captures");
        model.notify(Severity::Warning, why);
    }
    refuses
}

pub(crate) fn cancel_capture(model: &mut Model, workers: &Workers) {
    if model.capture.is_some() {
        let asked = workers.ask_vision(VisionTask::CancelCapture);
        model.notify_if_refused(text!("The capture was not cancelled"), asked);
    }
}

fn capture_waits(model: &mut Model, number: u64, wait: CaptureWait) {
    if let Some(capture) = model.capture.as_mut().filter(|capture| capture.number == number) {
        capture.wait = wait;
    }
}

fn capture_refused(cx: &mut Context, number: u64, refused: CaptureRefused) {
    if cx.model.capture.as_ref().is_none_or(|capture| capture.number != number) {
        return;
    }
    cx.model.capture = None;
    let reported = text!("No capture: {why}", why = refused.why.clone());
    cx.model.notify_in(Pane::Colour, Severity::Warning, reported);
    sequence_refused(cx, &refused);
    cx.model.refused = Some(refused);
}

fn captured(cx: &mut Context, number: u64, id: CaptureId) {
    if cx.model.capture.as_ref().is_some_and(|capture| capture.number == number) {
        cx.model.capture = None;
    }
    let capture = cx.model.document().capture(id);
    let settled = capture.and_then(|it| it.settled_s).map(|settled_s| format!("{settled_s:.2}"));
    let noise = capture.and_then(|it| it.corner_noise_px).map(|noise_px| format!("{noise_px:.3}"));
    let text = match (settled, noise) {
        (Some(settled), Some(noise)) => text!(
            "Capture {id} is kept (corner noise {noise} px, settled in {settled} s)",
            id = id,
            noise = noise,
            settled = settled
        ),
        (Some(settled), None) => text!("Capture {id} is kept (settled in {settled} s)", id = id, settled = settled),
        (None, _) => text!("Capture {id} is kept", id = id),
    };
    cx.model.notify(Severity::Info, text);
    let role = cx.model.document().capture(id).map(|it| it.role);
    sequence_captured(cx);
    captured_by_hand(&mut cx.model, role);
}
