//! The user's settings that the program remembers: a TOML file that can be edited.
//!
//! A value is taken from the first of these that has it: the command line, the environment (`HANDEYE_…`), the file
//! (`$XDG_CONFIG_HOME/handeye-workbench/settings.toml`, or below `~/.config`), the defaults. The file is written only when
//! the user changes a setting in the window. `docs/reference/settings.md` lists the keys.

use std::io;
use std::path::{Path, PathBuf};

use directories::BaseDirs;
use handeye_coppeliasim::cell::CellPaths;
use handeye_geometry::depth::ColourMap;
use serde::{Deserialize, Serialize};
use toml::de::{DeTable, ValueDeserializer};

use crate::messages;
use crate::messages::state::Severity;
use crate::shell::view::{DepthScale, RotationFormat, ThemeChoice, ViewSettings};
use crate::text::{Language, Text};
use handeye_link::{CellSource, Drivers};
use handeye_wording::text;

/// The name of this program's folders in those of the system.
pub const FOLDER: &str = "handeye-workbench";

/// Earlier addresses that are kept.
pub(crate) const ADDRESSES: usize = 8;

/// The settings: each field is a key of the file and, in capitals after `HANDEYE_`, a variable of the environment.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    theme: ThemeChoice,
    language: LanguageChoice,
    rotation: RotationFormat,
    depth_scale: DepthScale,
    depth_colours: ColourMap,
    /// Which cell to work with at the start; empty for the built-in one.
    connect: String,
    /// Scene of the built-in cell: a name, or a file; empty is the reference scene.
    scene: String,
    /// Where new sessions go; empty is `handeye-sessions` in the home folder.
    sessions: String,
    /// Addresses that were connected to, newest first.
    pub addresses: Vec<String>,
    /// Drivers that were connected to, newest first.
    pub drivers: Vec<Drivers>,
    /// Where a scene other than the built-in one has the parts of the cell.
    pub objects: CellPaths,
}

/// The language of the window, as configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
enum LanguageChoice {
    #[default]
    #[serde(rename = "system")]
    System,
    #[serde(rename = "en")]
    English,
    /// Simplified Chinese.
    #[serde(rename = "zh-CN")]
    Chinese,
}

impl LanguageChoice {
    fn language(self) -> Language {
        match self {
            Self::System => sys_locale::get_locale().map_or(Language::English, |locale| Language::of_locale(&locale)),
            Self::English => Language::English,
            Self::Chinese => Language::Chinese,
        }
    }
}

impl From<Language> for LanguageChoice {
    fn from(language: Language) -> Self {
        match language {
            Language::English => Self::English,
            Language::Chinese => Self::Chinese,
        }
    }
}

/// A setting that was ignored, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning(pub Text);

impl From<Warning> for messages::Event {
    fn from(Warning(text): Warning) -> Self {
        Self::Notice { severity: Severity::Warning, text }
    }
}

impl Settings {
    /// As a TOML table.
    fn table(&self) -> toml::Table {
        toml::Table::try_from(self).expect("words and lists of words can be written as TOML")
    }

    /// Sets one key. The others are unchanged if the value is invalid.
    fn set(&mut self, key: &str, value: toml::Value) -> Result<(), toml::de::Error> {
        let mut table = self.table();
        table.insert(key.to_owned(), value);
        *self = table.try_into()?;
        self.addresses.truncate(ADDRESSES);
        self.drivers.truncate(ADDRESSES);
        Ok(())
    }

    /// Takes in a file. What cannot be used is left as it was and reported.
    pub(crate) fn read(&mut self, file: &str, content: &str) -> Vec<Warning> {
        let (table, errors) = DeTable::parse_recoverable(content);
        let mut warnings: Vec<_> = errors
            .into_iter()
            .map(|error| {
                let at = error.span().map_or(1, |span| line_of(content, span.start));
                Warning(text!("{file}, line {line}: {why}", file = file, line = at, why = error.message()))
            })
            .collect();
        for (key, value) in table.into_inner() {
            let value = toml::Value::deserialize(ValueDeserializer::from(value));
            if let Err(error) = value.and_then(|value| self.set(key.get_ref(), value)) {
                warnings.push(Warning(text!(
                    "{file}, line {line}: {key} is left out: {why}",
                    file = file,
                    line = line_of(content, key.span().start),
                    key = key.get_ref(),
                    why = error.message()
                )));
            }
        }
        warnings
    }

    /// Takes in the environment, given as a function that looks a variable up.
    pub(crate) fn read_environment(&mut self, variable: impl Fn(&str) -> Option<String>) -> Vec<Warning> {
        let mut warnings = Vec::new();
        // A list cannot be given in a variable.
        for (key, _) in self.table().into_iter().filter(|(_, value)| value.is_str()) {
            let name = format!("HANDEYE_{}", key.to_uppercase());
            if let Some(value) = variable(&name)
                && let Err(error) = self.set(&key, value.into())
            {
                warnings.push(Warning(text!("{name} is left out: {why}", name = name, why = error.message())));
            }
        }
        warnings
    }

    /// How the window looks at the start; what is not stored here has its default.
    pub fn view(&self) -> ViewSettings {
        let Self { theme, language, rotation, depth_scale, depth_colours, .. } = *self;
        let language = language.language();
        ViewSettings { depth_colours, theme, language, rotation, depth_scale, ..ViewSettings::default() }
    }

