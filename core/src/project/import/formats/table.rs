//! Tables of poses: with or without a header, any delimiter, names of images or not, one row or four to a pose.

use nalgebra::Matrix4;

use super::tree::{self, LEAST_POSES, is_image_name};
use crate::project::import::conventions::{AngleUnit, Euler, LengthUnit, RotationForm, is_unit, rigid};
use crate::project::import::recording::{Known, Numbers, Role, Sample, Stated, Track};
use crate::project::import::value::number;

/// Numbers in a row at the most that are looked at.
const MOST_COLUMNS: usize = 64;

/// A line as cells.
struct Line {
    /// From 1.
    row: usize,
    cells: Vec<String>,
}

impl Line {
    fn numbers(&self) -> Vec<f64> {
        self.cells.iter().filter_map(|cell| number(cell)).collect()
    }

    fn is_numeric(&self) -> bool {
        let numbers = self.numbers().len();
        numbers >= 3 && numbers + 2 >= self.cells.len()
    }
}

/// The series of poses in a text, which may be none.
pub(in crate::project::import) fn read(file: &str, text: &str) -> Vec<Track> {
    let lines = lines(text);
    if let Some(tracks) = with_header(file, &lines) {
        return tracks;
    }
    let rows: Vec<&Line> = lines.iter().filter(|line| line.is_numeric()).collect();
    if let Some(track) = blocks(file, &rows) {
        return vec![track];
    }
    without_header(file, &rows)
}

/// Lines with something in them, cut into cells by the delimiter that the whole text has.
fn lines(text: &str) -> Vec<Line> {
    let delimiter = delimiter(text);
    let mut lines = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let trimmed = line.trim();
        let is_comment = trimmed.starts_with("//") || trimmed.starts_with('%');
        // A header may be a comment.
        let trimmed = trimmed.trim_start_matches('#').trim();
        if trimmed.is_empty() || is_comment {
            continue;
        }
        let cells = cells(trimmed, delimiter);
        if cells.len() <= MOST_COLUMNS {
            lines.push(Line { row: i + 1, cells });
        }
    }
    lines
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Delimiter {
    One(u8),
    /// With commas for points.
    Semicolon,
    Spaces,
}

fn delimiter(text: &str) -> Delimiter {
    let lines: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty()).take(50).collect();
    let most = |sign: char| lines.iter().filter(|line| line.contains(sign)).count() * 2 > lines.len();
    if most(';') {
        return Delimiter::Semicolon;
    }
    if most('\t') {
        return Delimiter::One(b'\t');
    }
    if most(',') { Delimiter::One(b',') } else { Delimiter::Spaces }
}

/// Brackets around numbers, as Python prints lists, are nothing; those in names and units stay.
fn without_brackets(line: &str) -> String {
    let starts_number = |rest: &str| rest.trim_start().starts_with(|c: char| c.is_ascii_digit() || "+-.[(".contains(c));
    let mut out = String::with_capacity(line.len());
    let mut open = Vec::new();
    for (at, c) in line.char_indices() {
        let rest = &line[at + c.len_utf8()..];
        match c {
            '[' | '{' | '(' => {
                // One number in parentheses is a part of a name, as of a copy that was made.
                let inner = rest.split([')', ']', '}']).next().unwrap_or_default();
                let is_list = starts_number(rest) && inner.trim().contains([',', ' ', ';', '\t']);
                open.push(is_list);
                out.push(if is_list { ' ' } else { c });
            }
            ']' | '}' | ')' => out.push(if open.pop().unwrap_or(true) { ' ' } else { c }),
            _ => out.push(c),
        }
    }
    out
}

fn cells(line: &str, delimiter: Delimiter) -> Vec<String> {
    let line = without_brackets(line);
    let line = line.trim();
    let tidy = |cell: &str| cell.trim().trim_matches(['"', '\'']).to_owned();
    let split = |line: &str, by: u8| -> Vec<String> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(by)
            .trim(csv::Trim::All)
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        match reader.read_record(&mut record) {
            Ok(true) => record.iter().map(str::to_owned).collect(),
            _ => Vec::new(),
        }
    };
    let mut cells: Vec<String> = match delimiter {
        Delimiter::Spaces => line.split_whitespace().map(tidy).collect(),
        Delimiter::One(by) => split(line, by).iter().map(|cell| tidy(cell)).collect(),
        Delimiter::Semicolon => {
            let cells: Vec<String> = split(line, b';').iter().map(|cell| tidy(cell)).collect();
            let with_comma = |cell: &String| {
                if cell.matches(',').count() == 1 && number(&cell.replace(',', ".")).is_some() {
                    cell.replace(',', ".")
                } else {
                    cell.clone()
                }
            };
            cells.iter().map(with_comma).collect()
        }
    };
    // A delimiter at the end of every line, and blanks among commas.
    let looks_spaced = |cell: &String| cell.contains(' ') && cell.split_whitespace().all(|word| number(word).is_some());
    if cells.iter().any(looks_spaced) {
        cells = cells
            .iter()
            .flat_map(|cell| {
                if looks_spaced(cell) {
                    cell.split_whitespace().map(str::to_owned).collect()
                } else {
                    vec![cell.clone()]
                }
            })
            .collect();
    }
    while cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    cells
}

