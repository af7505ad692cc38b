use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::*;

#[test]
fn a_text_is_said_in_the_language_with_its_values() {
    let reason = Text::verbatim("no answer {code}");
    let text = crate::text!("No {thing} {why}.", thing = 3, why = reason);
    assert_eq!(text.say(Language::English), "No 3 no answer {code}.", "values are not templates");
    let kept: Text = serde_json::from_str(&serde_json::to_string(&text).expect("json")).expect("text");
    assert_eq!(kept, text);
}

#[test]
fn a_noun_is_singular_where_its_count_is_one_and_chinese_has_one_form() {
    for (count, english) in [(0, "0 captures"), (1, "1 capture"), (2, "2 captures"), (11, "11 captures")] {
        let text = crate::text!("{count} {count|capture|captures}", count = count);
        assert_eq!(text.say(Language::English), english);
        assert_eq!(text.say(Language::Chinese), format!("{count} 次采集"));
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && !path.to_string_lossy().ends_with("text_tests.rs")
        {
            found.push(path);
        }
    }
}

/// The first string literal after a position, unescaped; `None` when something else comes first.
fn literal(source: &str) -> Option<String> {
    let start = source.find('"')?;
    let mut said = String::new();
    let mut letters = source[start + 1..].chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' => return Some(said),
            '\\' => match letters.next()? {
                'n' => said.push('\n'),
                // A line that goes on: the indentation of the next one does not count.
                '\n' => while letters.next_if(|next| next.is_whitespace()).is_some() {},
                other => said.push(other),
            },
            other => said.push(other),
        }
    }
    None
}

/// Every text in the sources with the places where it stands.
fn texts() -> BTreeMap<String, PathBuf> {
    let mut files = Vec::new();
    for folder in ["src", "../core/src"] {
        sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut files);
    }
    let mut texts = BTreeMap::new();
    for file in files {
        let source = std::fs::read_to_string(&file).expect("a source");
        for macro_name in ["tr!(", "text!("] {
            for (at, _) in source.match_indices(macro_name) {
                let before = source[..at].chars().next_back();
                if before.is_some_and(|letter| letter.is_alphanumeric() || letter == '_') {
                    continue;
                }
                if let Some(found) = literal(&source[at..]) {
                    texts.insert(found, file.clone());
                }
            }
        }
    }
    texts
}

fn placeholders(text: &str) -> BTreeSet<&str> {
    text.split('{')
        .skip(1)
        .filter_map(|part| part.split_once('}'))
        .map(|(name, _)| name.split('|').next().unwrap_or_default())
        .collect()
}

#[test]
fn every_text_of_the_window_is_there_in_chinese_with_the_same_values() {
    let texts = texts();
    let missing: Vec<String> = texts
        .iter()
        .filter(|(text, _)| !text.is_empty() && !chinese().contains_key(*text))
        .map(|(text, file)| format!("{text:?} ({})", file.file_name().unwrap_or_default().to_string_lossy()))
        .collect();
    assert!(missing.is_empty(), "no translation for:\n{}", missing.join("\n"));
    for (english, chinese) in chinese() {
        assert_eq!(placeholders(english), placeholders(chinese), "{english:?}");
        assert!(texts.contains_key(english), "nobody says {english:?} now");
    }
}

#[test]
fn every_catalogue_can_be_read_and_no_text_is_there_twice() {
    let mut all = BTreeSet::new();
    for (file, content) in CHINESE {
        let part: BTreeMap<String, String> = toml::from_str(content).expect(file);
        for english in part.into_keys() {
            assert!(all.insert(english.clone()), "{file}: {english:?} is there twice");
        }
    }
}
