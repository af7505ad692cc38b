//! JSON, YAML and other formats as one tree, within bounds: files come from strangers.

use std::cell::Cell;
use std::fmt;

use saphyr_parser::{Event, Parser, ScalarStyle};
use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};

use handeye_wording::Text;
use handeye_wording::foreign;
use handeye_wording::text;

/// Deepest nesting that is read; recordings have four or five levels.
pub(super) const MAX_DEPTH: usize = 32;
/// Most values in one file: ten thousand poses as 4×4 matrices.
pub(super) const MAX_VALUES: usize = 1_000_000;

/// A value of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// Null or an alias: not part of a pose.
    Other,
    Flag(bool),
    Number(f64),
    Text(String),
    List(Vec<Value>),
    /// In the order of the file; a key may be there twice.
    Map(Vec<(String, Value)>),
}

impl Value {
    /// The value of a key, ignoring case.
    pub fn get(&self, key: &str) -> Option<&Value> {
        let Self::Map(entries) = self else { return None };
        entries.iter().find(|(name, _)| name.eq_ignore_ascii_case(key)).map(|(_, value)| value)
    }

    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    pub fn flag(&self) -> Option<bool> {
        match self {
            Self::Flag(flag) => Some(*flag),
            _ => None,
        }
    }

    pub fn list(&self) -> &[Value] {
        match self {
            Self::List(items) => items,
            _ => &[],
        }
    }

    /// A whole number that is not negative.
    pub fn whole(&self) -> Option<u64> {
        self.number().filter(|n| *n >= 0.0 && n.fract() == 0.0 && *n < 1e15).map(|n| n as u64)
    }

    /// The numbers of a list of numbers, of lists of them, or of a matrix as OpenCV writes it, at most `most`; `None` when
    /// anything else is among them.
    pub fn numbers(&self, most: usize) -> Option<Vec<f64>> {
        let mut numbers = Vec::new();
        let whole = match self {
            Self::Map(_) => self.get("rows").and(self.get("cols")).and(self.get("data"))?,
            other => other,
        };
        collect(whole, most, &mut numbers)?;
        (!numbers.is_empty()).then_some(numbers)
    }

    /// The rows of a matrix as OpenCV writes it that is a table, with the channels of an entry in adjacent columns; up to four
    /// rows are a single matrix.
    pub fn matrix_rows(&self) -> Option<Value> {
        const MOST_ROWS_OF_A_MATRIX: u64 = 4;
        let rows = self.get("rows")?.whole().filter(|rows| *rows > MOST_ROWS_OF_A_MATRIX)?;
        let data = self.get("cols").and(self.get("data"))?.list();
        let rows = usize::try_from(rows).ok().filter(|rows| data.len().is_multiple_of(*rows))?;
        let width = data.len() / rows;
        (3..=16)
            .contains(&width)
            .then(|| Value::List(data.chunks_exact(width).map(|row| Value::List(row.to_vec())).collect()))
    }
}

fn collect(value: &Value, most: usize, numbers: &mut Vec<f64>) -> Option<()> {
    match value {
        Value::Number(number) if numbers.len() < most => {
            numbers.push(*number);
            Some(())
        }
        Value::List(items) => items.iter().try_for_each(|item| collect(item, most, numbers)),
        _ => None,
    }
}

/// Reads JSON; several consecutive values, for example one record per line, are a list.
pub(super) fn json(text: &str) -> Result<Value, Text> {
    let mut left = MAX_VALUES;
    let mut values = Vec::new();
    for record in serde_json::Deserializer::from_str(text).into_iter::<Record>() {
        let Record { value, count } = record.map_err(|e| refused(&e))?;
        left = left.checked_sub(count).ok_or_else(too_many)?;
        values.push(value);
    }
    match values.len() {
        0 => Err(text!("is empty")),
        1 => Ok(values.swap_remove(0)),
        _ => Ok(Value::List(values)),
    }
}

/// Why serde reads no further. What is ours of it comes back with its place.
fn refused(error: &serde_json::Error) -> Text {
    let reported = error.to_string();
    let ours = [too_many(), too_deep()].into_iter().find(|why| reported.starts_with(&why.to_string()));
    ours.filter(|_| error.line() > 0).map_or_else(
        || foreign(error),
        |why| text!("{why} at line {line} column {column}", why = why, line = error.line(), column = error.column()),
    )
}

/// A value of JSON with how many there are in it. What is too much is found while it is read, so that it takes no memory.
struct Record {
    value: Value,
    count: usize,
}

impl<'de> Deserialize<'de> for Record {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let left = Cell::new(MAX_VALUES);
        let value = Json { depth: 0, left: &left }.deserialize(deserializer)?;
        Ok(Self { value, count: MAX_VALUES - left.get() })
    }
}

/// Reads a value of JSON at some depth, with a limit on the values.
#[derive(Clone, Copy)]
struct Json<'a> {
    depth: usize,
    left: &'a Cell<usize>,
}

impl Json<'_> {
    fn inner<E: de::Error>(self) -> Result<Self, E> {
        let depth = self.depth + 1;
        if depth > MAX_DEPTH { Err(E::custom(too_deep())) } else { Ok(Self { depth, ..self }) }
    }
}

