//! One pose per file that has numbers and no names, so that their meaning is open.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::names::is_call;
use super::table::bare::{self, Row};
use crate::recording::{Role, Track};
use crate::value::number;
use handeye_wording::Text;

/// No pose with joint values has more numbers than this.
pub(super) const MOST_NUMBERS: usize = 32;

/// The series of files of one naming, where they contain only numbers, in every order of the numbers; none where most of them have
/// other words or different numbers of values.
pub(super) fn tracks<'a>(
    name: &str,
    role: Role,
    files: impl ExactSizeIterator<Item = (&'a Path, Option<u64>, Option<Vec<f64>>)>,
) -> Vec<Track> {
    let all = files.len();
    let rows = files.filter_map(|(file, number, numbers)| {
        Some(Row { image: None, number, place: Arc::new(place(file)), numbers: numbers? })
    });
    let mut rows: Vec<Row> = rows.collect();
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for row in &rows {
        *counts.entry(row.numbers.len()).or_default() += 1;
    }
    let Some((&width, _)) = counts.iter().max_by_key(|(_, count)| **count) else { return Vec::new() };
    rows.retain(|row| row.numbers.len() == width);
    if 2 * rows.len() < all {
        return Vec::new();
    }
    let mut tracks = bare::tracks(name, &rows);
    for track in &mut tracks {
        track.role = role;
    }
    tracks
}

/// The place of a pose that has its own file.
pub(super) fn place(file: &Path) -> Text {
    let name = file.display().to_string();
    Text::verbatim(name)
}

/// The numbers of a text that has nothing else, whatever separates them; brackets and Python calls are ignored.
pub(super) fn numbers(text: &str) -> Option<Vec<f64>> {
    let is_sign = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']' | '(' | ')');
    let words = text.split(is_sign).filter(|word| !word.is_empty() && !is_call(word));
    words.take(MOST_NUMBERS + 1).map(number).collect::<Option<Vec<f64>>>().filter(|n| n.len() <= MOST_NUMBERS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Numbers;

    fn read(text: impl Fn(usize) -> String) -> Vec<Track> {
        let names: Vec<String> = (0..4).map(|i| format!("view{i}.txt")).collect();
        let files = names.iter().enumerate().map(|(i, name)| (Path::new(name), Some(i as u64), numbers(&text(i))));
        tracks("view#.txt", Role::Unknown, files)
    }

    #[test]
    fn a_number_to_a_line_is_a_pose_in_both_orders() {
        let tracks = read(|i| format!("{i}.5\n-20\n30\n400\n-500.25\n600\n"));
        let [plain, turned] = tracks.as_slice() else { panic!("{tracks:?}") };
        assert_eq!(plain.samples[1].numbers, Numbers::Angles([1.5, -20.0, 30.0, 400.0, -500.25, 600.0]));
        assert_eq!(turned.samples[1].numbers, Numbers::Angles([400.0, -500.25, 600.0, 1.5, -20.0, 30.0]));
        assert_eq!(turned.reading_of.as_deref(), Some("view#.txt"), "another reading of the same series");
        assert_eq!((turned.samples[3].number, turned.samples[3].place.to_string()), (Some(3), "view3.txt".to_owned()));
    }

    #[test]
    fn an_array_as_python_prints_it_is_a_pose() {
        let row = |i: usize| format!("np.array([[1, 0, 0, {i}], [0.0, 1.0, 0.0, 5],\n [0, 0, 1, 6], [0, 0, 0, 1]])\n");
        let tracks = read(row);
        let [track] = tracks.as_slice() else { panic!("{tracks:?}") };
        let Numbers::Matrix(m) = track.samples[2].numbers else { panic!("{track:?}") };
        assert_eq!([m[(0, 3)], m[(1, 3)], m[(2, 3)]], [2.0, 5.0, 6.0]);
    }

    #[test]
    fn texts_with_words_or_with_other_numbers_are_no_poses() {
        assert!(read(|i| format!("the board has 11 8 corners of 20 {i} 3 4")).is_empty());
        assert!(read(|i| format!("{i} 2 3 4 5")).is_empty());
        assert!(read(|i| "1 ".repeat(6 + i)).is_empty(), "no common number of numbers");
    }
}
