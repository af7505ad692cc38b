//! XML of the exports: comments written, and elements read back by a reader that is not ours.

use roxmltree::{Document, Node};

use super::text::parse_exactly;

/// A comment of one line. XML allows no two hyphens in it, which a name may have.
pub(super) fn comment(text: &str) -> String {
    let mut text = text.to_owned();
    while text.contains("--") {
        text = text.replace("--", "- -");
    }
    format!("<!-- {text} -->")
}

pub(super) fn parse(text: &str) -> Result<Document<'_>, String> {
    Document::parse(text).map_err(|e| format!("the file is no XML: {e}"))
}

/// The only element of that name, in whatever namespace.
pub(super) fn only<'a, 'input>(document: &'a Document<'input>, element: &str) -> Result<Node<'a, 'input>, String> {
    let mut found = document.descendants().filter(|node| node.is_element() && node.tag_name().name() == element);
    let node = found.next().ok_or_else(|| format!("no element {element}"))?;
    if found.next().is_some() { Err(format!("more than one element {element}")) } else { Ok(node) }
}

pub(super) fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, String> {
    node.attribute(name).ok_or_else(|| format!("no attribute {name} in <{}>", node.tag_name().name()))
}

/// Numbers in an attribute.
pub(super) fn numbers<const N: usize>(node: Node<'_, '_>, name: &str) -> Result<[f64; N], String> {
    parse_exactly(name, attribute(node, name)?)
}

/// The text of the only element of that name.
pub(super) fn element_text<'a>(document: &'a Document<'_>, element: &str) -> Result<&'a str, String> {
    only(document, element)?.text().map(str::trim).ok_or_else(|| format!("{element} has no text"))
}
