//! Streams of a recording: where entries go, and how reliable that is.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rerun::log::{ChunkBatcherConfig, LogMsg};
use rerun::sink::{FileSink, FileSinkError, FileSinkOptions, LogSink, SinkFlushError};
use rerun::{RecordingStream, RecordingStreamBuilder, RecordingStreamError};

use super::blueprint::Arranged;
use super::lasting::Recording;
use super::scene::{RecordError, SceneWriter};
use super::{APPLICATION_ID, arrangement, file};
use handeye_workbench::model::Step;
use handeye_workbench::recording::Entry;
use handeye_workbench::scene::Extent;

/// Rows of a file are batched for this long: many small chunks make a large file, and its index uses much memory.
const FILE_TICK: Duration = Duration::from_secs(2);

/// Rows for a viewer are batched for this long; not perceptible.
const VIEWER_TICK: Duration = Duration::from_millis(30);

/// Limit of the data in flight to a sink inside the stream \[bytes\].
const MAX_BYTES_IN_FLIGHT: u64 = 16 * 1024 * 1024;

/// A sink that several streams share.
#[derive(Clone)]
pub struct SharedSink(pub Arc<dyn LogSink>);

impl LogSink for SharedSink {
    fn send(&self, msg: LogMsg) {
        self.0.send(msg);
    }

    fn send_all(&self, messages: Vec<LogMsg>) {
        self.0.send_all(messages);
    }

    fn flush_blocking(&self, timeout: Duration) -> Result<(), SinkFlushError> {
        self.0.flush_blocking(timeout)
    }

    fn default_batcher_config(&self) -> ChunkBatcherConfig {
        self.0.default_batcher_config()
    }
}

/// Where a thread writes to.
pub enum Target {
    /// Every recording into a new file in the folder of its session.
    Sessions,
    /// This file, which exists and is empty.
    File {
        /// Where it is.
        path: PathBuf,
        /// The sink that writes it.
        sink: SharedSink,
    },
    /// Viewers: lasting and live entries may take different paths.
    Viewers { lasting: SharedSink, live: SharedSink },
}

/// What is written for one recording.
pub struct Stream {
    lasting: RecordingStream,
    live: RecordingStream,
    writer: SceneWriter,
    /// The file, if it is one.
    pub file: Option<PathBuf>,
    /// Whether nothing live is written now.
    pub lasting_only: bool,
    /// The step to show, once there was one.
    step: Option<Step>,
    /// What viewers are set to show.
    shown: Option<Shown>,
    /// The arrangements that were sent.
    arranged: BTreeSet<Arranged>,
}

/// What viewers are set to show.
#[derive(Debug, Clone, Copy)]
struct Shown {
    arranged: Arranged,
    /// The extent in view; `None` while it is not known where anything is.
    extent: Option<Extent>,
}

