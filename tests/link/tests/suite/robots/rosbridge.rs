//! `handeye driver rosbridge` against a rosbridge written from its protocol's specification.

use std::path::Path;
use std::time::Duration;

use handeye_driver::message::{Ability, FromDriver, ImageEncoding};
use handeye_driver::testing::{RosScene, RosVersion, RosbridgeServer, Topic};
use handeye_geometry::camera::Distortion;
use handeye_geometry::testing::python;
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use serde_json::json;

use super::Talk;

const FRAMES: [&str; 4] = ["--base-frame", "base_link", "--tip-frame", "tool0"];
const JOINTS: [&str; 4] = ["--joints", "/joint_states", "--joint-names", "shoulder_pan_joint,elbow_joint"];
const IMAGE: [&str; 2] = ["--image", "/camera/image_raw"];
const CAMERA_INFO: [&str; 2] = ["--camera-info", "/camera/camera_info"];
const DEPTH: [&str; 2] = ["--depth", "/camera/depth"];

fn server(scene: RosScene) -> RosbridgeServer {
    RosbridgeServer::start(scene.topics()).expect("a port of the loopback interface")
}

fn start(python: &Path, server: &RosbridgeServer, options: &[&[&str]]) -> Talk {
    Talk::run(python, "rosbridge.py", &[&["--url", &server.url()], options.concat().as_slice()].concat())
}

/// Pose, joints, pixels, depth and lens are those of the robot.
fn the_robot_is_read(scene: RosScene, more: &[&str]) {
    let Some(python) = python() else { return };
    let server = server(scene);
    let mut talk = start(&python, &server, &[&FRAMES, &JOINTS, &IMAGE, &CAMERA_INFO, &DEPTH, more]);
    let hello = talk.hello();
    assert_eq!(hello.can, [Ability::State, Ability::Joints, Ability::Image, Ability::Depth]);

    let state = talk.state();
    let pose = state.base_from_tip.expect("a pose");
    let rotation = UnitQuaternion::from_quaternion(Quaternion::from(pose.rotation_xyzw));
    let pose = Isometry3::from_parts(pose.translation_m.into(), rotation);
    let off = (pose.to_homogeneous() - scene.base_from_tip().to_homogeneous()).amax();
    assert!(off < 1e-12, "{pose} {}", scene.base_from_tip());
    assert_eq!(&state.joints_rad.expect("joints")[..], [0.5, -1.25]);

    let (image, pixels) = talk.image(None, true);
    assert_eq!((image.width, image.height, image.encoding), (scene.width, scene.height, ImageEncoding::Rgb8));
    assert_eq!(pixels, scene.pixels());
    let (depth, bytes) = talk.wait(|message, bytes| match message {
        FromDriver::Depth(depth) => Some((depth, bytes)),
        _ => None,
    });
    assert!((depth.stamp - image.stamp).abs() < 0.005);
    assert_eq!(bytes, scene.depths());

    let lens = hello.camera.expect("a camera").intrinsics.expect("a lens");
    assert_eq!([lens.fx, lens.cx, lens.fy, lens.cy], [15.5, 7.25, 15.75, 5.5]);
    assert_eq!(lens.distortion, Distortion::BrownConrady([0.11, -0.21, 0.001, -0.002, 0.03]));
    talk.bye();
}

#[test]
fn ros_1_is_read() {
    the_robot_is_read(RosScene::new(RosVersion::One), &[]);
}

#[test]
fn ros_2_is_read_in_pieces_too() {
    // Its messages are longer than a piece.
    let scene = RosScene { width: 64, height: 48, ..RosScene::new(RosVersion::Two) };
    the_robot_is_read(scene, &["--fragment-size", "1000"]);
}

#[test]
fn states_and_images_go_on_with_stamps_that_rise() {
    let Some(python) = python() else { return };
    let server = server(RosScene::new(RosVersion::Two));
    let mut talk = start(&python, &server, &[&FRAMES, &JOINTS, &IMAGE]);
    talk.hello();
    let first = talk.state();
    let second = talk.state();
    assert!(second.stamp > first.stamp);
    let (image, _) = talk.image(None, false);
    let (next, _) = talk.image(Some(image.stamp), false);
    assert!(next.stamp > image.stamp);
    talk.bye();
}

