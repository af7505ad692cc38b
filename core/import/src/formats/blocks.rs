//! Texts in which names precede numbers, as printed by Python scripts: `Rotation:` above a matrix, `tvec 1 2 3`, `R = [[…]]`,
//! once or repeatedly, with a count or the name of an image before them. They are read as fields by those names.

use std::collections::HashSet;

use super::names::is_call;
use super::tree::{self, is_image_name};
use super::{File, Format};
use crate::formats::reader::Reader;
use crate::value::{Value, number};
use handeye_wording::Text;
use handeye_wording::text;

/// Most numbers and names of one text.
const MOST: usize = 1_000_000;
/// Most numbers after a name: more are neither a pose nor joint values.
const MOST_OF_A_FIELD: usize = 64;
/// Words that a name may have.
const MOST_WORDS: usize = 8;

pub(super) struct Blocks;

impl Format for Blocks {
    fn name(&self) -> Text {
        text!("numbers behind names in a text")
    }

    fn sniff(&self, file: &File) -> bool {
        file.text().is_some()
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let value = file.text().and_then(document);
        reader.recording.tracks.extend(value.iter().flat_map(|value| tree::series(value, &file.name())));
        true
    }
}

/// The fields of a text, or of every record that begins where a name is repeated; `None` where no numbers have names.
pub(super) fn document(text: &str) -> Option<Value> {
    let mut reader = Records::default();
    let is_between = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']' | '(' | ')' | '{' | '}' | '|');
    let mut read = 0;
    for line in text.lines() {
        reader.is_new_line = true;
        reader.has_brackets = line.contains(['[', '(']);
        for word in line.split(is_between).map(|word| word.trim_matches(['"', '\'', '`', '*'])) {
            reader.word(word, 0);
            read += 1;
            if read > MOST {
                return None;
            }
        }
    }
    reader.end_of_record();
    let mut records = reader.whole;
    match records.len() {
        0 => None,
        1 => records.pop(),
        _ => Some(Value::List(records)),
    }
}

#[derive(Default)]
struct Records {
    whole: Vec<Value>,
    /// Fields of the record that is being read, and their names.
    fields: Vec<(String, Value)>,
    known: HashSet<String>,
    /// The words of the name that is being read, and the numbers that follow it.
    name: Vec<String>,
    numbers: Vec<f64>,
    /// No word of the line was read.
    is_new_line: bool,
    /// Its line has brackets around numbers.
    has_brackets: bool,
    /// What the name would count by if the numbers that it names were below it: a whole number alone.
    may_count: bool,
}

impl Records {
    fn word(&mut self, word: &str, depth: usize) {
        if !word.chars().any(char::is_alphanumeric) || is_call(word) {
            return;
        }
        let is_first = std::mem::take(&mut self.is_new_line);
        if let Some(number) = number(word) {
            self.number(number, is_first);
            let is_count = !self.has_brackets && word.bytes().all(|b| b.is_ascii_digit());
            self.may_count = is_count && !is_first && self.numbers.len() == 1;
            return;
        }
        if is_image_name(word) {
            self.end_of_field();
            if self.fields.iter().any(|(_, value)| matches!(value, Value::Text(_))) {
                self.end_of_record();
            }
            self.field("image".to_owned(), Value::Text(word.to_owned()));
            return;
        }
        if let Some((name, rest)) = word.split_once([':', '=']).filter(|_| depth == 0) {
            // `3:` counts, and `10:28` is a time.
            match number(name) {
                Some(count) if rest.is_empty() => self.count(count),
                Some(_) => {}
                None => {
                    self.named(name, is_first);
                    self.word(rest, depth + 1);
                }
            }
            return;
        }
        self.named(word, is_first);
    }

    fn number(&mut self, number: f64, is_first: bool) {
        // A name and a whole number above others: `Pose 3`.
        if is_first
            && self.may_count
            && !self.name.is_empty()
            && let Some(count) = self.numbers.pop()
        {
            let name = std::mem::take(&mut self.name);
            self.count(count);
            self.name = name;
        }
        if self.numbers.len() <= MOST_OF_A_FIELD {
            self.numbers.push(number);
        }
    }

    fn named(&mut self, word: &str, is_first: bool) {
        self.end_of_field();
        // A name is on one line, after unrelated text on earlier lines.
        if is_first {
            self.name.clear();
        }
        if self.name.len() < MOST_WORDS {
            self.name.push(word.to_owned());
        }
    }

    fn count(&mut self, count: f64) {
        self.end_of_record();
        self.field("number".to_owned(), Value::Number(count));
    }

