//! The application without its window: the model, the workers, and the only two ways to change the model.
//!
//! [`App::apply`] does what the user wants, [`App::absorb`] takes in what happened. Each passes it on to the feature
//! concerned, whose `update` changes the model and passes work to threads; a feature can reach only what it is given here.
//! None of them waits.

pub(crate) mod context;
mod follow_up;
mod leave;
pub(crate) mod reach;

use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use handeye_coppeliasim::cell::CellPaths;

use crate::by_hand::update::guided_by_hand_step;
use crate::command::{Command, Event};
use crate::guided::update::guided_step;
use crate::keep_out::update::{keep_keep_out, send_keep_out};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::rest::{stop_requested, stop_waits};
use crate::motion::stop_line::StopLine;
use crate::recording::Recording;
use crate::recording::recorded::Recorded;
use crate::scene::update::fit_scene;
use crate::session::desk::SessionThreads;
use crate::session::requests::send_target;
use crate::session::update::{open_or_begin, prepare_session};
use crate::settings::SettingsWrite;
use crate::shell::view::ViewSettings;
use crate::worker::files::FileTask;
use crate::worker::shared::{Clock, Waker};
use crate::worker::threads::Workers;
use crate::{
    by_hand, capture, connect, export, guided, import, keep_out, live, messages, motion, recording, scene, session,
    shell, solve, target, taught, track,
};
use handeye_link::{CellSource, Drivers};
use handeye_wording::text;

pub use context::Connect;
pub(crate) use context::{Connector, Context, Numbers};
pub use reach::Reach;

/// What an application starts with.
pub struct Start {
    pub source: CellSource,
    /// What is remembered from one start to the next.
    pub view: ViewSettings,
    /// Addresses that were connected to before, newest first.
    pub addresses: Vec<String>,
    /// Drivers that were connected to before, newest first.
    pub drivers: Vec<Drivers>,
    /// Where a scene other than the built-in one has the parts of the cell.
    pub objects: CellPaths,
    /// Where the boxes that the arm keeps out of are kept; nowhere if not given.
    pub keep_out: Option<PathBuf>,
    /// Where new sessions go.
    pub sessions: PathBuf,
    /// A session or data set to open at once; if it does not exist, a session is started there.
    pub open: Option<PathBuf>,
    /// What can be reached where the window is shown in browsers; nothing is then opened on the screen of this machine.
    pub in_browser: Option<InBrowser>,
}

/// How a window is shown in browsers.
#[derive(Clone)]
pub struct InBrowser {
    /// What can be reached from there.
    pub reach: Reach,
    /// What stops the arm, for the threads that listen to pages.
    pub stop: Arc<StopLine>,
}

/// Model and workers.
pub struct App {
    pub(crate) cx: Context,
    connector: Connector,
    /// Nothing is recorded without it.
    recording: Option<Box<dyn Recording>>,
    recorded: Recorded,
    /// Deadline for everything to end, once the application ends.
    leave_by: Option<Instant>,
    /// Stops from other threads that were already handled.
    outside_stops: u64,
    /// What commands may reach, if not everything.
    reach: Option<Reach>,
}

impl App {
    /// Starts the workers; they connect by themselves.
    ///
    /// # Errors
    /// When the system cannot start more threads.
    pub fn start(start: Start, connect: Connect, clock: Clock, waker: Waker) -> io::Result<Self> {
        let Start { source, view, addresses, drivers, objects, keep_out, sessions, open, in_browser } = start;
        let desk = SessionThreads::start(sessions, &clock, &waker)?;
        let stop = in_browser.as_ref().map(|shown| Arc::clone(&shown.stop)).unwrap_or_default();
        let connector = connect(&source, &objects);
        let workers = Workers::start(&source, &view, &connector, desk.captures(), &stop, &clock, &waker)?;
        let sessions = desk.sessions().to_path_buf();
        let shown = in_browser.is_some();
        let model = Model { addresses, drivers, objects, sessions, in_browser: shown, ..Model::new(source, view) };
        let (keep_out, fault) = crate::keep_out::file::opened(keep_out);
        let model = Model { keep_out, ..model };
        let mut app = Self {
            cx: Context { model, workers, desk, numbers: Numbers::default(), reported: VecDeque::new() },
            connector: Connector { connect, clock, waker },
            recording: None,
            recorded: Recorded::default(),
            leave_by: None,
            outside_stops: 0,
            reach: in_browser.map(|shown| shown.reach),
        };
        let cx = &mut app.cx;
        if let Some(fault) = fault {
            cx.model.notify(Severity::Error, fault);
        }
        prepare_session(&mut cx.model, &cx.desk);
        send_target(&mut cx.model, &cx.workers);
        send_keep_out(&cx.model, &cx.workers);
        if let Some(folder) = open {
            open_or_begin(&mut cx.model, &cx.desk, folder);
        }
        Ok(app)
    }

    /// What the window shows.
    pub fn model(&self) -> &Model {
        &self.cx.model
    }

    /// Has the window drawn again.
    pub fn waker(&self) -> &Waker {
        &self.connector.waker
    }

    /// Continues from a model that a test has made up. The workers are not notified.
    #[cfg(feature = "testing")]
    pub fn replace_model(&mut self, model: Model) {
        self.cx.model = model;
    }

    /// Records everything from here on; without it nothing is recorded.
    pub fn record_into(&mut self, recording: impl Recording + 'static) {
        self.recording = Some(Box::new(recording));
    }

