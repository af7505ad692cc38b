//! What the program remembers of the user's wishes: a TOML file that people may edit.
//!
//! A value is taken from the first of these that has it: the command line, the environment (`HANDEYE_…`), the file
//! (`$XDG_CONFIG_HOME/handeye-workbench/settings.toml`, or below `~/.config`), the defaults. The file is written only when
//! the user changes a setting in the window. `docs/settings.md` lists the keys.

use std::io;
use std::path::{Path, PathBuf};

use handeye_core::depth::ColourMap;
use toml::de::{DeTable, DeValue};

use crate::command::Event;
use crate::model::{CellSource, DepthScale, RotationFormat, Severity, ThemeChoice, ViewSettings};
use crate::text;
use crate::text::{Language, Text};

/// Earlier addresses that are kept.
pub const ADDRESSES: usize = 8;

/// The settings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// How the window looks.
    pub view: ViewSettings,
    /// Which cell to work with at the start; `None` is the built-in one.
    pub connect: Option<String>,
    /// Addresses that were connected to, newest first.
    pub addresses: Vec<String>,
    /// Where new sessions go; `None` is `handeye-sessions` in the home folder.
    pub sessions: Option<PathBuf>,
}

/// Something in the settings that was left out, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning(pub Text);

impl From<Warning> for Event {
    fn from(Warning(text): Warning) -> Self {
        Self::Notice { severity: Severity::Warning, text }
    }
}

/// A setting that is one of a few words.
trait Word: Sized + Copy + PartialEq + 'static {
    /// The words and what they mean.
    const WORDS: &'static [(&'static str, Self)];

    fn from_word(word: &str) -> Result<Self, String> {
        Self::WORDS.iter().find(|(known, _)| *known == word).map(|(_, value)| *value).ok_or_else(|| {
            let words: Vec<_> = Self::WORDS.iter().map(|(known, _)| format!("{known:?}")).collect();
            words.join(", ")
        })
    }

    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("", |(word, _)| *word)
    }
}

impl Word for ThemeChoice {
    const WORDS: &'static [(&'static str, Self)] = &[("dark", Self::Dark), ("light", Self::Light)];
}

impl Word for Language {
    const WORDS: &'static [(&'static str, Self)] = &[("en", Self::English), ("zh-CN", Self::Chinese)];
}

impl Word for RotationFormat {
    const WORDS: &'static [(&'static str, Self)] = &[("rpy", Self::RollPitchYaw), ("quaternion", Self::Quaternion)];
}

impl Word for DepthScale {
    const WORDS: &'static [(&'static str, Self)] = &[("auto", Self::Auto), ("full", Self::Full)];
}

impl Word for ColourMap {
    const WORDS: &'static [(&'static str, Self)] =
        &[("turbo", Self::Turbo), ("viridis", Self::Viridis), ("grey", Self::Grey)];
}

/// The keys, as the file and (in capitals, after `HANDEYE_`) the environment have them.
const KEYS: [&str; 8] =
    ["theme", "language", "rotation", "depth_scale", "depth_colours", "connect", "sessions", "addresses"];

