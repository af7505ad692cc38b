//! Poses of named fields: a translation and a rotation, in separate fields or as named numbers, with units and rotation
//! convention from the names.

use nalgebra::{Matrix3, Matrix4, Vector3};

use super::names::{self, Part};
use super::tree::{last_of, roll_pitch_yaw};
use crate::conventions::{AngleUnit, LengthUnit, RotationForm, is_rotation, is_unit};
use crate::recording::{Known, Numbers, Stated};
use crate::value::Value;

/// Most fields of a map that are checked by their names: each translation is compared with every rotation.
const MOST_FIELDS: usize = 256;

/// A part of a pose, and what its names state.
struct Found<T> {
    /// What the fields belong to, in lower case; empty where their names do not state it.
    whose: String,
    key: String,
    numbers: T,
    stated: Stated,
}

/// The poses of the fields of a map, each with what the names of its fields have in common; that is empty where they are called
/// after what they are alone.
pub(super) fn poses(value: &Value) -> Vec<(String, Numbers, Stated)> {
    let Value::Map(entries) = value else { return Vec::new() };
    let entries = entries.get(..MOST_FIELDS).unwrap_or(entries);
    let mut translations: Vec<Found<[f64; 3]>> = translation(value).into_iter().collect();
    let mut rotations: Vec<Found<Vec<f64>>> = rotation(value).into_iter().collect();
    let mut called: Vec<Found<Vec<f64>>> = Vec::new();
    for (key, inner) in entries {
        let Some(name) = names::of(key) else { continue };
        match name.part {
            Part::Translation => translations.extend(translation_in(key, inner).map(|mut found| {
                found.whose = name.whose;
                found
            })),
            Part::Rotation => called.extend(rotation_in(key, inner).map(|mut found| {
                found.whose = name.whose;
                found
            })),
        }
    }
    // A matrix is more specific than a quaternion, and that more than three numbers.
    called.sort_by_key(|found| std::cmp::Reverse(found.numbers.len()));
    rotations.extend(called);
    let mut out: Vec<(String, Numbers, Stated)> = Vec::new();
    let mut done: Vec<&str> = Vec::new();
    for translation in &translations {
        if done.contains(&translation.whose.as_str()) {
            continue;
        }
        let of_it = rotations.iter().filter(|rotation| rotation.whose == translation.whose);
        let mut both =
            of_it.filter_map(|rotation| Some((rotation, joined_numbers(translation.numbers, &rotation.numbers)?)));
        let Some((rotation, numbers)) = both.next() else { continue };
        done.push(&translation.whose);
        let stated = Stated { length: translation.stated.length.clone(), ..rotation.stated.clone() };
        let pair = format!("{}+{}", rotation.key, translation.key);
        // No other name states whose poses these are.
        let name =
            if translation.whose.is_empty() && is_of_solve_pnp(&pair) { pair } else { translation.whose.clone() };
        out.push((name, numbers, stated));
    }
    out
}

/// Whether names are those that OpenCV gives the poses of targets, as `solvePnP` and `calibrateCamera` find them.
pub(super) fn is_of_solve_pnp(names: &str) -> bool {
    let lower = names.to_lowercase();
    let is_vector = |name: &str| matches!(last_of(name).trim_end_matches('s'), "rvec" | "tvec");
    lower.split_once('+').is_some_and(|(a, b)| is_vector(a) && is_vector(b))
}

