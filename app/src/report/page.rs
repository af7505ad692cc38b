//! The report as a page of text.

use super::{Line, Section, sections};
use crate::model::Solved;

/// The page. It ends with a newline.
pub fn page(solved: &Solved) -> String {
    let lines: Vec<String> = sections(solved).iter().flat_map(lines).collect();
    lines.join("\n") + "\n"
}

fn lines(section: &Section) -> Vec<String> {
    let Section { title, summary, name_width, .. } = section;
    let mut lines = Vec::new();
    if !title.is_empty() {
        let colon = if summary.is_empty() { "" } else { ": " };
        lines.push(format!("{title}{colon}{}", summary.join(", ")));
    }
    let indent = if title.is_empty() { "" } else { "  " };
    lines.extend(section.lines.iter().map(|line| match line {
        Line::Words(words) => format!("{indent}{words}"),
        Line::Row { name, values } => format!("{indent}{name:<name_width$} {}", values.join("  ")),
    }));
    lines
}
