//! Poses in JSON, YAML and OpenCV's files, anywhere in the tree: arrays of 6, 7, 12 or 16 numbers, named fields, a rotation
//! with a translation; in a list, under numbered keys, or one per file.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::Encoding::{self, Json, Xml, Yaml};
use super::parts::{self, Part};
use super::{File, Format, joints, named};
use crate::conventions::{Euler, RotationForm, is_unit, rigid};
use crate::folder;
use crate::formats::nothing::Likely;
use crate::formats::reader::Reader;
use crate::recording::{Known, Numbers, Role, Sample, Stated, Track};
use crate::value::Value;
use handeye_wording::Text;
use handeye_wording::text;

/// Poses that make a series.
pub(crate) const LEAST_POSES: usize = 3;
/// Most series of one file.
const MOST_SERIES: usize = 32;
/// Elements of a list that are not a series and are looked into.
const MOST_LOOKED_INTO: usize = 8;

pub(super) struct Documents;

impl Format for Documents {
    fn name(&self) -> Text {
        Text::verbatim("JSON, YAML, XML")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        &[("json", Json), ("jsonl", Json), ("yaml", Yaml), ("yml", Yaml), ("xml", Xml)]
    }

    /// A JSON file next to poses is more often other poses than a camera.
    fn is_companion(&self, file: &Path, _named: &Path) -> bool {
        !folder::ending(file).starts_with("json")
    }

    fn sniff(&self, file: &File) -> bool {
        file.value().is_some()
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let (Some(value), name) = (file.value(), file.name()) else { return false };
        reader.recording.tracks.extend(series(value, &name));
        reader.recording.joints.extend(joints::of_document(value, &name));
        true
    }

    fn instead(&self, file: &File, _reader: &Reader<'_>) -> Option<(Likely, Text)> {
        file.value().map(instead)
    }
}

/// What a document has in place of a series.
pub(super) fn instead(value: &Value) -> (Likely, Text) {
    match fields(value).poses.len() {
        0 => (Likely::Neither, text!("no fields that are poses")),
        1 => (Likely::Poses, text!("one pose, and three make a series")),
        many => (Likely::Poses, text!("{count} poses under different names, which are no series", count = many)),
    }
}

/// Contents of one element of a series, or of one file.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fields {
    pub poses: Vec<(String, Numbers, Stated)>,
    pub joints: Vec<f64>,
    pub image: Option<String>,
    pub number: Option<u64>,
}

impl Fields {
    /// A pose with several representations is added once.
    fn add(&mut self, path: String, numbers: Numbers, stated: Stated) {
        if self.poses.iter().all(|(known, ..)| *known != path) {
            self.poses.push((path, numbers, stated));
        }
    }
}

/// Everything in a value that may be a pose, with its path.
pub(crate) fn fields(value: &Value) -> Fields {
    let mut fields = Fields::default();
    walk(value, "", &mut fields, 0);
    fields
}

fn walk(value: &Value, path: &str, fields: &mut Fields, depth: usize) {
    if depth > 8 || fields.poses.len() > 16 {
        return;
    }
    if let Some(numbers) = value.numbers(16) {
        if is_about_joints(path) {
            let is_angles = !is_about_motion(path);
            if is_angles && numbers.len() >= 4 && numbers.len() <= 12 && fields.joints.is_empty() {
                fields.joints = numbers;
            }
        } else if let Some(found) = of_numbers(&numbers, last_of(path)) {
            fields.add(path.to_owned(), found.0, found.1);
        }
        return;
    }
    match value {
        Value::Map(entries) if entries.iter().any(|(key, inner)| inner.number().is_some() && ends_in_number(key)) => {
            let (mut folded, rest) = folded(entries);
            let is_folded = !folded.is_empty();
            folded.extend(rest.into_iter().cloned());
            if is_folded {
                walk(&Value::Map(folded), path, fields, depth);
            } else {
                walk_map(entries, value, path, fields, depth);
            }
        }
        Value::Map(entries) => walk_map(entries, value, path, fields, depth),
        Value::List(items) => {
            for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                walk(item, &joined(path, &format!("[{i}]")), fields, depth + 1);
            }
        }
        _ => {}
    }
}

fn walk_map(entries: &[(String, Value)], value: &Value, path: &str, fields: &mut Fields, depth: usize) {
    for (name, numbers, stated) in named::poses(value) {
        fields.add(joined(path, &name), numbers, stated);
    }
    for (key, inner) in entries {
        match inner {
            Value::Text(text) if fields.image.is_none() && is_image_name(text) => {
                fields.image = Some(text.trim().to_owned());
            }
            Value::Number(_) if fields.number.is_none() && is_counting(key) => fields.number = inner.whole(),
            // Parts of a pose that was found are not separate poses.
            Value::Map(_) | Value::List(_) => walk(inner, &joined(path, key), fields, depth + 1),
            _ => {}
        }
    }
}