/// Four rows of four numbers to a pose, as `numpy.savetxt` and others write them.
fn blocks(file: &str, rows: &[&Line]) -> Option<Track> {
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

fn sample(
    file: &str,
    line: &Line,
    image: Option<String>,
    number: Option<u64>,
    numbers: Numbers,
    joints: Vec<f64>,
) -> Sample {
    Sample { image, number, place: format!("{file}, row {}", line.row), numbers, joints }
}

/// The name of an image in a row.
fn image_of(line: &Line) -> Option<String> {
    line.cells.iter().find(|cell| is_image_name(cell)).cloned()
}

/// A name in a row that is neither a number nor has an ending; it may be the stem of an image's.
fn name_of(line: &Line) -> Option<String> {
    image_of(line).or_else(|| line.cells.iter().find(|cell| !cell.is_empty() && number(cell).is_none()).cloned())
}

fn without_header(file: &str, rows: &[&Line]) -> Vec<Track> {
    // The number of numbers that most rows have; a row with another number is a remark.
    let mut counts = std::collections::BTreeMap::new();
    for row in rows {
        *counts.entry(row.numbers().len()).or_insert(0usize) += 1;
    }
    let Some((&width, _)) = counts.iter().max_by_key(|(_, count)| **count) else { return Vec::new() };
    let rows: Vec<&Line> = rows.iter().filter(|row| row.numbers().len() == width).copied().collect();
    let numbers: Vec<Vec<f64>> = rows.iter().map(|row| row.numbers()).collect();
    if rows.len() < LEAST_POSES {
        return Vec::new();
    }
    let mut tracks = Vec::new();
    let layouts = layouts(&numbers);
    for layout in &layouts {
        let samples = rows.iter().zip(&numbers).filter_map(|(line, numbers)| {
            let pose = layout.pose(numbers)?;
            let counted = layout.index.and_then(|i| whole(numbers[i]));
            let joints = layout.joints.clone().map(|range| numbers[range].to_vec()).unwrap_or_default();
            Some(sample(file, line, name_of(line), counted, pose, joints))
        });
        let name = if layouts.len() == 1 {
            file.to_owned()
        } else {
            format!("{file}:numbers {}-{}", layout.first + 1, layout.first + layout.width)
        };
        if let Some(mut track) = tree::track(name, file, Stated::default(), samples.collect()) {
            // A table is not named after what it is of as often as a field is.
            track.role = if tree::role(file) == Role::Target { Role::Target } else { Role::Unknown };
            tracks.push(track);
        }
    }
    tracks
}

fn whole(value: f64) -> Option<u64> {
    (value >= 0.0 && value.fract() == 0.0 && value < 1e15).then_some(value as u64)
}

/// Where a pose stands among the numbers of a row.
#[derive(Debug, Clone)]
struct Layout {
    first: usize,
    width: usize,
    /// The quaternion stands before the translation.
    is_rotation_first: bool,
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
            [x, y, z, a, b, c] => Some(Numbers::Angles([x, y, z, a, b, c])),
            [a, b, c, d, x, y, z] if self.is_rotation_first => {
                is_unit(&part[..4]).then_some(Numbers::Quaternion([x, y, z, a, b, c, d]))
            }
            [x, y, z, a, b, c, d] => is_unit(&part[3..]).then_some(Numbers::Quaternion([x, y, z, a, b, c, d])),
            _ => rigid(part).map(Numbers::Matrix),
        }
    }
}