impl<'de> DeserializeSeed<'de> for Json<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        let left = self.left.get().checked_sub(1).ok_or_else(|| de::Error::custom(too_many()))?;
        self.left.set(left);
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Json<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Other)
    }

    fn visit_bool<E>(self, flag: bool) -> Result<Value, E> {
        Ok(Value::Flag(flag))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Value, E> {
        Ok(Value::Number(number as f64))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Value, E> {
        Ok(Value::Number(number as f64))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Value, E> {
        Ok(Value::Number(number))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let inner = self.inner()?;
        let mut items = Vec::new();
        while let Some(item) = access.next_element_seed(inner)? {
            items.push(item);
        }
        Ok(Value::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let inner = self.inner()?;
        let mut entries = Vec::new();
        while let Some(key) = access.next_key::<String>()? {
            entries.push((key, access.next_value_seed(inner)?));
        }
        Ok(Value::Map(entries))
    }
}

fn too_many() -> Text {
    text!("has more than {most} values", most = MAX_VALUES)
}

fn too_deep() -> Text {
    text!("is nested more than {most} levels deep", most = MAX_DEPTH)
}

/// Reads YAML: the documents of a file, one after the other. Tags are ignored; an alias is ignored, so that no file
/// grows when it is read.
pub(super) fn yaml(text: &str) -> Result<Vec<Value>, Text> {
    // OpenCV writes a first line that no version of YAML allows: `%YAML:1.0`.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, rest)| rest),
        None => text,
    };
    let mut parser = Parser::new_from_str(text);
    let mut documents = Vec::new();
    let mut open: Vec<Open> = Vec::new();
    let mut values = 0;
    while let Some(event) = parser.next_event() {
        let (event, _) = event.map_err(|e| foreign(&e))?;
        values += 1;
        if values > 2 * MAX_VALUES {
            return Err(too_many());
        }
        if open.len() > MAX_DEPTH {
            return Err(too_deep());
        }
        let done = match event {
            Event::SequenceStart(..) => {
                open.push(Open::List(Vec::new()));
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(Vec::new(), None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(items)) => Value::List(items),
                Some(Open::Map(entries, _)) => Value::Map(entries),
                None => continue,
            },
            Event::Scalar(text, style, ..) => scalar(&text, style),
            Event::Alias(_) => Value::Other,
            _ => continue,
        };
        match open.last_mut() {
            None => documents.push(done),
            Some(Open::List(items)) => items.push(done),
            Some(Open::Map(entries, key)) => match key.take() {
                Some(key) => entries.push((key, done)),
                None => *key = Some(as_key(done)),
            },
        }
    }
    Ok(documents)
}

/// The collection that is being read.
enum Open {
    List(Vec<Value>),
    /// And the key whose value comes next.
    Map(Vec<(String, Value)>, Option<String>),
}

fn as_key(value: Value) -> String {
    match value {
        Value::Text(text) => text,
        Value::Number(number) => number.to_string(),
        _ => String::new(),
    }
}

fn scalar(text: &str, style: ScalarStyle) -> Value {
    if style != ScalarStyle::Plain {
        return Value::Text(text.to_owned());
    }
    match text {
        "" | "~" | "null" => Value::Other,
        "true" | "True" => Value::Flag(true),
        "false" | "False" => Value::Flag(false),
        ".nan" | ".NaN" | ".Nan" => Value::Number(f64::NAN),
        _ => number(text).map_or_else(|| Value::Text(text.to_owned()), Value::Number),
    }
}

/// A number as people and programs write it: `1.`, `.5`, `1e-3`, `+2`; not `inf` and not `nan`.
pub(super) fn number(text: &str) -> Option<f64> {
    let first = text.bytes().find(|b| !matches!(b, b'+' | b'-'))?;
    (first.is_ascii_digit() || first == b'.').then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_that_opencv_writes_and_its_matrices_are_read() {
        let text = "%YAML:1.0\n---\nframeCount: 2\nT1_0: !!opencv-matrix\n   rows: 2\n   cols: 2\n   dt: d\n   \
                    data: [ 1., 2.5e-01,\n       -3., .5 ]\n";
        let documents = yaml(text).expect("read");
        let matrix = documents[0].get("T1_0").expect("there").numbers(16);
        assert_eq!(matrix, Some(vec![1.0, 0.25, -3.0, 0.5]));
        assert_eq!(documents[0].get("framecount").and_then(Value::whole), Some(2));
    }

    #[test]
    fn a_record_to_a_line_is_a_list() {
        let records = json("{\"a\": 1}\n{\"a\": 2}\n").expect("read");
        assert_eq!(records.list().len(), 2);
        assert!(json("{\"a\": 1}\n{\"a\": ").is_err() && json("").is_err());
    }

    #[test]
    fn what_is_nested_too_deep_or_refers_to_itself_is_no_danger() {
        for text in ["[".repeat(50_000), "- ".repeat(50_000), "{a: ".repeat(50_000)] {
            assert!(yaml(&text).is_err(), "{} brackets", text.len());
            assert!(json(&text).is_err());
        }
        let why = json(&"[".repeat(50)).expect_err("too deep").to_string();
        assert_eq!(why, format!("is nested more than {MAX_DEPTH} levels deep at line 1 column {}", MAX_DEPTH + 1));
        let laughs = "a: &a [1, 1]\nb: &b [*a, *a]\nc: [*b, *b]\n";
        let documents = yaml(laughs).expect("read");
        assert_eq!(documents[0].get("c"), Some(&Value::List(vec![Value::Other, Value::Other])));
    }

    /// Were any of these read in time that grows with the square of its length, this test would take hours.
    #[test]
    fn what_is_written_to_take_for_ever_is_refused_at_once() {
        for text in [format!("[{}1]", "1,".repeat(2 * MAX_VALUES)), "1 ".repeat(2 * MAX_VALUES)] {
            assert!(json(&text).is_err_and(|why| why.to_string().contains("more than")), "{}", &text[..20]);
        }
    }

    #[test]
    fn json_and_yaml_give_the_same_tree() {
        let text = r#"{"name": "a.png", "nested": {"q": [[1, 0], [0, 1]]}, "pose": [0.1, -2e-3, 3]}"#;
        assert_eq!(yaml(text).expect("read"), [json(text).expect("read")]);
    }
}