#[test]
fn without_frames_the_tree_is_shown_and_they_are_asked_for() {
    let Some(python) = python() else { return };
    let server = server(RosScene::new(RosVersion::Two));
    let text = start(&python, &server, &[]).error();
    assert!(text.contains("--base-frame and --tip-frame"), "{text}");
    assert!(text.contains("world\n  base_link\n    link_1\n      tool0"), "{text}");
}

#[test]
fn what_is_missing_is_named_with_the_topics_and_frames_that_there_are() {
    let cases: [(&[&[&str]], &[&str]); 3] = [
        (&[&["--base-frame", "base_link", "--tip-frame", "flange"]], &["no frame \"flange\"", "link_1"]),
        (
            &[&FRAMES, &["--image", "/camera/image"]],
            &["nothing comes on /camera/image", "/camera/image_raw (sensor_msgs/msg/Image)", "not yet advertised"],
        ),
        (&[&FRAMES, &JOINTS[..2]], &["elbow_joint,shoulder_pan_joint", "--joint-names"]),
    ];
    // Each waits some seconds, so they run together.
    let Some(python) = python() else { return };
    let server = server(RosScene::new(RosVersion::Two));
    let running: Vec<_> =
        cases.iter().map(|(options, expected)| (start(&python, &server, options), expected)).collect();
    for (talk, expected) in running {
        let text = talk.error();
        for part in *expected {
            assert!(text.contains(part), "{text:?} does not say {part:?}");
        }
    }
}

#[test]
fn a_camera_without_a_robot_is_a_driver() {
    let Some(python) = python() else { return };
    let server = server(RosScene::new(RosVersion::One));
    let mut talk = start(&python, &server, &[&IMAGE]);
    assert_eq!(talk.hello().can, [Ability::Image]);
    let (_, pixels) = talk.image(None, false);
    assert_eq!(pixels, RosScene::new(RosVersion::One).pixels());
    talk.bye();
}

#[test]
fn topics_that_come_later_are_waited_for() {
    let Some(python) = python() else { return };
    let server = server(RosScene::new(RosVersion::Two));
    let topics = RosScene::new(RosVersion::Two).topics();
    server.remove("/camera/image_raw");
    let mut talk = start(&python, &server, &[&FRAMES, &JOINTS, &IMAGE]);
    server.set("/camera/image_raw", topics["/camera/image_raw"].clone());
    talk.hello();
    talk.bye();
}

#[test]
fn images_that_change_their_size_or_have_no_stamp_end_the_driver_with_the_reason() {
    let small = RosScene::new(RosVersion::Two);
    let large = RosScene { width: 32, ..small };
    let Some(python) = python() else { return };
    let server = server(RosScene::new(RosVersion::Two));
    let mut talk = start(&python, &server, &[&IMAGE]);
    talk.hello();
    server.set("/camera/image_raw", large.topics()["/camera/image_raw"].clone());
    let text = talk.error();
    assert!(text.contains("32×12") && text.contains("16×12"), "{text}");
    let unstamped = Topic::every(
        "sensor_msgs/msg/Image",
        Duration::from_millis(20),
        move |_| json!({"header": small.header(0.0, "camera"), "height": 1, "width": 1, "encoding": "mono8", "step": 1, "data": "AA=="}),
    );
    server.set("/camera/image_raw", unstamped);
    let text = start(&python, &server, &[&IMAGE]).error();
    assert!(text.contains("no stamp"), "{text}");
}

#[test]
fn an_address_where_there_is_no_rosbridge_is_named_with_how_to_start_it() {
    let Some(python) = python() else { return };
    let url = server(RosScene::new(RosVersion::Two)).url();
    let text = Talk::run(&python, "rosbridge.py", &["--url", &url]).error();
    assert!(text.contains(&url) && text.contains("rosbridge_websocket_launch.xml"), "{text}");
    let silent = std::net::TcpListener::bind("127.0.0.1:0").expect("a port of the loopback interface");
    let url = format!("ws://{}", silent.local_addr().expect("an address"));
    let text = Talk::run(&python, "rosbridge.py", &["--url", &url]).error();
    assert!(text.contains(&url) && text.contains("does not answer as a rosbridge"), "{text}");
}
