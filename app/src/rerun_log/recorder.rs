//! What the application notes with. Noting never waits: it puts the entry into queues of bounded length.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::lasting::{Item, Lasting, Recording, Trail, is_live};
use super::pump::{Pump, Route};
use super::queue::{Queue, Rate, Rates};
use super::reports::Reports;
use super::stream::{Target, file_sink};
use super::viewer::{self, Viewers};
use super::{Entry, RerunChoice, ViewerWish, file};
use crate::command::Event;
use crate::model::{RerunState, Severity};
use crate::text;
use crate::worker::{Started, Waker};

/// How long the end of the program waits for what is still to be written.
const DEADLINE: Duration = Duration::from_secs(2);

/// How much of what is live is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// What a person can see, and in a file less: for a window that is open all day.
    Live,
    /// Everything: for a command that ends.
    Everything,
}

impl Pace {
    fn for_file(self) -> Rates {
        let every = |millis| Rate::newest_every(Duration::from_millis(millis));
        match self {
            Self::Live => Rates {
                robot: every(200),
                image: every(1000),
                detection: every(1000),
                tracked: every(50),
                waits: false,
            },
            Self::Everything => Rates { waits: true, ..Self::everything() },
        }
    }

    fn for_viewer(self) -> Rates {
        let every = |millis| Rate::newest_every(Duration::from_millis(millis));
        match self {
            Self::Live => {
                Rates { robot: every(50), image: every(100), detection: every(100), tracked: every(33), waits: false }
            }
            Self::Everything => Self::everything(),
        }
    }

    /// Images are megabytes, so that few may wait.
    fn everything() -> Rates {
        let (small, images) = (Rate::all(4096), Rate::all(8));
        Rates { robot: small, image: images, detection: Rate::all(64), tracked: small, waits: false }
    }
}

/// How to record.
pub struct RecorderOptions {
    /// Where to.
    pub choice: RerunChoice,
    /// How much.
    pub pace: Pace,
    /// Whether a file is written beside the session when nothing else is said.
    pub beside_session: bool,
    /// Whether a browser is opened with the web viewer.
    pub open_browser: bool,
    /// Called when there is something to report.
    pub waker: Waker,
}

/// The recording of a program. Off, it costs nothing.
#[derive(Default)]
pub struct Recorder {
    shared: Option<Arc<Shared>>,
}

/// What the threads of a recording share.
pub(super) struct Shared {
    state: Mutex<State>,
    /// What is told to the window.
    pub reports: Arc<Reports>,
    /// The viewers that are open.
    pub viewers: Mutex<Viewers>,
    /// Whether a browser may be opened.
    pub open_browser: bool,
    pace: Pace,
    beside_session: bool,
    ended: AtomicBool,
}

struct State {
    recording: Recording,
    /// How many recordings there were.
    recordings: u32,
    lasting: Lasting,
    trail: Trail,
    file: Option<Writer>,
    viewer: Option<Writer>,
    /// Writers that were told to end.
    ending: Vec<Writer>,
}

/// A thread that writes.
struct Writer {
    queue: Arc<Queue>,
    thread: Started,
}

impl Recorder {
    /// Records nothing.
    pub fn off() -> Self {
        Self { shared: None }
    }

    /// Begins to record.
    ///
    /// # Errors
    /// When the file that was named cannot be made, or the system has no more threads.
    pub fn start(options: RecorderOptions) -> io::Result<Self> {
        let RecorderOptions { choice, pace, beside_session, open_browser, waker } = options;
        if choice == RerunChoice::Off {
            return Ok(Self::off());
        }
        let reports = Arc::new(Reports::new(waker));
        let state = State {
            recording: Recording { id: new_id(0), name: "Handeye".to_owned(), folder: None },
            recordings: 0,
            lasting: Lasting::default(),
            trail: Trail::default(),
            file: None,
            viewer: None,
            ending: Vec::new(),
        };
        let shared = Arc::new(Shared {
            state: Mutex::new(state),
            reports,
            viewers: Mutex::default(),
            open_browser,
            pace,
            beside_session: beside_session && !matches!(choice, RerunChoice::Save(_)),
            ended: AtomicBool::new(false),
        });
        let recorder = Self { shared: Some(Arc::clone(&shared)) };
        match choice {
            RerunChoice::Save(path) => shared.save_to(path)?,
            RerunChoice::Spawn => recorder.open(ViewerWish::Native),
            RerunChoice::Web => recorder.open(ViewerWish::Web),
            RerunChoice::Connect(url) => recorder.open(ViewerWish::Connect(url)),
            RerunChoice::Record | RerunChoice::Off => {}
        }
        Ok(recorder)
    }

    /// Whether anything is recorded. Where nothing is, entries need not be made.
    pub fn is_on(&self) -> bool {
        self.shared.is_some()
    }

    /// Records an entry, later and elsewhere. Never waits for a disk or a viewer.
    ///
    /// A document in another folder begins another recording.
    pub fn note(&self, entry: Entry) {
        if let Some(shared) = &self.shared {
            shared.note(entry);
        }
    }

    /// Opens a viewer; how that goes is reported.
    pub fn open(&self, wish: ViewerWish) {
        if let Some(shared) = &self.shared {
            viewer::open(shared, wish);
        }
    }

    /// The state as it is now.
    pub fn state(&self) -> RerunState {
        self.shared.as_ref().map_or_else(RerunState::default, |shared| shared.now())
    }