    /// Takes in what the workers have reported. Never waits for them.
    pub fn collect(&mut self) {
        self.take_outside_stops();
        self.absorb(Event::Tick { now_s: (self.connector.clock)() });
        let mut events = Vec::new();
        self.cx.workers.drain(|event| events.push(event));
        self.cx.desk.drain(|event| events.push(event));
        if let Some(recording) = &self.recording {
            recording.drain(&mut |event| events.push(event));
        }
        for event in events {
            self.absorb(event);
        }
        if let Some(recording) = &self.recording {
            recording::update::note_changes(recording.as_ref(), &self.cx.model, &mut self.recorded);
        }
    }

    /// Takes note of stops that other threads have pressed. Nothing that moves begins before that: a sequence would
    /// continue with its next pose.
    fn take_outside_stops(&mut self) {
        let pressed = self.stop_line().outside();
        if std::mem::replace(&mut self.outside_stops, pressed) < pressed {
            stop_requested(&mut self.cx.model, &self.cx.workers);
        }
    }

    /// What is requested from now on was requested after this many stops of other threads.
    pub fn note_stops(&mut self, pressed: u64) {
        self.take_outside_stops();
        self.stop_line().note(pressed);
    }

    /// The stop for the arm, for use by other threads.
    pub fn stop_line(&self) -> &Arc<StopLine> {
        self.cx.workers.stop_line()
    }

    /// Does what the user wants, or has a worker do it. Never waits for a worker.
    pub fn apply(&mut self, command: impl Into<Command>) {
        self.hand_on(command.into());
        self.absorb_reported();
    }

    fn hand_on(&mut self, command: Command) {
        let Self { cx, connector, recording, reach, .. } = self;
        let reach = reach.as_ref();
        if let Some(why) = reach.and_then(|reach| reach.refusal(&command)) {
            return cx.model.notify(Severity::Warning, why);
        }
        let Context { model, workers, desk, numbers, .. } = cx;
        match command {
            Command::ByHand(command) => by_hand::update::apply(cx, command),
            Command::Capture(command) => capture::update::apply(model, workers, numbers, command),
            Command::Connect(command) => connect::update::apply(cx, connector, command),
            Command::Export(command) => export::update::apply(model, desk, command),
            Command::Guided(command) => guided::update::apply(cx, command),
            Command::Import(command) => import::update::apply(model, desk, numbers, reach, command),
            Command::KeepOut(command) => keep_out::update::apply(model, workers, desk, command),
            Command::Live(command) => live::update::apply(model, workers, command),
            Command::Messages(command) => messages::update::apply(model, command),
            Command::Motion(command) => motion::update::apply(cx, command),
            Command::Recording(command) => recording::update::apply(recording.as_deref(), command),
            Command::Scene(command) => scene::update::apply(model, command),
            Command::Session(command) => session::update::apply(model, workers, desk, reach, command),
            Command::Shell(command) => shell::update::apply(model, desk, command),
            Command::Solve(command) => solve::update::apply(model, desk, numbers, command),
            Command::Target(command) => target::update::apply(model, workers, desk, command),
            Command::Taught(command) => taught::update::apply(cx, command),
            Command::Track(command) => track::update::apply(model, workers, numbers, command),
        }
    }

    /// Takes in what happened.
    pub fn absorb(&mut self, event: impl Into<Event>) {
        self.take_in(event.into());
        self.absorb_reported();
    }

    /// Takes in what handlers have reported themselves, and what follows from that.
    fn absorb_reported(&mut self) {
        while let Some(event) = self.cx.reported.pop_front() {
            self.take_in(event);
        }
    }

    fn take_in(&mut self, event: Event) {
        let Self { cx, recording, reach, .. } = self;
        if let Some(recording) = recording {
            recording::update::note(recording.as_ref(), &cx.model, &cx.numbers, &event);
        }
        let Context { model, workers, desk, numbers, .. } = cx;
        match event {
            Event::Tick { now_s } => {
                model.now_s = now_s;
                keep_keep_out(model, desk, false);
                stop_waits(model);
            }
            Event::ByHand(event) => by_hand::update::absorb(model, numbers, event),
            Event::Capture(event) => {
                if let Some(ended) = capture::update::absorb(model, event) {
                    follow_up::capture_ended(cx, ended);
                }
            }
            Event::Connect(event) => connect::update::absorb(cx, event),
            Event::Export(event) => export::update::absorb(model, event),
            Event::Guided(event) => guided::update::absorb(cx, event),
            Event::Import(event) => import::update::absorb(model, desk, numbers, reach.as_ref(), event),
            Event::KeepOut(event) => keep_out::update::absorb(model, workers, event),
            Event::Live(event) => live::update::absorb(model, workers, numbers, event),
            Event::Messages(event) => messages::update::absorb(model, event),
            Event::Motion(event) => {
                if let Some(ended) = motion::update::absorb(cx, event) {
                    follow_up::motion_ended(cx, ended);
                }
            }
            Event::Recording(event) => recording::update::absorb(model, desk, event),
            Event::Session(event) => session::update::absorb(cx, event),
            Event::Solve(event) => solve::update::absorb(cx, event),
            Event::Taught(event) => taught::update::absorb(cx, event),
            Event::Track(event) => track::update::absorb(model, workers, numbers, event),
        }
        let Context { model, workers, desk, numbers, .. } = cx;
        guided_step(model, workers, numbers);
        guided_by_hand_step(model, desk, numbers);
        fit_scene(model);
    }

    /// Has the settings written.
    pub fn write_settings(&mut self, settings: SettingsWrite) {
        let asked = self.cx.desk.files(FileTask::Settings(settings));
        self.cx.model.notify_if_refused(text!("The settings were not written"), asked);
    }
}

#[cfg(test)]
mod motion_tests;
#[cfg(test)]
mod reasons_tests;
#[cfg(test)]
mod tests;
