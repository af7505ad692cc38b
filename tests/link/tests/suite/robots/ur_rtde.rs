//! `handeye driver ur-rtde` in front of a controller that PyPI's `ur_rtde` reads too.

use handeye_driver::drivers::ur_rtde::{RtdeOptions, UrRtde, UrRtdeOptions};
use handeye_driver::message::{Ability, ArmMessage, FromDriver, ToDriver};
use handeye_driver::testing::{Output, RtdeRobot, RtdeScript};
use handeye_geometry::testing::python;
use nalgebra::{UnitQuaternion, Vector3};

use super::{Talk, script};

fn device(robot: &RtdeRobot) -> UrRtde {
    let mut rtde = RtdeOptions::new(robot.address().ip().to_string());
    rtde.port = robot.address().port();
    UrRtde::new(UrRtdeOptions { rtde, arm: Some(ArmMessage::Name("ur5e".into())) })
}

fn robot(change: impl FnOnce(&mut RtdeScript)) -> RtdeRobot {
    let mut script = RtdeScript::default();
    change(&mut script);
    RtdeRobot::start(script).expect("a port of the loopback interface")
}

fn vector(name: &str) -> [f64; 6] {
    match RtdeScript::default().outputs[name] {
        Output::Vector6(values) => values,
        ref other => panic!("{name} is {other:?}"),
    }
}

/// What the controller writes as `x y z rx ry rz`, as a message of the driver has it.
fn assert_is_pose(message: &handeye_driver::message::PoseMessage, expected: [f64; 6]) {
    let [x, y, z, rx, ry, rz] = expected;
    assert_eq!(message.translation_m, [x, y, z]);
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz));
    let [i, j, k, w] = message.rotation_xyzw;
    let got = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    assert!(rotation.angle_to(&got) < 1e-12, "{message:?} is not {expected:?}");
}

#[test]
fn the_controller_is_read_as_the_pendant_shows_it() {
    let robot = robot(|_| {});
    let mut talk = Talk::start(device(&robot));
    let hello = talk.hello();
    assert_eq!(hello.can, [Ability::State, Ability::Joints]);
    assert!(hello.name.contains("5.15.0"), "{}", hello.name);
    assert_eq!(hello.joints.len(), 6);
    let state = talk.state();
    assert_eq!(&state.joints_rad.expect("joints")[..], vector("actual_q"));
    assert_is_pose(&state.base_from_tip.expect("the TCP"), vector("actual_TCP_pose"));
    assert_is_pose(&state.flange_from_tcp.expect("the tool"), vector("tcp_offset"));
    assert_eq!(state.moving, Some(false));
    assert!(talk.state().stamp > state.stamp);
    robot.set("actual_TCP_speed", Output::Vector6([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]));
    talk.wait(|message, _| match message {
        FromDriver::State(state) => state.moving.filter(|moving| *moving),
        _ => None,
    });
    talk.bye();
}

#[test]
fn another_client_reads_the_same_values_of_the_same_controller() {
    let Some(python) = python() else { return };
    let joints = [-2.9, 0.123_456_789, 1.0 / 3.0, -1.5, 0.7, 6.1];
    let pose = [0.1, -0.7, 0.25, 0.3, -1.1, 0.9];
    let mut script_of_robot = RtdeScript::default();
    script_of_robot.outputs.insert("actual_q", Output::Vector6(joints));
    script_of_robot.outputs.insert("actual_TCP_pose", Output::Vector6(pose));
    let robot = RtdeRobot::start_on_its_own_port(script_of_robot).expect("port 30004 of some loopback address");
    let theirs = script(&python, "read_rtde.py", &[&robot.address().ip().to_string()]);
    let mut talk = Talk::start(device(&robot));
    talk.hello();
    let ours = talk.state();
    assert_eq!(theirs["actual_q"], serde_json::json!(ours.joints_rad.expect("joints")));
    let read: [f64; 6] = serde_json::from_value(theirs["actual_TCP_pose"].clone()).expect("six numbers");
    assert_eq!(read, pose);
    assert_is_pose(&ours.base_from_tip.expect("the TCP"), read);
    assert_eq!(theirs["robot_mode"], 7);
    let their_time = theirs["timestamp"].as_f64().expect("a number");
    assert!(their_time >= 1000.0 && ours.stamp >= 1000.0, "{their_time} {}", ours.stamp);
    talk.bye();
}

