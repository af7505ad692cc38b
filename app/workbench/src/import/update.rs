//! How a recording becomes a session.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use handeye_files::budget::Limits;
use handeye_geometry::targets::BadTarget;
use handeye_import::Settings;

use super::command::{Command, Event};
use super::state::{Converted, Found, ImportState, ImportWork};
use super::understand;
use super::worker::{ImportJob, ImportTask};
use crate::app::context::Numbers;
use crate::app::reach::{Reach, bounds_of};
use crate::arguments::of_text;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::archive::ArchiveTask;
use crate::session::desk::SessionThreads;
use crate::shell::state::Dialog;
use crate::text::Text;
use handeye_wording::Value;
use handeye_wording::text;

/// Does what is wanted of a recording.
pub(crate) fn apply(
    model: &mut Model,
    desk: &mut SessionThreads,
    numbers: &mut Numbers,
    reach: Option<&Reach>,
    command: Command,
) {
    match command {
        Command::SetTarget(typed) => set_import_target(model, desk, numbers, reach, typed),
        Command::SetTime(seconds) => set_import_time(model, desk, numbers, reach, seconds),
        Command::FixConvention { key, value } => fix_convention(model, desk, numbers, reach, key, value),
        Command::ChooseHypothesis(place) => choose_hypothesis(model, place),
        Command::ConvertRecording => convert_recording(model, desk, numbers),
        Command::ConvertImages => convert_images(model, desk, numbers),
    }
}

/// Takes in what was found in a recording.
pub(crate) fn absorb(
    model: &mut Model,
    desk: &mut SessionThreads,
    numbers: &mut Numbers,
    reach: Option<&Reach>,
    event: Event,
) {
    match event {
        Event::NoSession(path) => import(model, desk, numbers, reach, path),
        Event::Progress { number, work } => import_progress(model, number, work),
        Event::Looked { number, found, trouble } => recording_looked(model, number, found, trouble),
        Event::Converted { number, converted } => recording_converted(model, desk, number, converted),
    }
}

/// Looks at what is neither a session nor a data set.
fn import(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, reach: Option<&Reach>, path: PathBuf) {
    model.opening = false;
    model.import = Some(Box::new(ImportState {
        path,
        number: 0,
        time: Limits::default().time,
        target: String::new(),
        fixed: std::collections::BTreeMap::new(),
        work: None,
        found: None,
        trouble: None,
        chosen: None,
    }));
    model.dialog = Some(Dialog::Import);
    look_at_recording(model, desk, numbers, reach);
}

/// Ends what is being done for the dialog, and forgets it.
pub(crate) fn forget_import(model: &mut Model, desk: &SessionThreads) {
    if model.import.take().is_some() {
        desk.cancel_import();
    }
}

fn set_import_target(
    model: &mut Model,
    desk: &mut SessionThreads,
    numbers: &mut Numbers,
    reach: Option<&Reach>,
    typed: String,
) {
    if let Some(import) = model.import.as_deref_mut() {
        import.target = typed;
        look_at_recording(model, desk, numbers, reach);
    }
}

fn set_import_time(
    model: &mut Model,
    desk: &mut SessionThreads,
    numbers: &mut Numbers,
    reach: Option<&Reach>,
    seconds: u32,
) {
    if let Some(import) = model.import.as_deref_mut() {
        import.time = Duration::from_secs(seconds.into());
        look_at_recording(model, desk, numbers, reach);
    }
}

/// Fixes a convention, or leaves it to the data again.
fn fix_convention(
    model: &mut Model,
    desk: &mut SessionThreads,
    numbers: &mut Numbers,
    reach: Option<&Reach>,
    key: String,
    value: Option<String>,
) {
    let Some(import) = model.import.as_deref_mut() else { return };
    let is_about_images = import.found.as_ref().is_none_or(|found| understand::looks(&key, &found.opened));
    match value {
        Some(value) => import.fixed.insert(key, value),
        None => import.fixed.remove(&key),
    };
    let known = import.found.clone().filter(|found| found.looked.is_some() && !is_about_images);
    let (Some(known), Some(settings)) = (known, import_settings(model)) else {
        return look_at_recording(model, desk, numbers, reach);
    };
    ask_import(model, desk, numbers, ImportWork::Looking(0, 0), ImportTask::Judge { known, settings });
}