/// Why there is no stream.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file cannot be made.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The file cannot be written.
    #[error(transparent)]
    Sink(#[from] FileSinkError),
    /// Rerun refuses.
    #[error(transparent)]
    Stream(#[from] RecordingStreamError),
}

/// A sink into a file. It buffers nothing until it is closed: the footer with a list of all chunks would be collected in
/// memory for as long as the session lasts, and is missing anyway after a crash of the program.
///
/// # Errors
/// When it cannot be written.
pub fn file_sink(path: &Path) -> Result<SharedSink, FileSinkError> {
    Ok(SharedSink(Arc::new(FileSink::with_options(path, FileSinkOptions { write_footer: false })?)))
}

impl Stream {
    /// Starts a recording.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(target: &Target, recording: &Recording) -> Result<Self, OpenError> {
        let (lasting, live, file) = match target {
            Target::Sessions => {
                // Recordings with a session are stored here.
                let folder =
                    recording.folder.as_deref().ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))?;
                let path = file::create_next_to(folder)?;
                let stream = stream(recording, file_sink(&path)?, FILE_TICK, true)?;
                (stream.clone(), stream, Some(path))
            }
            Target::File { path, sink } => {
                let stream = stream(recording, sink.clone(), FILE_TICK, true)?;
                (stream.clone(), stream, Some(path.clone()))
            }
            Target::Viewers { lasting, live } => {
                let lasting_stream = stream(recording, lasting.clone(), VIEWER_TICK, true)?;
                if Arc::ptr_eq(&lasting.0, &live.0) {
                    (lasting_stream.clone(), lasting_stream, None)
                } else {
                    (lasting_stream, stream(recording, live.clone(), VIEWER_TICK, false)?, None)
                }
            }
        };
        Ok(Self {
            lasting,
            live,
            writer: SceneWriter::new(),
            file,
            lasting_only: false,
            step: None,
            shown: None,
            arranged: BTreeSet::new(),
        })
    }

    /// Writes what never changes.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn begin(&mut self) -> Result<(), RecordError> {
        SceneWriter::begin(&self.lasting)
    }

    /// Writes something that lasts.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn write_lasting(&mut self, entry: &Entry) -> Result<(), RecordError> {
        if let Entry::Step(step) = entry {
            self.step = Some(*step);
        }
        let written = self.writer.write(&self.lasting, entry);
        self.show(matches!(entry, Entry::Cell(_)));
        written
    }

    /// Writes something live.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn write_live(&mut self, entry: &Entry) -> Result<(), RecordError> {
        if self.lasting_only {
            return Ok(());
        }
        let written = self.writer.write(&self.live, entry);
        // The first state of the robot shows where the arm is; from then on it only moves.
        if self.shown.is_some_and(|shown| shown.extent.is_none()) && matches!(entry, Entry::Robot { .. }) {
            self.show(false);
        }
        written
    }

    /// Makes viewers lay out their views for the step, with the whole cell in view. A view that already shows it is not
    /// moved: the user may have turned it.
    fn show(&mut self, is_another_cell: bool) {
        let Some(step) = self.step else { return };
        let arranged = self.writer.arranged(step);
        if is_another_cell {
            // The place of its arm is known from its first state.
            self.shown = self.shown.map(|shown| Shown { extent: None, ..shown });
        }
        let now = self.writer.extent();
        let suits = |seen: &Extent| now.is_none_or(|now| seen.suits(&now));
        let seen = self.shown.and_then(|shown| shown.extent).filter(suits);
        let is_shown = self.shown.is_some_and(|shown| shown.arranged == arranged);
        if is_shown && (seen.is_some() || now.is_none()) {
            return;
        }
        let extent = seen.or(now);
        let sent = arrangement::of(arranged)
            .and_then(|arrangement| arrangement.send(&self.lasting, self.arranged.insert(arranged), extent.as_ref()));
        if let Err(error) = sent {
            tracing::debug!(%error, "the layout of the viewer stays as it was");
        }
        self.shown = Some(Shown { arranged, extent });
    }

    /// Gives it another name.
    pub fn name(&self, name: &str) {
        if let Err(error) = self.lasting.send_recording_name(name) {
            tracing::debug!(%error, "the recording keeps its name");
        }
    }

    /// Writes everything that is in flight, and waits for it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn flush(&self) -> Result<(), SinkFlushError> {
        self.lasting.flush_blocking()?;
        self.live.flush_blocking()
    }
}

/// One of the streams of a recording; one of them sends its name, and when it began.
fn stream(
    recording: &Recording,
    sink: SharedSink,
    tick: Duration,
    says_name: bool,
) -> Result<RecordingStream, RecordingStreamError> {
    let batching = ChunkBatcherConfig {
        flush_tick: tick,
        max_bytes_in_flight: MAX_BYTES_IN_FLIGHT,
        ..ChunkBatcherConfig::DEFAULT
    };
    let builder = RecordingStreamBuilder::new(APPLICATION_ID)
        .enabled(true)
        .recording_id(recording.id.as_str())
        .send_properties(says_name)
        .recording_name(recording.name.as_str())
        .batcher_config(batching);
    let (_enabled, info, properties, batching, hooks, _blueprint) = builder.into_args();
    RecordingStream::new(info, properties, batching, hooks, Box::new(sink))
}

#[cfg(test)]
#[path = "stream_tests.rs"]
mod tests;
