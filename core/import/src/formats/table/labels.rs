//! Tables in which every row says what it is of, `hand,…` above `eye,…`: a series to each of the words.

use std::collections::BTreeMap;

use super::cells::Line;
use crate::formats::tree::{self, LEAST_POSES, is_image_name};
use crate::recording::Role;
use crate::value::number;

/// Words of one table at the most: more are names of rows.
const MOST_LABELS: usize = 4;

/// The rows of one word.
pub(super) struct Group {
    pub label: String,
    pub role: Role,
    /// With the words left out.
    pub lines: Vec<Line>,
    /// Which record each row is of: that of its word, or counted.
    pub numbers: Vec<u64>,
}

/// The word of a row without what counts behind it, its cell, and that number.
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
    // A record has each of its words. Names of images of two places are seldom as many each, but for a row that is missing.
    let is_series = (2..=MOST_LABELS).contains(&counts.len()) && least >= LEAST_POSES && most - least <= 1 + most / 10;
    if !is_series || 10 * labelled.len() < 9 * numeric.count() {
        return None;
    }
    let header: Vec<&Line> = lines.iter().filter(|line| !line.is_numeric()).collect();
    let copy = |line: &Line| Line { row: line.row, cells: line.cells.clone() };
    let mut groups: Vec<Group> = Vec::new();
    // A record begins where a word stands again.
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

/// What rows of this word are of. What the eye sees is the target.
fn role(label: &str) -> Role {
    let is_eye = label.split(|c: char| !c.is_alphanumeric()).any(|word| word == "eye");
    if is_eye { Role::Target } else { tree::role(label) }
}
