//! Tables of poses: with or without a header, any delimiter, names of images or not, one row or four to a pose.

pub(in crate::formats) mod bare;
mod cells;
mod header;
mod labels;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::tree::is_image_name;
use super::{Encoding, File, Format, blocks, joints, tree};
use crate::formats::nothing::Likely;
use crate::formats::reader::Reader;
use crate::recording::{JointSeries, Numbers, Sample, Track};
use crate::value::number;
use cells::Line;
use handeye_wording::Text;
use handeye_wording::text;

pub(super) struct Tables;

impl Format for Tables {
    fn name(&self) -> Text {
        text!("tables")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        const HOW: Encoding = Encoding::Text;
        &[("csv", HOW), ("txt", HOW), ("tsv", HOW), ("dat", HOW), ("log", HOW), ("", HOW)]
    }

    fn sniff(&self, file: &File) -> bool {
        file.text().is_some()
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let (Some(text), name) = (file.text(), file.name()) else { return false };
        let tracks = read(&name, text);
        let joints = if tracks.is_empty() { joints(&name, text) } else { None };
        let is_so = !tracks.is_empty() || joints.is_some();
        reader.recording.tracks.extend(tracks);
        reader.recording.joints.extend(joints);
        reader.recording.rows.extend(unnamed(&name, text));
        is_so
    }

    fn instead(&self, file: &File, _reader: &Reader<'_>) -> Option<(Likely, Text)> {
        let instead = file.value().map(tree::instead).or_else(|| file.text().map(instead))?;
        // Programs and licences have no ending either.
        (file.path.extension().is_some() || instead.0 != Likely::Neither).then_some(instead)
    }
}

/// What a text has in place of a series.
fn instead(text: &str) -> (Likely, Text) {
    let mut widths: BTreeMap<usize, usize> = BTreeMap::new();
    for line in cells::lines(text).iter().filter(|line| line.is_numeric()) {
        *widths.entry(line.numbers().len()).or_default() += 1;
    }
    let Some((width, rows)) = widths.iter().max_by_key(|(_, rows)| **rows) else {
        let poses = blocks::document(text).map_or(0, |value| tree::fields(&value).poses.len());
        return if poses > 0 {
            (Likely::Poses, text!("{count} of the poses of which three make a series", count = poses))
        } else {
            (Likely::Neither, text!("no rows of numbers"))
        };
    };
    let why = match (*rows, width) {
        (1, _) => text!("one row of {width} numbers, and three make a series"),
        (2, _) => text!("two rows of {width} numbers, and three make a series"),
        (_, 5..=8) => text!(
            "{rows} rows of {width} numbers that are no poses: if they are joint values, name the arm with arm=NAME"
        ),
        _ => text!("{rows} rows of {width} numbers, of which poses are not made"),
    };
    (Likely::Numbers, why.with("rows", rows).with("width", width))
}

/// The series of poses in a text, if there are any.
fn read(file: &str, text: &str) -> Vec<Track> {
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
    // Six joint values are not a pose.
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
fn joints(file: &str, text: &str) -> Option<JointSeries> {
    header::joints(file, &cells::lines(text))
}

/// The rows of a text without a header, which may be joint values.
fn unnamed(file: &str, text: &str) -> Option<JointSeries> {
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

/// The place of a row.
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
