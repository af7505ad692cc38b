//! Changes of the boxes: the arm avoids them from its next motion on, and they are kept in a file.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_plan::Surroundings;
use handeye_plan::surroundings::KeepOutFile;

use super::command::{Command, Event};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::desk::SessionThreads;
use crate::text::Text;
use crate::worker::files::FileTask;
use crate::worker::threads::Workers;
use handeye_wording::text;

/// How long after the last change they are written \[s\]: a value that is dragged changes with every frame.
const WRITTEN_AFTER_S: f64 = 0.5;

/// Does what is wanted of the boxes.
pub(crate) fn apply(model: &mut Model, workers: &Workers, desk: &SessionThreads, command: Command) {
    match command {
        Command::Set(content) => set_keep_out(model, workers, *content),
        Command::Import(file) => import_keep_out(model, desk, file),
        Command::Export(file) => export_keep_out(model, desk, file),
    }
}

/// Takes in the obstacles.
pub(crate) fn absorb(model: &mut Model, workers: &Workers, event: Event) {
    match event {
        Event::Standing(scene_obstacles) => surroundings_found(model, scene_obstacles),
        Event::Read(content) => keep_out_read(model, workers, *content),
    }
}

fn set_keep_out(model: &mut Model, workers: &Workers, content: KeepOutFile) {
    model.keep_out.set(content);
    model.keep_out.unwritten_since_s = Some(model.now_s);
    send_keep_out(model, workers);
}

/// Makes the arm avoid them.
pub(crate) fn send_keep_out(model: &Model, workers: &Workers) {
    workers.keep_out(Arc::clone(&model.keep_out.around));
}

/// Whether the arm keeps out of them, and of what else. If it does not, that is reported once.
fn surroundings_found(model: &mut Model, scene_obstacles: Result<Arc<Surroundings>, Text>) {
    let keep_out = &mut model.keep_out;
    match scene_obstacles {
        Ok(scene_obstacles) => {
            keep_out.scene_obstacles = Some(scene_obstacles);
            keep_out.unkept = None;
        }
        Err(why) => {
            let reported = text!("The arm is not kept out of the boxes: {why}", why = why);
            let is_news = keep_out.unkept.as_ref() != Some(&reported) && !keep_out.content.boxes.is_empty();
            keep_out.unkept = Some(reported.clone());
            if is_news {
                model.notify(Severity::Warning, reported);
            }
        }
    }
}

fn import_keep_out(model: &mut Model, desk: &SessionThreads, file: PathBuf) {
    let asked = desk.files(FileTask::ReadKeepOut(file));
    model.notify_if_refused(text!("The boxes were not read"), asked);
}

/// The boxes of a file come in place of those that there are.
fn keep_out_read(model: &mut Model, workers: &Workers, content: KeepOutFile) {
    let count = content.boxes.len();
    set_keep_out(model, workers, content);
    model.notify(Severity::Info, text!("The arm keeps out of {count} {count|box|boxes} of the file", count = count));
}

fn export_keep_out(model: &mut Model, desk: &SessionThreads, file: PathBuf) {
    let text = model.keep_out.content.to_toml();
    let asked = desk.files(FileTask::WriteKeepOut { file, text, is_wished: true });
    model.notify_if_refused(text!("The boxes were not written"), asked);
}

/// Writes them to their file once nobody is changing them any longer, or at once.
pub(crate) fn keep_keep_out(model: &mut Model, desk: &SessionThreads, at_once: bool) {
    let keep_out = &mut model.keep_out;
    let Some(since_s) = keep_out.unwritten_since_s else { return };
    if !at_once && model.now_s < since_s + WRITTEN_AFTER_S {
        return;
    }
    keep_out.unwritten_since_s = None;
    let Some(file) = keep_out.file.clone() else { return };
    let text = keep_out.content.to_toml();
    let asked = desk.files(FileTask::WriteKeepOut { file, text, is_wished: false });
    model.notify_if_refused(text!("The boxes were not written"), asked);
}