/// Where poses may stand: matrices and quaternions are known by their numbers, six numbers are what is left.
fn layouts(rows: &[Vec<f64>]) -> Vec<Layout> {
    let width = rows[0].len();
    let most = |test: &dyn Fn(&[f64]) -> bool| 10 * rows.iter().filter(|row| test(row)).count() >= 9 * rows.len();
    let index = (width > 6 && counts(rows, 0)).then_some(0);
    let with = |first: usize, wide: usize, is_rotation_first: bool| {
        let behind = width - first - wide;
        let joints = (4..=12).contains(&behind).then(|| first + wide..width);
        Layout { first, width: wide, is_rotation_first, index: index.filter(|i| *i < first), joints }
    };
    for wide in [16, 12] {
        for first in 0..=width.saturating_sub(wide) {
            if wide <= width && most(&|row| rigid(&row[first..first + wide]).is_some()) {
                return vec![with(first, wide, false)];
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
    match width {
        6 => vec![with(0, 6, false)],
        // A number or a time before it.
        7 if counts(rows, 0) || grows(rows) => vec![with(1, 6, false)],
        8 if counts(rows, 0) || grows(rows) => vec![with(2, 6, false)],
        // With joint values, before or behind.
        12 | 13 => {
            let first = width - 12;
            let before = Layout { joints: Some(first..first + 6), ..with(first + 6, 6, false) };
            vec![with(first, 6, false), before]
        }
        _ => Vec::new(),
    }
}

fn counts(rows: &[Vec<f64>], column: usize) -> bool {
    let mut values: Vec<f64> = rows.iter().map(|row| row[column]).collect();
    let are_whole = values.iter().all(|v| whole(*v).is_some());
    values.sort_by(f64::total_cmp);
    values.dedup();
    // A row may be there twice.
    are_whole && 5 * values.len() >= 4 * rows.len()
}

fn grows(rows: &[Vec<f64>]) -> bool {
    rows.windows(2).all(|pair| pair[0][0] < pair[1][0])
}

/// What a header calls a column, without its unit; and the unit.
fn column(name: &str) -> (String, Option<&'static str>) {
    let lower = name.to_lowercase();
    let lower = lower.trim().trim_matches(['"', '\'']);
    let units = [
        ("mm", "mm"),
        ("cm", "cm"),
        ("deg", "deg"),
        ("degree", "deg"),
        ("degrees", "deg"),
        ("rad", "rad"),
        ("m", "m"),
        ("°", "deg"),
        ("radians", "rad"),
        ("meter", "m"),
        ("metre", "m"),
        ("meters", "m"),
    ];
    let words: Vec<&str> =
        lower.split(['[', ']', '(', ')', ' ', '_', '/', '.', '-', ':']).filter(|w| !w.is_empty()).collect();
    let unit = words.iter().skip(1).find_map(|word| units.iter().find(|(name, _)| name == word).map(|(_, unit)| *unit));
    let is_unit = |word: &str| units.iter().any(|(name, _)| *name == word);
    let rest: Vec<&str> = words.iter().enumerate().filter(|(i, w)| *i == 0 || !is_unit(w)).map(|(_, w)| *w).collect();
    (rest.join("_"), unit)
}

/// The names that columns of a pose have, in their order.
const TRANSLATIONS: [[&str; 3]; 9] = [
    ["x", "y", "z"],
    ["tx", "ty", "tz"],
    ["px", "py", "pz"],
    ["t_x", "t_y", "t_z"],
    ["p_x", "p_y", "p_z"],
    ["pos_x", "pos_y", "pos_z"],
    ["position_x", "position_y", "position_z"],
    ["translation_x", "translation_y", "translation_z"],
    ["x_pos", "y_pos", "z_pos"],
];
const QUATERNIONS: [[&str; 4]; 7] = [
    ["qx", "qy", "qz", "qw"],
    ["q_x", "q_y", "q_z", "q_w"],
    ["quat_x", "quat_y", "quat_z", "quat_w"],
    ["orientation_x", "orientation_y", "orientation_z", "orientation_w"],
    ["rotation_x", "rotation_y", "rotation_z", "rotation_w"],
    ["rot_x", "rot_y", "rot_z", "rot_w"],
    ["ox", "oy", "oz", "ow"],
];
const ANGLES: [[&str; 3]; 11] = [
    ["rx", "ry", "rz"],
    ["roll", "pitch", "yaw"],
    ["a", "b", "c"],
    ["w", "p", "r"],
    ["r_x", "r_y", "r_z"],
    ["rot_x", "rot_y", "rot_z"],
    ["rotation_x", "rotation_y", "rotation_z"],
    ["rvec_x", "rvec_y", "rvec_z"],
    ["euler_x", "euler_y", "euler_z"],
    ["alpha", "beta", "gamma"],
    ["theta_x", "theta_y", "theta_z"],
];

fn with_header(file: &str, lines: &[Line]) -> Option<Vec<Track>> {
    let at = lines
        .iter()
        .take(20)
        .position(|line| !line.is_numeric() && lines.iter().any(Line::is_numeric) && is_header(line))?;
    let header: Vec<(String, Option<&str>)> = lines[at].cells.iter().map(|cell| column(cell)).collect();
    let find = |name: &str| header.iter().position(|(column, _)| column == name);
    let all = |names: &[&str]| -> Option<Vec<usize>> { names.iter().map(|name| find(name)).collect() };
    let translation = TRANSLATIONS.iter().find_map(|names| all(names));
    let mut stated = Stated::default();
    let by_header = |what: &str| format!("the header of {file}: {what}");
    let rotation = if let Some((names, columns)) = QUATERNIONS.iter().find_map(|names| Some((names, all(names)?))) {
        stated.rotation = Some(Known::by(by_header(&names.join(" ")), vec![RotationForm::Xyzw]));
        Some(columns)
    } else if let Some((names, columns)) = ANGLES.iter().find_map(|names| Some((names, all(names)?))) {
        let forms = match names[0] {
            "roll" => Some(Euler::of_roll_pitch_yaw().into_iter().map(RotationForm::Euler).collect()),
            "rvec_x" => Some(vec![RotationForm::Vector]),
            _ => None,
        };
        stated.rotation = forms.map(|forms| Known::by(by_header(&names.join(" ")), forms));
        if let Some(unit) = header[columns[0]].1 {
            let unit =
                if unit == "deg" { Some(AngleUnit::Degree) } else { (unit == "rad").then_some(AngleUnit::Radian) };
            stated.angle = unit.map(|unit| Known::by(by_header(&lines[at].cells[columns[0]]), unit));
        }
        Some(columns)
    } else {
        let names = |from: usize| -> Vec<String> {
            (from..from + 3).flat_map(|i| (from..from + 3).map(move |j| format!("r{i}{j}"))).collect()
        };
        [1, 0].iter().find_map(|from| {
            let names = names(*from);
            all(&names.iter().map(String::as_str).collect::<Vec<_>>())
        })
    };
    let (translation, rotation) = (translation?, rotation?);
    if let Some(unit) = header[translation[0]].1 {
        let unit = LengthUnit::ALL.into_iter().find(|u| u.name() == unit);
        stated.length = unit.map(|unit| Known::by(by_header(&lines[at].cells[translation[0]]), unit));
    }
    let image = header.iter().position(|(name, _)| {
        matches!(
            &**name,
            "image"
                | "img"
                | "file"
                | "filename"
                | "name"
                | "image_name"
                | "image_file"
                | "path"
                | "image_path"
                | "file_name"
                | "picture"
        )
    });
    let index = header.iter().position(|(name, _)| {
        matches!(
            &**name,
            "id" | "index"
                | "idx"
                | "number"
                | "no"
                | "n"
                | "frame"
                | "num"
                | "sample"
                | "pose"
                | "image_id"
                | "view"
                | "i"
                | ""
        )
    });
    let joints: Vec<usize> = (1..=12)
        .map_while(|j| {
            ["q", "j", "joint", "joint_", "q_", "j_", "axis", "a"]
                .iter()
                .find_map(|prefix| find(&format!("{prefix}{j}")))
        })
        .collect();
    let mut samples = Vec::new();
    for line in &lines[at + 1..] {
        let cell = |i: usize| line.cells.get(i).map_or("", String::as_str);
        let Some(numbers): Option<Vec<f64>> = translation.iter().chain(&rotation).map(|i| number(cell(*i))).collect()
        else {
            continue;
        };
        let pose = match *numbers.as_slice() {
            [x, y, z, a, b, c] => Some(Numbers::Angles([x, y, z, a, b, c])),
            [x, y, z, a, b, c, d] => is_unit(&[a, b, c, d]).then_some(Numbers::Quaternion([x, y, z, a, b, c, d])),
            [x, y, z, ..] => {
                let mut m = Matrix4::identity();
                m.fixed_view_mut::<3, 3>(0, 0).copy_from(&nalgebra::Matrix3::from_row_slice(&numbers[3..]));
                (m[(0, 3)], m[(1, 3)], m[(2, 3)]) = (x, y, z);
                rigid(m.transpose().as_slice()).map(Numbers::Matrix)
            }
            _ => None,
        };
        let Some(pose) = pose else { continue };
        let named = image.map(|i| cell(i).to_owned()).filter(|name| !name.is_empty()).or_else(|| image_of(line));
        let (named, counted) = match named {
            // An image that is called by its number.
            Some(name) if name.bytes().all(|b| b.is_ascii_digit()) => (None, name.parse().ok()),
            named => (named, index.and_then(|i| number(cell(i))).and_then(whole)),
        };
        let joints: Option<Vec<f64>> = joints.iter().map(|i| number(cell(*i))).collect();
        samples.push(sample(file, line, named, counted, pose, joints.unwrap_or_default()));
    }
    let mut track = tree::track(file.to_owned(), file, stated, samples)?;
    track.role = if tree::role(file) == Role::Target { Role::Target } else { Role::Unknown };
    Some(vec![track])
}

fn is_header(line: &Line) -> bool {
    let names: Vec<String> = line.cells.iter().map(|cell| column(cell).0).collect();
    TRANSLATIONS.iter().any(|axes| axes.iter().all(|axis| names.iter().any(|name| name == axis)))
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
