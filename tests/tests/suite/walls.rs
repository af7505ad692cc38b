//! What must hold between crates beyond what Cargo refuses to build: no module that estimates names the truth, and a
//! program that estimates is built without crates that it does not need.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use handeye_tests::workspace_root;
use serde_json::Value;

/// Names of the truth that a simulated cell publishes for reports and tests.
const TRUTH: [&str; 3] = ["GroundTruth", "ground_truth", "TruthComparison"];

/// Crates whose sources produce an estimate.
const ESTIMATING: [&str; 10] =
    ["arm", "capture", "detect", "estimate", "files", "geometry", "import", "pairs", "plan", "track"];

/// Limit of crates in a program that only estimates, itself included.
const MOST_CRATES: usize = 60;

/// Lines of a source that name the truth, tests excepted.
fn lines_that_name_the_truth(file: &Path, text: &str) -> Vec<String> {
    let path = file.to_string_lossy().replace('\\', "/");
    if path.ends_with("tests.rs") || path.contains("/tests/") {
        return Vec::new();
    }
    let names_it = |line: &&str| TRUTH.iter().any(|word| line.contains(word));
    text.lines().filter(names_it).map(|line| format!("{path}: {}", line.trim())).collect()
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn nothing_that_estimates_names_the_truth() {
    let mut seen = Vec::new();
    for name in ESTIMATING {
        let mut files = Vec::new();
        sources(&workspace_root().join("core").join(name).join("src"), &mut files);
        assert!(!files.is_empty(), "core/{name} is not searched");
        for file in &files {
            let text = std::fs::read_to_string(file).expect("a source");
            seen.extend(lines_that_name_the_truth(file, &text));
            let broken = format!("{text}\nuse handeye_session::GroundTruth;\n");
            let is_test = lines_that_name_the_truth(file, &broken).is_empty();
            assert!(!is_test || file.to_string_lossy().contains("tests"), "{} is not searched", file.display());
        }
    }
    assert!(seen.is_empty(), "{}", seen.join("\n"));
}

/// Names of the packages that a package of the workspace is built with, itself included.
fn built_with(package: &str) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--offline", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"])
        .args(["--package", package])
        .current_dir(workspace_root())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().filter_map(|line| line.split(' ').next()).map(ToOwned::to_owned).collect()
}

#[test]
fn a_program_that_estimates_is_built_without_formats_windows_and_opencv() {
    let heavy = ["rusqlite", "zstd", "mcap", "pdf-writer", "opencv", "rerun", "egui", "tokio", "zmq"];
    for package in ["handeye_estimate", "handeye_python"] {
        let built = built_with(package);
        assert!(built.contains("handeye_geometry"), "{built:?}");
        for name in heavy {
            assert!(!built.contains(name), "{package} is built with {name}");
        }
        assert!(built.len() <= MOST_CRATES, "{package} is built with {} crates: {built:?}", built.len());
    }
}

#[test]
fn the_workbench_is_built_without_a_window_and_the_window_without_rerun() {
    for (package, foreign) in [
        ("handeye_workbench", ["rerun", "egui", "hyper", "tonic"].as_slice()),
        ("handeye_ui", ["rerun", "hyper", "tonic"].as_slice()),
        ("handeye_record", ["egui"].as_slice()),
    ] {
        let built = built_with(package);
        assert!(built.contains("handeye_session"), "{built:?}");
        for name in foreign {
            assert!(!built.contains(*name), "{package} is built with {name}");
        }
    }
}

#[test]
fn the_description_of_a_crate_is_there_for_a_registry() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--locked", "--offline"])
        .current_dir(workspace_root())
        .output()
        .expect("cargo runs");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo prints JSON");
    for package in metadata["packages"].as_array().expect("packages") {
        let is_library =
            package["manifest_path"].as_str().is_some_and(|path| path.replace('\\', "/").contains("/core/"));
        let text = |key: &str| package[key].as_str().unwrap_or_default().to_owned();
        assert!(!text("description").is_empty(), "{} has no description", text("name"));
        let keywords = package["keywords"].as_array().map_or(0, Vec::len);
        assert!(!is_library || (1..=5).contains(&keywords), "{} has {keywords} keywords", text("name"));
    }
}

/// What several panes show is in the shell.
#[test]
fn no_pane_knows_the_pane_of_another_feature() {
    let ui = workspace_root().join("app/ui/src");
    let (mut files, mut seen) = (Vec::new(), Vec::new());
    sources(&ui, &mut files);
    for file in &files {
        let path = file.strip_prefix(&ui).expect("below it").to_string_lossy().replace('\\', "/");
        let Some((feature, _)) = path.split_once('/').filter(|(folder, _)| *folder != "shell") else { continue };
        let text = std::fs::read_to_string(file).expect("a source");
        let other = |line: &&str| {
            line.match_indices("::pane").any(|(at, found)| {
                if line[at + found.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_') {
                    return false;
                }
                let before: String =
                    line[..at].chars().rev().take_while(|c| c.is_alphanumeric() || "_:".contains(*c)).collect();
                let before: String = before.chars().rev().collect();
                before.strip_prefix("crate::").is_some_and(|named| named.split("::").next() != Some(feature))
            })
        };
        seen.extend(text.lines().filter(other).map(|line| format!("{path}: {}", line.trim())));
    }
    assert!(files.len() > 100 && seen.is_empty(), "{}", seen.join("\n"));
}
