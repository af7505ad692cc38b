//! JSON for people and programs: one key per line, a row of numbers on one line.

use serde::Serialize;

/// Pretty JSON with a line end; arrays without arrays or objects inside are kept on one line.
pub fn pretty(value: &impl Serialize) -> serde_json::Result<String> {
    let mut text = join_flat_arrays(&serde_json::to_string_pretty(value)?);
    text.push('\n');
    Ok(text)
}

fn join_flat_arrays(pretty: &str) -> String {
    let mut out = String::with_capacity(pretty.len());
    let mut rest = pretty;
    while let Some(at) = find_outside_strings(rest, &['[']) {
        let (before, array) = rest.split_at(at);
        out.push_str(before);
        match find_outside_strings(&array[1..], &['[', '{', ']']) {
            Some(end) if array.as_bytes()[end + 1] == b']' => {
                let (flat, after) = array.split_at(end + 2);
                // Strings hold no line ends in JSON, so a trimmed line is all of an element.
                let elements: Vec<&str> = flat[1..flat.len() - 1].lines().map(str::trim).collect();
                out.push('[');
                out.push_str(elements.join(" ").trim());
                out.push(']');
                rest = after;
            }
            _ => {
                out.push('[');
                rest = &array[1..];
            }
        }
    }
    out.push_str(rest);
    out
}

fn find_outside_strings(text: &str, wanted: &[char]) -> Option<usize> {
    let (mut in_string, mut escaped) = (false, false);
    for (at, c) in text.char_indices() {
        if in_string {
            match c {
                _ if escaped => escaped = false,
                '\\' => escaped = true,
                '"' => in_string = false,
                _ => {}
            }
        } else if c == '"' {
            in_string = true;
        } else if wanted.contains(&c) {
            return Some(at);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn rows_of_numbers_stay_on_one_line_and_nothing_changes() {
        let value = json!({
            "empty": [], "flat": [1.5, -2, null], "matrix": [[1, 2], [3, 4]],
            "text": "a [\"b\", \\", "texts": ["[x", "y]\"", "  two  spaces "], "objects": [{"k": [7]}]
        });
        let text = pretty(&value).expect("text");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).expect("JSON"), value);
        assert!(text.contains("\"flat\": [1.5, -2, null]"), "{text}");
        assert!(text.contains("    [1, 2],\n    [3, 4]\n"), "{text}");
        assert!(text.contains("\"empty\": []"), "{text}");
    }
}