fn ends_in_number(key: &str) -> bool {
    key.ends_with(|c: char| c.is_ascii_digit())
}

/// A field of a document.
type Entry = (String, Value);

/// Numbers in fields that count, `pose1` to `pose6`, as the lists that they are; and the other fields.
fn folded(entries: &[Entry]) -> (Vec<Entry>, Vec<&Entry>) {
    let mut by_prefix: BTreeMap<String, Vec<(u64, f64)>> = BTreeMap::new();
    for (key, inner) in entries {
        if let (Some((prefix, count)), Some(number)) = (counting_key(key), inner.number()) {
            by_prefix.entry(prefix).or_default().push((count, number));
        }
    }
    by_prefix.retain(|prefix, members| {
        members.sort_by_key(|(count, _)| *count);
        let are_next = members.windows(2).all(|pair| pair[0].0 + 1 == pair[1].0);
        !prefix.is_empty() && are_next && matches!(members.len(), 3 | 4 | 6 | 7 | 9 | 12 | 16)
    });
    let is_folded = |key: &str| counting_key(key).is_some_and(|(prefix, _)| by_prefix.contains_key(&prefix));
    let rest = entries.iter().filter(|(key, inner)| inner.number().is_none() || !is_folded(key)).collect();
    let list = |(prefix, members): (&String, &Vec<(u64, f64)>)| {
        // A field of this name is an axis of the arm.
        let name = if matches!(&*prefix.to_lowercase(), "j" | "a" | "axis") { "joint" } else { prefix.as_str() };
        (name.to_owned(), Value::List(members.iter().map(|(_, number)| Value::Number(*number)).collect()))
    };
    (by_prefix.iter().map(list).collect(), rest)
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() || key.is_empty() { format!("{path}{key}") } else { format!("{path}.{key}") }
}

