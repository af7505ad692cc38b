//! The little of YAML that the exports use, read back: nested maps by indentation, scalars, lists in brackets over one
//! or more lines, `%` and `---` lines, comments, and OpenCV's tags.

use std::collections::BTreeMap;

/// The scalars and lists of a document by their path, `transform.rotation.x`.
#[derive(Debug)]
pub(super) struct Yaml(BTreeMap<String, String>);

impl Yaml {
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut values = BTreeMap::new();
        let mut open: Vec<(usize, String)> = Vec::new();
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            let content = line.trim();
            if content.is_empty() || content.starts_with(['#', '%']) || content == "---" {
                continue;
            }
            let indent = line.len() - line.trim_start().len();
            let (key, value) = content.split_once(':').ok_or_else(|| format!("no key in {content:?}"))?;
            open.retain(|(outer, _)| *outer < indent);
            open.push((indent, key.to_owned()));
            let path = open.iter().map(|(_, key)| key.as_str()).collect::<Vec<_>>().join(".");
            let mut value = value.trim().to_owned();
            while value.starts_with('[') && !value.ends_with(']') {
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

    pub fn has(&self, path: &str) -> bool {
        self.0.contains_key(path)
    }

    pub fn text(&self, path: &str) -> Result<&str, String> {
        self.0.get(path).map(|v| v.trim_matches('"')).ok_or_else(|| format!("{path} is missing"))
    }

    pub fn number(&self, path: &str) -> Result<f64, String> {
        parse_number(path, self.text(path)?)
    }

    pub fn numbers(&self, path: &str) -> Result<Vec<f64>, String> {
        let text = self.text(path)?;
        let inner = text.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
        let inner = inner.ok_or_else(|| format!("{path} is not a list"))?;
        inner.split(',').map(|element| parse_number(path, element.trim())).collect()
    }
}

fn parse_number(path: &str, text: &str) -> Result<f64, String> {
    text.parse().map_err(|_error| format!("{path}: {text:?} is not a number"))
}
