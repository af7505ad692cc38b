//! `handeye driver`: the fake driver as a program of its own, and the conformance test as run by an author.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

use handeye_geometry::testing::python;
use handeye_tests::{handeye_binary, workspace_root};
use image::RgbImage;
use serde_json::Value;

use crate::solved::{handeye, text};

/// A Python on a `PATH` of its own, which creates environments without a network: they are the Python of the tests. Counts how
/// often it has to install packages, and waits for permission before that, or fails.
struct Installer {
    home: tempfile::TempDir,
}

impl Installer {
    fn new(python: &Path, venv: &str, pip: &str) -> Self {
        let home = tempfile::tempdir().expect("a folder");
        let (here, real) = (home.path().display(), python.display());
        let environment = format!(
            "#!/bin/sh\ncase \"$*\" in *'pip install'*) echo installs >> '{here}/noted'; {pip};; *) exec '{real}' \"$@\";; esac\n"
        );
        std::fs::write(home.path().join("environment"), environment).expect("written");
        let python3 = format!(
            "#!/bin/sh\ncase \"$*\" in *'-m venv'*) {venv}\nfor folder; do :; done; mkdir -p \"$folder/bin\"; \
             cp '{here}/environment' \"$folder/bin/python\"; chmod +x \"$folder/bin/python\";; *) exec '{real}' \"$@\";; esac\n"
        );
        let file = home.path().join("python3");
        std::fs::write(&file, python3).expect("written");
        std::fs::set_permissions(&file, std::os::unix::fs::PermissionsExt::from_mode(0o755)).expect("a program");
        Self { home }
    }

    /// `handeye` with this Python and a cache of its own.
    fn handeye(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(handeye_binary());
        let path = format!("{}:/usr/bin:/bin", self.home.path().display());
        command.args(arguments).env("PATH", path).env("XDG_CACHE_HOME", self.home.path().join("cache"));
        command
    }

    fn installed(&self) -> usize {
        std::fs::read_to_string(self.home.path().join("noted")).map_or(0, |text| text.lines().count())
    }
}

#[test]
fn the_environment_of_a_driver_is_made_once_and_says_so() {
    let Some(python) = python() else { return };
    // Longer than a workbench is left without a message: `driver test` is not a workbench, and its output is the
    // report.
    let installer = Installer::new(&python, "", "echo Collecting pillow; sleep 3");
    let images = tempfile::tempdir().expect("a folder");
    RgbImage::new(8, 6).save(images.path().join("a.png")).expect("an image");
    let driver = format!("handeye driver folder '{}' --images-only", images.path().display());
    for run in 1..=2 {
        // The driver is started twice in each run.
        let output = installer.handeye(&["driver", "test", &driver, "--json", "-"]).output().expect("handeye runs");
        let report: Value = serde_json::from_slice(&output.stdout).expect("nothing but the report");
        let errors = text(&output.stderr);
        assert_eq!(installer.installed(), 1, "{errors}");
        let says_so =
            errors.contains("making a Python environment for the driver folder") && errors.contains("Collecting");
        assert_eq!(says_so, run == 1, "{errors}");
        assert_eq!(report["passed"], true, "{report:#}");
    }
    // Help creates no environment.
    let other = Installer::new(&python, "", "");
    let output = other.handeye(&["driver", "ur-rtde", "--help"]).output().expect("handeye runs");
    let help = text(&output.stdout);
    assert!(help.contains("usage: handeye driver ur-rtde") && help.contains("--python PATH"), "{help}");
    assert_eq!(other.installed(), 0);
}

/// Seen with a simulator: the command ended with "is being prepared", and only its second start found the environment.
#[test]
fn a_command_waits_for_the_environment_of_its_driver() {
    let Some(python) = python() else { return };
    let installer = Installer::new(&python, "", "echo Collecting pillow; sleep 3");
    let images = tempfile::tempdir().expect("a folder");
    RgbImage::new(8, 6).save(images.path().join("a.png")).expect("an image");
    let driver = format!("handeye driver folder '{}' --images-only", images.path().display());
    let output =
        installer.handeye(&["auto", "--driver", &driver, "--target", "9x6x25"]).output().expect("handeye runs");
    let errors = text(&output.stderr);
    assert!(installer.installed() == 1 && errors.contains("Collecting pillow"), "{errors}");
    assert!(!errors.contains("is being prepared"), "{errors}");
}