    /// The cell to work with at the start.
    pub fn source(&self) -> CellSource {
        if self.connect.is_empty() { self.built_in() } else { CellSource::Address(self.connect.clone()) }
    }

    pub fn built_in(&self) -> CellSource {
        CellSource::BuiltIn(self.scene.clone().into())
    }

    /// Where new sessions go.
    pub fn sessions_folder(&self) -> PathBuf {
        if !self.sessions.is_empty() {
            return PathBuf::from(&self.sessions);
        }
        let home = BaseDirs::new().map(|folders| folders.home_dir().to_path_buf());
        home.unwrap_or_default().join("handeye-sessions")
    }

    /// The file with this content.
    fn written(&self) -> String {
        let table = self.table();
        format!(
            "# Settings of the Handeye Workbench (docs/reference/settings.md), written when one is changed.\n{table}"
        )
    }
}

fn line_of(content: &str, at: usize) -> usize {
    content.bytes().take(at).filter(|&byte| byte == b'\n').count() + 1
}

/// Default place of the file; `None` without a home folder.
pub fn default_path() -> Option<PathBuf> {
    Some(BaseDirs::new()?.config_dir().join(FOLDER).join("settings.toml"))
}

/// The file, its content, and what the user has changed since.
#[derive(Debug, Default)]
pub struct SettingsFile {
    path: Option<PathBuf>,
    /// The content of the file, without command line and environment.
    in_file: Settings,
    /// How the window looked when it was last compared.
    last_view: ViewSettings,
    /// Objects of the scene when they were last compared.
    last_objects: CellPaths,
}

impl SettingsFile {
    /// Reads file and environment.
    pub fn open(path: Option<PathBuf>, variable: impl Fn(&str) -> Option<String>) -> (Self, Settings, Vec<Warning>) {
        let mut in_file = Settings::default();
        let mut warnings = Vec::new();
        if let Some(path) = &path {
            match std::fs::read_to_string(path) {
                Ok(content) => warnings = in_file.read(&path.to_string_lossy(), &content),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => warnings.push(Warning(unreadable(path, &error))),
            }
        }
        let mut settings = in_file.clone();
        warnings.extend(settings.read_environment(variable));
        let (last_view, last_objects) = (settings.view(), settings.objects.clone());
        (Self { path, in_file, last_view, last_objects }, settings, warnings)
    }

    /// Objects of the scene that are given for this run alone and do not get into the file.
    #[must_use]
    pub fn with_objects(mut self, objects: &CellPaths) -> Self {
        self.last_objects = objects.clone();
        self
    }

    /// What has to be written when the user has changed how the window looks or where the scene has its objects, or an
    /// address or a driver is new; a worker does it.
    pub fn keep(
        &mut self,
        view: ViewSettings,
        addresses: &[String],
        drivers: &[Drivers],
        objects: &CellPaths,
    ) -> Option<SettingsWrite> {
        if view == self.last_view
            && *addresses == self.in_file.addresses
            && *drivers == self.in_file.drivers
            && *objects == self.last_objects
        {
            return None;
        }
        let before_text = self.in_file.written();
        // What the environment sets and the user did not change stays out of the file.
        let ViewSettings { theme, language, rotation, depth_scale, depth_colours, .. } = view;
        let (before, kept) = (self.last_view, &mut self.in_file);
        keep(&mut kept.theme, before.theme, theme);
        keep(&mut kept.language, before.language.into(), language.into());
        keep(&mut kept.rotation, before.rotation, rotation);
        keep(&mut kept.depth_scale, before.depth_scale, depth_scale);
        keep(&mut kept.depth_colours, before.depth_colours, depth_colours);
        self.last_view = view;
        self.in_file.addresses = addresses.to_vec();
        self.in_file.drivers = drivers.to_vec();
        if self.last_objects != *objects {
            self.last_objects = objects.clone();
            self.in_file.objects = objects.clone();
        }
        let content = self.in_file.written();
        let path = self.path.clone().filter(|_| content != before_text)?;
        Some(SettingsWrite { path, content })
    }
}

/// A settings file, or what is remembered next to it, that has to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingsWrite {
    path: PathBuf,
    content: String,
}

impl SettingsWrite {
    /// A file with this text.
    pub fn new(path: PathBuf, content: String) -> Self {
        Self { path, content }
    }

    /// Writes it, as a whole or not at all.
    ///
    /// # Errors
    /// When it cannot be written; it is not retried before the next change.
    pub fn perform(&self) -> Result<(), Warning> {
        let write = || {
            if let Some(folder) = self.path.parent() {
                std::fs::create_dir_all(folder)?;
            }
            handeye_files::atomic_file::write(&self.path, self.content.as_bytes())
        };
        write().map_err(|error: io::Error| {
            Warning(text!(
                "The settings were not written to {file}: {error}",
                file = self.path.display(),
                error = error
            ))
        })
    }
}

fn keep<T: PartialEq + Copy>(kept: &mut T, before: T, now: T) {
    if before != now {
        *kept = now;
    }
}

fn unreadable(path: &Path, error: &io::Error) -> Text {
    text!("The settings in {file} cannot be read: {error}", file = path.display(), error = error)
}

#[cfg(test)]
#[path = "settings_tests.rs"]
mod tests;
