//! How much text can be entered into the window at once. Text layout takes time, and nothing else is drawn meanwhile.

use egui::{Event, ImeEvent, RawInput};

/// Longest text that is typed or pasted within a frame \[letters\]: as long as the longest path.
pub(crate) const MOST_TYPED: usize = 4096;

/// Cuts what is typed and pasted.
pub fn bound(input: &mut RawInput) {
    let mut room = MOST_TYPED;
    for event in &mut input.events {
        let (Event::Text(text)
        | Event::Paste(text)
        | Event::Ime(ImeEvent::Commit(text) | ImeEvent::Preedit { text, .. })) = event
        else {
            continue;
        };
        cut(text, room);
        room -= text.chars().count();
    }
}

/// Cuts a text after this many letters.
pub fn cut(text: &mut String, most: usize) {
    if let Some((end, _)) = text.char_indices().nth(most) {
        text.truncate(end);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Rust files of a folder.
    fn sources(folder: &Path) -> Vec<std::path::PathBuf> {
        let entries = std::fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path());
        let of = |path: std::path::PathBuf| match path.extension() {
            None if path.is_dir() => sources(&path),
            Some(extension) if extension == "rs" => vec![path],
            _ => Vec::new(),
        };
        entries.flat_map(of).collect()
    }

    #[test]
    fn every_field_has_a_longest_text() {
        let mut fields = 0;
        for file in sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
            let text = std::fs::read_to_string(&file).expect("a file");
            for made in text.split("TextEdit::").skip(1).filter(|made| made.contains("line(&mut")) {
                let statement = made.split(';').next().unwrap_or_default();
                // Text that cannot be changed is not a field.
                if !statement.starts_with("multiline(&mut text)") && made.starts_with(['s', 'm']) {
                    fields += 1;
                    assert!(statement.contains(".char_limit("), "{}: {statement}", file.display());
                }
            }
        }
        assert!(fields > 5, "{fields} fields");
    }

    #[test]
    fn what_is_pasted_within_a_frame_is_cut_between_letters() {
        let long = "ä".repeat(900_000);
        let events = vec![Event::Text("abc".to_owned()), Event::Paste(long.clone()), Event::Paste(long)];
        let mut input = RawInput { events, ..RawInput::default() };
        bound(&mut input);
        let lengths: Vec<_> = input
            .events
            .iter()
            .map(|event| match event {
                Event::Text(text) | Event::Paste(text) => text.chars().count(),
                _ => 0,
            })
            .collect();
        assert_eq!(lengths, [3, MOST_TYPED - 3, 0]);
    }
}
