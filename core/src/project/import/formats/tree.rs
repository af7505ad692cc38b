//! Poses in JSON, YAML and OpenCV's files, wherever they stand in the tree: arrays of 6, 7, 12 or 16 numbers, named fields,
//! a rotation beside a translation; in a list, under keys that count, or one to a file.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::project::import::conventions::{Euler, RotationForm, is_rotation, is_unit, rigid};
use crate::project::import::recording::{Known, Numbers, Role, Sample, Stated, Track};
use crate::project::import::value::Value;

/// Poses that make a series.
pub(in crate::project::import) const LEAST_POSES: usize = 3;
/// Series of one file that are looked at.
const MOST_SERIES: usize = 32;
/// Elements of a list that are not a series and are looked into.
const MOST_LOOKED_INTO: usize = 8;

/// What one element of a series, or one file, has.
#[derive(Debug, Clone, Default)]
pub(in crate::project::import) struct Fields {
    pub poses: Vec<(String, Numbers, Stated)>,
    pub joints: Vec<f64>,
    pub image: Option<String>,
    pub number: Option<u64>,
}

/// Everything in a value that may be a pose, with where it stands.
pub(in crate::project::import) fn fields(value: &Value) -> Fields {
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
            if numbers.len() >= 4 && numbers.len() <= 12 && fields.joints.is_empty() {
                fields.joints = numbers;
            }
        } else if let Some(found) = of_numbers(&numbers, last_of(path)) {
            fields.poses.push((path.to_owned(), found.0, found.1));
        }
        return;
    }
    match value {
        Value::Map(entries) => {
            if let Some((numbers, stated)) = of_map(value) {
                fields.poses.push((path.to_owned(), numbers, stated));
            }
            for (key, inner) in entries {
                match inner {
                    Value::Text(text) if fields.image.is_none() && is_image_name(text) => {
                        fields.image = Some(text.clone());
                    }
                    Value::Number(_) if fields.number.is_none() && is_counting(key) => fields.number = inner.whole(),
                    // Parts of a pose that was found are no poses of their own.
                    Value::Map(_) | Value::List(_) => walk(inner, &joined(path, key), fields, depth + 1),
                    _ => {}
                }
            }
        }
        Value::List(items) => {
            for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                walk(item, &joined(path, &format!("[{i}]")), fields, depth + 1);
            }
        }
        _ => {}
    }
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

