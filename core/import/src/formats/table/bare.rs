//! Tables without a header: the columns of a pose are found from the numbers.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix4, Vector3};

use super::cells::Line;
use super::{name_of, place, sample, whole};
use crate::conventions::{is_rotation, is_unit, rigid};
use crate::formats::tree::{self, LEAST_POSES};
use crate::recording::{Numbers, Role, Sample, Stated, Track};
use handeye_wording::Text;

/// Four rows of four numbers to a pose, as `numpy.savetxt` and others write them.
pub(super) fn blocks(file: &str, rows: &[&Line]) -> Option<Track> {
    let numbers: Vec<Vec<f64>> = rows.iter().map(|row| row.numbers()).collect();
    if numbers.len() < 4 * LEAST_POSES || !numbers.len().is_multiple_of(4) || numbers.iter().any(|row| row.len() != 4) {
        return None;
    }
    let samples: Option<Vec<Sample>> = numbers
        .chunks_exact(4)
        .zip(rows.chunks_exact(4))
        .map(|(block, lines)| {
            let matrix = rigid(&block.concat())?;
            Some(sample(file, lines[0], None, None, Numbers::Matrix(matrix), Vec::new()))
        })
        .collect();
    tree::track(file.to_owned(), file, Stated::default(), samples?)
}

/// In a report that has other rows as well, at least one row in this many may be a pose: a matrix is often printed below its
/// pose.
const MOST_ROWS_TO_A_POSE: usize = 8;

/// Numbers that belong together, a row of a table or a file, and what is next to them.
pub(in crate::formats) struct Row {
    pub image: Option<String>,
    pub number: Option<u64>,
    pub place: Arc<Text>,
    pub numbers: Vec<f64>,
}

pub(super) fn without_header(file: &str, lines: &[&Line]) -> Vec<Track> {
    let mut by_width: BTreeMap<usize, Vec<Row>> = BTreeMap::new();
    for line in lines {
        let row =
            Row { image: name_of(line), number: None, place: Arc::new(place(file, line)), numbers: line.numbers() };
        by_width.entry(row.numbers.len()).or_default().push(row);
    }
    // The number of numbers that most rows have, or most of those that a pose may have; rows with another number are remarks.
    let mut widths: Vec<Vec<Row>> = by_width.into_values().rev().collect();
    widths.sort_by_key(|rows| std::cmp::Reverse(rows.len()));
    widths.retain(|rows| MOST_ROWS_TO_A_POSE * rows.len() >= lines.len());
    let found = widths.into_iter().map(|mut rows| {
        // A name that is in all rows is not the name of one.
        let first = rows.first().and_then(|row| row.image.clone());
        if rows.len() > 1 && rows.iter().all(|row| row.image == first) {
            for row in &mut rows {
                row.image = None;
            }
        }
        tracks(file, &rows)
    });
    let mut still = Vec::new();
    let mut tracks = Vec::new();
    for of_width in found {
        if of_width.iter().any(|track| !track.is_still()) {
            tracks = of_width;
            break;
        }
        still.extend(of_width);
    }
    if tracks.is_empty() {
        tracks = still;
    }
    for track in &mut tracks {
        // A table is not named after what it is of as often as a field is.
        track.role = if tree::is_of_target(file) { Role::Target } else { Role::Unknown };
    }
    tracks
}

/// The series of poses in rows of as many numbers each, in every order that the numbers leave open.
pub(in crate::formats) fn tracks(name: &str, rows: &[Row]) -> Vec<Track> {
    let numbers: Vec<&[f64]> = rows.iter().map(|row| row.numbers.as_slice()).collect();
    if rows.len() < LEAST_POSES {
        return Vec::new();
    }
    let mut tracks = Vec::new();
    let layouts = layouts(&numbers);
    let places = layouts.iter().filter(|layout| layout.order == Order::Plain).count();
    for layout in &layouts {
        let samples = rows.iter().filter_map(|row| {
            let pose = layout.pose(&row.numbers)?;
            let counted = layout.index.and_then(|i| whole(*row.numbers.get(i)?));
            let joints = layout.joints.clone().and_then(|range| row.numbers.get(range)).unwrap_or_default().to_vec();
            let (image, place) = (row.image.clone(), Arc::clone(&row.place));
            Some(Sample { image, number: row.number.or(counted), place, numbers: pose, joints })
        });
        let place = if places <= 1 {
            name.to_owned()
        } else {
            format!("{name}:numbers {}-{}", layout.first + 1, layout.first + layout.width)
        };
        let named = layout.order.named(&place);
        if let Some(mut track) = tree::track(named, name, Stated::default(), samples.collect()) {
            track.reading_of = (layout.order != Order::Plain).then_some(place);
            tracks.push(track);
        }
    }
    tracks
}

