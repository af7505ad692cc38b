//! The recording of `handeye auto`, read with the Rerun package from PyPI and compared with session and result.

use std::process::Command;

use handeye_geometry::testing::python;
use handeye_tests::{handeye_binary, workspace_root};

#[test]
fn transforms_composed_from_a_recording_are_the_calibration_and_put_the_corners_where_it_does() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let session = folder.path().join("session");
    let output = Command::new(handeye_binary())
        .args(["auto", "--quiet", "--poses", "seed10", "--out"])
        .arg(&session)
        .output()
        .expect("the binary is built: cargo build -p handeye_app");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let recording = session.join("recording.rrd");
    assert!(recording.is_file(), "there is no {}", recording.display());

    let output = Command::new(python)
        .arg(workspace_root().join("tests/python/read_recording.py"))
        .args([&recording, &session])
        .output()
        .expect("python runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{text}");
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
}
