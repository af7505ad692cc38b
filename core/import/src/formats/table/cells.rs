//! A text as rows of cells, whatever separates them.

use crate::value::number;

/// Most numbers in a row that are read.
const MOST_COLUMNS: usize = 64;

/// A line as cells.
pub(super) struct Line {
    /// From 1.
    pub row: usize,
    pub cells: Vec<String>,
}

impl Line {
    pub fn numbers(&self) -> Vec<f64> {
        self.cells.iter().filter_map(|cell| number(cell)).collect()
    }

    pub fn is_numeric(&self) -> bool {
        let numbers = self.numbers().len();
        numbers >= 3 && numbers + 2 >= self.cells.len()
    }
}

/// Lines with something in them, cut into cells by the delimiter that the whole text has.
pub(super) fn lines(text: &str) -> Vec<Line> {
    let delimiter = delimiter(text);
    let mut lines = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let trimmed = line.trim();
        // `rostopic echo -p` begins its header with a sign that is one of comments elsewhere.
        let trimmed = trimmed.strip_prefix("%time").map_or(trimmed, |_| &trimmed[1..]);
        let is_comment = trimmed.starts_with("//") || trimmed.starts_with('%');
        // A header may be a comment.
        let trimmed = trimmed.trim_start_matches('#').trim();
        if trimmed.is_empty() || is_comment {
            continue;
        }
        let cells = cells(trimmed, delimiter);
        if cells.len() <= MOST_COLUMNS {
            lines.push(Line { row: i + 1, cells });
        }
    }
    lines
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Delimiter {
    One(u8),
    /// With commas for points.
    Semicolon,
    Spaces,
}

fn delimiter(text: &str) -> Delimiter {
    let lines: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty()).take(50).collect();
    let most = |sign: char| lines.iter().filter(|line| line.contains(sign)).count() * 2 > lines.len();
    if most(';') {
        return Delimiter::Semicolon;
    }
    if most('\t') {
        return Delimiter::One(b'\t');
    }
    if most(',') { Delimiter::One(b',') } else { Delimiter::Spaces }
}

/// Brackets around numbers, as Python prints lists, are nothing; those in names and units stay.
fn without_brackets(line: &str) -> String {
    let mut lists = lists(line).into_iter().rev();
    let mut out = String::with_capacity(line.len());
    let mut open = Vec::new();
    for c in line.chars() {
        match c {
            '[' | '{' | '(' => {
                let is_list = lists.next().unwrap_or(false);
                open.push(is_list);
                out.push(if is_list { ' ' } else { c });
            }
            ']' | '}' | ')' => out.push(if open.pop().unwrap_or(true) { ' ' } else { c }),
            _ => out.push(c),
        }
    }
    out
}

/// For every opening bracket, the last one first, whether a list begins there: a number, and a separator between it and the next
/// closing bracket. A single number in parentheses is part of a name, for example of a copy. A line is read once, from its end,
/// however many brackets it has.
fn lists(line: &str) -> Vec<bool> {
    let mut lists = Vec::new();
    // For the text up to the next closing bracket: whether there is any, whether it begins with a blank, whether it has a
    // separator.
    let (mut has_more, mut is_after_blank, mut is_parted) = (false, false, false);
    let mut next = None;
    for c in line.chars().rev() {
        if matches!(c, '[' | '{' | '(') {
            let starts_number = next.is_some_and(|c: char| c.is_ascii_digit() || "+-.[(".contains(c));
            lists.push(starts_number && is_parted);
        }
        if matches!(c, ']' | '}' | ')') {
            (has_more, is_after_blank, is_parted) = (false, false, false);
        } else if matches!(c, ' ' | '\t') {
            is_after_blank |= has_more;
        } else if !c.is_whitespace() {
            is_parted |= is_after_blank || matches!(c, ',' | ';');
            has_more = true;
        }
        if !c.is_whitespace() {
            next = Some(c);
        }
    }
    lists
}

fn cells(line: &str, delimiter: Delimiter) -> Vec<String> {
    let line = without_brackets(line);
    let line = line.trim();
    let tidy = |cell: &str| cell.trim().trim_matches(['"', '\'']).to_owned();
    let split = |line: &str, by: u8| -> Vec<String> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(by)
            .trim(csv::Trim::All)
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        match reader.read_record(&mut record) {
            Ok(true) => record.iter().map(str::to_owned).collect(),
            _ => Vec::new(),
        }
    };
    let mut cells: Vec<String> = match delimiter {
        Delimiter::Spaces => line.split_whitespace().map(tidy).collect(),
        Delimiter::One(by) => split(line, by).iter().map(|cell| tidy(cell)).collect(),
        Delimiter::Semicolon => {
            let cells: Vec<String> = split(line, b';').iter().map(|cell| tidy(cell)).collect();
            let with_comma = |cell: &String| {
                if cell.matches(',').count() == 1 && number(&cell.replace(',', ".")).is_some() {
                    cell.replace(',', ".")
                } else {
                    cell.clone()
                }
            };
            cells.iter().map(with_comma).collect()
        }
    };
    // A delimiter at the end of every line, and blanks among commas.
    let looks_spaced = |cell: &String| cell.contains(' ') && cell.split_whitespace().all(|word| number(word).is_some());
    if cells.iter().any(looks_spaced) {
        cells = cells
            .iter()
            .flat_map(|cell| {
                if looks_spaced(cell) {
                    cell.split_whitespace().map(str::to_owned).collect()
                } else {
                    vec![cell.clone()]
                }
            })
            .collect();
    }
    while cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_around_lists_are_nothing_and_those_of_names_stay() {
        for (line, without) in [
            ("[1, 2]", " 1, 2 "),
            ("[ 1 2 ]", "  1 2  "),
            ("[1]", "[1]"),
            ("[ 1 ]", "[ 1 ]"),
            ("image (2).png", "image (2).png"),
            ("[[1, 2], [3, 4]]", "  1, 2 ,  3, 4  "),
            ("x (mm), y (mm)", "x (mm), y (mm)"),
            ("a) 1", "a  1"),
            ("(-1;2) {3\t4}", " -1;2   3\t4 "),
        ] {
            assert_eq!(without_brackets(line), without, "{line}");
        }
    }

    /// With two thousand times as many brackets the work is two thousand times as much; were it quadratic, this test would take
    /// hours.
    #[test]
    fn a_line_of_brackets_is_read_once() {
        let line = "(".repeat(4_000_000);
        assert!(without_brackets(&line).len() == line.len());
    }
}
