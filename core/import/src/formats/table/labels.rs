//! Tables in which a label starts every row, `hand,…` above `eye,…`: one series per label.

use std::collections::BTreeMap;

use super::cells::Line;
use crate::formats::tree::{self, LEAST_POSES, is_image_name};
use crate::recording::Role;
use crate::value::number;

/// Most labels of one table: more are names of rows.
const MOST_LABELS: usize = 4;

/// The rows of one word.
pub(super) struct Group {
    pub label: String,
    pub role: Role,
    /// With the words left out.
    pub lines: Vec<Line>,
    /// The record of each row: by its label, or counted.
    pub numbers: Vec<u64>,
}

/// The label of a row without the counter after it, its cell, and that counter.
fn label(line: &Line) -> Option<(String, usize, Option<u64>)> {
    let is_word = |cell: &&String| cell.contains(char::is_alphabetic) && number(cell).is_none();
    let cell = line.cells.iter().position(|cell| is_word(&cell))?;
    let word = line.cells[cell].trim().trim_end_matches([':', '=']).trim();
    if is_image_name(word) {
        return None;
    }
    let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let counted = word[stem.len()..].parse().ok();
    let stem = stem.trim_end_matches(['_', '-', ' ', '#', '.']).to_lowercase();
    stem.contains(char::is_alphabetic).then_some((stem, cell, counted))
}

/// The groups of a table; `None` where rows have no words or one of their own each. Headers are part of every group.
pub(super) fn groups(lines: &[Line]) -> Option<Vec<Group>> {
    let numeric = lines.iter().filter(|line| line.is_numeric());
    let labelled: Vec<_> = numeric.clone().filter_map(|line| Some((line, label(line)?))).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (_, (label, ..)) in &labelled {
        *counts.entry(label).or_default() += 1;
    }
    let (least, most) = (counts.values().min().copied()?, counts.values().max().copied()?);
    // A record has each of the labels. Image names of two places seldom occur equally often, except for a missing row.
    let is_series = (2..=MOST_LABELS).contains(&counts.len()) && least >= LEAST_POSES && most - least <= 1 + most / 10;
    if !is_series || 10 * labelled.len() < 9 * numeric.count() {
        return None;
    }
    let header: Vec<&Line> = lines.iter().filter(|line| !line.is_numeric()).collect();
    let copy = |line: &Line| Line { row: line.row, cells: line.cells.clone() };
    let mut groups: Vec<Group> = Vec::new();
    // A record begins where a label is repeated.
    let (mut record, mut in_record) = (0, Vec::new());
    for (line, (label, cell, counted)) in &labelled {
        if in_record.contains(&label) {
            record += 1;
            in_record.clear();
        }
        in_record.push(label);
        let place = groups.iter().position(|group| group.label == *label).unwrap_or_else(|| {
            let lines = header.iter().map(|line| copy(line)).collect();
            groups.push(Group { label: label.clone(), role: role(label), lines, numbers: Vec::new() });
            groups.len() - 1
        });
        let mut line = copy(line);
        line.cells[*cell].clear();
        groups[place].lines.push(line);
        groups[place].numbers.push(counted.unwrap_or(record));
    }
    Some(groups)
}

/// What rows with this label belong to. The eye sees the target.
fn role(label: &str) -> Role {
    let is_eye = label.split(|c: char| !c.is_alphanumeric()).any(|word| word == "eye");
    if is_eye { Role::Target } else { tree::role(label) }
}
