//! The little of YAML that the exports use, read back: nested maps by indentation, scalars, lists in brackets over one
//! or more lines, items of lists behind `-`, `%` and `---` lines, comments, and OpenCV's tags.

use std::collections::BTreeMap;

use super::text::{compare_numbers, compare_text, parse_number};

/// The scalars and lists of a document by their path, `transform.rotation.x`; an item of a list has its number as key.
#[derive(Debug)]
pub(super) struct Yaml(BTreeMap<String, String>);

/// What a path has to hold.
pub(super) enum Leaf {
    Number(f64),
    Numbers(Vec<f64>),
    Text(String),
}

impl Leaf {
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }
}

impl Yaml {
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut values: BTreeMap<String, String> = BTreeMap::new();
        let mut open: Vec<(usize, String)> = Vec::new();
        let mut lines = text.lines();
        let mut items = 0;
        while let Some(line) = lines.next() {
            let content = line.trim();
            if content.is_empty() || content.starts_with(['#', '%']) || content == "---" {
                continue;
            }
            let indent = line.len() - line.trim_start().len();
            let (key, value) = if let Some(item) = content.strip_prefix("- ") {
                items += 1;
                ((items - 1).to_string(), item)
            } else if content.starts_with('[') {
                // A list on the lines below its key.
                let (outer, key) = open.pop().ok_or("a list without a key")?;
                if outer >= indent {
                    return Err(format!("the list of {key} is not indented"));
                }
                (key, content)
            } else {
                let (key, value) = content.split_once(':').ok_or_else(|| format!("no key in {content:?}"))?;
                items = 0;
                (key.to_owned(), value)
            };
            open.retain(|(outer, _)| *outer < indent);
            open.push((indent, key));
            let path = open.iter().map(|(_, key)| key.as_str()).collect::<Vec<_>>().join(".");
            let mut value = value.trim().to_owned();
            while value.starts_with('[') && value.matches('[').count() > value.matches(']').count() {
                let more = lines.next().ok_or_else(|| format!("{path} has no end"))?;
                value.push(' ');
                value.push_str(more.trim());
            }
            let is_nested = value.is_empty() || value.starts_with("!!");
            if !is_nested && values.insert(path.clone(), value).is_some() {
                return Err(format!("{path} is there twice"));
            }
        }
        Ok(Self(values))
    }

    /// Compares every value with what it has to be; nothing may be missing and nothing may be there besides.
    pub fn compare(&self, expected: &[(impl AsRef<str>, Leaf)]) -> Result<(), String> {
        for (path, leaf) in expected {
            let path = path.as_ref();
            match leaf {
                Leaf::Number(value) => compare_numbers(path, &[self.number(path)?], &[*value])?,
                Leaf::Numbers(values) => compare_numbers(path, &self.numbers(path)?, values)?,
                Leaf::Text(text) => compare_text(path, self.text(path)?, text)?,
            }
        }
        let is_expected = |path: &str| expected.iter().any(|(known, _)| known.as_ref() == path);
        self.0
            .keys()
            .find(|path| !is_expected(path))
            .map_or(Ok(()), |path| Err(format!("{path} does not belong there")))
    }

    pub fn text(&self, path: &str) -> Result<&str, String> {
        self.0.get(path).map(|v| v.trim_matches('"')).ok_or_else(|| format!("{path} is missing"))
    }

    pub fn number(&self, path: &str) -> Result<f64, String> {
        match self.text(path)? {
            ".nan" => Ok(f64::NAN),
            text => parse_number(path, text),
        }
    }

    /// The numbers of a list, those of lists in it one after the other.
    pub fn numbers(&self, path: &str) -> Result<Vec<f64>, String> {
        let text = self.text(path)?;
        let inner = text.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
        let inner = inner.ok_or_else(|| format!("{path} is not a list"))?.replace(['[', ']'], " ");
        inner.split(',').map(str::trim).filter(|e| !e.is_empty()).map(|e| parse_number(path, e)).collect()
    }
}
