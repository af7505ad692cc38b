//! Writes archetypes at a given time.

use handeye_geometry::frames::Pose;
use nalgebra::Isometry3;
use rerun::{AsComponents, RecordingStream};

use super::convert::{axes, no_axes, transform};
use super::error::RecordError;
use super::paths;

/// The time of something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Instant {
    /// Number of the newest capture; `None` for what happens between captures.
    pub capture: Option<i64>,
    /// Simulated time \[s\]; `None` for what belongs to another simulation than the live one.
    pub sim_time_s: Option<f64>,
}

/// The times for entries without one of their own.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Clock {
    /// Captures so far.
    pub captures: i64,
    /// The newest simulated time \[s\]; 0 before there is any.
    pub sim_time_s: f64,
    /// Whether robot or camera were seen live; then `sim_time_s` is their time.
    pub is_live: bool,
}

impl Clock {
    /// For what changes the set of captures or its result.
    pub fn now(&self) -> Instant {
        Instant { capture: Some(self.captures), sim_time_s: Some(self.sim_time_s) }
    }

    /// For what happens between captures.
    pub fn live(&self) -> Instant {
        Instant { capture: None, sim_time_s: Some(self.sim_time_s) }
    }

    /// Robot or camera are at this simulated time.
    pub fn tick(&mut self, sim_time_s: f64) {
        self.is_live = true;
        if sim_time_s.is_finite() && sim_time_s >= 0.0 {
            self.sim_time_s = sim_time_s;
        }
    }
}

/// A recording, for the time of one entry.
#[derive(Clone, Copy)]
pub(super) struct Pen<'a> {
    rec: &'a RecordingStream,
}

impl<'a> Pen<'a> {
    pub fn new(rec: &'a RecordingStream) -> Self {
        // Time lines are those of `paths` and the wall time; a count of calls is not useful.
        rec.set_log_tick_enabled(false);
        Self { rec }
    }

    /// What is written from now on is at this time.
    pub fn at(self, instant: Instant) {
        match instant.capture {
            Some(capture) => self.rec.set_time_sequence(paths::CAPTURE_TIMELINE, capture),
            None => self.rec.disable_timeline(paths::CAPTURE_TIMELINE),
        }
        match instant.sim_time_s {
            Some(sim_time_s) => self.rec.set_duration_secs(paths::SIM_TIMELINE, sim_time_s),
            None => self.rec.disable_timeline(paths::SIM_TIMELINE),
        }
    }

    /// Writes at the present time.
    pub fn write(self, path: &str, what: &impl AsComponents) -> Result<(), RecordError> {
        self.rec.log(path, what).map_err(|source| failed(path, source))
    }

    /// Writes for all times.
    pub fn write_static(self, path: &str, what: &impl AsComponents) -> Result<(), RecordError> {
        self.rec.log_static(path, what).map_err(|source| failed(path, source))
    }

    /// A frame with axes of a length in metres.
    pub fn frame(self, path: &str, parent_from_it: &Isometry3<f64>, axes_m: f32) -> Result<(), RecordError> {
        self.write(path, &[&transform(parent_from_it) as &dyn AsComponents, &axes(axes_m)])
    }

    /// The same for a frame that comes and goes.
    pub fn frame_if<Dst, Src>(
        self,
        path: &str,
        dst_from_src: Option<&Pose<Dst, Src>>,
        axes_m: f32,
    ) -> Result<(), RecordError> {
        match dst_from_src {
            Some(dst_from_src) => self.frame(path, dst_from_src.isometry(), axes_m),
            None => self.write(path, &no_axes()),
        }
    }

    /// From the present time on nothing exists there and below.
    pub fn clear(self, path: &str) -> Result<(), RecordError> {
        self.write(path, &rerun::Clear::recursive())
    }
}

fn failed(path: &str, source: rerun::RecordingStreamError) -> RecordError {
    RecordError::Stream { path: path.to_owned(), source: Box::new(source) }
}