    /// Hands over what is to be told since the last time. Never waits.
    pub fn drain(&self, mut absorb: impl FnMut(Event)) {
        let Some(shared) = &self.shared else { return };
        let now = shared.now();
        for (severity, text) in shared.reports.take_notices() {
            absorb(Event::Notice { severity, text });
        }
        if shared.reports.is_news(&now) {
            absorb(Event::Rerun(now));
        }
        if shared.reports.take_no_browser() {
            absorb(Event::NoBrowser);
        }
    }

    /// Has everything written that was noted, waits for that no longer than so long, and ends. Returns whether all of it
    /// is where it belongs.
    pub fn finish(&mut self, deadline: Duration) -> bool {
        let Some(shared) = self.shared.take() else { return true };
        shared.finish(deadline)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if !self.finish(DEADLINE) {
            tracing::warn!("the end of the recording for Rerun was not written in time");
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the program ends.
    pub fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    fn now(&self) -> RerunState {
        let state = self.state();
        let writers = state.file.iter().chain(&state.viewer);
        let left_out = writers.map(|writer| writer.queue.left_out()).sum();
        drop(state);
        self.reports.state(left_out)
    }

    fn note(&self, entry: Entry) {
        let mut state = self.state();
        if is_live(&entry) {
            state.trail.put(&entry);
        } else {
            if let Entry::Document { folder: Some(folder), .. } = &entry {
                self.belongs_to(&mut state, folder);
            }
            state.lasting.put(entry.clone());
        }
        let State { file, viewer, .. } = &*state;
        match (file, viewer) {
            (Some(file), Some(viewer)) => {
                file.queue.put(entry.clone());
                viewer.queue.put(entry);
            }
            (Some(writer), None) | (None, Some(writer)) => writer.queue.put(entry),
            (None, None) => {}
        }
    }

    /// From here on everything belongs to the session in a folder.
    fn belongs_to(&self, state: &mut State, folder: &Path) {
        if state.recording.folder.as_deref() == Some(folder) {
            return;
        }
        let name = folder.file_name().map_or_else(|| "Handeye".to_owned(), |name| name.to_string_lossy().into_owned());
        let first = state.recording.folder.replace(folder.to_path_buf()).is_none();
        state.recording.name.clone_from(&name);
        if first {
            // What was there before the first capture belongs to it as well.
            for writer in state.file.iter().chain(&state.viewer) {
                writer.queue.push(Item::Name(name.clone()));
            }
        } else {
            state.recordings += 1;
            state.recording.id = new_id(state.recordings);
            state.lasting.begin_another();
            state.trail = Trail::default();
            for writer in state.file.iter().chain(&state.viewer) {
                state.replay(&writer.queue);
            }
        }
        if state.file.is_none() && self.beside_session {
            let queue = Arc::new(Queue::new(&self.pace.for_file()));
            state.replay(&queue);
            state.file = self.writer("rerun-file", queue, Route::Sessions);
        }
    }

    fn save_to(&self, path: PathBuf) -> io::Result<()> {
        file::create_named(&path)?;
        let sink = file_sink(&path).map_err(io::Error::other)?;
        self.reports.set_file(Some(path.clone()));
        let queue = Arc::new(Queue::new(&self.pace.for_file()));
        let mut state = self.state();
        state.replay(&queue);
        state.file = self.writer("rerun-file", queue, Route::To(Target::File { path, sink }));
        if state.file.is_none() { Err(io::Error::other("the system has no more threads")) } else { Ok(()) }
    }

    /// Has everything written to viewers from here on, and first what lasts of what was before.
    pub fn write_to_viewers(&self, target: Target) {
        let queue = Arc::new(Queue::new(&self.pace.for_viewer()));
        let mut state = self.state();
        state.replay(&queue);
        let writer = self.writer("rerun-viewer", queue, Route::To(target));
        if let Some(before) = std::mem::replace(&mut state.viewer, writer) {
            before.queue.end();
            state.ending.push(before);
        }
    }

    /// Writes no more to viewers.
    pub fn leave_viewers(&self) {
        let mut state = self.state();
        if let Some(writer) = state.viewer.take() {
            writer.queue.end();
            state.ending.push(writer);
        }
    }

    fn writer(&self, name: &str, queue: Arc<Queue>, route: Route) -> Option<Writer> {
        let pump = Pump::new(Arc::clone(&queue), route, Arc::clone(&self.reports));
        match Started::spawn(name, move || pump.run()) {
            Ok(thread) => Some(Writer { queue, thread }),
            Err(error) => {
                let text = text!("Nothing is recorded for Rerun: {error}; the session itself is safe", error = error);
                self.reports.notice(Severity::Warning, text);
                None
            }
        }
    }

    fn finish(&self, deadline: Duration) -> bool {
        self.ended.store(true, Ordering::Relaxed);
        let end = Instant::now() + deadline;
        let mut state = self.state();
        let State { file, viewer, ending, .. } = &mut *state;
        let writers: Vec<Writer> = file.take().into_iter().chain(viewer.take()).chain(ending.drain(..)).collect();
        drop(state);
        for writer in &writers {
            writer.queue.end();
        }
        writers.into_iter().all(|writer| writer.thread.join_until(end))
    }
}

impl State {
    /// Everything that lasts, for somebody who has nothing yet.
    fn replay(&self, queue: &Queue) {
        queue.push(Item::Begin(self.recording.clone()));
        for item in self.lasting.iter() {
            queue.push(item.clone());
        }
        for state in self.trail.iter() {
            queue.push(Item::Entry(state.clone()));
        }
    }
}

/// No two recordings have the same.
fn new_id(number: u32) -> String {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("{}-{}-{number}", since_epoch.as_millis(), std::process::id())
}

#[cfg(test)]
#[path = "recorder_tests.rs"]
mod tests;
