//! What of the drivers is tested in Python: parts that need no server, and drivers in front of their makers' own libraries.

use std::path::Path;
use std::process::Command;

use handeye_geometry::testing::python;

/// A script of `tests/python` succeeds.
fn passes(script: &str, arguments: &[&str]) {
    let Some(python) = python() else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let file = root.join("tests/python").join(script);
    let output = Command::new(python).current_dir(root).arg(file).args(arguments).output().expect("python runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn the_parts_of_the_drivers_pass_their_tests() {
    passes("driver_units.py", &[]);
}

/// UFACTORY's SDK and libfranka in front of controllers, ROS 2 by a stand-in.
#[test]
fn drivers_of_arms_read_what_their_controllers_state() {
    passes("robot_drivers.py", &["assets/drivers"]);
}

/// Software devices of librealsense, and recordings that Orbbec's SDK plays, where it is installed.
#[test]
fn drivers_of_cameras_read_what_their_libraries_give() {
    passes("camera_drivers.py", &["assets/drivers"]);
}
