//! Where a device's states and images go.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde::Serialize;

use super::clock::DeviceClock;
use crate::message::{
    DepthEncoding, DepthMessage, Hello, ImageEncoding, ImageMessage, LensMessage, LogLevel, StateMessage,
};

/// An image of a device, with the depth image of the same instant if there is one.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Middle of the exposure on the device's clock, seconds.
    pub stamp: f64,
    /// The instant is within ± this of the stamp.
    pub stamp_uncertainty_s: f64,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// How the bytes are to be read.
    pub encoding: ImageEncoding,
    /// The image.
    pub bytes: Vec<u8>,
    /// The lens, where it is known.
    pub intrinsics: Option<LensMessage>,
    /// Depth, of the same size.
    pub depth: Option<DepthFrame>,
}

/// A depth image.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthFrame {
    /// On the device's clock, seconds.
    pub stamp: f64,
    /// How the bytes are to be read.
    pub encoding: DepthEncoding,
    /// The image.
    pub bytes: Vec<u8>,
}

/// What the workbench wants: the next image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    pub id: u64,
    pub after: Option<f64>,
    pub depth: bool,
}

struct Line {
    output: Box<dyn Write + Send>,
    greeted: bool,
    wanted: Option<Wanted>,
    newest: Option<Frame>,
}

/// A device's end of the connection to the workbench; copies are the same one. It holds one image.
#[derive(Clone)]
pub struct Outlet {
    line: Arc<Mutex<Line>>,
    clock: Arc<Mutex<DeviceClock>>,
    ended: Arc<AtomicBool>,
    start: Instant,
}

impl std::fmt::Debug for Outlet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Outlet").field("ended", &self.has_ended()).finish_non_exhaustive()
    }
}

/// A message without bytes.
#[derive(Serialize)]
struct Message<'a, T: Serialize> {
    #[serde(rename = "type")]
    kind: &'a str,
    #[serde(flatten)]
    body: T,
}

impl Outlet {
    pub(super) fn new(output: impl Write + Send + 'static) -> Self {
        let line = Line { output: Box::new(output), greeted: false, wanted: None, newest: None };
        Self { line: Arc::new(Mutex::new(line)), clock: Arc::default(), ended: Arc::default(), start: Instant::now() }
    }

    /// Seconds of a steady clock of this process.
    pub fn own_time(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Says that a message with this stamp of the device's clock has just arrived. A device that never says it stamps with
    /// [`Self::own_time`].
    pub fn heard(&self, stamp: f64) {
        locked(&self.clock).heard(self.own_time(), stamp);
    }

    /// What the device's clock shows.
    pub fn device_time(&self) -> f64 {
        locked(&self.clock).at(self.own_time())
    }

    /// Whether the workbench has gone.
    pub fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    pub(super) fn greet(&self, hello: &Hello) {
        let mut line = locked(&self.line);
        self.write(&mut line, "hello", hello, &[]);
        line.greeted = true;
    }

    /// Where the robot is. Before the device is open it goes nowhere.
    pub fn state(&self, state: &StateMessage) {
        let mut line = locked(&self.line);
        if line.greeted {
            self.write(&mut line, "state", state, &[]);
        }
    }

    /// A line for the log.
    pub fn log(&self, level: LogLevel, text: impl Into<String>) {
        let message = crate::message::LogMessage { level, text: text.into() };
        let mut line = locked(&self.line);
        if line.greeted {
            self.write(&mut line, "log", &message, &[]);
        } else {
            tracing::warn!("{}", message.text);
        }
    }

    /// A new image: it answers the request that waits for one, or the next.
    pub fn frame(&self, frame: Frame) {
        let mut line = locked(&self.line);
        line.newest = Some(frame);
        self.answer(&mut line);
    }

    pub(super) fn want(&self, wanted: Wanted) {
        let mut line = locked(&self.line);
        line.wanted = Some(wanted);
        self.answer(&mut line);
    }

    /// Any message without bytes.
    pub(super) fn say(&self, kind: &str, body: impl Serialize) {
        self.write(&mut locked(&self.line), kind, body, &[]);
    }

    fn answer(&self, line: &mut Line) {
        let (Some(wanted), Some(frame)) = (line.wanted, &line.newest) else { return };
        if wanted.after.is_some_and(|after| frame.stamp <= after) || (wanted.depth && frame.depth.is_none()) {
            return;
        }
        // Taken, not copied: an image is megabytes. Its stamp is not greater than itself, so it would answer no other request.
        let Some(frame) = line.newest.take() else { return };
        line.wanted = None;
        let Frame { stamp, stamp_uncertainty_s, width, height, encoding, bytes, intrinsics, depth } = frame;
        let id = wanted.id;
        let length = bytes.len() as u64;
        let image = ImageMessage { id, stamp, stamp_uncertainty_s, width, height, encoding, bytes: length, intrinsics };
        self.write(line, "image", image, &bytes);
        if let Some(depth) = depth.filter(|_| wanted.depth) {
            let DepthFrame { stamp, encoding, bytes } = depth;
            let length = bytes.len() as u64;
            self.write(line, "depth", DepthMessage { id, stamp, width, height, encoding, bytes: length }, &bytes);
        }
    }

    fn write(&self, line: &mut Line, kind: &str, body: impl Serialize, bytes: &[u8]) {
        let Ok(mut text) = serde_json::to_vec(&Message { kind, body }) else {
            tracing::error!("a message of type {kind} has no form in JSON");
            return;
        };
        text.push(b'\n');
        let output = &mut line.output;
        if output.write_all(&text).and_then(|()| output.write_all(bytes)).and_then(|()| output.flush()).is_err() {
            // Nobody reads any more.
            self.end();
        }
    }
}

/// What is behind it stays whole when a thread panics while it holds it: every change is one assignment.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
