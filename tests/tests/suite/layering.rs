//! The dependency law: core ← sim_link ← app, and nothing of the window or the wire below its layer.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// Names of all packages that each package of the workspace is built with, directly or not.
fn dependency_closures() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", &host()])
        .current_dir(handeye_tests::workspace_root())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo prints JSON");
    let names: BTreeMap<&str, &str> = metadata["packages"]
        .as_array()
        .expect("packages")
        .iter()
        .map(|p| (p["id"].as_str().expect("id"), p["name"].as_str().expect("name")))
        .collect();
    let edges: BTreeMap<&str, Vec<&str>> = metadata["resolve"]["nodes"]
        .as_array()
        .expect("nodes")
        .iter()
        .map(|node| (node["id"].as_str().expect("id"), normal_dependencies(node)))
        .collect();
    metadata["workspace_members"]
        .as_array()
        .expect("members")
        .iter()
        .map(|member| {
            let member = member.as_str().expect("id");
            let mut seen = BTreeSet::new();
            let mut queue = vec![member];
            while let Some(id) = queue.pop() {
                for next in &edges[id] {
                    if seen.insert(*next) {
                        queue.push(next);
                    }
                }
            }
            (names[member].to_owned(), seen.iter().map(|id| names[id].to_owned()).collect())
        })
        .collect()
}

/// The platform of this machine: packages of others were never downloaded.
fn host() -> String {
    let output = Command::new("rustc").arg("-vV").output().expect("rustc runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().find_map(|line| line.strip_prefix("host: ")).expect("rustc names its host").to_owned()
}

/// Dependencies that end up in the binary: neither for tests nor for build scripts.
fn normal_dependencies(node: &Value) -> Vec<&str> {
    node["deps"]
        .as_array()
        .expect("deps")
        .iter()
        .filter(|d| d["dep_kinds"].as_array().expect("kinds").iter().any(|k| k["kind"].is_null()))
        .map(|d| d["pkg"].as_str().expect("id"))
        .collect()
}

#[test]
fn core_is_below_sim_link_is_below_app() {
    let closures = dependency_closures();
    let core = &closures["handeye_core"];
    for above in ["handeye_sim_link", "handeye_app", "zmq", "egui", "eframe", "rerun", "tokio"] {
        assert!(!core.contains(above), "core must not depend on {above}");
    }
    let link = &closures["handeye_sim_link"];
    assert!(link.contains("handeye_core"));
    for above in ["handeye_app", "egui", "eframe", "rerun"] {
        assert!(!link.contains(above), "sim_link must not depend on {above}");
    }
    let app = &closures["handeye_app"];
    assert!(app.contains("handeye_core") && app.contains("handeye_sim_link"));
    assert!(!app.contains("handeye_tests"));
}

/// What names the truth that a simulated cell publishes for reports and tests.
const TRUTH: [&str; 3] = ["GroundTruth", "ground_truth", "TruthComparison"];

/// The files of core that keep or report it, and compute nothing from it.
const MAY_NAME_THE_TRUTH: [&str; 3] =
    ["project/session/document.rs", "project/session/mod.rs", "project/result/mod.rs"];

/// Lines of a source that name the truth; none where the source may.
fn lines_that_see_the_truth(path: &str, text: &str) -> Vec<String> {
    let name = path.rsplit('/').next().unwrap_or(path);
    let is_test = name.ends_with("tests.rs") || path.contains("/tests/");
    if is_test || MAY_NAME_THE_TRUTH.contains(&path) {
        return Vec::new();
    }
    let names_it = |line: &&str| TRUTH.iter().any(|word| line.contains(word));
    text.lines().filter(names_it).map(|line| format!("core/src/{path}: {}", line.trim())).collect()
}

/// All sources of core with their paths below `core/src`, in folders of any depth.
fn sources_of_core() -> Vec<(String, String)> {
    let root = handeye_tests::workspace_root().join("core/src");
    let mut folders = vec![root.clone()];
    let mut sources = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let below = path.strip_prefix(&root).expect("below it").to_string_lossy().replace('\\', "/");
                sources.push((below, std::fs::read_to_string(&path).expect("source")));
            }
        }
    }
    sources
}

#[test]
fn solvers_never_see_the_ground_truth() {
    let sources = sources_of_core();
    let seen: Vec<String> = sources.iter().flat_map(|(path, text)| lines_that_see_the_truth(path, text)).collect();
    assert!(seen.is_empty(), "{}", seen.join("\n"));
    for path in MAY_NAME_THE_TRUTH {
        let text = sources.iter().find(|(p, _)| p == path).map(|(_, text)| text.as_str());
        let names_it = text.is_some_and(|text| TRUTH.iter().any(|word| text.contains(word)));
        assert!(names_it, "core/src/{path} need no longer be allowed to name the truth");
    }
}

#[test]
fn one_line_anywhere_in_core_that_names_the_truth_is_found() {
    let sources = sources_of_core();
    for folder in [
        "detect/checkerboard/search",
        "diagnose/doctor",
        "diagnose/findings",
        "estimate",
        "estimate/handeye",
        "estimate/handeye/joint",
        "estimate/intrinsics",
        "estimate/uncertainty",
        "geometry",
        "track",
        "verify",
    ] {
        let (path, text) = sources
            .iter()
            .find(|(path, _)| {
                path.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/')) && !path.contains("tests")
            })
            .unwrap_or_else(|| panic!("core/src/{folder} is not searched"));
        let broken = format!("{text}\nuse crate::session::GroundTruth;\n");
        assert_eq!(lines_that_see_the_truth(path, &broken).len(), 1, "{path}");
    }
}