pub(super) fn last_of(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// Whether a name denotes joint values.
pub(crate) fn is_about_joints(name: &str) -> bool {
    let name = name.to_lowercase();
    let last = last_of(&name);
    last.contains("joint") || matches!(last, "q" | "qpos" | "actual_q" | "angles" | "axes")
}

/// Whether joint values of this name describe how the joints move or are driven, not where they are.
fn is_about_motion(name: &str) -> bool {
    let name = name.to_lowercase();
    let last = last_of(&name);
    // `current_joint_values` are those of now.
    let is_current = last.ends_with("current") || last.ends_with("currents");
    is_current
        || ["torque", "effort", "veloc", "accel", "speed", "temperature", "force"]
            .iter()
            .any(|word| last.contains(word))
}

fn is_counting(key: &str) -> bool {
    let key = key.to_lowercase();
    matches!(
        &*key,
        "id" | "index" | "idx" | "number" | "no" | "n" | "frame" | "frame_id" | "num" | "seq" | "sample" | "view"
    )
}

/// Whether a text is the name of an image.
pub(crate) fn is_image_name(text: &str) -> bool {
    text.len() < 1024 && folder::is_image(Path::new(text.trim()))
}

/// Poses that an array of this many numbers may be.
pub(crate) fn of_numbers(numbers: &[f64], name: &str) -> Option<(Numbers, Stated)> {
    if numbers.iter().any(|n| !n.is_finite()) {
        return None;
    }
    let stated = Stated::default();
    match *numbers {
        [a, b, c, d, e, f] => {
            let mut stated = stated;
            let lower = name.to_lowercase();
            if lower.contains("rotvec") || lower.contains("rvec") {
                stated.rotation = Some(Known::by(format!("the name {name:?}"), vec![RotationForm::Vector]));
            } else if lower.contains("rpy") {
                stated.rotation = Some(roll_pitch_yaw(name));
            }
            Some((Numbers::Angles([a, b, c, d, e, f]), stated))
        }
        [x, y, z, a, b, c, d] if is_unit(&numbers[3..]) => Some((Numbers::Quaternion([x, y, z, a, b, c, d]), stated)),
        [a, b, c, d, x, y, z] if is_unit(&numbers[..4]) => Some((Numbers::Quaternion([x, y, z, a, b, c, d]), stated)),
        _ => rigid(numbers).map(|matrix| (Numbers::Matrix(matrix), stated)),
    }
}

pub(super) fn roll_pitch_yaw(name: &str) -> Known<Vec<RotationForm>> {
    let forms = Euler::of_roll_pitch_yaw().into_iter().map(RotationForm::Euler).collect();
    Known::by(format!("the name {name:?}: numbers about x, y and z"), forms)
}

/// Every series of poses in a document. `file` names it in messages.
pub(crate) fn series(value: &Value, file: &str) -> Vec<Track> {
    let mut tracks = Vec::new();
    let mut parts = Vec::new();
    look(value, "", file, &mut tracks, &mut parts, 0);
    tracks.extend(parts::series(&parts, file));
    tracks.sort_by_key(Track::is_still);
    tracks.truncate(MOST_SERIES);
    call_after_files(&mut tracks, file, role_of_document(file));
    tracks
}

fn look(value: &Value, path: &str, file: &str, tracks: &mut Vec<Track>, parts: &mut Vec<Part>, depth: usize) {
    if depth > 8 || tracks.len() > MOST_SERIES {
        return;
    }
    match value {
        // The covariance of a result is not a series of six poses.
        Value::List(items) if is_covariance(items) => {}
        // Joint values are not poses, whatever their number is.
        Value::List(items) if is_about_joints(path) && items.iter().all(|item| item.numbers(12).is_some()) => {}
        Value::List(items) if value.numbers(16).is_none() && items.len() >= LEAST_POSES => {
            let place = |i: usize| text!("{file}, entry {entry}", file = file, entry = i + 1);
            let named = items.iter().enumerate().map(|(i, item)| (place(i), None, item));
            let found = of_elements(path, file, named.collect());
            if found.iter().all(Track::is_still) {
                parts.extend(Part::of(path, items));
                for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                    look(item, &joined(path, &format!("[{i}]")), file, tracks, parts, depth + 1);
                }
            }
            tracks.extend(found);
        }
        Value::List(items) => {
            parts.extend(Part::of(path, items));
            for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                look(item, &joined(path, &format!("[{i}]")), file, tracks, parts, depth + 1);
            }
        }
        Value::Map(_) if value.matrix_rows().is_some() => {
            if let Some(rows) = value.matrix_rows() {
                look(&rows, path, file, tracks, parts, depth + 1);
            }
        }
        Value::Map(entries) => {
            let mut counted: BTreeMap<String, Vec<(u64, &str, &Value)>> = BTreeMap::new();
            for (key, inner) in entries {
                if let Some((prefix, number)) = counting_key(key) {
                    counted.entry(prefix).or_default().push((number, key, inner));
                } else {
                    look(inner, &joined(path, key), file, tracks, parts, depth + 1);
                }
            }
            for (prefix, mut members) in counted {
                members.sort_by_key(|(number, ..)| *number);
                let path = joined(path, if prefix.is_empty() { "#" } else { &prefix });
                if members.len() >= LEAST_POSES {
                    let place = |key: &str| text!("{file}, {key}", file = file, key = key);
                    let named = members.iter().map(|(n, key, item)| (place(key), Some(*n), *item));
                    tracks.extend(of_elements(&path, file, named.collect()));
                } else {
                    for (_, key, inner) in members {
                        look(inner, &joined(&path, key), file, tracks, parts, depth + 1);
                    }
                }
            }
        }
        _ => {}
    }
}

/// Whether rows of numbers are a matrix that is symmetric, as those of a covariance are, up to the rounding of printed
/// numbers.
fn is_covariance(items: &[Value]) -> bool {
    let rows: Option<Vec<Vec<f64>>> = items.iter().map(|row| row.numbers(16)).collect();
    let Some(rows) = rows.filter(|rows| rows.len() == 6 && rows.iter().all(|row| row.len() == 6)) else { return false };
    let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-3 * a.abs().max(b.abs());
    (0..6).all(|i| rows[i][i] >= 0.0 && (0..i).all(|j| is_near(rows[i][j], rows[j][i])))
}

/// A key that ends in a number, or is one; an image's name counts as one by its number.
fn counting_key(key: &str) -> Option<(String, u64)> {
    let stem = if is_image_name(key) { key.rsplit_once('.').map_or(key, |(stem, _)| stem) } else { key };
    let digits = stem.bytes().rev().take_while(u8::is_ascii_digit).count();
    let (prefix, number) = stem.split_at(stem.len() - digits);
    Some((prefix.trim_end_matches(['_', '-', ' ']).to_owned(), number.parse().ok()?))
}

