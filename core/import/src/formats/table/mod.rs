//! Tables of poses: with or without a header, any delimiter, names of images or not, one row or four to a pose.

pub(in crate::formats) mod bare;
mod cells;
mod header;
mod labels;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::joints;
use super::tree::is_image_name;
use crate::recording::{JointSeries, Numbers, Sample, Track};
use crate::value::number;
use cells::Line;
use handeye_wording::Text;
use handeye_wording::text;

/// The series of poses in a text, which may be none.
pub(crate) fn read(file: &str, text: &str) -> Vec<Track> {
    let lines = cells::lines(text);
    let groups = labels::groups(&lines).unwrap_or_default();
    let mut tracks = Vec::new();
    for group in groups {
        let mut of_group = of_lines(&format!("{file}:{}", group.label), &group.lines);
        for track in &mut of_group {
            track.role = group.role;
            if track.samples.len() == group.numbers.len() {
                track.samples.iter_mut().zip(&group.numbers).for_each(|(sample, number)| sample.number = Some(*number));
            }
        }
        tracks.extend(of_group);
    }
    if tracks.is_empty() { of_lines(file, &lines) } else { tracks }
}

fn of_lines(file: &str, lines: &[Line]) -> Vec<Track> {
    if let Some(tracks) = header::with_header(file, lines) {
        return tracks;
    }
    // Six joint values are no pose.
    if header::joints(file, lines).is_some() {
        return Vec::new();
    }
    let rows: Vec<&Line> = lines.iter().filter(|line| line.is_numeric()).collect();
    if let Some(track) = bare::blocks(file, &rows) {
        return vec![track];
    }
    bare::without_header(file, &rows)
}

/// The joint values of a text that has no poses.
pub(crate) fn joints(file: &str, text: &str) -> Option<JointSeries> {
    header::joints(file, &cells::lines(text))
}

/// How many rows of a text have how many numbers.
pub(crate) fn widths(text: &str) -> BTreeMap<usize, usize> {
    let mut widths = BTreeMap::new();
    for line in cells::lines(text).iter().filter(|line| line.is_numeric()) {
        *widths.entry(line.numbers().len()).or_default() += 1;
    }
    widths
}

/// The rows of a text without a header, which may be joint values.
pub(crate) fn unnamed(file: &str, text: &str) -> Option<JointSeries> {
    let lines = cells::lines(text);
    if header::with_header(file, &lines).is_some() || header::joints(file, &lines).is_some() {
        return None;
    }
    let rows = lines.iter().filter(|line| line.is_numeric());
    let rows = rows.map(|line| (name_of(line), None, place(file, line), line.numbers()));
    joints::unnamed(file, rows)
}

fn sample(
    file: &str,
    line: &Line,
    image: Option<String>,
    number: Option<u64>,
    numbers: Numbers,
    joints: Vec<f64>,
) -> Sample {
    Sample { image, number, place: Arc::new(place(file, line)), numbers, joints }
}

/// Where a row stands.
fn place(file: &str, line: &Line) -> Text {
    text!("{file}, row {row}", file = file, row = line.row)
}

/// The name of an image in a row.
fn image_of(line: &Line) -> Option<String> {
    line.cells.iter().find(|cell| is_image_name(cell)).cloned()
}

/// A name in a row that is neither a number nor has an ending; it may be the stem of an image's.
fn name_of(line: &Line) -> Option<String> {
    image_of(line).or_else(|| line.cells.iter().find(|cell| !cell.is_empty() && number(cell).is_none()).cloned())
}

fn whole(value: f64) -> Option<u64> {
    (value >= 0.0 && value.fract() == 0.0 && value < 1e15).then_some(value as u64)
}

#[cfg(test)]
mod tests;
