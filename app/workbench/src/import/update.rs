//! How a recording becomes a session.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use handeye_files::budget::Limits;
use handeye_geometry::targets::BadTarget;
use handeye_import::Settings;

use super::state::{Converted, Found, ImportState, ImportWork};
use super::understand;
use super::worker::{ImportJob, ImportTask};
use crate::app::App;
use crate::arguments::of_text;
use crate::model::{Dialog, Severity};
use crate::session::archive::ArchiveTask;
use crate::text::Text;
use handeye_wording::Value;
use handeye_wording::text;

impl App {
    /// Looks at what is neither a session nor a data set.
    pub(crate) fn import(&mut self, path: PathBuf) {
        self.model.opening = false;
        self.model.import = Some(Box::new(ImportState {
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
        self.model.dialog = Some(Dialog::Import);
        self.look_at_recording();
    }

    /// Ends what is being done for the dialog, and forgets it.
    pub(crate) fn forget_import(&mut self) {
        if self.model.import.take().is_some() {
            self.desk.cancel_import();
        }
    }

    pub(crate) fn set_import_target(&mut self, typed: String) {
        if let Some(import) = self.model.import.as_deref_mut() {
            import.target = typed;
            self.look_at_recording();
        }
    }

    pub(crate) fn set_import_time(&mut self, seconds: u32) {
        if let Some(import) = self.model.import.as_deref_mut() {
            import.time = Duration::from_secs(seconds.into());
            self.look_at_recording();
        }
    }

    /// Fixes a convention, or leaves it to the data again.
    pub(crate) fn fix_convention(&mut self, key: String, value: Option<String>) {
        let Some(import) = self.model.import.as_deref_mut() else { return };
        let is_about_images = import.found.as_ref().is_none_or(|found| understand::looks(&key, &found.opened));
        match value {
            Some(value) => import.fixed.insert(key, value),
            None => import.fixed.remove(&key),
        };
        let known = import.found.clone().filter(|found| found.looked.is_some() && !is_about_images);
        let (Some(known), Some(settings)) = (known, self.import_settings()) else { return self.look_at_recording() };
        self.ask_import(ImportWork::Looking(0, 0), ImportTask::Judge { known, settings });
    }

    pub(crate) fn choose_hypothesis(&mut self, place: usize) {
        if let Some(import) = self.model.import.as_deref_mut() {
            import.chosen = Some(place);
        }
    }

    pub(crate) fn convert_recording(&mut self) {
        let Some(import) = self.model.import.as_deref() else { return };
        let (Some(known), Some(hypothesis)) = (import.found.clone(), import.chosen) else { return };
        let is_taken = known.decided() != Some(hypothesis);
        self.ask_import(ImportWork::Writing(0, 0), ImportTask::Convert { known, hypothesis, is_taken });
    }

    pub(crate) fn convert_images(&mut self) {
        let Some(known) = self.model.import.as_deref().and_then(|import| import.found.clone()) else { return };
        self.ask_import(ImportWork::Writing(0, 0), ImportTask::ConvertImages { known });
    }

    fn import_settings(&mut self) -> Option<Settings> {
        let import = self.model.import.as_deref_mut()?;
        let mut settings = Settings::default();
        for (key, value) in &import.fixed {
            if let Err(error) = settings.set(&format!("{key}={value}")) {
                import.trouble = Some(error.into());
                return None;
            }
        }
        Some(settings)
    }

    fn look_at_recording(&mut self) {
        let Some(settings) = self.import_settings() else { return };
        let Some(import) = self.model.import.as_deref_mut() else { return };
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
        let bounds = self.bounds_of(&path);
        self.ask_import(ImportWork::Looking(0, 0), ImportTask::Look { path, bounds, time, known, target, settings });
    }

    fn ask_import(&mut self, work: ImportWork, task: ImportTask) {
        self.numbers.import += 1;
        let number = self.numbers.import;
        if let Some(import) = self.model.import.as_deref_mut() {
            (import.number, import.work, import.trouble) = (number, Some(work), None);
            self.desk.import(ImportJob { number, task });
        }
    }

    /// The import that an answer is for.
    fn import_of(&mut self, number: u64) -> Option<&mut ImportState> {
        self.model.import.as_deref_mut().filter(|import| import.number == number)
    }

    pub(crate) fn import_progress(&mut self, number: u64, work: ImportWork) {
        if let Some(import) = self.import_of(number).filter(|import| import.work.is_some()) {
            import.work = Some(work);
        }
    }

    pub(crate) fn recording_looked(&mut self, number: u64, found: Option<Arc<Found>>, trouble: Option<Text>) {
        let Some(import) = self.import_of(number) else { return };
        (import.work, import.trouble) = (None, trouble);
        import.chosen = found.as_ref().and_then(|found| found.decided());
        import.found = found;
    }

    pub(crate) fn recording_converted(&mut self, number: u64, converted: Result<Arc<Converted>, Text>) {
        let Some(import) = self.import_of(number) else { return };
        import.work = None;
        match converted {
            Ok(converted) => {
                self.model.opening = true;
                if self.desk.archive(ArchiveTask::Import(converted)).is_err() {
                    self.model.opening = false;
                    self.say(
                        Severity::Error,
                        text!("The disk does not keep up: nothing was changed. Try again in a moment"),
                    );
                }
            }
            Err(why) => import.trouble = Some(why),
        }
    }
}
