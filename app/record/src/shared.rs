//! What the threads of a recording share: what was noted, the writers, and the open viewers.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::file;
use super::lasting::{Item, Lasting, Recording, Trail, is_live};
use super::pace::Pace;
use super::pump::Pump;
use super::queue::Queue;
use super::recorder::WebViewer;
use super::reports::Reports;
use super::serving::Server;
use super::stream::{Target, file_sink};
use handeye_wording::text;
use handeye_workbench::command::Event;
use handeye_workbench::model::{RerunState, Severity};
use handeye_workbench::recording::Entry;
use handeye_workbench::worker::Started;

/// What the threads of a recording share.
pub(super) struct Shared {
    state: Mutex<State>,
    /// What is reported to the window.
    pub reports: Arc<Reports>,
    viewers: Mutex<Viewers>,
    /// Where the web viewer is shown.
    pub web: WebViewer,
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
    /// Writers that were requested to end.
    ending: Vec<Writer>,
}

/// A thread that writes.
struct Writer {
    queue: Arc<Queue>,
    thread: Started,
}

/// The viewers that are open.
#[derive(Default)]
pub(super) struct Viewers {
    pub server: Option<Server>,
    /// Whether the page of the web viewer is wanted: the server then continues when the native viewer is closed.
    pub on_page: bool,
}

impl Shared {
    /// Nothing was noted yet, and there is no writer.
    pub fn new(reports: Reports, pace: Pace, web: WebViewer, beside_session: bool) -> Self {
        let state = State {
            recording: Recording { id: new_id(0), name: "Handeye".to_owned(), folder: None },
            recordings: 0,
            lasting: Lasting::default(),
            trail: Trail::default(),
            file: None,
            viewer: None,
            ending: Vec::new(),
        };
        Self {
            state: Mutex::new(state),
            reports: Arc::new(reports),
            viewers: Mutex::default(),
            web,
            pace,
            beside_session,
            ended: AtomicBool::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn viewers(&self) -> MutexGuard<'_, Viewers> {
        self.viewers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the program ends.
    pub fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    pub fn now(&self) -> RerunState {
        self.reports.state(self.left_out())
    }

    pub fn drain(&self, absorb: &mut dyn FnMut(Event)) {
        self.reports.drain(self.left_out(), absorb);
    }

    fn left_out(&self) -> u64 {
        let state = self.state();
        state.file.iter().chain(&state.viewer).map(|writer| writer.queue.left_out()).sum()
    }

    pub fn note(&self, entry: Entry) {
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
            // What came before the first capture belongs to it as well.
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
            state.file = self.writer("rerun-file", queue, Target::Sessions);
        }
    }

    pub fn save_to(&self, path: PathBuf) -> io::Result<()> {
        file::create_named(&path)?;
        let sink = file_sink(&path).map_err(io::Error::other)?;
        self.reports.set_file(Some(path.clone()));
        let queue = Arc::new(Queue::new(&self.pace.for_file()));
        let mut state = self.state();
        state.replay(&queue);
        state.file = self.writer("rerun-file", queue, Target::File { path, sink });
        if state.file.is_none() { Err(io::Error::other("the system has no more threads")) } else { Ok(()) }
    }

    /// Writes everything to viewers from here on, starting with the lasting entries of what came before.
    pub fn write_to_viewers(&self, target: Target) {
        let queue = Arc::new(Queue::new(&self.pace.for_viewer()));
        let mut state = self.state();
        state.replay(&queue);
        let writer = self.writer("rerun-viewer", queue, target);
        if let Some(before) = std::mem::replace(&mut state.viewer, writer) {
            before.queue.end();
            state.ending.push(before);
        }
    }

    /// Stops writing to viewers.
    pub fn leave_viewers(&self) {
        let mut state = self.state();
        if let Some(writer) = state.viewer.take() {
            writer.queue.end();
            state.ending.push(writer);
        }
    }

    fn writer(&self, name: &str, queue: Arc<Queue>, target: Target) -> Option<Writer> {
        let pump = Pump::new(Arc::clone(&queue), target, Arc::clone(&self.reports));
        match Started::spawn(name, move || pump.run()) {
            Ok(thread) => Some(Writer { queue, thread }),
            Err(error) => {
                let text = text!("Nothing is recorded for Rerun: {error}; the session itself is safe", error = error);
                self.reports.notice(Severity::Warning, text);
                None
            }
        }
    }

    pub fn finish(&self, deadline: Duration) -> bool {
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
    /// Everything that lasts, for a new viewer.
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
