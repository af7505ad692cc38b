//! Poses in robot programs, whose languages define the meaning of their numbers: URScript's `p[…]`, frames of KUKA's KRL,
//! positions of FANUC and robtargets of ABB's RAPID.

use std::sync::Arc;

use super::Encoding::{self, Own};
use super::{File, Format, tree};
use crate::conventions::{AngleUnit, Euler, LengthUnit, RotationForm, is_unit};
use crate::formats::reader::Reader;
use crate::recording::{Known, Numbers, Role, Sample, Stated, Track};
use crate::value::number;
use handeye_wording::Text;
use handeye_wording::text;

/// Most poses of one file.
const MOST_POSES: usize = 100_000;

pub(super) struct Programs;

impl Format for Programs {
    fn name(&self) -> Text {
        text!("robot programs")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        &[("script", Own), ("src", Own), ("mod", Own), ("ls", Own)]
    }

    fn sniff(&self, file: &File) -> bool {
        file.text().is_some() || self.has_ending(file)
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let own = if file.text().is_none() { reader.text(&file.path) } else { None };
        let track = file.text().or(own.as_deref()).and_then(|text| read(&file.name(), text));
        let is_so = track.is_some();
        reader.recording.tracks.extend(track);
        is_so
    }
}

/// Languages, with the conventions of their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Language {
    UrScript,
    Krl,
    Fanuc,
    Rapid,
}

impl Language {
    const ALL: [Self; 4] = [Self::UrScript, Self::Krl, Self::Fanuc, Self::Rapid];

    fn stated(self) -> Stated {
        let (name, length, form, angle) = match self {
            Self::UrScript => ("URScript's p[…]", LengthUnit::Metre, RotationForm::Vector, Some(AngleUnit::Radian)),
            Self::Krl => {
                ("a frame of KRL", LengthUnit::Millimetre, RotationForm::Euler(Euler::KUKA), Some(AngleUnit::Degree))
            }
            Self::Fanuc => (
                "a position of FANUC",
                LengthUnit::Millimetre,
                RotationForm::Euler(Euler::RPY),
                Some(AngleUnit::Degree),
            ),
            Self::Rapid => ("a robtarget of RAPID", LengthUnit::Millimetre, RotationForm::Wxyz, None),
        };
        Stated {
            length: Some(Known::by(name, length)),
            rotation: Some(Known::by(name, vec![form])),
            angle: angle.map(|unit| Known::by(name, unit)),
            ..Stated::default()
        }
    }

    /// The pose that begins with a piece of a text, if one does; `before` is the text before it on its line.
    fn pose(self, before: &str, rest: &str) -> Option<Numbers> {
        match self {
            Self::UrScript => {
                let inner = rest.strip_prefix("p[")?.split(']').next()?;
                let numbers: Vec<f64> = inner.split(',').map(|word| number(word.trim())).collect::<Option<_>>()?;
                Some(Numbers::Angles(numbers.try_into().ok()?))
            }
            // Neither is what a person may write in braces with units of one's own.
            Self::Krl => by_keys(rest, ["X", "Y", "Z", "A", "B", "C"], |inner| !inner.contains([':', '=', '"'])),
            Self::Fanuc => by_keys(rest, ["X", "Y", "Z", "W", "P", "R"], |inner| inner.contains("mm")),
            Self::Rapid => {
                if !before.to_lowercase().contains("robtarget") {
                    return None;
                }
                let (place, rest) = rest.strip_prefix("[[")?.split_once(']')?;
                let turn = rest.trim_start().strip_prefix(',')?.trim_start().strip_prefix('[')?.split(']').next()?;
                let numbers: Vec<f64> =
                    place.split(',').chain(turn.split(',')).map(|word| number(word.trim())).collect::<Option<_>>()?;
                let numbers: [f64; 7] = numbers.try_into().ok()?;
                is_unit(&numbers[3..]).then_some(Numbers::Quaternion(numbers))
            }
        }
    }
}

/// Numbers behind their names in braces, `{X 1.0, Y 2.0, …}` or `X = 1.0 mm`.
fn by_keys(rest: &str, keys: [&str; 6], is_so: impl Fn(&str) -> bool) -> Option<Numbers> {
    let inner = rest.strip_prefix('{')?.split(['{', '}']).next().filter(|inner| is_so(inner))?;
    let words: Vec<&str> = inner
        .split(|c: char| c.is_whitespace() || matches!(c, ',' | '=' | ':'))
        .filter(|word| !word.is_empty())
        .collect();
    let value = |key: &str| words.windows(2).find(|pair| pair[0] == key).and_then(|pair| number(pair[1]));
    let mut numbers = [0.0; 6];
    for (slot, key) in numbers.iter_mut().zip(keys) {
        *slot = value(key)?;
    }
    Some(Numbers::Angles(numbers))
}

