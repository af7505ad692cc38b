//! Changes of the boxes: the arm avoids them from its next motion on, and they are kept in a file.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use handeye_plan::Surroundings;
use handeye_plan::surroundings::{KeepOutFile, SurroundingsError};

use super::command::{Command, Event};
use super::state::KeepOut;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::desk::SessionThreads;
use crate::text::Text;
use crate::worker::files::FileTask;
use crate::worker::threads::Workers;
use handeye_wording::text;

/// How long after the last change they are written \[s\]: a value that is dragged changes with every frame.
const WRITTEN_AFTER_S: f64 = 0.5;

/// What a file contains at the start; nothing if it does not exist. One that cannot be used is left as it is.
pub(crate) fn opened(file: Option<PathBuf>) -> (KeepOut, Option<Text>) {
    let Some(file) = file else { return (KeepOut::default(), None) };
    match KeepOutFile::read(&file) {
        Ok(content) => {
            let mut keep_out = KeepOut { file: Some(file), ..KeepOut::default() };
            keep_out.set(content);
            let fault = keep_out.fault.clone();
            (keep_out, fault)
        }
        Err(SurroundingsError::Unreadable { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
            (KeepOut { file: Some(file), ..KeepOut::default() }, None)
        }
        Err(error) => {
            let reported = text!(
                "The arm does not keep out of the boxes of this file. The file stays as it is, and the present boxes are not kept for the next start: {error}",
                error = error
            );
            (KeepOut { unsaved: Some(reported.clone()), ..KeepOut::default() }, Some(reported))
        }
    }
}

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

/// Writes them, as a whole or not at all.
pub(crate) fn write(file: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)?;
    }
    let head = "# What the robot's arm keeps out of; docs/reference/surroundings.md lists the keys. Lengths are metres in the base.\n";
    handeye_files::atomic_file::write(file, format!("{head}{text}").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keep_out::state::with_drawn;

    #[test]
    fn what_was_written_is_there_at_the_next_start_and_a_file_with_a_fault_is_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("deep").join("keep_out.toml");
        let (none, reported) = opened(Some(file.clone()));
        assert_eq!((none.content.boxes.len(), none.file.as_deref(), reported), (0, Some(file.as_path()), None));
        let content = with_drawn(&none.content, [0.1, 0.1], [0.4, 0.3]).expect("a rectangle");
        write(&file, &content.to_toml()).expect("written");
        let (again, reported) = opened(Some(file.clone()));
        assert_eq!((&again.content, again.around.obstacles.len(), reported), (&content, 1, None));

        // One invalid entry is shown, and does not affect the others.
        let mut faulty = again.content.clone();
        faulty.boxes.push(faulty.boxes[0].clone());
        faulty.boxes[1].size_m[0] = -1.0;
        write(&file, &faulty.to_toml()).expect("written");
        let (with_fault, reported) = opened(Some(file.clone()));
        assert_eq!((with_fault.content, with_fault.around.obstacles.len()), (faulty, 1));
        assert!(reported.is_some() && with_fault.file.is_some());

        std::fs::write(&file, "[[box]]\nname = \"post\"\n").expect("written");
        let (broken, reported) = opened(Some(file.clone()));
        assert!(broken.file.is_none() && broken.unsaved.is_some(), "nothing is written over it");
        assert!(
            reported
                .is_some_and(|reported| reported.in_language(crate::text::Language::English).contains("keep_out.toml"))
        );
    }
}
