//! The parts of the drivers that need no server, tested in Python.

use std::path::Path;
use std::process::Command;

use handeye_geometry::testing::python;

#[test]
fn the_parts_of_the_drivers_pass_their_tests() {
    let Some(python) = python() else { return };
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/python/driver_units.py");
    let output = Command::new(python).arg(tests).output().expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