impl Settings {
    /// Sets one value from text.
    ///
    /// # Errors
    /// What may stand there.
    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "theme" => self.view.theme = Word::from_word(value)?,
            "language" => self.view.language = Word::from_word(value)?,
            "rotation" => self.view.rotation = Word::from_word(value)?,
            "depth_scale" => self.view.depth_scale = Word::from_word(value)?,
            "depth_colours" => self.view.depth_colours = Word::from_word(value)?,
            "connect" => self.connect = Some(value.to_owned()).filter(|value| !value.is_empty()),
            "sessions" => self.sessions = Some(PathBuf::from(value)).filter(|_| !value.is_empty()),
            _ => return Err(KEYS.map(|key| format!("{key:?}")).join(", ")),
        }
        Ok(())
    }

    /// Takes in a file. What cannot be used is left as it was and told.
    pub fn read(&mut self, file: &str, content: &str) -> Vec<Warning> {
        let (table, errors) = DeTable::parse_recoverable(content);
        let mut warnings: Vec<_> = errors
            .into_iter()
            .map(|error| {
                let at = error.span().map_or(1, |span| line_of(content, span.start));
                Warning(text!("{file}, line {line}: {why}", file = file, line = at, why = error.message()))
            })
            .collect();
        for (key, value) in table.into_inner() {
            let line = line_of(content, key.span().start);
            let key = key.into_inner();
            let expected = match (key.as_ref(), value.into_inner()) {
                ("addresses", DeValue::Array(all)) => {
                    let text = |value: toml::Spanned<DeValue<'_>>| value.into_inner().as_str().map(str::to_owned);
                    self.addresses = all.into_iter().filter_map(text).take(ADDRESSES).collect();
                    continue;
                }
                ("addresses", _) => "[\"tcp://host:port\", …]".to_owned(),
                (key, DeValue::String(value)) => match self.set(key, &value) {
                    Ok(()) => continue,
                    Err(expected) => expected,
                },
                _ => "\"…\"".to_owned(),
            };
            warnings.push(Warning(text!(
                "{file}, line {line}: {key} is left out; it can be one of {expected}",
                file = file,
                line = line,
                key = key,
                expected = expected
            )));
        }
        warnings
    }

    /// Takes in the environment, given as a function that looks a variable up.
    pub fn read_environment(&mut self, variable: impl Fn(&str) -> Option<String>) -> Vec<Warning> {
        let mut warnings = Vec::new();
        for key in KEYS.into_iter().filter(|key| *key != "addresses") {
            let name = format!("HANDEYE_{}", key.to_uppercase());
            if let Some(value) = variable(&name)
                && let Err(expected) = self.set(key, &value)
            {
                warnings.push(Warning(text!(
                    "{name} is left out; it can be one of {expected}",
                    name = name,
                    expected = expected
                )));
            }
        }
        warnings
    }

    /// The cell to work with at the start.
    pub fn source(&self) -> CellSource {
        self.connect.clone().map_or(CellSource::BuiltIn, CellSource::Address)
    }

    /// Where new sessions go.
    pub fn sessions_folder(&self, variable: impl Fn(&str) -> Option<String>) -> PathBuf {
        let home = || variable("HOME").filter(|home| !home.is_empty()).map(PathBuf::from).unwrap_or_default();
        self.sessions.clone().unwrap_or_else(|| home().join("handeye-sessions"))
    }

    /// The file that says this.
    fn written(&self) -> String {
        let mut table = toml::Table::new();
        let ViewSettings { theme, language, rotation, depth_scale, depth_colours, .. } = self.view;
        for (key, word) in [
            ("theme", theme.word()),
            ("language", language.word()),
            ("rotation", rotation.word()),
            ("depth_scale", depth_scale.word()),
            ("depth_colours", depth_colours.word()),
        ] {
            table.insert(key.to_owned(), word.into());
        }
        if let Some(connect) = &self.connect {
            table.insert("connect".to_owned(), connect.as_str().into());
        }
        if let Some(sessions) = &self.sessions {
            table.insert("sessions".to_owned(), sessions.to_string_lossy().into_owned().into());
        }
        if !self.addresses.is_empty() {
            table.insert("addresses".to_owned(), self.addresses.clone().into());
        }
        format!(
            "# Settings of the Handeye Workbench, see docs/settings.md. Written when one is changed in the window.\n{table}"
        )
    }
}

fn line_of(content: &str, at: usize) -> usize {
    content.bytes().take(at).filter(|&byte| byte == b'\n').count() + 1
}

/// Where the file is by the environment; `None` without a home.
pub fn default_path(variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    let set = |name| variable(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    // The specification of these folders has relative paths ignored.
    let config = set("XDG_CONFIG_HOME").filter(|path| path.is_absolute());
    let config = config.or_else(|| Some(set("HOME")?.join(".config")))?;
    Some(config.join("handeye-workbench").join("settings.toml"))
}

/// The file, what it says, and what the user has changed since.
#[derive(Debug, Default)]
pub struct SettingsFile {
    path: Option<PathBuf>,
    /// What the file says, without command line and environment.
    in_file: Settings,
    /// How the window looked when it was last compared.
    last_view: ViewSettings,
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
        let last_view = settings.view;
        (Self { path, in_file, last_view }, settings, warnings)
    }

    /// What is to be written when the user has changed how the window looks, or an address is new; a worker does it.
    pub fn keep(&mut self, view: ViewSettings, addresses: &[String]) -> Option<SettingsWrite> {
        if view == self.last_view && *addresses == self.in_file.addresses {
            return None;
        }
        let before_text = self.in_file.written();
        // What the environment says and the user did not touch stays out of the file.
        let ViewSettings { theme, language, rotation, depth_scale, depth_colours, .. } = view;
        let (before, kept) = (self.last_view, &mut self.in_file.view);
        keep(&mut kept.theme, before.theme, theme);
        keep(&mut kept.language, before.language, language);
        keep(&mut kept.rotation, before.rotation, rotation);
        keep(&mut kept.depth_scale, before.depth_scale, depth_scale);
        keep(&mut kept.depth_colours, before.depth_colours, depth_colours);
        self.last_view = view;
        self.in_file.addresses = addresses.to_vec();
        let content = self.in_file.written();
        let path = self.path.clone().filter(|_| content != before_text)?;
        Some(SettingsWrite { path, content })
    }
}

/// A settings file that is to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingsWrite {
    path: PathBuf,
    content: String,
}

impl SettingsWrite {
    /// Writes it, as a whole or not at all.
    ///
    /// # Errors
    /// When it cannot be written; it is not tried again before the next change.
    pub fn perform(&self) -> Result<(), Warning> {
        let write = || {
            if let Some(folder) = self.path.parent() {
                std::fs::create_dir_all(folder)?;
            }
            handeye_core::atomic_file::write(&self.path, self.content.as_bytes())
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
