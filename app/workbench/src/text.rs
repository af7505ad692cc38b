//! Texts that the window shows, in the language of the user.
//!
//! The English sentence is the key. `tr!(language, "Capture")` gives a fixed text at once; `text!` makes a [`Text`] that is
//! shown later. Translations are in `assets/text/<language>/*.toml` as `"English" = "translation"`; a test reads the
//! sources, those of the core too, and fails for a text that has none.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

pub use handeye_wording::{Catalogue, Text};

/// Languages of the window.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Language {
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

    /// The language of the window for a locale of the system, such as `zh_CN.UTF-8`: English if it has no translation.
    pub(crate) fn of_locale(locale: &str) -> Self {
        let language = locale.split(['-', '_', '.', '@']).next().unwrap_or_default();
        if language.eq_ignore_ascii_case("zh") { Self::Chinese } else { Self::English }
    }

    /// Its name in the language itself.
    pub fn own_name(self) -> &'static str {
        match self {
            Self::English => "English",
            Self::Chinese => "简体中文",
        }
    }
}

impl Catalogue for Language {
    fn translation(self, english: &str) -> Option<&'static str> {
        match self {
            Self::English => None,
            Self::Chinese => chinese().get(english).map(String::as_str),
        }
    }
}

/// A fixed text in a language: `tr!(language, "Capture")`.
#[macro_export]
macro_rules! tr {
    ($language:expr, $english:literal) => {
        $crate::text::Catalogue::translation($language, $english).unwrap_or($english)
    };
}

/// One file per part of the window.
const CHINESE: &[(&str, &str)] = &[
    ("app", include_str!("../../../assets/text/zh-CN/app.toml")),
    ("capture", include_str!("../../../assets/text/zh-CN/capture.toml")),
    ("errors", include_str!("../../../assets/text/zh-CN/errors.toml")),
    ("export", include_str!("../../../assets/text/zh-CN/export.toml")),
    ("import", include_str!("../../../assets/text/zh-CN/import.toml")),
    ("frame", include_str!("../../../assets/text/zh-CN/frame.toml")),
    ("jog", include_str!("../../../assets/text/zh-CN/jog.toml")),
    ("live", include_str!("../../../assets/text/zh-CN/live.toml")),
    ("poses", include_str!("../../../assets/text/zh-CN/poses.toml")),
    ("result", include_str!("../../../assets/text/zh-CN/result.toml")),
    ("serve", include_str!("../../../assets/text/zh-CN/serve.toml")),
    ("session", include_str!("../../../assets/text/zh-CN/session.toml")),
    ("track", include_str!("../../../assets/text/zh-CN/track.toml")),
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
#[cfg(any(test, feature = "testing"))]
pub fn every_translation() -> impl Iterator<Item = (&'static str, &'static str)> {
    chinese().iter().map(|(english, chinese)| (english.as_str(), chinese.as_str()))
}

#[cfg(test)]
#[path = "text_tests.rs"]
mod tests;
