//! Series with separate rotations and translations, as `calibrateHandEye` takes them.

use std::sync::Arc;

use nalgebra::Matrix3;

use super::named::joined_numbers;
use super::tree::{LEAST_POSES, last_of, track, track_name};
use crate::conventions::{RotationForm, is_rotation, rigid};
use crate::recording::{Known, Sample, Stated, Track};
use crate::value::Value;
use handeye_wording::text;

/// Lists of one document that are put together: each is compared with all others.
const MOST_PARTS: usize = 256;

/// A list of rotations or of translations, which are a series together.
pub(crate) struct Part {
    pub name: String,
    pub rows: Vec<Vec<f64>>,
}

impl Part {
    pub fn of(path: &str, items: &[Value]) -> Option<Self> {
        let rows: Vec<Vec<f64>> = items.iter().map(|item| item.numbers(9)).collect::<Option<_>>()?;
        (!rows.is_empty()).then(|| Self { name: path.to_owned(), rows })
    }

    /// Whether its rows are those of a matrix: of a rotation, of a pose, of a camera.
    fn is_matrix(&self) -> bool {
        let numbers = self.rows.concat();
        match (self.rows.len(), numbers.as_slice()) {
            (3, &[.., g, h, i]) if numbers.len() == 9 => {
                is_rotation(&Matrix3::from_row_slice(&numbers)) || [g, h, i] == [0.0, 0.0, 1.0]
            }
            (3 | 4, _) => rigid(&numbers).is_some(),
            _ => false,
        }
    }
}

/// The series that parts of one document are together.
pub(crate) fn series(parts: &[Part], file: &str) -> Vec<Track> {
    let parts: Vec<&Part> = parts.iter().filter(|part| !part.is_matrix()).take(MOST_PARTS).collect();
    let mut tracks = Vec::new();
    let of_size = |part: &Part, size: &[usize]| part.rows.iter().all(|row| size.contains(&row.len()));
    for rotations in parts.iter().filter(|part| of_size(part, &[9, 4, 3])) {
        let whose = whose(&rotations.name);
        let beside =
            |part: &Part| part.rows.len() == rotations.rows.len() && of_size(part, &[3]) && part.name != rotations.name;
        let mut candidates = parts.iter().filter(|part| beside(part) && self::whose(&part.name) == whose);
        let Some(translations) = candidates.next() else { continue };
        let is_rotation = |part: &Part| {
            let name = last_of(&part.name).to_lowercase();
            !of_size(part, &[3]) || name.starts_with('r') || name.contains("rot") || name.contains("euler")
        };
        if !is_rotation(rotations) || rotations.rows.len() < LEAST_POSES {
            continue;
        }
        let samples = rotations.rows.iter().zip(&translations.rows).enumerate().filter_map(|(i, (r, t))| {
            let &[x, y, z] = t.as_slice() else { return None };
            let numbers = joined_numbers([x, y, z], r)?;
            let place = Arc::new(text!("{file}, entry {entry}", file = file, entry = i + 1));
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

/// What a part belongs to, by the rest of its name.
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
mod tests {
    use super::*;

    fn part(name: &str, rows: &[&[f64]]) -> Part {
        Part { name: name.into(), rows: rows.iter().map(|row| row.to_vec()).collect() }
    }

    /// Results of a calibration have matrices row by row.
    #[test]
    fn the_rows_of_a_matrix_are_no_series() {
        let turn: [&[f64]; 3] = [&[0.0, -1.0, 0.0], &[1.0, 0.0, 0.0], &[0.0, 0.0, 1.0]];
        let camera: [&[f64]; 3] = [&[600.0, 0.0, 320.0], &[0.0, 601.0, 240.0], &[0.0, 0.0, 1.0]];
        let vectors: [&[f64]; 3] = [&[0.1, 0.2, 0.3], &[0.2, 0.2, 0.3], &[0.4, 0.2, 0.3]];
        let of = |rotations: &[&[f64]], translations: &[&[f64]]| {
            series(&[part("rotation_matrix", rotations), part("t_matrix", translations)], "a.json").len()
        };
        assert_eq!([of(&turn, &vectors), of(&camera, &vectors), of(&vectors, &camera)], [0; 3]);
        assert_eq!(of(&vectors, &vectors.map(|row| &row[..3])), 1, "three vectors are three");
    }

    #[test]
    fn vectors_without_another_name_are_of_the_target_unless_the_file_is_of_the_robot() {
        use crate::formats::tree;
        use crate::recording::Role;
        let vectors: [&[f64]; 3] = [&[0.1, 0.2, 0.3], &[0.2, 0.2, 0.3], &[0.4, 0.2, 0.3]];
        let role = |names: [&str; 2], file: &str| {
            let mut tracks = series(&[part(names[0], &vectors), part(names[1], &vectors)], file);
            tree::call_after_files(&mut tracks, file, tree::role_of_document(file));
            tracks.first().map(|track| track.role)
        };
        assert_eq!(role(["rvecs", "tvecs"], "handeye.npz"), Some(Role::Target));
        assert_eq!(role(["rvecs", "tvecs"], "robot.npz"), Some(Role::Robot));
        assert_eq!(role(["Rotation_Vec", "Translation_Vec"], "board.yml"), Some(Role::Target));
        assert_eq!(role(["R", "t"], "poses.yml"), Some(Role::Unknown));
    }
}
