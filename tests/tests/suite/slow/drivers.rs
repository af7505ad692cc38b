//! `handeye driver`: the fake driver as a program of its own, and the conformance test as an author runs it.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use handeye_geometry::testing::python;
use handeye_tests::{handeye_binary, workspace_root};
use serde_json::Value;

use crate::solved::{handeye, text};

#[test]
fn the_fake_driver_passes_its_own_test_in_a_process_and_over_tcp() {
    let command = format!("'{}' driver fake", handeye_binary().display());
    let output = handeye(&["driver", "test", &command, "--allow-motion", "--json", "-"]);
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!((output.status.code(), &report["passed"]), (Some(0), &Value::Bool(true)), "{report:#}");
    let outcomes: Vec<&str> =
        report["checks"].as_array().expect("checks").iter().filter_map(|check| check["outcome"].as_str()).collect();
    assert!(outcomes.len() >= 9 && !outcomes.contains(&"skipped"), "{report:#}");

    let mut listening = Command::new(handeye_binary())
        .args(["driver", "fake", "--listen", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("handeye runs");
    let mut line = String::new();
    BufReader::new(listening.stdout.take().expect("its output")).read_line(&mut line).expect("a line");
    let address = line.trim().strip_prefix("listening on ").expect("where it listens");
    let output = handeye(&["driver", "test", address, "--allow-motion"]);
    listening.kill().and_then(|()| listening.wait()).expect("it listens until it is ended");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
}

/// As the window starts those of its list.
#[test]
fn the_drivers_that_come_with_the_program_are_started_from_it_where_it_is_not_on_the_path() {
    let output = Command::new(handeye_binary())
        .args(["driver", "test", "handeye driver fake"])
        .env("PATH", "/nowhere")
        .output()
        .expect("handeye runs");
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
}

/// As somebody does who wants to see what it says.
#[test]
fn a_driver_that_is_started_in_a_terminal_says_for_what_it_waits() {
    let mut driver = Command::new(handeye_binary())
        .args(["driver", "rosbridge", "--url", "ws://127.0.0.1:9"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("handeye runs");
    let mut line = String::new();
    BufReader::new(driver.stderr.take().expect("its errors")).read_line(&mut line).expect("a line");
    drop(driver.stdin.take());
    driver.wait().expect("it ends with its input");
    assert!(line.contains("waits for `hello`") && line.contains("handeye driver test"), "{line}");
}

#[test]
fn an_author_is_told_what_is_wrong_with_the_line_and_by_the_exit_code() {
    let Some(python) = python() else { return };
    let template = workspace_root().join("assets/drivers/template.py");
    let output = handeye(&["driver", "test", &format!("'{}' '{}'", python.display(), template.display())]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));

    let output = handeye(&["driver", "test", "echo connecting"]);
    assert_eq!(output.status.code(), Some(1));
    let report = text(&output.stdout);
    assert!(report.contains("print to standard error") && report.contains("message 1: connecting"), "{report}");

    for missing in ["/there/is/no/such/program", "python3 'x", "tcp://127.0.0.1:1"] {
        let output = handeye(&["driver", "test", missing]);
        assert_eq!(output.status.code(), Some(2), "{missing}");
    }
}