#[test]
fn older_software_says_nothing_of_the_tool_and_is_read_all_the_same() {
    let robot = robot(|script| {
        script.outputs.remove("tcp_offset");
    });
    let mut talk = Talk::start(device(&robot));
    talk.hello();
    let state = talk.state();
    assert_eq!(state.flange_from_tcp, None);
    assert_is_pose(&state.base_from_tip.expect("the TCP"), vector("actual_TCP_pose"));
    talk.bye();
}

#[test]
fn a_pong_shows_the_clock_of_the_controller() {
    let robot = robot(|_| {});
    let mut talk = Talk::start(device(&robot));
    talk.hello();
    let before = talk.state().stamp;
    talk.say(&ToDriver::Ping { id: 9 });
    let pong = talk.wait(|message, _| match message {
        FromDriver::Pong(pong) => Some(pong),
        _ => None,
    });
    let after = talk.state().stamp;
    assert_eq!(pong.id, 9);
    // It is not before a state that was sent before the ping; what follows it took its way and one period at most.
    assert!(pong.stamp >= before - 0.001 && pong.stamp <= after + 5.0, "{before} {} {after}", pong.stamp);
    talk.bye();
}

#[test]
fn nothing_moves_the_arm() {
    let robot = robot(|_| {});
    let mut talk = Talk::start(device(&robot));
    talk.hello();
    let joints_rad = Some([0.0; 6].into());
    for message in
        [ToDriver::Arm { id: 1, on: true }, ToDriver::Move { id: 1, joints_rad, base_from_tip: None, speed: 1.0 }]
    {
        talk.say(&message);
        let why = talk.wait(|message, _| match message {
            FromDriver::Refused(answer) if answer.id == 1 => Some(answer.why),
            FromDriver::Accepted(_) | FromDriver::Done(_) => panic!("{message:?}"),
            _ => None,
        });
        assert!(why.contains("only reads"), "{why}");
    }
    talk.say(&ToDriver::Stop { id: 2 });
    talk.wait(|message, _| matches!(message, FromDriver::Done(answer) if answer.id == 2).then_some(()));
    talk.bye();
}

#[test]
fn what_is_wrong_with_the_controller_is_said_with_what_to_do() {
    let cases: [(&str, RtdeRobot); 6] = [
        ("does not accept version 2", robot(|script| script.accepts_version_2 = false)),
        (
            "no output actual_TCP_speed, robot_mode",
            robot(|script| script.outputs.retain(|name, _| !["actual_TCP_speed", "robot_mode"].contains(name))),
        ),
        (
            "of the types",
            robot(|script| {
                script.outputs.insert("robot_mode", Output::Double(7.0));
            }),
        ),
        ("sent nothing for 2.0 s", robot(|script| script.silent_after = Some(60))),
        ("closed the connection", robot(|script| script.closes_after = Some(60))),
        ("this is not RTDE", robot(|script| script.garbage = Some(b"\0\x01SSH-2.0".to_vec()))),
    ];
    for (expected, robot) in cases {
        let text = Talk::start(device(&robot)).error();
        assert!(text.contains(expected), "{text:?} does not say {expected:?}");
    }
}

#[test]
fn a_controller_that_is_not_there_is_named_with_its_port() {
    let address = robot(|_| {}).address();
    let mut rtde = RtdeOptions::new(address.ip().to_string());
    rtde.port = address.port();
    let text = Talk::start(UrRtde::new(UrRtdeOptions { rtde, arm: None })).error();
    assert!(text.contains(&address.to_string()) && text.contains("Services"), "{text}");
}

#[test]
fn an_arm_that_is_switched_off_has_no_pose_until_it_is_switched_on() {
    let robot = robot(|script| {
        script.outputs.insert("robot_mode", Output::Int(3));
    });
    let mut talk = Talk::start(device(&robot));
    talk.hello();
    talk.wait(|message, _| match message {
        FromDriver::Log(log) => log.text.contains("switched off (POWER_OFF)").then_some(()),
        FromDriver::State(state) => panic!("{state:?}"),
        _ => None,
    });
    robot.set("robot_mode", Output::Int(7));
    talk.state();
    talk.bye();
}
