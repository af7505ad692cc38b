//! What the documents name is there: pages and headings that they link to, paths, examples of `cargo run`, and the pages that
//! sources name. How long they may be.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Folders at the top of the repository: what begins with one of them is a path of it.
const TOP: [&str; 9] = [".ci", ".github", "app", "assets", "core", "docs", "scripts", "sim_link", "tests"];
/// A path with one of these endings is the end of one of the repository.
const SOURCES: [&str; 3] = ["rs", "py", "js"];
/// Names of what existed when a line was written.
const HISTORY: &str = "CHANGELOG.md";
/// Words of all pages but the studies, which are measured tables.
const MOST_WORDS: usize = 45_000;
/// Words of README.md.
const MOST_WORDS_OF_README: usize = 900;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace")
}

/// Files below a folder, relative to the root of the workspace, without what is built or hidden.
fn files(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !["target", ".git", "node_modules", "__pycache__"].contains(&name.as_str()) {
                files(&path, found);
            }
        } else {
            found.insert(path.strip_prefix(root()).expect("below the root").to_string_lossy().replace('\\', "/"));
        }
    }
}

fn all_files() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    files(root(), &mut found);
    found
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The ending of a path, as `md`.
fn ending(path: &str) -> &str {
    Path::new(path).extension().and_then(|ending| ending.to_str()).unwrap_or_default()
}

/// A path without `.` and `..`.
fn plain(path: &Path) -> String {
    let mut parts = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(parts.pop()),
            Component::CurDir => {}
            other => parts.push(other),
        }
    }
    parts.to_string_lossy().replace('\\', "/")
}

/// Text of a page outside of blocks of code, and the code.
fn prose_and_code(page: &str) -> (String, String) {
    let (mut prose, mut code, mut is_fenced) = (String::new(), String::new(), false);
    for line in page.lines() {
        let is_fence = line.trim_start().starts_with("```");
        let to = if is_fenced || is_fence || line.starts_with("    ") { &mut code } else { &mut prose };
        is_fenced ^= is_fence;
        to.push_str(line);
        to.push('\n');
    }
    (prose, code)
}

/// What follows a link's `](`, with targets of links by name.
fn links(prose: &str) -> Vec<&str> {
    let inline = prose.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let named =
        prose.lines().filter_map(|line| line.strip_prefix('[')?.split_once("]: ").map(|(_, target)| target.trim()));
    inline.chain(named).collect()
}

/// Anchors of a page's headings, as the hosts of repositories make them.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let (prose, _) = prose_and_code(page);
    let mut found = BTreeSet::new();
    for heading in prose.lines().filter(|line| line.starts_with('#')) {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|&letter| letter.is_alphanumeric() || " -_".contains(letter));
        let slug: String = kept.map(|letter| if letter == ' ' { '-' } else { letter }).collect();
        let count = seen.entry(slug.clone()).or_default();
        found.insert(if *count == 0 { slug } else { format!("{slug}-{count}") });
        *count += 1;
    }
    found
}

/// Spans of code in a text, and the words of blocks of code: each may be a path.
fn named<'a>(prose: &'a str, code: &'a str) -> Vec<&'a str> {
    let spans = prose.split('\n').flat_map(|line| line.split('`').skip(1).step_by(2)).flat_map(str::split_whitespace);
    spans.chain(code.split_whitespace()).map(|word| word.trim_matches(|c: char| "'\"`,;:()|".contains(c))).collect()
}

/// Whether a word is a path of the repository by its looks; patterns and placeholders are not, nor is what is built.
fn is_path(word: &str) -> bool {
    let letters = |letter: char| letter.is_ascii_alphanumeric() || "._/-".contains(letter);
    let begins = TOP.iter().any(|top| word.strip_prefix(top).is_some_and(|rest| rest.starts_with('/')));
    let ends = SOURCES.contains(&ending(word)) && (word.contains('/') || ending(word) == "rs");
    word.chars().all(letters)
        && !word.contains("VERSION")
        && !word.contains("/target/")
        && !word.starts_with('/')
        && (begins || ends)
}

