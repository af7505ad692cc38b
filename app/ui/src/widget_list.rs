//! Where the controls are, for a program that presses them with a real mouse: a file with one JSON object per line.
//!
//! Only when `HANDEYE_WIDGETS` names the file. It is the tree that screen readers get, flattened.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, io};

use egui::{Context, FullOutput, RawInput};

/// The variable that names the file.
pub const VARIABLE: &str = "HANDEYE_WIDGETS";

/// Writes the list after every frame in which it changed.
pub struct WidgetList {
    file: PathBuf,
    written: String,
}

impl WidgetList {
    /// Into a file.
    pub fn new(file: PathBuf) -> Self {
        Self { file, written: String::new() }
    }
}

impl egui::Plugin for WidgetList {
    fn debug_name(&self) -> &'static str {
        "widget list"
    }

    fn input_hook(&mut self, ctx: &Context, _input: &mut RawInput) {
        // Otherwise the tree is made only while a screen reader listens.
        ctx.enable_accesskit();
    }

    fn output_hook(&mut self, _ctx: &Context, output: &mut FullOutput) {
        let Some(update) = &output.platform_output.accesskit_update else { return };
        let mut list = String::new();
        for (_, node) in &update.nodes {
            let Some(bounds) = node.bounds() else { continue };
            let Some(label) = node.label().or_else(|| node.value()).filter(|label| !label.is_empty()) else { continue };
            let line = serde_json::json!({
                "label": label,
                "role": format!("{:?}", node.role()),
                "rect": [bounds.x0, bounds.y0, bounds.x1, bounds.y1],
                "enabled": !node.is_disabled(),
            });
            // Writing to a string cannot fail.
            let _infallible = writeln!(list, "{line}");
        }
        if list != self.written {
            if let Err(error) = replaced(&self.file, &list) {
                tracing::warn!(%error, "the list of controls was not written");
            }
            self.written = list;
        }
    }
}

/// Replaces the file as a whole, and leaves it to the system when to write it to disk: a frame does not wait for that.
fn replaced(file: &Path, list: &str) -> io::Result<()> {
    let partial = file.with_extension("partial");
    fs::write(&partial, list)?;
    fs::rename(&partial, file)
}