    fn end_of_field(&mut self) {
        let numbers = std::mem::take(&mut self.numbers);
        if numbers.is_empty() {
            return;
        }
        let name = std::mem::take(&mut self.name).join("_");
        if self.known.contains(&name) {
            self.end_of_record();
        }
        let value = match numbers.as_slice() {
            [one] => Value::Number(*one),
            many if many.len() > MOST_OF_A_FIELD => Value::Other,
            many => Value::List(many.iter().map(|number| Value::Number(*number)).collect()),
        };
        self.field(name, value);
    }

    fn field(&mut self, name: String, value: Value) {
        self.known.insert(name.clone());
        self.fields.push((name, value));
    }

    fn end_of_record(&mut self) {
        if !self.numbers.is_empty() {
            self.end_of_field();
        }
        self.name.clear();
        let fields = std::mem::take(&mut self.fields);
        self.known.clear();
        let has_numbers = fields.iter().any(|(name, value)| name != "number" && !matches!(value, Value::Text(_)));
        if has_numbers {
            self.whole.push(Value::Map(fields));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::RotationForm;
    use crate::recording::{Numbers, Role, Track};

    fn read(file: &str, text: &str) -> Vec<Track> {
        tree::series(&document(text).expect("fields"), file)
    }

    #[test]
    fn blocks_with_a_count_have_a_rotation_above_a_translation() {
        let block = |i: usize| format!("{i}:\nRotation:\n[0.1, -0.2, 0.{i}]\nTranslation:\n[0.5,\n -0.25, {i}.5]\n\n");
        let tracks = read("views.txt", &[4, 7, 9].map(block).concat());
        let [track] = tracks.as_slice() else { panic!("{tracks:?}") };
        assert_eq!(track.samples[1].numbers, Numbers::Angles([0.5, -0.25, 7.5, 0.1, -0.2, 0.7]));
        assert_eq!(track.samples.iter().map(|s| s.number).collect::<Vec<_>>(), [Some(4), Some(7), Some(9)]);
        assert!(track.stated.rotation.is_none(), "three numbers of a rotation may be anything");
    }

    #[test]
    fn matrices_as_numpy_prints_them_belong_to_the_image_above_them() {
        let block = |i: usize| {
            format!(
                "cam/{i}.png\nrotation matrix = [[ 0. -1.  0.]\n [ 1.  0.  0.]\n [ 0.  0.  1.]]\ntranslation vector = \
                 np.array([[1.],\n [2.],\n [{i}.]])\nerror: 0.{i} px at 10:28:59.1\n"
            )
        };
        let tracks = read("views.txt", &[1, 2, 3, 4].map(block).concat());
        let [track] = tracks.as_slice() else { panic!("{tracks:?}") };
        let Numbers::Matrix(m) = track.samples[3].numbers else { panic!("{track:?}") };
        assert_eq!([m[(0, 1)], m[(1, 3)], m[(2, 3)]], [-1.0, 2.0, 4.0]);
        assert_eq!(track.samples[3].image.as_deref(), Some("cam/4.png"));
        assert_eq!(track.samples.len(), 4);
    }

    #[test]
    fn a_name_with_a_number_above_a_matrix_counts_it() {
        let block = |i: usize| format!("Robot pose {i}\n1 0 0 {i}\n0 1 0 5\n0 0 1 6\n0 0 0 1\n");
        let tracks = read("views.txt", &[3, 5, 8].map(block).concat());
        let [track] = tracks.as_slice() else { panic!("{tracks:?}") };
        assert_eq!(track.samples.iter().map(|s| s.number).collect::<Vec<_>>(), [Some(3), Some(5), Some(8)]);
        assert_eq!((track.name.as_str(), track.role), ("views.txt:Robot_pose", Role::Robot));
    }

    #[test]
    fn names_before_numbers_say_what_they_are() {
        let fields = tree::fields(&document("rvec 3.05 -0.85 0.11\ntvec 64.6 -133.2 421.5\n").expect("fields"));
        let [(path, numbers, stated)] = fields.poses.as_slice() else { panic!("{fields:?}") };
        assert_eq!(*numbers, Numbers::Angles([64.6, -133.2, 421.5, 3.05, -0.85, 0.11]));
        assert_eq!(path, "rvec+tvec");
        assert_eq!(stated.rotation.as_ref().map(|known| known.value.clone()), Some(vec![RotationForm::Vector]));
        let fields = tree::fields(&document("x=1, y=2, z=3\nrx: 4\nry: 5\nrz: 6").expect("fields"));
        assert_eq!(fields.poses[0].1, Numbers::Angles([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    }

    #[test]
    fn prose_has_no_poses() {
        for text in ["", "we took 20 images\nof 11 8 corners of 20 mm\n", "1 2 3\n4 5 6\n"] {
            assert!(document(text).is_none_or(|value| tree::series(&value, "notes.txt").is_empty()), "{text:?}");
        }
    }
}
