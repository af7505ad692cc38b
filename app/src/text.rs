//! Words that the window shows, in the language of the user.
//!
//! The English sentence is the key. `tr!(language, "Capture")` gives a fixed text at once; `text!("Pose {name} taught",
//! name = name)` makes a [`Text`] that can be kept, sent between threads, logged, and said in any language later.
//! Translations stand in `assets/text/<language>/*.toml` as `"English" = "translation"`; a test reads the sources and
//! fails for a text that has none. What a library or the cell says in its own words stays as it is.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

/// Languages of the window.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Language {
    /// English.
    #[default]
    #[serde(rename = "en")]
    English,
    /// Simplified Chinese.
    #[serde(rename = "zh-CN")]
    Chinese,
}

impl Language {
    /// All of them, in the order of menus.
    pub const ALL: [Self; 2] = [Self::English, Self::Chinese];

    /// Its name in itself.
    pub fn own_name(self) -> &'static str {
        match self {
            Self::English => "English",
            Self::Chinese => "简体中文",
        }
    }
}

/// A sentence with values in it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Text {
    english: Cow<'static, str>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    values: Vec<(Cow<'static, str>, Value)>,
    /// Whether somebody else's words stand here, which are not looked up.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    verbatim: bool,
}

/// What stands for a `{name}` in a sentence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Value {
    /// The same in every language.
    Plain(String),
    /// Translated as well.
    Text(Text),
}

impl<T: Display> From<T> for Value {
    fn from(value: T) -> Self {
        Self::Plain(value.to_string())
    }
}

impl From<Text> for Value {
    fn from(text: Text) -> Self {
        Self::Text(text)
    }
}

impl Text {
    /// A sentence of the catalogue; see the macro [`text!`](crate::text!).
    pub fn new(english: &'static str, values: Vec<(&'static str, Value)>) -> Self {
        let values = values.into_iter().map(|(name, value)| (Cow::Borrowed(name), value)).collect();
        Self { english: Cow::Borrowed(english), values, verbatim: false }
    }

    /// Words of a library, of the cell or of the user: the same in every language.
    pub fn verbatim(words: impl Into<String>) -> Self {
        Self { english: Cow::Owned(words.into()), values: Vec::new(), verbatim: true }
    }

    /// The sentence in a language.
    pub fn say(&self, language: Language) -> String {
        if self.verbatim {
            return self.english.to_string();
        }
        let template = translation(language, &self.english).unwrap_or(&self.english);
        let mut said = String::with_capacity(template.len() + 16);
        let mut rest = template;
        while let Some((before, after)) = rest.split_once('{') {
            said.push_str(before);
            let (name, after) = after.split_once('}').unwrap_or((after, ""));
            if let Some((_, value)) = self.values.iter().find(|(known, _)| known == name) {
                match value {
                    Value::Plain(plain) => said.push_str(plain),
                    Value::Text(text) => said.push_str(&text.say(language)),
                }
            }
            rest = after;
        }
        said.push_str(rest);
        said
    }

    /// Whether there is nothing to say.
    pub fn is_empty(&self) -> bool {
        self.english.is_empty()
    }
}

/// A [`Text`]: `text!("{count} poses captured", count = 10)`.
#[macro_export]
macro_rules! text {
    ($english:literal $(, $name:ident = $value:expr)* $(,)?) => {
        $crate::text::Text::new($english, vec![$((stringify!($name), $crate::text::Value::from($value))),*])
    };
}

/// A fixed text in a language: `tr!(language, "Capture")`.
#[macro_export]
macro_rules! tr {
    ($language:expr, $english:literal) => {
        $crate::text::translation($language, $english).unwrap_or($english)
    };
}

/// The translation of an English text; `None` where there is none, and for English.
pub fn translation(language: Language, english: &str) -> Option<&'static str> {
    match language {
        Language::English => None,
        Language::Chinese => chinese().get(english).map(String::as_str),
    }
}

/// One file per part of the window.
const CHINESE: &[(&str, &str)] = &[
    ("app", include_str!("../../assets/text/zh-CN/app.toml")),
    ("capture", include_str!("../../assets/text/zh-CN/capture.toml")),
    ("export", include_str!("../../assets/text/zh-CN/export.toml")),
    ("frame", include_str!("../../assets/text/zh-CN/frame.toml")),
    ("jog", include_str!("../../assets/text/zh-CN/jog.toml")),
    ("live", include_str!("../../assets/text/zh-CN/live.toml")),
    ("poses", include_str!("../../assets/text/zh-CN/poses.toml")),
    ("result", include_str!("../../assets/text/zh-CN/result.toml")),
    ("session", include_str!("../../assets/text/zh-CN/session.toml")),
    ("track", include_str!("../../assets/text/zh-CN/track.toml")),
];

fn chinese() -> &'static BTreeMap<String, String> {
    static CATALOGUE: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    CATALOGUE.get_or_init(|| {
        let mut all = BTreeMap::new();
        for (file, content) in CHINESE {
            match toml::from_str::<BTreeMap<String, String>>(content) {
                Ok(part) => all.extend(part),
                // The files are part of the program and a test reads them; English is shown if one is broken.
                Err(error) => tracing::error!(file, %error, "a catalogue of translations cannot be read"),
            }
        }
        all
    })
}

/// Every English text with its translation.
#[cfg(test)]
pub fn every_translation() -> impl Iterator<Item = (&'static str, &'static str)> {
    chinese().iter().map(|(english, chinese)| (english.as_str(), chinese.as_str()))
}

#[cfg(test)]
#[path = "text_tests.rs"]
mod tests;