/// The order of the numbers of a pose, where it does not follow from the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    /// The commonest: the translation first, matrices by rows.
    Plain,
    /// Three numbers of a rotation, then the translation.
    RotationFirst,
    /// A rotation matrix by columns.
    ByColumns,
}

impl Order {
    fn named(self, place: &str) -> String {
        match self {
            Self::Plain => place.to_owned(),
            Self::RotationFirst => format!("{place}:rotation first"),
            Self::ByColumns => format!("{place}:matrix by columns"),
        }
    }
}

/// Columns of a pose among the numbers of a row.
#[derive(Debug, Clone)]
struct Layout {
    first: usize,
    width: usize,
    /// The quaternion or the rotation matrix precedes the translation.
    is_rotation_first: bool,
    order: Order,
    index: Option<usize>,
    joints: Option<std::ops::Range<usize>>,
}

impl Layout {
    fn pose(&self, numbers: &[f64]) -> Option<Numbers> {
        let part = numbers.get(self.first..self.first + self.width)?;
        if part.iter().any(|n| !n.is_finite()) {
            return None;
        }
        match *part {
            [a, b, c, x, y, z] if self.order == Order::RotationFirst => Some(Numbers::Angles([x, y, z, a, b, c])),
            [x, y, z, a, b, c] => Some(Numbers::Angles([x, y, z, a, b, c])),
            [a, b, c, d, x, y, z] if self.is_rotation_first => {
                is_unit(&part[..4]).then_some(Numbers::Quaternion([x, y, z, a, b, c, d]))
            }
            [x, y, z, a, b, c, d] => is_unit(&part[3..]).then_some(Numbers::Quaternion([x, y, z, a, b, c, d])),
            _ => rigid(part).or_else(|| self.beside(part)).map(Numbers::Matrix),
        }
    }

    /// A rotation matrix and a translation one after the other.
    fn beside(&self, part: &[f64]) -> Option<Matrix4<f64>> {
        let (first, second) = part.split_at_checked(if self.is_rotation_first { 9 } else { 3 })?;
        let (turn, place) = if self.is_rotation_first { (first, second) } else { (second, first) };
        let (turn, &[x, y, z]) = (rotation(turn)?, place) else { return None };
        let turn = if self.order == Order::ByColumns { turn.transpose() } else { turn };
        let mut matrix = turn.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::new(x, y, z));
        Some(matrix)
    }
}

/// The rotation of nine numbers, row by row.
fn rotation(numbers: &[f64]) -> Option<Matrix3<f64>> {
    let turn = (numbers.len() == 9).then(|| Matrix3::from_row_slice(numbers))?;
    is_rotation(&turn).then_some(turn)
}

