//! The report as a page of text.

use handeye_result::CalibrationResult;

use super::{Line, Section, camera, findings, headline, sections};
use crate::solve::state::Solved;

/// The page. It ends with a newline.
pub fn page(solved: &Solved) -> String {
    text(&sections(solved))
}

/// One session of several: how good it is and what was found, under its `name`. It ends with a newline.
pub fn of_session(name: &str, result: &CalibrationResult) -> String {
    format!("{name}\n{}", text(&[headline(result), findings(result)]))
}

/// The lens that sessions share, from the result of one of them. It ends with a newline.
pub fn shared_camera(sessions: usize, views: usize, result: &CalibrationResult) -> String {
    let by = format!("one lens by {views} views of {sessions} sessions\n");
    camera(result).map_or(by.clone(), |camera| by + &text(&[camera]))
}

fn text(sections: &[Section]) -> String {
    let lines: Vec<String> = sections.iter().flat_map(lines).collect();
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
