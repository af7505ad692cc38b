//! The JSON of a track: written image by image, so that hours of it need no memory, and readable whenever it ends.

use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::Path;

use anyhow::anyhow;
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_track::State;
use serde_json::{Value, json};

use super::live::Summary;
use crate::output::Output;
use crate::{Failure, out};
use handeye_workbench::model::Tracked;

/// The document, or nothing if none is wanted.
pub struct Document {
    open: Option<(Output, BufWriter<Box<dyn Write>>)>,
    written: u64,
    is_closed: bool,
}

impl Document {
    /// Begins a document.
    pub fn begin(output: Option<&Output>, calibration: &Path) -> Result<Self, Failure> {
        let mut document = Self { open: None, written: 0, is_closed: false };
        let Some(output) = output else { return Ok(document) };
        let opened =
            output.open().map_err(|error| Failure::unusable(anyhow!("{output} cannot be written: {error}")))?;
        document.open = Some((output.clone(), BufWriter::new(opened)));
        let calibration = json!(calibration.display().to_string());
        document.write(&format!(
            "{{ \"format\": \"handeye-track\", \"version\": 1,\n  \"calibration\": {calibration},\n  \"frames\": ["
        ))?;
        Ok(document)
    }

    /// Adds an image.
    pub fn add(&mut self, tracked: &Tracked) -> Result<(), Failure> {
        if self.open.is_none() {
            return Ok(());
        }
        let comma = if self.written == 0 { "" } else { "," };
        self.written += 1;
        self.write(&format!("{comma}\n    {}", frame(tracked)))
    }

    /// Whether its reader is gone.
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Ends the document.
    pub fn finish(mut self, summary: &Summary, error: Option<&Failure>) -> Result<(), Failure> {
        let mut summary = summary.json();
        summary["error"] = json!(error.map(ToString::to_string));
        let end = format!("\n  ],\n  \"summary\": {summary} }}\n");
        self.with(|file| file.write_all(end.as_bytes()).and_then(|()| file.flush()))
    }

    fn write(&mut self, text: &str) -> Result<(), Failure> {
        self.with(|file| file.write_all(text.as_bytes()))
    }

    fn with(&mut self, work: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
        let Some((output, file)) = self.open.as_mut().filter(|_| !self.is_closed) else { return Ok(()) };
        let written = work(file);
        self.is_closed = written.as_ref().is_err_and(|error| error.kind() == ErrorKind::BrokenPipe);
        out::finished(written, output)
    }
}

fn pose(pose: &Pose<Base, Target>) -> Value {
    let translation_m: [f64; 3] = pose.translation().into();
    json!({ "parent_frame": "base", "child_frame": "target", "translation_m": translation_m, "rotation_xyzw": pose.xyzw() })
}

fn frame(tracked: &Tracked) -> Value {
    let update = &tracked.update;
    let (state, corners) = match update.state {
        State::Searching => ("searching", 0),
        State::Tracking { corners, .. } => ("tracking", corners),
        State::Coasting { .. } => ("coasting", 0),
        State::Lost { .. } => ("lost", 0),
    };
    let estimate = update.estimate.as_ref().map(|estimate| {
        let rows: [[f64; 6]; 6] = std::array::from_fn(|i| std::array::from_fn(|j| estimate.covariance[(i, j)]));
        let velocity: [f64; 3] = estimate.velocity_m_s.into();
        let turn: [f64; 3] = estimate.angular_velocity_rad_s.into();
        let mut value = pose(&estimate.base_from_target);
        value["covariance"] = json!(rows);
        value["velocity_m_s"] = json!(velocity);
        value["angular_velocity_rad_s"] = json!(turn);
        value
    });
    let first_corner: Option<[f64; 3]> =
        update.by_depth.as_ref().and_then(|by_depth| by_depth.first_corner_in_base).map(|point| point.coords.into());
    json!({
        "time_s": update.time_s,
        "state": state,
        "corners": corners,
        "base_from_target": estimate,
        "by_pnp": update.seen.as_ref().map(|seen| pose(&seen.base_from_target)),
        "with_depth": update.with_depth.as_ref().map(|both| pose(&both.base_from_target)),
        "by_depth": update.by_depth.as_ref().map(|by_depth| pose(&by_depth.base_from_target)),
        "first_corner_by_depth_m": first_corner,
        "rms_px": update.seen.as_ref().map(|seen| seen.rms_px),
        "latency_ms": tracked.latency_s * 1e3,
        "truth": tracked.truth.as_ref().map(pose),
        "error": tracked.error.map(|error| json!({
            "position_mm": error.position_m * 1e3, "rotation_deg": error.rotation_rad.to_degrees() })),
    })
}
