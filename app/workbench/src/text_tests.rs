use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::*;

#[test]
fn a_text_is_said_in_the_language_with_its_values() {
    let reason = Text::verbatim("no answer {code}");
    let text = handeye_wording::text!("No {thing} {why}.", thing = 3, why = reason);
    assert_eq!(text.in_language(Language::English), "No 3 no answer {code}.", "values are not templates");
    let kept: Text = serde_json::from_str(&serde_json::to_string(&text).expect("json")).expect("text");
    assert_eq!(kept, text);
}

#[test]
fn a_noun_is_singular_where_its_count_is_one_and_chinese_has_one_form() {
    for (count, english) in [(0, "0 captures"), (1, "1 capture"), (2, "2 captures"), (11, "11 captures")] {
        let text = handeye_wording::text!("{count} {count|capture|captures}", count = count);
        assert_eq!(text.in_language(Language::English), english);
        assert_eq!(text.in_language(Language::Chinese), format!("{count} 次采集"));
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
    let mut reported = String::new();
    let mut letters = source[start + 1..].chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' => return Some(reported),
            '\\' => match letters.next()? {
                'n' => reported.push('\n'),
                // A continued line: the indentation of the next one does not count.
                '\n' => while letters.next_if(|next| next.is_whitespace()).is_some() {},
                other => reported.push(other),
            },
            other => reported.push(other),
        }
    }
    None
}

/// The folder of the workspace.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("a workspace")
}

fn all_sources() -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    for folder in ["app", "core", "sim_link"] {
        sources(&root().join(folder), &mut files);
    }
    files.retain(|file| file.components().any(|part| part.as_os_str() == "src"));
    let read = |file: PathBuf| std::fs::read_to_string(&file).map(|source| (file, source)).expect("a source");
    files.into_iter().map(read).collect()
}

/// The message of an error as `derive(Localized)` makes a template of it: without the formats of its values.
fn without_formats(message: &str) -> String {
    let parts = message.split('{').enumerate();
    let part = |(at, part): (usize, &str)| match part.split_once('}') {
        Some((value, after)) if at > 0 => format!("{{{}}}{after}", value.split(':').next().unwrap_or_default()),
        _ => part.to_owned(),
    };
    parts.map(part).collect()
}

/// Whether there is anything to translate: not in `{place}: {problem}`.
fn has_words(text: &str) -> bool {
    let mut rest = text.split('{');
    let first = rest.next().unwrap_or_default();
    let after = rest.map(|part| part.split_once('}').map_or(part, |(_, after)| after));
    std::iter::once(first).chain(after).any(|words| words.contains(char::is_alphabetic))
}

/// The messages of errors that reach the window, with the places where they are defined.
fn errors() -> BTreeMap<String, PathBuf> {
    let mut errors = BTreeMap::new();
    for (file, source) in all_sources().into_iter().filter(|(_, source)| source.contains("Localized)]")) {
        for (at, attribute) in source.match_indices("#[error(") {
            let message = source[at + attribute.len()..].trim_start();
            if message.starts_with('"')
                && let Some(message) = literal(message)
            {
                errors.insert(without_formats(&message), file.clone());
            }
        }
    }
    errors
}

/// Every string in the sources of core and link: a fixed phrase of an error is one.
fn phrases() -> BTreeSet<String> {
    let mut phrases = BTreeSet::new();
    for (_, source) in all_sources().iter().filter(|(file, _)| !file.starts_with(own_sources())) {
        phrases.extend(source.match_indices('"').filter_map(|(at, _)| literal(&source[at..])));
    }
    phrases
}

fn own_sources() -> PathBuf {
    root().join("app")
}

#[test]
fn what_an_error_misses_or_wants_is_there_in_chinese() {
    let mut missing = Vec::new();
    for (file, source) in all_sources() {
        let path = file.to_string_lossy().replace('\\', "/");
        let is_reported = ["/core/", "/sim_link/coppeliasim/src/"].iter().any(|folder| path.contains(folder));
        if !is_reported || path.contains("tests") {
            continue;
        }
        for field in ["holds: \"", "reason: \"", "want: \"", "needs: \"", "expected: \"", "problem: \""] {
            let found = source.match_indices(field).filter_map(|(at, _)| literal(&source[at..]));
            missing.extend(found.filter(|phrase| phrase.contains(' ') && !chinese().contains_key(phrase)));
        }
    }
    assert!(missing.is_empty(), "no translation for the phrases\n{}", missing.join("\n"));
}

