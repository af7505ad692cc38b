//! Sentences with values in them, which can be reported in any language.
//!
//! The English sentence is the template. `text!("{n} degrees of freedom", n = 12)` makes a [`Text`] that can be kept, sent
//! between threads and logged; the program that shows it has a [`Catalogue`]. Texts of a library or the cell are not
//! translated.
//!
//! Errors are such sentences by `derive(Localized)`: `#[error("…")]` is the template. An error of another library is a value in
//! one of them.
//!
//! `{n|degree|degrees}` in a template is the first word where the value of `n` is 1, and the second otherwise. A language
//! whose nouns have one form does without.
//!
//! ```
//! use handeye_wording::{English, text};
//!
//! let size = text!("{count} bytes", count = 12);
//! assert_eq!(size.in_language(English), "12 bytes");
//! ```
//!
//! Depends on `serde` and its own derive macro alone.

#![warn(missing_docs)]

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize, Serializer};

pub use handeye_wording_derive::Localized;

/// A language, with the templates in it.
pub trait Catalogue: Copy {
    /// The translation of an English sentence, with the same values; `None` where there is none, and for English.
    fn translation(self, english: &str) -> Option<&'static str>;
}

/// The language of the templates, of documents and of the command line.
#[derive(Debug, Clone, Copy)]
pub struct English;

impl Catalogue for English {
    fn translation(self, _: &str) -> Option<&'static str> {
        None
    }
}

/// Decimals that a number is shown with: at least `least`, and enough for one digit that is not zero.
pub fn decimals(value: f64, least: usize) -> usize {
    /// Beyond it is the rounding of what was computed.
    const MOST: usize = 9;
    let first = -value.abs().log10().floor();
    if first.is_finite() { (first.max(0.0) as usize).clamp(least, MOST.max(least)) } else { least }
}

/// A number with `least` decimals, and with more where these would all be zero.
pub fn shown(value: f64, least: usize) -> String {
    format!("{value:.*}", decimals(value, least))
}

/// The error text of another library, on one line.
pub fn foreign(error: &dyn fmt::Display) -> Text {
    Text::verbatim(one_line(error))
}

/// Messages are one line, also where a library wrote more.
pub fn one_line(message: &dyn fmt::Display) -> String {
    message.to_string().split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}

/// A sentence with values in it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Text {
    english: Cow<'static, str>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    values: Vec<(Cow<'static, str>, Value)>,
    /// Whether it is the text of another program, which is not translated.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    verbatim: bool,
}

/// Value of a `{name}` in a sentence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Value {
    /// The same in every language.
    Plain(String),
    /// Translated as well.
    Text(Text),
}

/// Values that are the same in every language. Our own errors are not among these: they are sentences, which their
/// package translates.
#[macro_export]
macro_rules! plain_values {
    ($($of:ty),* $(,)?) => {$(
        impl From<$of> for $crate::Value {
            fn from(value: $of) -> Self {
                Self::Plain(value.to_string())
            }
        }
        impl From<&$of> for $crate::Value {
            fn from(value: &$of) -> Self {
                Self::Plain(value.to_string())
            }
        }
    )*};
}

plain_values!(String, char, f32, f64, i32, i64, i128, u8, u16, u32, u64, u128, usize);
plain_values!(std::io::Error, std::process::ExitStatus, std::path::Display<'_>, Cow<'_, str>);

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Plain(value.to_owned())
    }
}

impl From<&&str> for Value {
    fn from(value: &&str) -> Self {
        Self::Plain((*value).to_owned())
    }
}

impl Value {
    /// Words of ours in a sentence of ours: they are translated. A single one is a key, or the name of a method: it is not.
    pub fn phrase(words: &'static str) -> Self {
        if words.contains(' ') { Self::Text(Text::new(words, Vec::new())) } else { Self::Plain(words.to_owned()) }
    }

    /// The text alone, in a language.
    pub fn in_language(&self, language: impl Catalogue) -> String {
        match self {
            Self::Plain(plain) => plain.clone(),
            Self::Text(text) => text.in_language(language),
        }
    }
}

impl From<&Text> for Value {
    fn from(text: &Text) -> Self {
        Self::Text(text.clone())
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

    /// The text, where it is from another program ([`Text::verbatim`]).
    pub fn foreign_words(&self) -> Option<&str> {
        self.verbatim.then_some(&*self.english)
    }

    /// With a value more, for what is reported with one of several templates.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.values.push((Cow::Borrowed(name), value.into()));
        self
    }

    /// Consecutive sentences.
    pub fn sentences(all: impl IntoIterator<Item = Self>) -> Self {
        let joined = all.into_iter().reduce(|first, next| text!("{first} {next}", first = first, next = next));
        joined.unwrap_or_default()
    }

    /// Things that are listed within a sentence.
    pub fn list(all: impl IntoIterator<Item = Self>) -> Self {
        let joined = all.into_iter().reduce(|first, rest| text!("{first}, {rest}", first = first, rest = rest));
        joined.unwrap_or_default()
    }

    /// The sentence in a language.
    pub fn in_language(&self, language: impl Catalogue) -> String {
        if self.verbatim {
            return self.english.to_string();
        }
        let template = language.translation(&self.english).unwrap_or(&self.english);
        let mut reported = String::with_capacity(template.len() + 16);
        let mut rest = template;
        while let Some((before, after)) = rest.split_once('{') {
            reported.push_str(before);
            let (name, after) = after.split_once('}').unwrap_or((after, ""));
            let (name, forms) =
                name.split_once('|').map_or((name, None), |(name, forms)| (name, forms.split_once('|')));
            let value = self.values.iter().find(|(known, _)| known == name);
            debug_assert!(value.is_some(), "{template:?} has no value {name}");
            match value {
                Some((_, Value::Plain(plain))) => {
                    reported.push_str(forms.map_or(plain, |(one, many)| if plain == "1" { one } else { many }));
                }
                Some((_, Value::Text(text))) => reported.push_str(&text.in_language(language)),
                None => {}
            }
            rest = after;
        }
        reported.push_str(rest);
        reported
    }

    /// Whether the text is empty.
    pub fn is_empty(&self) -> bool {
        self.english.is_empty()
    }

    /// The English sentence, for fields of documents.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize_english<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.in_language(English))
    }
}

/// In English, as errors are logged, kept in documents and printed by the command line.
impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.in_language(English))
    }
}

/// A [`Text`](crate::Text): `text!("{n} degrees of freedom", n = 12)`.
#[macro_export]
macro_rules! text {
    ($english:literal $(, $name:ident = $value:expr)* $(,)?) => {
        $crate::Text::new($english, vec![$((stringify!($name), $crate::Value::from($value))),*])
    };
}