#[test]
fn a_workbench_hears_that_an_environment_is_being_made_before_the_driver_answers() {
    let Some(python) = python() else { return };
    let installer = Installer::new(&python, "", "until [ -e \"$(dirname $0)/../../may\" ]; do sleep 0.05; done");
    let images = tempfile::tempdir().expect("a folder");
    let folder = images.path().to_str().expect("letters");
    let mut driver = installer
        .handeye(&["driver", "folder", folder, "--images-only", "--size", "8x6"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("handeye runs");
    let mut input = driver.stdin.take().expect("its input");
    writeln!(input, r#"{{"type":"hello","protocol":1,"workbench":"test"}}"#).expect("it is there");
    let mut lines = BufReader::new(driver.stdout.take().expect("its output")).lines().map(|line| line.expect("text"));
    let preparing: Value = serde_json::from_str(&lines.next().expect("a line")).expect("a message");
    assert_eq!(preparing["type"], "preparing");
    std::fs::write(installer.home.path().join("cache/handeye-workbench/drivers/may"), "").expect("written");
    let hello = lines.map(|line| serde_json::from_str::<Value>(&line).expect("a message"));
    let hello = hello.into_iter().find(|message| message["type"] != "preparing").expect("an answer");
    assert_eq!(hello["type"], "hello", "{hello}");
    drop(input);
    assert!(driver.wait().expect("it ends with its input").success());
}

#[test]
fn without_venv_network_or_python_a_driver_says_what_to_do() {
    let Some(python) = python() else { return };
    let run = |installer: &Installer| {
        let output = installer.handeye(&["driver", "ur-rtde", "--host", "127.0.0.1"]).output().expect("handeye runs");
        assert_eq!(output.status.code(), Some(1));
        text(&output.stderr)
    };
    let errors = run(&Installer::new(&python, "echo 'ensurepip is not available'; exit 1", ""));
    assert!(
        errors.contains("ensurepip is not available. Install") && errors.contains("apt install python3-venv"),
        "{errors}"
    );
    let offline = Installer::new(&python, "", "echo 'ERROR: No matching distribution found for ur_rtde' >&2; exit 1");
    for runs in 1..=2 {
        let errors = run(&offline);
        assert!(errors.contains("No matching distribution") && errors.contains("--python PATH"), "{errors}");
        assert_eq!(offline.installed(), runs, "what is not whole is made again");
    }
    let none = Installer::new(&python, "", "");
    std::fs::remove_file(none.home.path().join("python3")).expect("removed");
    let command = &mut none.handeye(&["driver", "ur-rtde", "--host", "127.0.0.1"]);
    let output = command.env("PATH", none.home.path()).output().expect("handeye runs");
    let errors = text(&output.stderr);
    assert!(errors.contains("python3 cannot be started") && errors.contains("apt install python3"), "{errors}");
}

#[test]
fn a_driver_is_written_out_to_be_changed_and_nothing_is_overwritten_unasked() {
    let Some(python) = python() else { return };
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("mine");
    let (out, eject) = (out.to_str().expect("letters"), ["driver", "eject", "folder", "--out"]);
    let run = |more: &[&str]| handeye(&[&eject, [out].as_slice(), more].concat());
    assert!(run(&[]).status.success());
    let file = Path::new(out).join("folder.py");
    let shipped = std::fs::read_to_string(workspace_root().join("assets/drivers/folder.py")).expect("text");
    assert_eq!(std::fs::read_to_string(&file).expect("text"), shipped);
    let images = tempfile::tempdir().expect("a folder");
    RgbImage::new(8, 6).save(images.path().join("a.png")).expect("an image");
    let driver = format!("'{}' '{}' '{}' --images-only", python.display(), file.display(), images.path().display());
    let output = handeye(&["driver", "test", &driver]);
    assert!(output.status.success(), "{}", text(&output.stdout));
    std::fs::write(&file, "# mine\n").expect("written");
    let output = run(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("folder.py is there and differs"), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_to_string(&file).expect("text"), "# mine\n");
    assert!(run(&["--overwrite"]).status.success());
    assert_eq!(std::fs::read_to_string(&file).expect("text"), shipped);
}

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

/// As the window starts those in its list.
#[test]
fn the_drivers_that_come_with_the_program_are_started_from_it_where_it_is_not_on_the_path() {
    let output = Command::new(handeye_binary())
        .args(["driver", "test", "handeye driver fake"])
        .env("PATH", "/nowhere")
        .output()
        .expect("handeye runs");
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
}

/// As a user would to see its output.
#[test]
fn a_driver_that_is_started_in_a_terminal_says_for_what_it_waits() {
    let Some(python) = python() else { return };
    let mut driver = Command::new(handeye_binary())
        .args(["driver", "rosbridge", "--url", "ws://127.0.0.1:9", "--python"])
        .arg(python)
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
