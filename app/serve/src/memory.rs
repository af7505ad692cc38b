//! What a window in browsers remembers from one start to the next: a file next to the settings.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use handeye_ui::Layout;
use handeye_ui::window::Remembered;
use handeye_workbench::settings::{self, SettingsWrite};

/// Name of the file.
const FILE: &str = "browser.json";

/// The file, and its content.
#[derive(Debug)]
pub struct Memory {
    path: Option<PathBuf>,
    kept: Kept,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Kept {
    remembered: Remembered,
    layout: Option<Layout>,
}

impl Memory {
    /// Reads it. What cannot be read is ignored: a lost layout must not prevent the start.
    pub fn open() -> Self {
        let path = settings::default_path().map(|path| path.with_file_name(FILE));
        let kept = path.as_ref().and_then(|path| std::fs::read(path).ok());
        let kept = kept.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        Self { path, kept }
    }

    /// The state of the last window.
    pub fn last(&self) -> (Remembered, Layout) {
        let layout = self.kept.layout.clone().map_or_else(Layout::default, Layout::brought_up_to_date);
        (self.kept.remembered.clone(), layout)
    }

    /// What has to be written, if it has changed.
    pub fn keep(&mut self, (remembered, layout): (Remembered, Layout)) -> Option<SettingsWrite> {
        let now = Kept { remembered, layout: Some(layout) };
        if now == self.kept {
            return None;
        }
        self.kept = now;
        let content = serde_json::to_string_pretty(&self.kept).ok()?;
        Some(SettingsWrite::new(self.path.clone()?, content))
    }
}