/// Possible columns of poses: matrices and quaternions are recognised by their numbers, six numbers are the remaining
/// case.
fn layouts(rows: &[&[f64]]) -> Vec<Layout> {
    let width = rows[0].len();
    let most = |test: &dyn Fn(&[f64]) -> bool| 10 * rows.iter().filter(|row| test(row)).count() >= 9 * rows.len();
    let index = (width > 6 && counts(rows, 0)).then_some(0);
    let with = |first: usize, wide: usize, is_rotation_first: bool| {
        let behind = width - first - wide;
        let joints = (4..=12).contains(&behind).then(|| first + wide..width);
        let index = index.filter(|i| *i < first);
        Layout { first, width: wide, is_rotation_first, order: Order::Plain, index, joints }
    };
    let sides = side_by_side(width, &most, &with);
    if sides.iter().filter(|layout| layout.order == Order::Plain).count() > 1 {
        return sides;
    }
    for wide in [16, 12] {
        for first in 0..=width.saturating_sub(wide) {
            if wide <= width && most(&|row| rigid(&row[first..first + wide]).is_some()) {
                return vec![with(first, wide, false)];
            }
        }
    }
    for first in 0..=width.saturating_sub(12) {
        for (is_rotation_first, at) in [(false, first + 3), (true, first)] {
            // Transposed it is a rotation as well: both are tried.
            if width >= 12 && most(&|row| rotation(&row[at..at + 9]).is_some()) {
                let plain = with(first, 12, is_rotation_first);
                return vec![plain.clone(), Layout { order: Order::ByColumns, ..plain }];
            }
        }
    }
    if width >= 7 {
        for first in 0..=width - 7 {
            if most(&|row| is_unit(&row[first + 3..first + 7])) {
                return vec![with(first, 7, false)];
            }
            if most(&|row| is_unit(&row[first..first + 4])) {
                return vec![with(first, 7, true)];
            }
        }
    }
    let six = |first: usize| {
        let plain = with(first, 6, false);
        // A rotation is within some turns, whatever its unit.
        let may_turn = most(&|row| row[first..first + 3].iter().all(|angle| angle.abs() <= 720.0));
        let other = may_turn.then(|| Layout { order: Order::RotationFirst, ..plain.clone() });
        std::iter::once(plain).chain(other).collect()
    };
    match width {
        6 => six(0),
        // A number or a time before it.
        7 if counts(rows, 0) || grows(rows) => six(1),
        8 if counts(rows, 0) || grows(rows) => six(2),
        // Two poses, or one with joint values before or behind.
        12 | 13 => {
            let first = width - 12;
            let mut second: Vec<Layout> = six(first + 6);
            for layout in &mut second {
                layout.joints = Some(first..first + 6);
            }
            [six(first), second].concat()
        }
        14 if counts(rows, 0) || grows(rows) => [six(2), six(8)].concat(),
        _ => Vec::new(),
    }
}

/// Whether most rows satisfy a predicate.
type Most<'a> = dyn Fn(&dyn Fn(&[f64]) -> bool) -> bool + 'a;

/// Poses that are recognised by their numbers, side by side in a row: of the robot and of the target.
fn side_by_side(width: usize, most: &Most<'_>, with: &dyn Fn(usize, usize, bool) -> Layout) -> Vec<Layout> {
    let mut found: Vec<Layout> = Vec::new();
    let mut first = 0;
    while first < width {
        let has = |wide: usize| first + wide <= width;
        let before = found.len();
        if let Some(wide) =
            [16, 12].into_iter().find(|w| has(*w) && most(&|row| rigid(&row[first..first + w]).is_some()))
        {
            found.push(with(first, wide, false));
        } else if let Some(is_rotation_first) = [false, true].into_iter().find(|is_first| {
            let at = if *is_first { first } else { first + 3 };
            has(12) && most(&|row| rotation(&row[at..at + 9]).is_some())
        }) {
            let plain = with(first, 12, is_rotation_first);
            found.extend([plain.clone(), Layout { order: Order::ByColumns, ..plain }]);
        } else if let Some(is_rotation_first) = [false, true].into_iter().find(|is_first| {
            let at = if *is_first { first } else { first + 3 };
            has(7) && most(&|row| is_unit(&row[at..at + 4]))
        }) {
            found.push(with(first, 7, is_rotation_first));
        }
        // The other columns are another pose, not joint values.
        found[before..].iter_mut().for_each(|layout| layout.joints = None);
        first = found.get(before).map_or(first + 1, |layout| layout.first + layout.width);
    }
    found
}

fn counts(rows: &[&[f64]], column: usize) -> bool {
    let mut values: Vec<f64> = rows.iter().map(|row| row[column]).collect();
    let are_whole = values.iter().all(|v| whole(*v).is_some());
    values.sort_by(f64::total_cmp);
    values.dedup();
    // A row may be there twice.
    are_whole && 5 * values.len() >= 4 * rows.len()
}

fn grows(rows: &[&[f64]]) -> bool {
    rows.windows(2).all(|pair| pair[0][0] < pair[1][0])
}