fn of_elements(path: &str, file: &str, elements: Vec<(Text, Option<u64>, &Value)>) -> Vec<Track> {
    let mut by_path: BTreeMap<String, (Stated, Vec<Sample>)> = BTreeMap::new();
    let count = elements.len();
    for (place, number, element) in elements {
        let (place, found) = (Arc::new(place), fields(element));
        for (inner, numbers, stated) in found.poses {
            let sample = Sample {
                image: found.image.clone(),
                number: number.or(found.number),
                place: Arc::clone(&place),
                numbers,
                joints: found.joints.clone(),
            };
            by_path.entry(inner).or_insert_with(|| (stated, Vec::new())).1.push(sample);
        }
    }
    let mut tracks = Vec::new();
    for (inner, (stated, samples)) in by_path {
        if samples.len() < LEAST_POSES || 2 * samples.len() < count {
            continue;
        }
        let inner = joined(path, &inner);
        tracks.extend(track(track_name(file, &inner), &inner, stated, samples));
    }
    tracks
}

/// Value of `--set poses=`: the file and the place in it.
pub(crate) fn track_name(file: &str, path: &str) -> String {
    if path.is_empty() { file.to_owned() } else { format!("{file}:{path}") }
}

/// A series of samples of one kind; those of another kind are not of it. `None` when too few are left.
pub(crate) fn track(name: String, path: &str, stated: Stated, mut samples: Vec<Sample>) -> Option<Track> {
    let kind = std::mem::discriminant(&samples.first()?.numbers);
    samples.retain(|sample| std::mem::discriminant(&sample.numbers) == kind);
    (samples.len() >= LEAST_POSES).then(|| Track { role: by_path(path), name, stated, reading_of: None, samples })
}

/// What poses of this name belong to.
pub(crate) fn role(name: &str) -> Role {
    let name = name.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    if has(&[
        "target2",
        "object",
        "marker",
        "board",
        "tracking",
        "tag",
        "aruco",
        "checker",
        "chess",
        "pattern",
        "cpo",
        "cmo",
        "cam_t_",
        "camera_t_",
    ]) {
        return Role::Target;
    }
    let is_end = || name.split(|c: char| !c.is_ascii_alphanumeric()).any(|word| word == "ee");
    if has(&[
        "robot", "effector", "eef", "gripper", "hand", "tcp", "flange", "tool", "tip", "rpe", "fme", "wme", "base",
        "arm", "end",
    ]) || is_end()
    {
        return Role::Robot;
    }
    if has(&["target", "cam"]) { Role::Target } else { Role::Unknown }
}

/// What poses at a path of a document belong to; with the names of OpenCV, to the target.
fn by_path(path: &str) -> Role {
    match role(path) {
        Role::Unknown if named::is_of_solve_pnp(path) => Role::Target,
        role => role,
    }
}

/// What poses in files of this name belong to. Many are named after the calibration, whose "hand" does not mean the
/// robot.
pub(crate) fn role_of_files(name: &str) -> Role {
    let mut name = name.to_lowercase();
    for by in ["", "_", "-", " "] {
        for words in [
            ["eye", "in", "hand"],
            ["eye", "to", "hand"],
            ["eye", "on", "hand"],
            ["eye", "on", "base"],
            ["hand", "to", "eye"],
            ["hand", "2", "eye"],
            ["eye", "2", "hand"],
        ] {
            name = name.replace(&words.join(by), "");
        }
        name = name.replace(&["hand", "eye"].join(by), "").replace(&["eye", "hand"].join(by), "");
    }
    role(&name)
}

/// Gives the only series of a document or of files, or the one that covers all of them, the role of their name, where its
/// own path has none. Of several series some belong to something other than the file's name.
pub(crate) fn call_after_files(tracks: &mut [Track], files: &str, of_files: Role) {
    let is_alone = tracks.iter().filter(|track| !track.is_still()).count() <= 1;
    for track in tracks.iter_mut().filter(|_| of_files != Role::Unknown) {
        let path = track.name.strip_prefix(files).unwrap_or_default();
        if path.is_empty() || (is_alone && role(path) == Role::Unknown) {
            track.role = of_files;
        }
    }
}

/// Whether a table or a program is of the target by its name or that of its folder, which may be a folder of images of
/// it.
pub(crate) fn is_of_target(file: &str) -> bool {
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
    role(file) == Role::Target && role(&stem) != Role::Robot
}

/// What poses in a document of this name belong to; those of a camera may be those of its mount.
pub(crate) fn role_of_document(file: &str) -> Role {
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    role_of_files(&stem.replace("cam", ""))
}

#[cfg(test)]
#[path = "tree_tests.rs"]
mod tests;