/// A pose of a translation and numbers of a rotation.
pub(super) fn joined_numbers([x, y, z]: [f64; 3], rotation: &[f64]) -> Option<Numbers> {
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

/// Three numbers by name, each with the same unit behind its name or none.
fn three_in<U: Copy>(value: &Value, keys: [&str; 3], units: &[(&str, U)]) -> Option<([f64; 3], Option<Known<U>>)> {
    three(value, keys).map(|numbers| (numbers, None)).or_else(|| {
        units.iter().find_map(|(suffix, unit)| {
            let keys = keys.map(|key| format!("{key}_{suffix}"));
            let [a, b, c] = &keys;
            Some((three(value, [a, b, c])?, Some(Known::by(format!("the name {a:?}"), *unit))))
        })
    })
}

const LENGTHS: [(&str, LengthUnit); 3] =
    [("mm", LengthUnit::Millimetre), ("m", LengthUnit::Metre), ("cm", LengthUnit::Centimetre)];
const ANGLES: [(&str, AngleUnit); 2] = [("deg", AngleUnit::Degree), ("rad", AngleUnit::Radian)];

fn found<T>(key: &str, numbers: T, stated: Stated) -> Found<T> {
    Found { whose: String::new(), key: key.to_owned(), numbers, stated }
}

fn translation(value: &Value) -> Option<Found<[f64; 3]>> {
    for keys in [["x", "y", "z"], ["tx", "ty", "tz"], ["px", "py", "pz"], ["pos_x", "pos_y", "pos_z"]] {
        if let Some((numbers, length)) = three_in(value, keys, &LENGTHS) {
            return Some(found("", numbers, Stated { length, ..Stated::default() }));
        }
    }
    let keys = ["translation", "position", "trans", "xyz", "tvec", "t", "pos", "location", "p"];
    keys.into_iter().find_map(|key| translation_in(key, value.get(key)?))
}

/// The translation that a field is.
fn translation_in(key: &str, inner: &Value) -> Option<Found<[f64; 3]>> {
    let (numbers, length) =
        three_in(inner, ["x", "y", "z"], &LENGTHS).or_else(|| match inner.numbers(3)?.as_slice() {
            [x, y, z] => Some(([*x, *y, *z], None)),
            _ => None,
        })?;
    let named = || names::of(key)?.length.map(|unit| Known::by(format!("the name {key:?}"), unit));
    Some(found(key, numbers, Stated { length: length.or_else(named), ..Stated::default() }))
}

fn four(value: &Value, keys: [&str; 4]) -> Option<Vec<f64>> {
    keys.iter().map(|key| value.get(key).and_then(Value::number)).collect()
}

fn of_form(why: &str, forms: Vec<RotationForm>) -> Stated {
    Stated { rotation: Some(Known::by(format!("the names {why}"), forms)), ..Stated::default() }
}

/// Three angles by name; of roll, pitch and yaw the axes are reported with them.
fn three_angles(value: &Value, names: &[[&str; 3]]) -> Option<Found<Vec<f64>>> {
    let roll = three_in(value, ["roll", "pitch", "yaw"], &ANGLES).map(|(numbers, angle)| {
        let stated = Stated { rotation: Some(roll_pitch_yaw("roll pitch yaw")), angle, ..Stated::default() };
        found("", numbers.to_vec(), stated)
    });
    roll.or_else(|| {
        let (numbers, angle) = names.iter().find_map(|keys| three_in(value, *keys, &ANGLES))?;
        Some(found("", numbers.to_vec(), Stated { angle, ..Stated::default() }))
    })
}

/// Numbers of a rotation, with its convention as far as the names state it.
fn rotation(value: &Value) -> Option<Found<Vec<f64>>> {
    for keys in [["qx", "qy", "qz", "qw"], ["q_x", "q_y", "q_z", "q_w"], ["rot_x", "rot_y", "rot_z", "rot_w"]] {
        if let Some(numbers) = four(value, keys) {
            return Some(found("", numbers, of_form(&keys.join(" "), vec![RotationForm::Xyzw])));
        }
    }
    let angles = [["rx", "ry", "rz"], ["a", "b", "c"], ["w", "p", "r"], ["alpha", "beta", "gamma"], ["u", "v", "w"]];
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
    three_angles(value, &angles).or_else(|| keys.into_iter().find_map(|key| rotation_in(key, value.get(key)?)))
}

/// The rotation that a field is.
fn rotation_in(key: &str, inner: &Value) -> Option<Found<Vec<f64>>> {
    for keys in [["x", "y", "z", "w"], ["i", "j", "k", "w"], ["qx", "qy", "qz", "qw"]] {
        if let Some(numbers) = four(inner, keys) {
            return Some(found(key, numbers, of_form(&keys.join(" "), vec![RotationForm::Xyzw])));
        }
    }
    let unit = names::of(key).and_then(|name| name.angle).map(|unit| Known::by(format!("the name {key:?}"), unit));
    if let Some(mut found) = three_angles(inner, &[["x", "y", "z"], ["rx", "ry", "rz"]]) {
        key.clone_into(&mut found.key);
        found.stated.angle = found.stated.angle.or(unit);
        return Some(found);
    }
    let numbers = inner.numbers(9).filter(|numbers| matches!(numbers.len(), 3 | 4 | 9))?;
    let mut stated = match numbers.len() {
        3 if names::is_rotation_vector(key) => of_form(key, vec![RotationForm::Vector]),
        3 if key.to_lowercase().contains("rpy") => Stated { rotation: Some(roll_pitch_yaw(key)), ..Stated::default() },
        _ => Stated::default(),
    };
    stated.angle = unit.filter(|_| numbers.len() == 3);
    Some(found(key, numbers, stated))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::json;

    fn read(text: &str) -> Vec<(String, Numbers, Stated)> {
        poses(&json(text).expect("JSON"))
    }

    #[test]
    fn fields_with_a_name_in_common_are_one_pose_and_say_their_units() {
        let found = read(
            r#"{"robot_translation_mm": [1, 2, 3], "robot_rotation_deg": [10, 20, 30],
                "T_cam_target_rvec": [[0.1], [0.2], [0.3]], "T_cam_target_tvec": [[4], [5], [6]], "lone_tvec": [7, 8, 9]}"#,
        );
        let [(robot, at, reported), (target, seen, meant)] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!((robot.as_str(), target.as_str()), ("robot", "T_cam_target"));
        assert_eq!(*at, Numbers::Angles([1.0, 2.0, 3.0, 10.0, 20.0, 30.0]));
        assert_eq!(reported.length.as_ref().map(|known| known.value), Some(LengthUnit::Millimetre));
        assert_eq!(reported.angle.as_ref().map(|known| known.value), Some(AngleUnit::Degree));
        assert!(reported.rotation.is_none(), "degrees about which axes is not said");
        assert_eq!(*seen, Numbers::Angles([4.0, 5.0, 6.0, 0.1, 0.2, 0.3]));
        assert!(meant.length.is_none() && meant.angle.is_none());
        assert_eq!(meant.rotation.as_ref().map(|known| known.value.clone()), Some(vec![RotationForm::Vector]));
    }

    #[test]
    fn numbers_by_name_say_their_units_too() {
        let found = read(r#"{"x_mm": 1, "y_mm": 2, "z_mm": 3, "rx_deg": 4, "ry_deg": 5, "rz_deg": 6}"#);
        let [(_, numbers, stated)] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!(*numbers, Numbers::Angles([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(stated.length.as_ref().map(|known| known.value), Some(LengthUnit::Millimetre));
        assert_eq!(stated.angle.as_ref().map(|known| known.value), Some(AngleUnit::Degree));
    }

    #[test]
    fn a_matrix_is_preferred_to_angles_and_parts_of_different_things_are_no_pose() {
        let found = read(
            r#"{"translation": [1, 2, 3], "rotation_euler": [1, 2, 3], "rotation_as_matrix": [1, 2, 3],
                "rotation_matrix_3x3": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}"#,
        );
        assert!(found.iter().all(|(_, numbers, _)| matches!(numbers, Numbers::Angles(_))), "{found:?}");
        let found =
            read(r#"{"tcp_translation": [1, 2, 3], "tcp_euler": [1, 2, 3], "tcp_rot": [1, 0, 0, 0, 1, 0, 0, 0, 1]}"#);
        assert!(matches!(found.as_slice(), [(name, Numbers::Matrix(_), _)] if name == "tcp"), "{found:?}");
        assert!(read(r#"{"robot_position": [1, 2, 3], "board_rvec": [1, 2, 3]}"#).is_empty());
    }

    #[test]
    fn vectors_as_opencv_calls_them_keep_their_names() {
        let found = read(r#"{"rvec": [1, 2, 3], "tvec": [1, 2, 3]}"#);
        assert!(matches!(found.as_slice(), [(name, ..)] if name == "rvec+tvec"), "{found:?}");
        let found = read(r#"{"R": [1, 2, 3], "t": [1, 2, 3]}"#);
        assert!(matches!(found.as_slice(), [(name, ..)] if name.is_empty()), "{found:?}");
    }
}
