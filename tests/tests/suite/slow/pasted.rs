//! Commands as users paste them: those of README.md and of the pages in docs/howto, and the examples in the help of each
//! command.

use std::fs;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::{Command, Stdio};

use handeye_geometry::testing::python;
use handeye_tests::{handeye_binary, workspace_root};
use tempfile::TempDir;

use crate::solved::{handeye, text};

/// Longest time for all commands of a page or a help together; only a failure takes this long.
const PATIENCE_S: &str = "1200";

/// The blocks of a page with how each is marked.
fn blocks(page: &str) -> Vec<(&str, String)> {
    let mut blocks: Vec<(&str, String)> = Vec::new();
    let mut inside = false;
    for line in page.lines() {
        match (line.strip_prefix("```"), inside) {
            (Some(mark), false) => {
                inside = true;
                blocks.push((mark, String::new()));
            }
            (Some(_), true) => inside = false,
            (None, true) => {
                let (_, block) = blocks.last_mut().expect("one was begun");
                block.push_str(line);
                block.push('\n');
            }
            (None, false) => assert!(!line.starts_with("    "), "a block without a mark: {line}"),
        }
    }
    blocks
}

/// Runs commands in a folder, one after the other, until one fails.
fn run(script: &str, folder: &Path, programs: Option<&Path>) {
    // The command `handeye` is the program.
    let bin = folder.join(".bin");
    fs::create_dir(&bin).expect("made");
    symlink(handeye_binary(), bin.join("handeye")).expect("linked");
    let mut path = vec![bin];
    path.extend(programs.map(Path::to_owned));
    path.extend(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()));
    let output = Command::new("timeout")
        .args([PATIENCE_S, "bash", "-e", "-x", "-c", script])
        .current_dir(folder)
        .env("PATH", std::env::join_paths(path).expect("a path"))
        .env_remove("RUST_LOG")
        .stdin(Stdio::null())
        .output()
        .expect("a shell");
    assert!(output.status.success(), "{}\n{}\n{}", output.status, text(&output.stdout), text(&output.stderr));
}

/// Runs the blocks of a page that are marked `sh` in a folder like a clone of the project: the files that its commands name
/// exist, and nothing from an earlier run. The number of commands, and the folder.
fn run_page(page: &Path, python: &Path) -> (usize, TempDir) {
    let text = fs::read_to_string(page).expect("a page");
    let blocks = blocks(&text);
    for (mark, block) in &blocks {
        assert!(["sh", "console", "python", "text"].contains(mark), "{}: ```{mark}\n{block}", page.display());
    }
    let home = tempfile::tempdir().expect("a folder");
    symlink(workspace_root().join("assets"), home.path().join("assets")).expect("linked");
    let run_file = home.path().join("run");
    fs::write(&run_file, "#!/bin/sh\nexec handeye \"$@\"\n").expect("written");
    fs::set_permissions(&run_file, fs::Permissions::from_mode(0o755)).expect("made a program");
    let script: String = blocks.into_iter().filter(|(mark, _)| *mark == "sh").map(|(_, block)| block).collect();
    run(&script, home.path(), python.parent());
    (script.lines().count(), home)
}

#[test]
fn the_commands_of_the_readme_work_as_they_are_one_after_the_other() {
    let Some(python) = python() else { return };
    let (_, home) = run_page(&workspace_root().join("README.md"), &python);
    for made in ["my_session/exports", "result.json", "files"] {
        assert!(home.path().join(made).exists(), "{made}");
    }
}

#[test]
fn the_commands_of_every_how_to_work_as_they_are_one_after_the_other() {
    let Some(python) = python() else { return };
    let pages = fs::read_dir(workspace_root().join("docs/howto")).expect("a folder");
    // Not the folder of translations, which have the same commands.
    let pages = pages.map(|page| page.expect("an entry").path()).filter(|page| page.is_file());
    let commands: usize = pages.map(|page| run_page(&page, &python).0).sum();
    assert!(commands > 15, "{commands}");
}

/// The commands that are in the list of a help.
fn listed(help: &str) -> Vec<String> {
    let Some((_, rest)) = help.split_once("\nCommands:\n") else { return Vec::new() };
    let lines = rest.lines().take_while(|line| !line.is_empty());
    // A continued line has more indentation.
    let named = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    named.filter_map(|line| line.split_whitespace().next().map(str::to_owned)).filter(|name| name != "help").collect()
}

/// How each command is called, with its help at that width of the terminal.
fn helps(width: &str) -> Vec<(Vec<String>, String)> {
    let mut open: Vec<Vec<String>> = vec![Vec::new()];
    let mut all = Vec::new();
    while let Some(words) = open.pop() {
        let output = Command::new(handeye_binary())
            .args(&words)
            .arg("--help")
            .env("COLUMNS", width)
            .stdin(Stdio::null())
            .output()
            .expect("it runs");
        assert!(output.status.success(), "{words:?}");
        let help = text(&output.stdout);
        open.extend(listed(&help).into_iter().map(|name| [&words[..], &[name]].concat()));
        all.push((words, help));
    }
    assert!(all.len() > 15, "{}", all.len());
    all
}

#[test]
fn no_line_of_a_help_is_wider_than_the_terminal_and_no_example_is_broken() {
    for (width, most) in [("80", 80), ("120", 100)] {
        for (words, help) in helps(width) {
            for line in help.lines() {
                assert!(line.chars().count() <= most, "{words:?} at {width}: {line}");
                assert_eq!(line, line.trim_end(), "{words:?} at {width}");
            }
            assert!(help.contains("--quiet"), "{words:?}");
            let (_, examples) = help.split_once("\nExamples").unwrap_or_else(|| panic!("{words:?}: {help}"));
            let mut goes_on = false;
            for line in examples.lines().skip(1) {
                if line.is_empty() || (line.ends_with(':') && !line.starts_with(' ')) {
                    assert!(!goes_on, "{words:?} at {width}: {line}");
                    continue;
                }
                let begins = line.starts_with("  handeye");
                assert!(begins != goes_on && (begins || line.starts_with("      ")), "{words:?} at {width}: {line}");
                goes_on = line.ends_with('\\');
            }
            assert!(!goes_on, "{words:?}: {examples}");
        }
    }
}

#[test]
fn the_examples_of_every_help_work_as_they_are_one_after_the_other() {
    // The others run until Ctrl-C, or connect to another machine.
    let run_here =
        ["auto", "calibrate", "doctor", "export", "import", "plan", "sample", "target", "track", "driver fake"];
    let mut ran = 0;
    for (words, help) in helps("80") {
        if !run_here.contains(&words.join(" ").as_str()) {
            continue;
        }
        let (_, examples) = help.split_once("\nExamples").expect("examples");
        let (_, script) = examples.split_once(":\n").expect("a heading");
        // What comes after an empty line has another heading: it needs further prerequisites.
        let script = script.split("\n\n").next().unwrap_or_default();
        let home = tempfile::tempdir().expect("a folder");
        run(script, home.path(), None);
        ran += 1;
    }
    assert_eq!(ran, run_here.len());
}

/// Following a help to the sample a second time loses nothing.
#[test]
fn the_sample_is_not_written_over_what_is_there() {
    let home = tempfile::tempdir().expect("a folder");
    fs::write(home.path().join("mine.txt"), "mine").expect("written");
    let refused = handeye(&["sample", "--out", home.path().to_str().expect("UTF-8")]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("is not empty"), "{}", text(&refused.stderr));
    assert_eq!(fs::read_dir(home.path()).expect("a folder").count(), 1);
}
