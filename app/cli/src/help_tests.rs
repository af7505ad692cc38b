use std::ffi::OsString;

use clap::{CommandFactory as _, Parser as _};

use clap_complete::Shell;

use crate::rerun_arg;
use crate::{Cli, shell};

/// The program and all its commands, with how each is called.
fn commands() -> Vec<(String, clap::Command)> {
    fn add(path: &str, command: &clap::Command, all: &mut Vec<(String, clap::Command)>) {
        all.push((path.to_owned(), command.clone()));
        for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
            add(&format!("{path} {}", inner.get_name()), inner, all);
        }
    }
    let mut root = Cli::command();
    root.build();
    let mut all = Vec::new();
    add("handeye", &root, &mut all);
    all
}

/// The command lines of its examples, split as by a shell.
fn examples(command: &clap::Command) -> Vec<Vec<String>> {
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let Some((_, examples)) = help.split_once("Examples") else { return Vec::new() };
    let (_, lines) = examples.split_once(":\n").expect("a heading");
    let lines = lines.replace("\\\n", "");
    // A line with less indentation is a heading.
    let lines = lines.lines().filter(|line| line.starts_with("  "));
    lines.flat_map(|line| line.split("&&")).map(|line| shlex::split(line).expect("words")).collect()
}

#[test]
fn every_command_has_examples_and_all_of_them_are_understood() {
    fn check(path: &str, words: &[String]) {
        if words.first().map(String::as_str) != Some("handeye") {
            return;
        }
        let joined = rerun_arg::joined(words.iter().map(OsString::from));
        if let Err(error) = Cli::try_parse_from(joined) {
            assert!(!error.use_stderr(), "{path}: {words:?}: {error}");
        }
        // A driver is a command line of its own.
        for word in &words[1..] {
            check(path, &shlex::split(word).expect("words"));
        }
    }
    for (path, command) in commands() {
        let examples = examples(&command);
        assert!(!examples.is_empty(), "{path}");
        for words in examples {
            assert!(matches!(words[0].as_str(), "handeye" | "rm"), "{path}: {words:?}");
            check(&path, &words);
        }
    }
}

#[test]
fn options_are_listed_under_what_they_are_about() {
    for (path, command) in commands() {
        for option in command.get_arguments().filter(|it| !it.is_positional()) {
            let id = option.get_id().as_str();
            let is_general = matches!(id, "help" | "version" | "quiet");
            assert_eq!(option.get_help_heading().is_none(), is_general, "{path} --{id}");
        }
    }
}

/// A heading that belongs to the options of one struct applies to all that follow it as well.
#[test]
fn what_guided_capture_has_of_its_own_is_the_whole_of_its_heading() {
    let auto = commands().into_iter().find(|(path, _)| path == "handeye auto").expect("there").1;
    let guided: Vec<&str> = auto
        .get_arguments()
        .filter(|it| it.get_help_heading() == Some(handeye_workbench::arguments::heading::GUIDED))
        .filter_map(clap::Arg::get_long)
        .collect();
    assert_eq!(guided, ["goal", "max-poses", "max-minutes", "check-poses", "box"]);
}

#[test]
fn shells_complete_and_manual_pages_describe_every_command() {
    let shown: Vec<String> = commands()
        .into_iter()
        .filter(|(_, command)| !command.is_hide_set())
        .map(|(path, _)| path)
        .filter(|path| path.split(' ').count() == 2)
        .collect();
    assert!(shown.len() > 12, "{shown:?}");
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        let text = shell::completions_of(shell);
        for path in &shown {
            let (_, name) = path.split_once(' ').expect("two words");
            assert!(text.contains(name), "{shell}: {name}");
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("man1");
    let man = shell::ManArgs { out: out.clone() };
    shell::man(&man).expect("written");
    for path in &shown {
        let page = out.join(format!("{}.1", path.replace(' ', "-")));
        let text = std::fs::read_to_string(&page).unwrap_or_else(|error| panic!("{}: {error}", page.display()));
        assert!(text.contains(".SH OPTIONS"), "{path}");
    }
}