/// Every text in the sources with the places where it is used.
fn texts() -> BTreeMap<String, PathBuf> {
    let mut texts = errors();
    for (file, source) in all_sources() {
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
        .filter(|(text, _)| has_words(text) && !chinese().contains_key(*text))
        .map(|(text, file)| format!("{text:?} ({})", file.file_name().unwrap_or_default().to_string_lossy()))
        .collect();
    assert!(missing.is_empty(), "no translation for:\n{}", missing.join("\n"));
    let phrases = phrases();
    for (english, chinese) in chinese() {
        assert_eq!(placeholders(english), placeholders(chinese), "{english:?}");
        assert!(texts.contains_key(english) || phrases.contains(english), "nothing says {english:?} now");
    }
}

#[test]
fn no_error_of_ours_is_passed_on_in_english() {
    let mut found = Vec::new();
    for (file, source) in all_sources() {
        let path = file.to_string_lossy().replace('\\', "/");
        if path.contains("/cli/") || path.contains("tests") {
            continue;
        }
        // What the user reads is a sentence of the catalogue, in which the words of a library are a value.
        for (at, _) in source.match_indices("verbatim(") {
            let rest = source[at..].split([';', '\n']).next().unwrap_or_default();
            if rest.contains(".to_string()") {
                found.push(format!("{path}: {rest}"));
            }
        }
    }
    assert!(found.is_empty(), "use Text::from(error), or text!(\"… {{why}}\", why = error):\n{}", found.join("\n"));
}

#[test]
fn an_error_within_errors_is_said_in_chinese_to_its_end() {
    use handeye_driver::{DriverError, Ending};
    use handeye_estimate::CalibrateError;
    use handeye_estimate::intrinsics::IntrinsicsError;
    use handeye_geometry::camera::CameraError;

    let source = CameraError::BehindCamera { z_m: -1.0 };
    let error = CalibrateError::Intrinsics(IntrinsicsError::BadStart { source });
    assert_eq!(Text::from(&error).in_language(Language::English), error.to_string(), "the command line says the same");
    assert_eq!(Text::from(&error).in_language(Language::Chinese), "相机模型：z = -1 m 处的点不在相机前方");

    let why = Ending::Silent { after: std::time::Duration::from_secs(3) };
    let error = DriverError::Gone { driver: "a.py".to_owned(), why };
    assert_eq!(Text::from(&error).in_language(Language::English), error.to_string());
    assert_eq!(Text::from(&error).in_language(Language::Chinese), "驱动 `a.py` 3 s 没有应答 `ping`");
    let failed = handeye_wording::text!("The connection could not be started: {error}", error = &error);
    assert!(failed.in_language(Language::Chinese).ends_with("驱动 `a.py` 3 s 没有应答 `ping`"), "errors are values");
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

/// What a README contains in any language: levels of headings, lines of code without their comments, and the documents it names,
/// by their names in English.
fn skeleton(readme: &str) -> (Vec<usize>, Vec<String>, BTreeSet<String>) {
    let (mut headings, mut code, mut is_code) = (Vec::new(), Vec::new(), false);
    for line in readme.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
        } else if is_code || line.starts_with("    ") {
            code.push(line.split(" #").next().unwrap_or_default().trim().to_owned());
        } else if line.starts_with('#') {
            headings.push(line.bytes().take_while(|&byte| byte == b'#').count());
        }
    }
    let links = readme.split("](").skip(1).filter_map(|part| part.split(')').next());
    let documents = links.filter(|link| link.contains(".md") && link.starts_with("docs/"));
    (headings, code, documents.map(|link| link.replace("/zh-CN/", "/")).collect())
}

#[test]
fn the_chinese_readme_has_the_commands_and_the_documents_of_the_english_one() {
    let root = root();
    let [english, chinese] =
        ["README.md", "README.zh-CN.md"].map(|name| std::fs::read_to_string(root.join(name)).expect(name));
    let (english, chinese) = (skeleton(&english), skeleton(&chinese));
    assert_eq!(english.0, chinese.0, "headings");
    assert_eq!(english.1, chinese.1, "commands");
    assert_eq!(english.2, chinese.2, "documents");
}