#[test]
fn every_link_path_and_example_that_a_page_names_is_there() {
    let files = all_files();
    let examples: BTreeSet<String> = files
        .iter()
        .filter(|file| file.ends_with("Cargo.toml"))
        .flat_map(|file| {
            read(file).lines().filter_map(|line| line.strip_prefix("name = ").map(str::to_owned)).collect::<Vec<_>>()
        })
        .map(|name| name.trim_matches('"').to_owned())
        .chain(files.iter().filter_map(|file| Some(file.split_once("examples/")?.1.trim_end_matches(".rs").to_owned())))
        .collect();
    let mut wrong = Vec::new();
    for page in files.iter().filter(|file| ending(file) == "md") {
        let text = read(page);
        let (prose, code) = prose_and_code(&text);
        let folder = Path::new(page).parent().expect("a folder");
        for link in links(&prose).into_iter().filter(|link| !link.contains("://") && !link.starts_with("mailto:")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let to = if path.is_empty() { page.clone() } else { plain(&folder.join(path)) };
            if !root().join(&to).exists() {
                wrong.push(format!("{page}: no {link}"));
            } else if !anchor.is_empty() && !anchors(&read(&to)).contains(anchor) {
                wrong.push(format!("{page}: no heading {link}"));
            }
        }
        if page == HISTORY {
            continue;
        }
        let words = named(&prose, &code);
        for word in words.iter().map(|word| word.split(':').next().unwrap_or_default()).filter(|word| is_path(word)) {
            let (end, folder) = (format!("/{word}"), format!("/{}/", word.trim_end_matches('/')));
            let holds = |file: &String| file.ends_with(&end) || file.contains(&folder);
            if !root().join(word).exists() && !files.iter().any(holds) {
                wrong.push(format!("{page}: no {word}"));
            }
        }
        for pair in words.windows(2).filter(|pair| pair[0] == "--example" && !examples.contains(pair[1])) {
            wrong.push(format!("{page}: no example {}", pair[1]));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_page_that_sources_name_is_there() {
    let files = all_files();
    let endings = ["rs", "py", "js", "toml", "sh", "yml"];
    let mut wrong = Vec::new();
    for file in files.iter().filter(|file| endings.contains(&ending(file))) {
        let Ok(text) = fs::read_to_string(root().join(file)) else { continue };
        for (at, _) in text.match_indices("docs/") {
            let path: String = text[at..]
                .chars()
                .take_while(|&letter| letter.is_ascii_alphanumeric() || "._/-".contains(letter))
                .collect();
            let Some((path, _)) = path.split_once(".md") else { continue };
            if !files.contains(&format!("{path}.md")) {
                wrong.push(format!("{file}: no {path}.md"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_index_has_every_page() {
    let index = read("docs/README.md");
    let linked: BTreeSet<String> = links(&index)
        .into_iter()
        .map(|link| plain(&Path::new("docs").join(link.split('#').next().unwrap_or_default())))
        .collect();
    let part_of_a_list = |file: &str| file.starts_with("docs/decisions/0");
    let pages = all_files().into_iter().filter(|file| file.starts_with("docs/") && ending(file) == "md");
    let missing: Vec<String> =
        pages.filter(|file| file != "docs/README.md" && !part_of_a_list(file) && !linked.contains(file)).collect();
    assert!(missing.is_empty(), "docs/README.md does not link to {missing:?}");
}

#[test]
fn the_documents_are_no_longer_than_a_person_reads() {
    let pages = all_files().into_iter().filter(|file| file.starts_with("docs/") && ending(file) == "md");
    let words: usize = pages
        .filter(|file| !file.starts_with("docs/studies/"))
        .map(|file| read(&file).split_whitespace().count())
        .sum();
    assert!(words <= MOST_WORDS, "{words} words in docs without studies");
    let words = read("README.md").split_whitespace().count();
    assert!(words <= MOST_WORDS_OF_README, "{words} words in README.md");
}
