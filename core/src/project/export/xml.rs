//! The little of XML that the exports use, read back: attributes and texts of elements that are there once.

use super::text::parse_exactly;

/// A comment of one line. XML allows no two hyphens in it, which a name may have.
pub(super) fn comment(text: &str) -> String {
    let mut text = text.to_owned();
    while text.contains("--") {
        text = text.replace("--", "- -");
    }
    format!("<!-- {text} -->")
}

/// The text without its comments.
pub(super) fn without_comments(text: &str) -> Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("<!--") {
        out.push_str(before);
        rest = after.split_once("-->").ok_or("a comment has no end")?.1;
    }
    out.push_str(rest);
    Ok(out)
}

/// The start tag of the only element of that name, without its brackets.
pub(super) fn start_tag<'a>(text: &'a str, element: &str) -> Result<&'a str, String> {
    let mut found = text.match_indices('<').filter_map(|(at, _)| {
        let tag = text[at + 1..].split_once('>')?.0;
        let name_end = tag.find(|c: char| c.is_ascii_whitespace() || c == '/').unwrap_or(tag.len());
        (&tag[..name_end] == element).then_some(tag)
    });
    let tag = found.next().ok_or_else(|| format!("no element {element}"))?;
    if found.next().is_some() { Err(format!("more than one element {element}")) } else { Ok(tag) }
}

/// An attribute in a start tag.
pub(super) fn attribute<'a>(tag: &'a str, name: &str) -> Result<&'a str, String> {
    let missing = || format!("no attribute {name} in <{tag}>");
    let key = format!("{name}=\"");
    let is_start = |at: usize| at > 0 && tag.as_bytes()[at - 1].is_ascii_whitespace();
    let at = tag.match_indices(&key).map(|(at, _)| at).find(|at| is_start(*at)).ok_or_else(missing)?;
    tag[at + key.len()..].split_once('"').map(|(value, _)| value).ok_or_else(missing)
}

/// Numbers in an attribute.
pub(super) fn numbers<const N: usize>(tag: &str, name: &str) -> Result<[f64; N], String> {
    parse_exactly(name, attribute(tag, name)?)
}

/// The text of the only element of that name.
pub(super) fn element_text<'a>(text: &'a str, element: &str) -> Result<&'a str, String> {
    start_tag(text, element)?;
    let (_, after) = text.split_once(&format!("<{element}>")).ok_or_else(|| format!("{element} has attributes"))?;
    after.split_once("</").map(|(value, _)| value.trim()).ok_or_else(|| format!("{element} has no end"))
}