/// The series of poses of a program; `None` when it is not one.
fn read(file: &str, text: &str) -> Option<Track> {
    Language::ALL.into_iter().find_map(|language| {
        let begins: &[char] = if language == Language::UrScript { &['p'] } else { &['{', '['] };
        let mut samples = Vec::new();
        let mut row = 1;
        let mut counted_to = 0;
        for (at, _) in text.match_indices(begins).take(MOST_POSES) {
            let (before, rest) = around(text, at);
            let line = before.rfind('\n').map_or(before, |i| &before[i + 1..]);
            let Some(numbers) = language.pose(line, rest) else { continue };
            row += text[counted_to..at].matches('\n').count();
            counted_to = at;
            samples.push(Sample {
                image: image_near(text, at),
                number: None,
                place: Arc::new(text!("{file}, row {row}", file = file, row = row)),
                numbers,
                joints: Vec::new(),
            });
        }
        let mut track = tree::track(file.to_owned(), file, language.stated(), samples)?;
        track.role = if tree::is_of_target(file) { Role::Target } else { Role::Robot };
        Some(track)
    })
}

/// The text before and after a place, no more than a pose with its line has: a long line is not read again and again.
fn around(text: &str, at: usize) -> (&str, &str) {
    const MOST: usize = 1000;
    let start = text.ceil_char_boundary(at.saturating_sub(MOST));
    let end = text.floor_char_boundary(at.saturating_add(MOST));
    (&text[start..at], &text[at..end])
}

/// The name of an image on the line of a pose.
fn image_near(text: &str, at: usize) -> Option<String> {
    let (before, rest) = around(text, at);
    let before = before.rfind('\n').map_or(before, |i| &before[i + 1..]);
    let rest = rest.find('\n').map_or(rest, |i| &rest[..i]);
    let line = format!("{before}{rest}");
    let words = line.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';' | '"' | '\'' | '(' | ')' | '[' | ']'));
    words.filter(|word| tree::is_image_name(word)).map(str::to_owned).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(text: &str) -> (Numbers, Stated) {
        let track = read("poses.txt", text).expect("poses");
        assert_eq!(track.samples.len(), 3);
        (track.samples[0].numbers, track.stated)
    }

    fn reported(stated: &Stated) -> (LengthUnit, RotationForm, Option<AngleUnit>) {
        let form = stated.rotation.as_ref().expect("said").value[0];
        (stated.length.as_ref().expect("said").value, form, stated.angle.as_ref().map(|known| known.value))
    }

    #[test]
    fn every_language_gives_its_numbers_with_what_they_mean() {
        let three = |row: &dyn Fn(usize) -> String| (0..3).map(row).collect::<Vec<_>>().join("\n");
        let (numbers, stated) =
            first(&three(&|i| format!("  movej(p[0.1, -0.2, 0.{i}, 1.5, 0, -3e-1], a=1.4) # a{i}.png")));
        assert_eq!(numbers, Numbers::Angles([0.1, -0.2, 0.0, 1.5, 0.0, -0.3]));
        assert_eq!(reported(&stated), (LengthUnit::Metre, RotationForm::Vector, Some(AngleUnit::Radian)));
        let krl = "DECL E6POS XP";
        let (numbers, stated) =
            first(&three(&|i| format!("{krl}{i}={{X 400.5,Y {i},Z 300.0,A 90.0,B -1.5,C 180.0,S 2,T 10,E1 0.0}}")));
        assert_eq!(numbers, Numbers::Angles([400.5, 0.0, 300.0, 90.0, -1.5, 180.0]));
        assert_eq!(
            reported(&stated),
            (LengthUnit::Millimetre, RotationForm::Euler(Euler::KUKA), Some(AngleUnit::Degree))
        );
        let (numbers, stated) = first(&three(&|i| {
            format!(
                "P[{i}]{{\n GP1:\n  UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',\n  X = {i}.5 mm, Y = -20 mm, Z = 3 mm,\n  \
                 W = 179.0 deg, P = .5 deg, R = -90 deg\n}};"
            )
        }));
        assert_eq!(numbers, Numbers::Angles([0.5, -20.0, 3.0, 179.0, 0.5, -90.0]));
        assert_eq!(
            reported(&stated),
            (LengthUnit::Millimetre, RotationForm::Euler(Euler::RPY), Some(AngleUnit::Degree))
        );
        let (numbers, stated) = first(&three(&|i| {
            format!("CONST robtarget p{i}:=[[600.0,{i},700],[0.6,0,0.8,0],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];")
        }));
        assert_eq!(numbers, Numbers::Quaternion([600.0, 0.0, 700.0, 0.6, 0.0, 0.8, 0.0]));
        assert_eq!(reported(&stated), (LengthUnit::Millimetre, RotationForm::Wxyz, None));
    }

    #[test]
    fn a_pose_of_a_program_has_the_image_of_its_line() {
        let rows = (0..3).map(|i| format!("view_{i}.png, p[0.{i}, 0, 0, 0, 0, 0]")).collect::<Vec<_>>().join("\n");
        let track = read("poses.txt", &rows).expect("poses");
        assert_eq!(track.samples[2].image.as_deref(), Some("view_2.png"));
        assert_eq!(track.samples[2].place.to_string(), "poses.txt, row 3");
        let lists = "[[600.0,1,700],[0.6,0,0.8,0]]\n".repeat(2) + "[[600.0,2,700],[0.6,0,0.8,0]]";
        assert!(
            read("poses.txt", &lists).is_none(),
            "lists of Python say neither millimetres nor the order of a quaternion"
        );
        assert!(read("poses.txt", "1,2,3,4,5,6\n2,3,4,5,6,7\n3,4,5,6,7,8").is_none());
    }
}
