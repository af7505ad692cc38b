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

#[test]
fn solvers_never_see_the_ground_truth() {
    // The cell publishes its truth for reports and tests. No module that estimates may name it.
    let core = handeye_tests::workspace_root().join("core/src");
    for folder in ["handeye", "vision", "calibrate"] {
        for entry in std::fs::read_dir(core.join(folder)).expect("folder").flatten() {
            let path = entry.path();
            if path.is_dir() || path.file_name().is_some_and(|n| n.to_string_lossy().contains("tests")) {
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("source");
            assert!(!text.contains("GroundTruth"), "{} names the ground truth", path.display());
        }
    }
}
