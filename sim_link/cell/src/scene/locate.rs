//! From byte offsets to lines and fields of a TOML text, and back.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Line, counted from 1, of a byte offset.
pub(super) fn line_at(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|&byte| byte == b'\n').count() + 1
}

/// Line of the value of a dotted field such as `camera.near_m` or `solids[2].size_m`; of the nearest parent that is
/// written down where the field itself is not; `None` where no part of it is.
pub(super) fn line_of(text: &str, field: &str) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let mut keys = field.split(['.', '[', ']']).filter(|key| !key.is_empty());
    let mut value = child(document.get_ref(), keys.next()?)?;
    for key in keys {
        let next = match value.get_ref() {
            DeValue::Table(table) => child(table, key),
            DeValue::Array(items) => key.parse::<usize>().ok().and_then(|index| items.get(index)),
            _ => None,
        };
        match next {
            Some(next) => value = next,
            None => break,
        }
    }
    Some(line_at(text, value.span().start))
}

fn child<'t, 'i>(table: &'t DeTable<'i>, key: &str) -> Option<&'t Spanned<DeValue<'i>>> {
    table.iter().find(|(name, _)| name.get_ref().as_ref() == key).map(|(_, value)| value)
}

/// Dotted name of the innermost field at a byte offset, empty where there is none.
pub(super) fn field_at(text: &str, offset: usize) -> String {
    let (document, _) = DeTable::parse_recoverable(text);
    let mut name = String::new();
    descend(document.get_ref(), offset, &mut name);
    name
}

fn descend(table: &DeTable<'_>, offset: usize, name: &mut String) {
    for (key, value) in table {
        let on_key = key.span().contains(&offset);
        let mut inner = String::new();
        match value.get_ref() {
            DeValue::Table(table) => descend(table, offset, &mut inner),
            DeValue::Array(items) => {
                for (index, item) in items.iter().enumerate() {
                    let mut member = String::new();
                    if let DeValue::Table(table) = item.get_ref() {
                        descend(table, offset, &mut member);
                    }
                    if !member.is_empty() {
                        inner = format!("[{index}].{member}");
                    } else if item.span().contains(&offset) {
                        inner = format!("[{index}]");
                    }
                }
            }
            _ => {}
        }
        if on_key || !inner.is_empty() || value.span().contains(&offset) {
            let dot = if inner.is_empty() || inner.starts_with('[') { "" } else { "." };
            *name = format!("{}{dot}{inner}", key.get_ref());
        }
    }
}