fn choose_hypothesis(model: &mut Model, place: usize) {
    if let Some(import) = model.import.as_deref_mut() {
        import.chosen = Some(place);
    }
}

fn convert_recording(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    let Some(import) = model.import.as_deref() else { return };
    let (Some(known), Some(hypothesis)) = (import.found.clone(), import.chosen) else { return };
    let is_taken = known.decided() != Some(hypothesis);
    ask_import(model, desk, numbers, ImportWork::Writing(0, 0), ImportTask::Convert { known, hypothesis, is_taken });
}

fn convert_images(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    let Some(known) = model.import.as_deref().and_then(|import| import.found.clone()) else { return };
    ask_import(model, desk, numbers, ImportWork::Writing(0, 0), ImportTask::ConvertImages { known });
}

fn import_settings(model: &mut Model) -> Option<Settings> {
    let import = model.import.as_deref_mut()?;
    let mut settings = Settings::default();
    for (key, value) in &import.fixed {
        if let Err(error) = settings.set(&format!("{key}={value}")) {
            import.trouble = Some(error.into());
            return None;
        }
    }
    Some(settings)
}

fn look_at_recording(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, reach: Option<&Reach>) {
    let Some(settings) = import_settings(model) else { return };
    let Some(import) = model.import.as_deref_mut() else { return };
    let typed = import.target.trim();
    let target = match (!typed.is_empty()).then(|| of_text(typed)).transpose() {
        Ok(target) => target,
        Err(error) => {
            let why = match error.downcast::<BadTarget>() {
                Ok(bad) => Value::from(bad),
                Err(other) => Value::from(other.to_string()),
            };
            import.trouble = Some(text!("The target cannot be used: {why}", why = why));
            return;
        }
    };
    let (path, time, known) = (import.path.clone(), import.time, import.found.clone());
    let bounds = bounds_of(reach, &path);
    ask_import(
        model,
        desk,
        numbers,
        ImportWork::Looking(0, 0),
        ImportTask::Look { path, bounds, time, known, target, settings },
    );
}

fn ask_import(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, work: ImportWork, task: ImportTask) {
    numbers.import += 1;
    let number = numbers.import;
    if let Some(import) = model.import.as_deref_mut() {
        (import.number, import.work, import.trouble) = (number, Some(work), None);
        desk.import(ImportJob { number, task });
    }
}

/// The import that an answer is for.
fn import_of(model: &mut Model, number: u64) -> Option<&mut ImportState> {
    model.import.as_deref_mut().filter(|import| import.number == number)
}

fn import_progress(model: &mut Model, number: u64, work: ImportWork) {
    if let Some(import) = import_of(model, number).filter(|import| import.work.is_some()) {
        import.work = Some(work);
    }
}

fn recording_looked(model: &mut Model, number: u64, found: Option<Arc<Found>>, trouble: Option<Text>) {
    let Some(import) = import_of(model, number) else { return };
    (import.work, import.trouble) = (None, trouble);
    import.chosen = found.as_ref().and_then(|found| found.decided());
    import.found = found;
}

fn recording_converted(model: &mut Model, desk: &SessionThreads, number: u64, converted: Result<Arc<Converted>, Text>) {
    let Some(import) = import_of(model, number) else { return };
    import.work = None;
    match converted {
        Ok(converted) => {
            model.opening = true;
            if desk.archive(ArchiveTask::Import(converted)).is_err() {
                model.opening = false;
                model.notify(
                    Severity::Error,
                    text!("The disk does not keep up: nothing was changed. Try again in a moment"),
                );
            }
        }
        Err(why) => import.trouble = Some(why),
    }
}
