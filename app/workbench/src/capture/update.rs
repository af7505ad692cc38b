//! Captures.

use handeye_capture::Wait;
use handeye_session::{CaptureId, Role};

use super::command::{Command, Event};
use crate::app::context::Numbers;
use crate::capture::CaptureRequest;
use crate::capture::state::{CapturePurpose, CaptureRefused, CaptureUnderWay, CaptureWait};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::shell::state::Pane;
use crate::taught::break_off::break_off;
use crate::worker::threads::Workers;
use crate::worker::vision::VisionTask;
use handeye_wording::text;

/// Does what the user wants with captures.
pub(crate) fn apply(model: &mut Model, workers: &Workers, numbers: &mut Numbers, command: Command) {
    match command {
        Command::Take(purpose) => capture(model, workers, numbers, purpose, None),
        Command::Cancel => cancel_capture(model, workers),
        Command::SetOptions(options) => model.view.capture = options,
    }
}

/// How a capture has ended.
pub(crate) enum Ended {
    Refused(CaptureRefused),
    /// It is on the disk, for this use.
    Kept(Option<Role>),
}

/// Takes in how a capture goes on; returns how it has ended.
pub(crate) fn absorb(model: &mut Model, event: Event) -> Option<Ended> {
    match event {
        Event::Waits { number, wait } => capture_waits(model, number, wait),
        Event::Refused { number, refused } => return capture_refused(model, number, refused),
        Event::Captured { number, id } => return Some(captured(model, number, id)),
    }
    None
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

fn capture_refused(model: &mut Model, number: u64, refused: CaptureRefused) -> Option<Ended> {
    if model.capture.as_ref().is_none_or(|capture| capture.number != number) {
        return None;
    }
    model.capture = None;
    let reported = text!("No capture: {why}", why = refused.why.clone());
    model.notify_in(Pane::Colour, Severity::Warning, reported);
    Some(Ended::Refused(refused))
}

fn captured(model: &mut Model, number: u64, id: CaptureId) -> Ended {
    if model.capture.as_ref().is_some_and(|capture| capture.number == number) {
        model.capture = None;
    }
    let capture = model.document().capture(id);
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
    model.notify(Severity::Info, text);
    Ended::Kept(model.document().capture(id).map(|it| it.role))
}
