//! The meaning of a field's name: which part of a pose it is, of what, and in which unit.

use crate::conventions::{AngleUnit, LengthUnit};

/// Parts of a pose that have fields of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Translation,
    Rotation,
}

/// A name that denotes a part of a pose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Name {
    pub part: Part,
    /// Rest of the name: what the pose belongs to.
    pub whose: String,
    pub length: Option<LengthUnit>,
    pub angle: Option<AngleUnit>,
}

/// The meaning of a name; `None` where it denotes neither a translation nor a rotation.
pub(super) fn of(key: &str) -> Option<Name> {
    let words = words(key);
    let lower: Vec<String> = words.iter().map(|word| word.to_lowercase()).collect();
    let mut part = None;
    for word in &lower {
        match (by_word(word), part) {
            (Some(found), Some(known)) if found != known => return None,
            (Some(found), _) => part = Some(found),
            _ => {}
        }
    }
    let (mut length, mut angle) = (None, None);
    // A letter alone is a name at the end or at the beginning: `R_tcp`, `tcp_t`.
    let by_letter = part.is_none();
    let at = |i: Option<usize>| i.and_then(|i| Some((i, letter(lower.get(i)?)?)));
    let lettered = at(Some(0)).or_else(|| at(lower.len().checked_sub(1))).filter(|_| by_letter);
    let part = part.or(lettered.map(|(_, part)| part))?;
    let mut whose = Vec::new();
    for (i, (word, small)) in words.iter().zip(&lower).enumerate() {
        let is_part = by_word(small).is_some() || lettered.is_some_and(|(at, _)| at == i);
        let is_kind = matches!(small.as_str(), "mat" | "matrix" | "vec" | "vector" | "as" | "in");
        // The first word is a name, whatever it is elsewhere.
        let (metres, radians) = if i == 0 { (None, None) } else { (length_unit(small), angle_unit(small)) };
        length = length.or(metres);
        angle = angle.or(radians);
        if !is_part && !is_kind && metres.is_none() && radians.is_none() {
            whose.push(word.as_str());
        }
    }
    Some(Name { part, whose: whose.join("_"), length, angle })
}

/// Whether a name denotes axis times angle.
pub(super) fn is_rotation_vector(key: &str) -> bool {
    let words: Vec<String> = words(key).iter().map(|word| word.to_lowercase()).collect();
    let has = |names: &[&str]| words.iter().any(|word| names.contains(&word.as_str()));
    has(&["rvec", "rvecs", "rotvec"]) || (has(&["rotation", "rot", "r"]) && has(&["vec", "vector"]))
}

/// Words of a name, `like_this`, `like-this` or `likeThis`.
fn words(key: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut before = ' ';
    for c in key.chars() {
        let begins = !c.is_alphanumeric() || (c.is_uppercase() && before.is_lowercase());
        if begins {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.push(c);
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

fn by_word(word: &str) -> Option<Part> {
    match word {
        "translation" | "position" | "trans" | "xyz" | "tvec" | "pos" | "location" => Some(Part::Translation),
        "rotation" | "orientation" | "quaternion" | "quat" | "rot" | "rpy" | "euler" | "rvec" | "rotvec" => {
            Some(Part::Rotation)
        }
        _ => None,
    }
}

fn letter(word: &str) -> Option<Part> {
    match word {
        "t" | "p" => Some(Part::Translation),
        "r" | "q" | "o" => Some(Part::Rotation),
        _ => None,
    }
}

fn length_unit(word: &str) -> Option<LengthUnit> {
    match word {
        "mm" | "millimeter" | "millimeters" | "millimetres" => Some(LengthUnit::Millimetre),
        "m" | "meter" | "meters" | "metres" => Some(LengthUnit::Metre),
        "cm" => Some(LengthUnit::Centimetre),
        _ => None,
    }
}

fn angle_unit(word: &str) -> Option<AngleUnit> {
    match word {
        "deg" | "degree" | "degrees" => Some(AngleUnit::Degree),
        "rad" | "radian" | "radians" => Some(AngleUnit::Radian),
        _ => None,
    }
}

/// The word that Python prints before the brackets of an array.
pub(super) fn is_call(word: &str) -> bool {
    matches!(word, "array" | "np.array" | "numpy.array" | "matrix" | "np.matrix" | "Matrix" | "tensor" | "torch.tensor")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reported(key: &str) -> Option<(Part, String)> {
        of(key).map(|name| (name.part, name.whose))
    }

    #[test]
    fn a_name_says_its_part_and_of_what_it_is() {
        for (key, part, whose) in [
            ("T_cam_target_rvec", Part::Rotation, "T_cam_target"),
            ("aruco_tvec", Part::Translation, "aruco"),
            ("robot_translation_mm", Part::Translation, "robot"),
            ("R_gripper2base", Part::Rotation, "gripper2base"),
            ("tcpPosition", Part::Translation, "tcp"),
            ("Rotation_Vec", Part::Rotation, ""),
            ("rotation_quaternion", Part::Rotation, ""),
            ("tVec", Part::Translation, ""),
        ] {
            assert_eq!(reported(key), Some((part, whose.to_owned())), "{key}");
        }
        for key in ["camera_matrix", "pose", "position_and_rotation", "image", "arm_t_end", ""] {
            assert_eq!(reported(key), None, "{key}");
        }
    }

    #[test]
    fn a_unit_is_one_behind_a_name_alone() {
        assert_eq!(of("position_mm").and_then(|name| name.length), Some(LengthUnit::Millimetre));
        assert_eq!(of("m_position").and_then(|name| name.length), None);
        assert_eq!(of("tcp_rpy_deg").and_then(|name| name.angle), Some(AngleUnit::Degree));
    }
}
