//! The application without its window: the model, the workers, and the only two ways to change the model.

use std::io;
use std::sync::Arc;

use crate::command::{Command, Event, Outbox};
use crate::model::{CellSource, Link, LinkState, LiveFrame, Message, Model, Severity, ViewSettings};
use crate::text;
use crate::text::Text;
use crate::worker::{Busy, CameraTask, Clock, Connector, ControlTask, Request, Waker, Workers};

/// Model and workers.
pub struct App {
    model: Model,
    workers: Workers,
    clock: Clock,
}

impl App {
    /// Starts the workers; they connect by themselves.
    ///
    /// # Errors
    /// When the system has no more threads.
    pub fn start(
        source: CellSource,
        view: ViewSettings,
        connector: &Arc<dyn Connector>,
        clock: Clock,
        waker: &Waker,
    ) -> io::Result<Self> {
        let workers = Workers::start(&source, view.depth_scale, connector, &clock, waker)?;
        Ok(Self { model: Model::new(source, view), workers, clock })
    }

    /// What the window shows.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Takes in what the workers have reported. Never waits for them.
    pub fn collect(&mut self) {
        self.absorb(Event::Tick { now_s: (self.clock)() });
        let mut events = Vec::new();
        self.workers.drain(|event| events.push(event));
        for event in events {
            self.absorb(event);
        }
    }

    /// Applies the commands of a frame of the window.
    pub fn apply_all(&mut self, outbox: &mut Outbox) {
        for (command, place) in outbox.drain() {
            tracing::trace!(?command, %place, "command");
            self.apply(command);
        }
    }

    /// Does what the user wants, or has a worker do it. Never waits for a worker.
    #[expect(
        clippy::needless_pass_by_value,
        reason = "a command is spent when it is applied; others will carry documents"
    )]
    pub fn apply(&mut self, command: Command) {
        match command {
            Command::Stop => self.stop(),
            Command::StartSimulation => {
                let asked = self.workers.ask_control(Request::Do(ControlTask::StartSimulation));
                self.expect(text!("The simulation was not started"), asked);
            }
            Command::Reconnect => {
                let control = self.workers.ask_control(Request::Reconnect);
                let camera = self.workers.ask_camera(Request::Reconnect);
                self.expect(text!("The connection was not tried again"), control.and(camera));
            }
            Command::SetTheme(theme) => self.model.view.theme = theme,
            Command::SetRotationFormat(format) => self.model.view.rotation = format,
            Command::SetDepthScale(scale) => {
                let asked = self.workers.ask_camera(Request::Do(CameraTask::SetDepthScale(scale)));
                if asked.is_ok() {
                    self.model.view.depth_scale = scale;
                }
                self.expect(text!("The depth range was not changed"), asked);
            }
            Command::PointAt(point) => self.model.cursor = point,
            Command::SetLanguage(language) => self.model.view.language = language,
            _ => {}
        }
    }

    /// Takes in what happened.
    pub fn absorb(&mut self, event: Event) {
        match event {
            Event::Tick { now_s } => self.model.now_s = now_s,
            Event::Link { link, state } => self.link_changed(link, state),
            Event::Robot(robot) => self.model.robot = Some(robot),
            Event::Frame { info, dropped, images } => {
                self.model.dropped_frames = dropped;
                // A frame out of a log has no pixels, and nothing to show.
                if let Some(images) = images {
                    self.model.frame = Some(LiveFrame { info, images });
                }
            }
            Event::Stopped => {
                self.model.stop_pending = false;
                self.say(Severity::Info, text!("Arm stopped: every joint stays where it is"));
            }
            Event::Notice { severity, text } => self.say(severity, text),
            _ => {}
        }
    }

    fn stop(&mut self) {
        self.workers.press_stop();
        self.model.stop_pending = true;
        if self.model.control.is_connected() {
            self.say(Severity::Warning, text!("Stopping the arm…"));
        } else {
            self.say(
                Severity::Error,
                text!(
                    "The arm cannot be reached: use its own emergency stop. It is stopped as soon as the connection is \
                     back"
                ),
            );
        }
    }

    fn link_changed(&mut self, link: Link, state: LinkState) {
        let before = match link {
            Link::Control => std::mem::replace(&mut self.model.control, state),
            Link::Camera => std::mem::replace(&mut self.model.camera, state),
            Link::Motion => std::mem::replace(&mut self.model.mover, state),
        };
        match (self.model.link(link).clone(), before.is_connected()) {
            (LinkState::Connected { server, address }, false) => {
                let text = match link {
                    Link::Control => text!("Robot connected to {server} at {address}", server = server, address = address),
                    Link::Camera => text!("Camera connected to {server} at {address}", server = server, address = address),
                    Link::Motion => return,
                };
                self.say(Severity::Info, text);
            }
            (LinkState::Lost { why, .. }, true) => {
                let text = match link {
                    Link::Control => text!("Robot connection lost: {why}", why = why),
                    Link::Camera => text!("Camera connection lost: {why}", why = why),
                    Link::Motion => text!("Connection for motions lost: {why}", why = why),
                };
                self.say(Severity::Warning, text);
            }
            (LinkState::Failed { why }, _) => self.say(Severity::Error, Text::verbatim(why)),
            _ => {}
        }
    }

    /// Tells the user when a worker did not take a request.
    fn expect(&mut self, failure: Text, asked: Result<(), Busy>) {
        if asked.is_err() {
            let text = text!("{failure}: the connection does not answer; wait until it is back", failure = failure);
            self.say(Severity::Warning, text);
        }
    }

    /// Shows a message from the window itself.
    fn say(&mut self, severity: Severity, text: Text) {
        self.model.message = Some(Message { severity, text, at_s: self.model.now_s });
    }
}

#[cfg(test)]
#[path = "app_tests.rs"]
mod tests;
