//! The report as Markdown: read next to the scene.

use super::{Line, Section, sections};
use crate::solve::state::Solved;

/// The report of a calibration, with what is weak in it and what to do next.
pub fn markdown(solved: &Solved) -> String {
    let marks = std::iter::once("#").chain(std::iter::repeat("##"));
    let lines: Vec<String> =
        sections(solved).iter().zip(marks).flat_map(|(section, mark)| lines(section, mark)).collect();
    lines.join("\n")
}

fn lines(section: &Section, mark: &str) -> Vec<String> {
    let mut lines = Vec::new();
    if !section.title.is_empty() {
        lines.extend([format!("{mark} {}", section.title), String::new()]);
    }
    let (mut items, mut rows) = (section.summary.clone(), Vec::new());
    for line in &section.lines {
        match line {
            Line::Words(words) => items.push(words.clone()),
            Line::Row { name, values } => rows.push((name, values)),
        }
    }
    if !items.is_empty() {
        lines.extend(items.iter().map(|item| format!("- {}", plain(item))));
        lines.push(String::new());
    }
    if let Some(columns) = rows.iter().map(|(_, values)| values.len()).max() {
        lines.extend([" |", " --- |"].map(|cell| format!("|{}", cell.repeat(columns + 1))));
        for (name, values) in rows {
            let cells: Vec<String> = std::iter::once(name).chain(values).map(|value| plain(value)).collect();
            lines.push(format!("| {} |{}", cells.join(" | "), " |".repeat(columns - values.len())));
        }
        lines.push(String::new());
    }
    lines
}

/// Text that may hold anything, on one line and in one cell of a table.
fn plain(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::sample;

    #[test]
    fn the_report_says_what_to_expect_and_lists_every_view() {
        let model = sample::solved();
        let text = markdown(model.solve.current().expect("solved"));
        let expected = model.solve.current().and_then(|s| s.result.quality.tip_error_95_mm).expect("stated");
        assert!(text.contains(&format!("below {expected:.3} mm in 95 %")), "{text}");
        for n in 1..=sample::FITTED {
            assert!(text.contains(&format!("| images/{n:04}.png | used | 0.")), "{text}");
        }
        assert!(text.contains("## tip_from_camera") && text.contains("## base_from_target"), "{text}");
        assert!(text.contains("## verification on 2 captures"), "{text}");
    }

    #[test]
    fn the_report_says_what_is_an_outlier_and_what_the_estimate_found_out() {
        let model = sample::with_an_outlier();
        let text = markdown(model.solve.current().expect("solved"));
        assert!(text.contains("- error of a point: Student's t with "), "{text}");
        assert!(text.contains("- warning [outlier_view]: 1 outlier view"), "{text}");
        assert!(text.contains("| images/0003.png | outlier | 18.0000 px |"), "{text}");
    }

    #[test]
    fn a_name_cannot_break_a_table() {
        assert_eq!(plain("a|b\nc"), "a\\|b c");
    }
}
