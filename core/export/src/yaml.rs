//! YAML of the exports read back, by a reader that is not ours, and compared.

use std::collections::BTreeMap;

use saphyr::{LoadableYamlNode as _, Scalar, Yaml as Node};

use super::text::{compare_numbers, compare_text};

/// The scalars of a document and its lists of numbers, by their path, `transform.rotation.x`.
#[derive(Debug)]
pub(super) struct Yaml(BTreeMap<String, Leaf>);

/// The value at a path.
#[derive(Debug)]
pub(super) enum Leaf {
    Number(f64),
    /// The numbers of a list, those of lists in it one after the other.
    Numbers(Vec<f64>),
    Text(String),
    Flag(bool),
}

impl Leaf {
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }
}

impl Yaml {
    pub fn parse(text: &str) -> Result<Self, String> {
        let documents = Node::load_from_str(text).map_err(|e| format!("the file is no YAML: {e}"))?;
        let [document] = documents.as_slice() else {
            return Err(format!("the file has {} documents of YAML", documents.len()));
        };
        let mut leaves = BTreeMap::new();
        collect(document, String::new(), &mut leaves)?;
        Ok(Self(leaves))
    }

    /// Compares every value with the expected one; no value may be missing or additional.
    pub fn compare(&self, expected: &[(impl AsRef<str>, Leaf)]) -> Result<(), String> {
        for (path, leaf) in expected {
            let path = path.as_ref();
            match (self.leaf(path)?, leaf) {
                (Leaf::Number(got), Leaf::Number(value)) => compare_numbers(path, &[*got], &[*value])?,
                (Leaf::Numbers(got), Leaf::Numbers(values)) => compare_numbers(path, got, values)?,
                (Leaf::Text(got), Leaf::Text(text)) => compare_text(path, got, text)?,
                (Leaf::Flag(got), Leaf::Flag(flag)) if got == flag => {}
                (got, leaf) => return Err(format!("{path} is {got:?}, not {leaf:?}")),
            }
        }
        let is_expected = |path: &str| expected.iter().any(|(known, _)| known.as_ref() == path);
        self.0
            .keys()
            .find(|path| !is_expected(path))
            .map_or(Ok(()), |path| Err(format!("{path} does not belong there")))
    }

    fn leaf(&self, path: &str) -> Result<&Leaf, String> {
        self.0.get(path).ok_or_else(|| format!("{path} is missing"))
    }

    pub fn number(&self, path: &str) -> Result<f64, String> {
        match self.leaf(path)? {
            Leaf::Number(number) => Ok(*number),
            other => Err(format!("{path} is {other:?}, not a number")),
        }
    }

    pub fn numbers(&self, path: &str) -> Result<&[f64], String> {
        match self.leaf(path)? {
            Leaf::Numbers(numbers) => Ok(numbers),
            other => Err(format!("{path} is {other:?}, not a list of numbers")),
        }
    }
}

fn collect(node: &Node<'_>, path: String, leaves: &mut BTreeMap<String, Leaf>) -> Result<(), String> {
    let leaf = match node {
        Node::Mapping(entries) => {
            for (key, value) in entries {
                let key = key.as_str().ok_or_else(|| format!("a key in {path:?} is no text"))?;
                let inner = if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
                collect(value, inner, leaves)?;
            }
            return Ok(());
        }
        // OpenCV's tag of a matrix.
        Node::Tagged(_, inner) => return collect(inner, path, leaves),
        Node::Sequence(_) => {
            let mut values = Vec::new();
            numbers_in(node, &path, &mut values)?;
            Leaf::Numbers(values)
        }
        Node::Value(Scalar::String(text)) => Leaf::text(text.as_ref()),
        Node::Value(Scalar::Boolean(flag)) => Leaf::Flag(*flag),
        other => Leaf::Number(number(other).ok_or_else(|| format!("{path} is {other:?}"))?),
    };
    leaves.insert(path, leaf);
    Ok(())
}

fn numbers_in(node: &Node<'_>, path: &str, values: &mut Vec<f64>) -> Result<(), String> {
    if let Node::Sequence(items) = node {
        return items.iter().try_for_each(|item| numbers_in(item, path, values));
    }
    values.push(number(node).ok_or_else(|| format!("{path} has {node:?} among its numbers"))?);
    Ok(())
}

fn number(node: &Node<'_>) -> Option<f64> {
    node.as_floating_point().or_else(|| node.as_integer().map(|integer| integer as f64))
}
