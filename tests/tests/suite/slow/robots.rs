//! The drivers that come with the workbench, as programs, through the driver test and through the client of the window.

use std::path::Path;
use std::time::Duration;

use handeye_coppeliasim::CancelToken;
use handeye_driver::testing::{RosScene, RosVersion, RosbridgeServer, RtdeRobot, RtdeScript};
use handeye_driver::{DriverCell, DriverCellSpec, DriverOptions};
use handeye_geometry::testing::python;
use handeye_tests::handeye_binary;
use image::RgbImage;
use serde_json::Value;

use crate::solved::handeye;

/// With the Python of the tests, which has the packages of all drivers.
fn command(python: &Path, arguments: &str) -> String {
    format!("'{}' driver {arguments} --python '{}'", handeye_binary().display(), python.display())
}

/// Runs `handeye driver test`: every check is passed, or skipped because motion is not allowed or the driver lacks the
/// feature.
fn assert_passes(arguments: &str) {
    let Some(python) = python() else { return };
    let output = handeye(&["driver", "test", &command(&python, arguments), "--json", "-"]);
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!((output.status.code(), &report["passed"]), (Some(0), &Value::Bool(true)), "{arguments}: {report:#}");
}

fn robot() -> RtdeRobot {
    RtdeRobot::start(RtdeScript::default()).expect("port 30004 of some loopback address")
}

fn ur_rtde(robot: &RtdeRobot) -> String {
    format!("ur-rtde --host {} --arm ur5e", robot.address().ip())
}

fn ros() -> RosbridgeServer {
    RosbridgeServer::start(RosScene::new(RosVersion::Two).topics()).expect("a port of the loopback interface")
}

#[test]
fn the_driver_of_universal_robots_passes_the_driver_test() {
    let robot = robot();
    assert_passes(&ur_rtde(&robot));
}

#[test]
fn the_driver_of_ros_passes_the_driver_test() {
    let server = ros();
    assert_passes(&format!(
        "rosbridge --url {} --base-frame base_link --tip-frame tool0 --image /camera/image_raw --camera-info \
         /camera/camera_info --depth /camera/depth --joints /joint_states --joint-names shoulder_pan_joint,elbow_joint",
        server.url()
    ));
}

#[test]
fn the_driver_of_a_folder_passes_the_driver_test() {
    let folder = tempfile::tempdir().expect("a folder");
    RgbImage::new(8, 6).save(folder.path().join("a.png")).expect("an image");
    std::fs::write(folder.path().join("a.txt"), "0.1 0.2 0.3 0 0 0 1\n").expect("written");
    let options = "--length-unit m --rotation quaternion_xyzw --pose base_from_tip";
    assert_passes(&format!("folder '{}' {options}", folder.path().display()));
}

#[test]
fn a_robot_and_a_camera_of_two_drivers_make_images_with_poses() {
    let Some(python) = python() else { return };
    let (robot, server) = (robot(), ros());
    let camera = format!("rosbridge --url {} --image /camera/image_raw", server.url());
    let spec = DriverCellSpec {
        robot: command(&python, &ur_rtde(&robot)).parse().expect("a command"),
        camera: Some(command(&python, &camera).parse().expect("a command")),
    };
    let cancel = CancelToken::default();
    let cell = DriverCell::start(&spec, &DriverOptions::default(), &cancel).expect("both drivers");
    // The first images come before the clocks are related.
    let mut after = None;
    let tip = (0..100).find_map(|_| {
        let frame = cell.frame(after, Duration::from_secs(10), &cancel).expect("an image").expect("in time");
        after = Some(frame.stamp_s);
        frame.robot.ok().map(|robot| robot.base_from_tip.translation())
    });
    let tip = tip.expect("a pose at the instant of an image");
    assert!((tip.x - 0.4123).abs() < 1e-12, "{tip}");
}
