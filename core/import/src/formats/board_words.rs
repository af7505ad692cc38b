//! A board in the settings of an unknown script. Such field names have no standard: whether inner corners or squares are
//! counted, and the unit of lengths, is left to the user, who gets a message about what to give.

use super::{File, Format};
use crate::formats::reader::Reader;
use crate::value::Value;
use handeye_wording::Text;
use handeye_wording::text;

/// Rows or columns of a board; images are larger.
const MOST: f64 = 60.0;
/// Settings are not nested deeper.
const DEEPEST: usize = 4;

const SIZES: [&str; 8] =
    ["chessboard", "checkerboard", "checker_board", "board", "pattern", "grid_size", "inner_corners", "corners"];
const COLUMNS: [&str; 12] = [
    "columns",
    "cols",
    "num_cols",
    "squares_x",
    "squaresx",
    "board_squaresx",
    "board_width",
    "corners_x",
    "num_corners_x",
    "nx",
    "xx",
    "width_corners",
];
const ROWS: [&str; 12] = [
    "rows",
    "row",
    "num_rows",
    "squares_y",
    "squaresy",
    "board_squaresy",
    "board_height",
    "corners_y",
    "num_corners_y",
    "ny",
    "yy",
    "height_corners",
];

pub(super) struct BoardWords;

impl Format for BoardWords {
    fn name(&self) -> Text {
        text!("a board in settings")
    }

    fn is_of_poses(&self) -> bool {
        false
    }

    fn sniff(&self, file: &File) -> bool {
        file.value().is_some()
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        if reader.recording.targets.is_empty() {
            reader.recording.beliefs.extend(file.value().and_then(|value| stated(value, &file.name())));
        }
        false
    }
}

/// A sentence with the option to give, where a document names rows, columns and a square.
fn stated(value: &Value, file: &str) -> Option<Text> {
    let mut found = Found::default();
    found.look(value, 0);
    let (columns, rows) = found.count?;
    let (square, name) = found.square?;
    let lower = name.to_lowercase();
    // Metres by the name, or because no square is that small in millimetres.
    let is_metres = !lower.contains("mm") && (lower.ends_with("_m") || square < 0.5);
    let square_mm = if is_metres { square * 1e3 } else { square };
    // Three digits after the point are micrometres.
    let square_mm = (square_mm * 1e3).round() / 1e3;
    Some(text!(
        "{file} names a board of {columns} × {rows} and {name} = {square}: if those are inner corners, and that is {square_mm} mm, \
         give --target {columns}x{rows}x{square_mm}",
        file = file,
        columns = columns,
        rows = rows,
        name = name,
        square = square,
        square_mm = square_mm
    ))
}

#[derive(Default)]
struct Found {
    count: Option<(u32, u32)>,
    square: Option<(f64, String)>,
}

impl Found {
    fn look(&mut self, value: &Value, depth: usize) {
        let Value::Map(entries) = value else { return };
        let named = |names: &[&str]| {
            let is_named = |key: &str| names.contains(&key.to_lowercase().as_str());
            entries.iter().find(|(key, _)| is_named(key)).and_then(|(_, value)| count(value))
        };
        if let (None, Some(columns), Some(rows)) = (self.count, named(&COLUMNS), named(&ROWS)) {
            self.count = Some((columns, rows));
        }
        for (key, inner) in entries {
            let lower = key.to_lowercase();
            if self.count.is_none()
                && SIZES.iter().any(|name| lower.contains(name))
                && let [columns, rows] = inner.list()
                && let (Some(columns), Some(rows)) = (count(columns), count(rows))
            {
                self.count = Some((columns, rows));
            }
            let is_square = ["square", "tile", "cell_size", "checker_size"].iter().any(|name| lower.contains(name));
            if self.square.is_none()
                && is_square
                && let Some(length) = inner.number().filter(|length| length.is_finite() && *length > 0.0)
                && !COLUMNS.contains(&lower.as_str())
                && !ROWS.contains(&lower.as_str())
            {
                self.square = Some((length, key.clone()));
            }
            if depth < DEEPEST {
                self.look(inner, depth + 1);
            }
        }
    }
}

fn count(value: &Value) -> Option<u32> {
    let number = value.number().filter(|n| (2.0..=MOST).contains(n) && n.fract() == 0.0)?;
    Some(number as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::{json, yaml};

    #[test]
    fn the_option_to_give_is_told_however_the_fields_are_called() {
        let of_json =
            |text: &str| stated(&json(text).expect("JSON"), "config.json").map(|reported| reported.to_string());
        let reported = of_json(r#"{"camera": {"chessboard_size": [9, 6], "square_size_mm": 25}}"#).expect("a board");
        assert!(
            reported.contains("give --target 9x6x25") && reported.contains("if those are inner corners"),
            "{reported}"
        );
        let reported = of_json(r#"{"board": {"cols": 11, "rows": 8, "square_length": 0.02}}"#).expect("a board");
        assert!(reported.ends_with("--target 11x8x20"), "{reported}");
        let documents = yaml("board_squaresX: 5\nboard_squaresY: 7\nsquare_size_m: 0.0365\n").expect("YAML");
        let reported = stated(&documents[0], "board.yaml").expect("a board").to_string();
        assert!(reported.ends_with("--target 5x7x36.5"), "{reported}");
        // Sizes of images and boards without a square are not targets.
        assert_eq!(of_json(r#"{"board_image": [640, 480], "square_size": 25}"#), None);
        assert_eq!(of_json(r#"{"chessboard_size": [9, 6]}"#), None);
    }
}
