//! The thread that owns a stream: takes from its queue and writes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::file;
use super::lasting::{Item, Recording};
use super::queue::{Next, Queue};
use super::reports::Reports;
use super::scene::RecordError;
use super::stream::{OpenError, Stream, Target};
use handeye_wording::text;
use handeye_workbench::model::Severity;
use handeye_workbench::recording::Entry;

/// How often a file is checked.
const LOOK: Duration = Duration::from_secs(2);

/// Writes what is in a queue, until that ends.
pub struct Pump {
    queue: Arc<Queue>,
    target: Target,
    reports: Arc<Reports>,
    stream: Option<Stream>,
    /// Something was written since the file was checked.
    touched: bool,
    looked: Instant,
    failed: bool,
}

impl Pump {
    /// With a queue of its own.
    pub fn new(queue: Arc<Queue>, target: Target, reports: Arc<Reports>) -> Self {
        Self { queue, target, reports, stream: None, touched: false, looked: Instant::now(), failed: false }
    }

    /// Works until the queue ends.
    pub fn run(mut self) {
        loop {
            match self.queue.next(LOOK) {
                Next::Lasting(Item::Begin(recording)) => self.begin(&recording),
                Next::Lasting(Item::Name(name)) => {
                    if let Some(stream) = &self.stream {
                        stream.name(&name);
                    }
                }
                Next::Lasting(Item::Entry(entry)) => self.write(|stream| stream.write_lasting(&entry)),
                Next::Live(entry) => {
                    self.write(|stream| stream.write_live(&entry));
                    if matches!(entry, Entry::Image { .. }) && matches!(self.target, Target::Viewers { .. }) {
                        // Waiting here, and not in buffers of the library, keeps memory use low and images new.
                        self.flush();
                    }
                }
                Next::Idle => {}
                Next::End => break,
            }
            self.look_after();
        }
        self.flush();
    }

    fn begin(&mut self, recording: &Recording) {
        // The previous file is completed first.
        self.stream = None;
        self.failed = false;
        match Stream::open(&self.target, recording) {
            Ok(stream) => {
                if stream.file.is_some() {
                    self.reports.set_file(stream.file.clone());
                }
                self.stream = Some(stream);
                self.write(Stream::begin);
            }
            Err(error) => self.no_file(&error),
        }
    }

    fn no_file(&self, error: &OpenError) {
        self.reports.set_file(None);
        self.reports.notice(
            Severity::Warning,
            text!("Nothing is recorded for Rerun: {error}; the session itself is safe", error = error.to_string()),
        );
    }

    fn write(&mut self, write: impl FnOnce(&mut Stream) -> Result<(), RecordError>) {
        let Some(stream) = &mut self.stream else { return };
        self.touched = true;
        if let Err(error) = write(stream) {
            tracing::debug!(%error, "an entry was not recorded");
            // Once is enough: what comes next will most likely fail for the same reason.
            if !std::mem::replace(&mut self.failed, true) {
                let text = text!("Something was not recorded for Rerun: {error}", error = error);
                self.reports.notice(Severity::Warning, text);
            }
        }
    }

    /// A disk that is full is noticed when the file is flushed.
    fn flush(&mut self) {
        let Some(stream) = &self.stream else { return };
        self.touched = false;
        let Err(error) = stream.flush() else { return };
        let Some(path) = &stream.file else {
            tracing::debug!(%error, "the viewer does not take everything");
            return;
        };
        let text = text!(
            "The recording {file} ends here: {why}; the session itself is safe",
            file = path.display(),
            why = error.to_string()
        );
        self.reports.notice(Severity::Warning, text);
        self.reports.set_file(None);
        self.stream = None;
    }

    fn look_after(&mut self) {
        if self.looked.elapsed() < LOOK {
            return;
        }
        self.looked = Instant::now();
        if self.touched && self.stream.as_ref().is_some_and(|stream| stream.file.is_some()) {
            self.flush();
        }
        let Some(stream) = self.stream.as_mut().filter(|stream| !stream.lasting_only) else { return };
        if let Some(path) = stream.file.as_deref()
            && file::size(path) > file::MAX_LIVE_BYTES
        {
            stream.lasting_only = true;
            let text = text!(
                "The recording {file} has reached {size} MB: from here on it has no live images and no robot motion",
                file = path.display(),
                size = file::MAX_LIVE_BYTES / (1024 * 1024)
            );
            self.reports.notice(Severity::Info, text);
        }
    }
}