fn last_of(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// Whether a name is one of joint values.
pub(in crate::project::import) fn is_about_joints(name: &str) -> bool {
    let name = name.to_lowercase();
    let last = last_of(&name);
    last.contains("joint") || matches!(last, "q" | "qpos" | "actual_q" | "angles" | "axes")
}

fn is_counting(key: &str) -> bool {
    let key = key.to_lowercase();
    matches!(
        &*key,
        "id" | "index" | "idx" | "number" | "no" | "n" | "frame" | "frame_id" | "num" | "seq" | "sample" | "view"
    )
}

/// Whether a text is the name of an image.
pub(in crate::project::import) fn is_image_name(text: &str) -> bool {
    text.len() < 1024 && super::super::folder::is_image(std::path::Path::new(text.trim()))
}

/// What a pose of so many numbers may be.
pub(in crate::project::import) fn of_numbers(numbers: &[f64], name: &str) -> Option<(Numbers, Stated)> {
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

fn roll_pitch_yaw(name: &str) -> Known<Vec<RotationForm>> {
    let forms = Euler::of_roll_pitch_yaw().into_iter().map(RotationForm::Euler).collect();
    Known::by(format!("the name {name:?}: numbers about x, y and z"), forms)
}

/// The pose of named fields.
fn of_map(value: &Value) -> Option<(Numbers, Stated)> {
    let translation = translation(value)?;
    let (rotation, stated) = rotation(value)?;
    Some((joined_numbers(translation, &rotation)?, stated))
}

/// A pose of a translation and numbers of a rotation.
fn joined_numbers([x, y, z]: [f64; 3], rotation: &[f64]) -> Option<Numbers> {
    if rotation.iter().chain(&[x, y, z]).any(|n| !n.is_finite()) {
        return None;
    }
    match *rotation {
        [a, b, c] => Some(Numbers::Angles([x, y, z, a, b, c])),
        [a, b, c, d] if is_unit(rotation) => Some(Numbers::Quaternion([x, y, z, a, b, c, d])),
        _ if rotation.len() == 9 => {
            let turn = Matrix3::from_row_slice(rotation);
            is_rotation(&turn).then(|| {
                let mut matrix = Matrix4::identity();
                matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
                matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::new(x, y, z));
                Numbers::Matrix(matrix)
            })
        }
        _ => None,
    }
}

fn three(value: &Value, keys: [&str; 3]) -> Option<[f64; 3]> {
    let [a, b, c] = keys.map(|key| value.get(key).and_then(Value::number));
    Some([a?, b?, c?])
}

fn translation(value: &Value) -> Option<[f64; 3]> {
    for keys in [["x", "y", "z"], ["tx", "ty", "tz"], ["px", "py", "pz"], ["pos_x", "pos_y", "pos_z"]] {
        if let Some(found) = three(value, keys) {
            return Some(found);
        }
    }
    for key in ["translation", "position", "trans", "xyz", "tvec", "t", "pos", "location", "p"] {
        let Some(inner) = value.get(key) else { continue };
        if let Some(found) = three(inner, ["x", "y", "z"]) {
            return Some(found);
        }
        if let Some([x, y, z]) = inner.numbers(3).as_deref() {
            return Some([*x, *y, *z]);
        }
    }
    None
}

/// Numbers of a rotation, with its meaning as far as the names say it.
fn rotation(value: &Value) -> Option<(Vec<f64>, Stated)> {
    let named = |why: &str, forms: Vec<RotationForm>| Stated {
        rotation: Some(Known::by(format!("the names {why}"), forms)),
        ..Stated::default()
    };
    let four = |value: &Value, keys: [&str; 4]| -> Option<Vec<f64>> {
        keys.iter().map(|key| value.get(key).and_then(Value::number)).collect()
    };
    for keys in [["qx", "qy", "qz", "qw"], ["q_x", "q_y", "q_z", "q_w"], ["rot_x", "rot_y", "rot_z", "rot_w"]] {
        if let Some(found) = four(value, keys) {
            return Some((found, named(&keys.join(" "), vec![RotationForm::Xyzw])));
        }
    }
    if let Some(found) = three(value, ["roll", "pitch", "yaw"]) {
        let stated = Stated { rotation: Some(roll_pitch_yaw("roll pitch yaw")), ..Stated::default() };
        return Some((found.to_vec(), stated));
    }
    for keys in [["rx", "ry", "rz"], ["a", "b", "c"], ["w", "p", "r"], ["alpha", "beta", "gamma"], ["u", "v", "w"]] {
        if let Some(found) = three(value, keys) {
            return Some((found.to_vec(), Stated::default()));
        }
    }
    let keys = [
        "rotation",
        "orientation",
        "quaternion",
        "quat",
        "rot",
        "rpy",
        "euler",
        "rvec",
        "rotvec",
        "rotation_vector",
        "r",
        "rotation_matrix",
        "q",
        "o",
    ];
    for key in keys {
        let Some(inner) = value.get(key) else { continue };
        for keys in [["x", "y", "z", "w"], ["i", "j", "k", "w"], ["qx", "qy", "qz", "qw"]] {
            if let Some(found) = four(inner, keys) {
                return Some((found, named(&keys.join(" "), vec![RotationForm::Xyzw])));
            }
        }
        if let Some(found) = three(inner, ["roll", "pitch", "yaw"]) {
            let stated = Stated { rotation: Some(roll_pitch_yaw("roll pitch yaw")), ..Stated::default() };
            return Some((found.to_vec(), stated));
        }
        if let Some(found) = three(inner, ["x", "y", "z"]).or_else(|| three(inner, ["rx", "ry", "rz"])) {
            return Some((found.to_vec(), Stated::default()));
        }
        let Some(found) = inner.numbers(9) else { continue };
        let stated = match (key, found.len()) {
            ("rvec" | "rotvec" | "rotation_vector", 3) => named(key, vec![RotationForm::Vector]),
            ("rpy", 3) => Stated { rotation: Some(roll_pitch_yaw("rpy")), ..Stated::default() },
            (_, 3 | 4 | 9) => Stated::default(),
            _ => continue,
        };
        return Some((found, stated));
    }
    None
}

/// Every series of poses in a document. `file` names it in messages.
pub(in crate::project::import) fn series(value: &Value, file: &str) -> Vec<Track> {
    let mut tracks = Vec::new();
    let mut parts = Vec::new();
    look(value, "", file, &mut tracks, &mut parts, 0);
    tracks.extend(of_parts(&parts, file));
    tracks.truncate(MOST_SERIES);
    tracks
}

/// A list of rotations or of translations, which are a series together.
pub(in crate::project::import) struct Part {
    pub name: String,
    pub rows: Vec<Vec<f64>>,
}

fn look(value: &Value, path: &str, file: &str, tracks: &mut Vec<Track>, parts: &mut Vec<Part>, depth: usize) {
    if depth > 8 || tracks.len() > MOST_SERIES {
        return;
    }
    match value {
        // Joint values are no poses, however many they are.
        Value::List(items) if is_about_joints(path) && items.iter().all(|item| item.numbers(12).is_some()) => {}
        Value::List(items) if value.numbers(16).is_none() && items.len() >= LEAST_POSES => {
            let named = items.iter().enumerate().map(|(i, item)| (format!("{file}, entry {}", i + 1), None, item));
            let found = of_elements(path, file, named.collect());
            if found.is_empty() {
                parts.extend(part(path, items));
                for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                    look(item, &joined(path, &format!("[{i}]")), file, tracks, parts, depth + 1);
                }
            }
            tracks.extend(found);
        }
        Value::List(items) => {
            parts.extend(part(path, items));
            for (i, item) in items.iter().take(MOST_LOOKED_INTO).enumerate() {
                look(item, &joined(path, &format!("[{i}]")), file, tracks, parts, depth + 1);
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
                    let named = members.iter().map(|(n, key, item)| (format!("{file}, {key}"), Some(*n), *item));
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

/// A key that ends in a number, or is one; an image's name counts as one by its number.
fn counting_key(key: &str) -> Option<(String, u64)> {
    let stem = if is_image_name(key) { key.rsplit_once('.').map_or(key, |(stem, _)| stem) } else { key };
    let digits = stem.bytes().rev().take_while(u8::is_ascii_digit).count();
    let (prefix, number) = stem.split_at(stem.len() - digits);
    Some((prefix.trim_end_matches(['_', '-', ' ']).to_owned(), number.parse().ok()?))
}

fn of_elements(path: &str, file: &str, elements: Vec<(String, Option<u64>, &Value)>) -> Vec<Track> {
    let mut by_path: BTreeMap<String, (Stated, Vec<Sample>)> = BTreeMap::new();
    let count = elements.len();
    for (place, number, element) in elements {
        let found = fields(element);
        for (inner, numbers, stated) in found.poses {
            let sample = Sample {
                image: found.image.clone(),
                number: number.or(found.number),
                place: place.clone(),
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
        let inner =
            if path.is_empty() || inner.is_empty() { format!("{path}{inner}") } else { format!("{path}.{inner}") };
        tracks.extend(track(track_name(file, &inner), &inner, stated, samples));
    }
    tracks
}

/// As `--set poses=` has it: the file and the place in it.
pub(in crate::project::import) fn track_name(file: &str, path: &str) -> String {
    if path.is_empty() { file.to_owned() } else { format!("{file}:{path}") }
}

/// A series of samples of one kind; those of another kind are not of it. `None` when too few are left.
pub(in crate::project::import) fn track(
    name: String,
    path: &str,
    stated: Stated,
    mut samples: Vec<Sample>,
) -> Option<Track> {
    let kind = std::mem::discriminant(&samples.first()?.numbers);
    samples.retain(|sample| std::mem::discriminant(&sample.numbers) == kind);
    // A rigid transform that never changes is a setting.
    let moves = samples.iter().any(|sample| sample.numbers != samples[0].numbers);
    (samples.len() >= LEAST_POSES && moves).then(|| Track { role: role(path), name, stated, reading_of: None, samples })
}

/// What poses of this name are of.
pub(in crate::project::import) fn role(name: &str) -> Role {
    let name = name.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    if has(&[
        "target2",
        "object",
        "marker",
        "board",
        "tracking",
        "tag",
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
    if has(&[
        "robot", "effector", "eef", "gripper", "hand", "tcp", "flange", "tool", "tip", "rpe", "fme", "wme", "base",
        "arm", "end",
    ]) {
        return Role::Robot;
    }
    if has(&["target", "cam"]) { Role::Target } else { Role::Unknown }
}

fn part(path: &str, items: &[Value]) -> Option<Part> {
    let rows: Vec<Vec<f64>> = items.iter().map(|item| item.numbers(9)).collect::<Option<_>>()?;
    (!rows.is_empty()).then(|| Part { name: path.to_owned(), rows })
}

/// Series of which rotations and translations stand apart, as `calibrateHandEye` takes them.
pub(in crate::project::import) fn of_parts(parts: &[Part], file: &str) -> Vec<Track> {
    let mut tracks = Vec::new();
    let of_size = |part: &&Part, size: &[usize]| part.rows.iter().all(|row| size.contains(&row.len()));
    for rotations in parts.iter().filter(|part| of_size(part, &[9, 4, 3])) {
        let whose = whose(&rotations.name);
        let beside = |part: &&Part| {
            part.rows.len() == rotations.rows.len() && of_size(part, &[3]) && part.name != rotations.name
        };
        let mut candidates = parts.iter().filter(beside).filter(|part| self::whose(&part.name) == whose);
        let Some(translations) = candidates.next() else { continue };
        let is_rotation = |part: &Part| {
            let name = last_of(&part.name).to_lowercase();
            part.rows[0].len() != 3 || name.starts_with('r') || name.contains("rot") || name.contains("euler")
        };
        if !is_rotation(rotations) || rotations.rows.len() < LEAST_POSES {
            continue;
        }
        let samples = rotations.rows.iter().zip(&translations.rows).enumerate().filter_map(|(i, (r, t))| {
            let numbers = joined_numbers([t[0], t[1], t[2]], r)?;
            let place = format!("{file}, entry {}", i + 1);
            Some(Sample { image: None, number: None, place, numbers, joints: Vec::new() })
        });
        let name = format!("{}+{}", rotations.name, translations.name);
        let stated = if last_of(&rotations.name).to_lowercase().contains("vec") {
            let why = format!("the name {:?}", rotations.name);
            Stated { rotation: Some(Known::by(why, vec![RotationForm::Vector])), ..Stated::default() }
        } else {
            Stated::default()
        };
        tracks.extend(track(track_name(file, &name), &name, stated, samples.collect()));
    }
    tracks
}

/// What a part is of, by its name without what says which part it is.
fn whose(name: &str) -> String {
    let name = name.to_lowercase();
    let last = last_of(&name);
    let words = last.split(['_', '-', ' ']).filter(|word| {
        !matches!(
            *word,
            "r" | "t"
                | "rot"
                | "rotation"
                | "rotations"
                | "trans"
                | "translation"
                | "translations"
                | "rvec"
                | "rvecs"
                | "tvec"
                | "tvecs"
                | "rotvec"
                | "position"
                | "positions"
                | "orientation"
                | "orientations"
                | "quat"
                | "quaternion"
                | "quaternions"
                | "euler"
                | "xyz"
                | "rpy"
                | "mat"
                | "matrix"
                | "vec"
        )
    });
    words.collect::<Vec<_>>().join("_")
}

#[cfg(test)]
#[path = "tree_tests.rs"]
mod tests;
