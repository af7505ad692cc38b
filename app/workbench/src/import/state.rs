//! A recording that is examined for import.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use handeye_geometry::targets::TargetSpec;
use handeye_import::{Hypothesis, Judgement, Recording, Settings, Verdict};
use image::RgbImage;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use super::understand::Looked;
use crate::text::Text;

/// What the dialog shows.
#[derive(Debug, Clone)]
pub struct ImportState {
    /// The recording.
    pub path: PathBuf,
    /// Number of the newest request: answers to earlier ones are ignored.
    pub number: u64,
    /// How long its files may be read.
    pub time: Duration,
    /// The target as it was typed; empty: as the files have it.
    pub target: String,
    /// Conventions that were fixed, by their key.
    pub fixed: BTreeMap<String, String>,
    /// What is being done.
    pub work: Option<ImportWork>,
    /// What was found.
    pub found: Option<Arc<Found>>,
    /// Why nothing can be made of it yet.
    pub trouble: Option<Text>,
    /// The hypothesis that was chosen, by its place.
    pub chosen: Option<usize>,
}

/// What is being done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ImportWork {
    /// Files are read and images searched; this many of this many.
    Looking(usize, usize),
    /// A session is being written; this many images of this many.
    Writing(usize, usize),
}

/// What was found in a recording.
#[derive(Debug)]
pub struct Found {
    /// Its files.
    pub opened: Arc<Recording>,
    /// The same, with what was derived from it when the images were searched.
    pub recording: Arc<Recording>,
    /// What the images show; `None` where nothing could be looked for.
    pub looked: Option<Arc<Looked>>,
    /// The target that the user named.
    pub given: Option<TargetSpec>,
    /// What the hypotheses were tried with.
    pub settings: Settings,
    /// The hypotheses.
    pub judgement: Option<Judgement>,
    /// The first images of every stream, small, by their place in the stream.
    pub previews: Arc<Vec<Vec<Arc<RgbImage>>>>,
}

impl Found {
    /// The hypotheses, the best first.
    pub fn hypotheses(&self) -> &[Hypothesis] {
        self.judgement.as_ref().map_or(&[], |judgement| &judgement.hypotheses)
    }

    /// Whether there are images that a camera can be calibrated with, even if nothing is known about a robot.
    pub fn has_images(&self) -> bool {
        (0..self.recording.streams.len()).any(|i| self.recording.has_photographs(i))
    }

    /// The target and where it comes from, even if nothing else was derived from the recording.
    pub fn target(&self) -> Option<(TargetSpec, String)> {
        let looked = self.looked.as_ref().and_then(|looked| looked.target.clone());
        looked.or_else(|| Some((self.given?, "given with --target".to_owned())))
    }

    /// The hypothesis that does not need the user to choose it.
    pub(crate) fn decided(&self) -> Option<usize> {
        let verdict = self.judgement.as_ref().map(|judgement| &judgement.verdict);
        (verdict == Some(&Verdict::Decided)).then_some(0)
    }
}

/// A recording as a data set, on its way into a session.
#[derive(Debug)]
pub struct Converted {
    /// The data set; it is deleted once the session exists.
    pub folder: TempDir,
    /// What the session is called.
    pub name: String,
    /// Poses and images that are not in it, and why.
    pub left_out: Vec<String>,
}
