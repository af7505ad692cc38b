//! `handeye driver rosbridge` in front of a rosbridge that PyPI's `roslibpy` reads too.

use std::time::Duration;

use handeye_arm::JointKind;
use handeye_driver::drivers::rosbridge::{Rosbridge, RosbridgeOptions};
use handeye_driver::message::{Ability, FromDriver, ImageEncoding, JointMessage};
use handeye_driver::testing::{RosScene, RosVersion, RosbridgeServer, Topic};
use handeye_geometry::camera::Distortion;
use handeye_geometry::testing::python;
use serde_json::json;

use super::{Talk, script};

fn server(version: RosVersion) -> RosbridgeServer {
    RosbridgeServer::start(RosScene::new(version).topics()).expect("a port of the loopback interface")
}

fn options(server: &RosbridgeServer) -> RosbridgeOptions {
    let joint = |name: &str| JointMessage { name: name.into(), kind: JointKind::Revolute, min: None, max: None };
    RosbridgeOptions {
        base_frame: Some("base_link".into()),
        tip_frame: Some("tool0".into()),
        joints: Some("/joint_states".into()),
        arm_joints: vec![joint("shoulder_pan_joint"), joint("elbow_joint")],
        image: Some("/camera/image_raw".into()),
        camera_info: Some("/camera/camera_info".into()),
        depth: Some("/camera/depth".into()),
        ..RosbridgeOptions::new(server.url())
    }
}

/// The driver and `roslibpy` at one server read the same pose, joints, pixels, depth and lens.
fn both_clients_read_the_same(version: RosVersion, name: &str, fragment_size: Option<u32>) {
    let Some(python) = python() else { return };
    let server = server(version);
    let theirs = script(&python, "read_rosbridge.py", &[&server.port().to_string(), name, "base_link", "tool0"]);
    let mut talk = Talk::start(Rosbridge::new(RosbridgeOptions { fragment_size, ..options(&server) }));
    let hello = talk.hello();
    assert_eq!(hello.can, [Ability::State, Ability::Joints, Ability::Image, Ability::Depth]);

    let state = talk.state();
    let numbers = |key: &str| -> Vec<f64> { serde_json::from_value(theirs[key].clone()).expect("numbers") };
    let pose = state.base_from_tip.expect("a pose");
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off(&pose.translation_m, &numbers("translation")) < 1e-12, "{pose:?} {theirs:#}");
    assert!(off(&pose.rotation_xyzw, &numbers("rotation")) < 1e-12, "{pose:?} {theirs:#}");
    let joints = state.joints_rad.expect("joints");
    assert_eq!(json!(joints), json!([theirs["joints"]["shoulder_pan_joint"], theirs["joints"]["elbow_joint"]]));

    let (image, pixels) = talk.image(None, true);
    assert_eq!((image.width, image.height, image.encoding), (16, 12, ImageEncoding::Rgb8));
    assert_eq!(theirs["image"], hex(&pixels));
    let (depth, bytes) = talk.wait(|message, bytes| match message {
        FromDriver::Depth(depth) => Some((depth, bytes)),
        _ => None,
    });
    assert!((depth.stamp - image.stamp).abs() < 0.005);
    assert_eq!(theirs["depth"], hex(&bytes));

    let lens = hello.camera.expect("a camera").intrinsics.expect("a lens");
    let k = numbers("k");
    assert_eq!([lens.fx, lens.cx, lens.fy, lens.cy], [k[0], k[2], k[4], k[5]]);
    assert_eq!(lens.distortion.coefficients(), numbers("d"));
    assert!(matches!(lens.distortion, Distortion::BrownConrady(_)));
    talk.bye();
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().concat()
}

#[test]
fn ros_1_is_read_as_another_client_reads_it() {
    both_clients_read_the_same(RosVersion::One, "1", None);
}

#[test]
fn ros_2_is_read_as_another_client_reads_it_in_pieces_too() {
    both_clients_read_the_same(RosVersion::Two, "2", Some(200));
}

#[test]
fn states_and_images_go_on_with_stamps_that_rise() {
    let server = server(RosVersion::Two);
    let mut talk = Talk::start(Rosbridge::new(options(&server)));
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
    let server = server(RosVersion::Two);
    let text = Talk::start(Rosbridge::new(RosbridgeOptions::new(server.url()))).error();
    assert!(text.contains("--base-frame and --tip-frame"), "{text}");
    assert!(text.contains("world\n  base_link\n    link_1\n      tool0"), "{text}");
}

#[test]
fn what_is_missing_is_named_with_the_topics_and_frames_that_there_are() {
    type Change = fn(&mut RosbridgeOptions);
    let cases: [(Change, &[&str]); 3] = [
        (|options| options.tip_frame = Some("flange".into()), &["no frame \"flange\"", "link_1"]),
        (
            |options| options.image = Some("/camera/image".into()),
            &["nothing comes on /camera/image", "/camera/image_raw (sensor_msgs/msg/Image)", "not yet advertised"],
        ),
        (|options| options.arm_joints.clear(), &["elbow_joint,shoulder_pan_joint", "--joint-names"]),
    ];
    // Each waits some seconds, so together.
    let server = server(RosVersion::Two);
    let running: Vec<_> = cases
        .iter()
        .map(|(change, expected)| {
            let mut options = options(&server);
            change(&mut options);
            (Talk::start(Rosbridge::new(options)), expected)
        })
        .collect();
    for (talk, expected) in running {
        let text = talk.error();
        for part in *expected {
            assert!(text.contains(part), "{text:?} does not say {part:?}");
        }
    }
}

#[test]
fn a_camera_without_a_robot_is_a_driver() {
    let server = server(RosVersion::One);
    let mut options = RosbridgeOptions::new(server.url());
    options.image = Some("/camera/image_raw".into());
    let mut talk = Talk::start(Rosbridge::new(options));
    assert_eq!(talk.hello().can, [Ability::Image]);
    let (_, pixels) = talk.image(None, false);
    assert_eq!(pixels, RosScene::new(RosVersion::One).pixels());
    talk.bye();
}

#[test]
fn topics_that_come_later_are_waited_for() {
    let server = server(RosVersion::Two);
    let topics = RosScene::new(RosVersion::Two).topics();
    server.remove("/camera/image_raw");
    let mut talk = Talk::start(Rosbridge::new(options(&server)));
    server.set("/camera/image_raw", topics["/camera/image_raw"].clone());
    talk.hello();
    talk.bye();
}

#[test]
fn images_that_change_their_size_or_have_no_stamp_end_the_driver_with_the_reason() {
    let small = RosScene::new(RosVersion::Two);
    let large = RosScene { width: 32, ..small };
    let server = server(RosVersion::Two);
    let mut options = RosbridgeOptions::new(server.url());
    options.image = Some("/camera/image_raw".into());
    let mut talk = Talk::start(Rosbridge::new(options.clone()));
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
    let text = Talk::start(Rosbridge::new(options)).error();
    assert!(text.contains("no stamp"), "{text}");
}

#[test]
fn an_address_where_there_is_no_rosbridge_is_said_with_how_to_start_it() {
    let url = server(RosVersion::Two).url();
    let text = Talk::start(Rosbridge::new(RosbridgeOptions::new(url.clone()))).error();
    assert!(text.contains(&url) && text.contains("rosbridge_websocket_launch.xml"), "{text}");
    for (url, expected) in [("http://127.0.0.1:1", "does not begin with ws://"), ("wss://robot:9090", "encrypted")] {
        let text = Talk::start(Rosbridge::new(RosbridgeOptions::new(url))).error();
        assert!(text.contains(expected), "{text}");
    }
}
