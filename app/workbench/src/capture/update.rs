//! Captures.

use handeye_capture::Wait;
use handeye_session::CaptureId;

use crate::app::App;
use crate::capture::CaptureRequest;
use crate::model::{CapturePurpose, CaptureRefused, CaptureUnderWay, CaptureWait, Pane, Severity};
use crate::worker::VisionTask;
use handeye_wording::text;

impl App {
    /// Takes a capture as soon as robot and image have settled.
    pub(crate) fn capture(&mut self, purpose: CapturePurpose, pose_name: Option<String>) {
        if self.model.capture.is_some() {
            // Pressing twice must not take two.
            return;
        }
        if self.refuses_without_robot() {
            return;
        }
        self.numbers.capture += 1;
        let number = self.numbers.capture;
        let options = self.model.view.capture;
        let request = CaptureRequest::new(number, purpose, options, pose_name, self.model.document());
        let asked = self.workers.ask_vision(VisionTask::Capture(request));
        if asked.is_ok() {
            let since_s = self.model.now_s;
            self.model.capture =
                Some(CaptureUnderWay { number, purpose, wait: CaptureWait::Images(Wait::ForImage), since_s });
            self.model.refused = None;
        }
        let has_begun = asked.is_ok();
        self.expect(text!("There is no capture"), asked);
        if !has_begun && self.model.sequence_runs {
            self.break_off(None);
        }
    }

    /// Whether nothing can be captured into this session, which is said.
    pub(crate) fn refuses_without_robot(&mut self) -> bool {
        let refuses = self.model.document().mode().is_none();
        if refuses {
            let why = text!("This session has images without a robot: begin a new session for captures");
            self.say(Severity::Warning, why);
        }
        refuses
    }

    pub(crate) fn cancel_capture(&mut self) {
        if self.model.capture.is_some() {
            let asked = self.workers.ask_vision(VisionTask::CancelCapture);
            self.expect(text!("The capture was not cancelled"), asked);
        }
    }

    pub(crate) fn capture_waits(&mut self, number: u64, wait: CaptureWait) {
        if let Some(capture) = self.model.capture.as_mut().filter(|capture| capture.number == number) {
            capture.wait = wait;
        }
    }

    pub(crate) fn capture_refused(&mut self, number: u64, refused: CaptureRefused) {
        if self.model.capture.as_ref().is_none_or(|capture| capture.number != number) {
            return;
        }
        self.model.capture = None;
        let said = text!("No capture: {why}", why = refused.why.clone());
        self.say_in(Pane::Colour, Severity::Warning, said);
        self.sequence_refused(&refused);
        self.model.refused = Some(refused);
    }

    pub(crate) fn captured(&mut self, number: u64, id: CaptureId) {
        if self.model.capture.as_ref().is_some_and(|capture| capture.number == number) {
            self.model.capture = None;
        }
        let capture = self.model.document().capture(id);
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
        self.say(Severity::Info, text);
        let role = self.model.document().capture(id).map(|it| it.role);
        self.sequence_captured();
        self.captured_by_hand(role);
    }
}
