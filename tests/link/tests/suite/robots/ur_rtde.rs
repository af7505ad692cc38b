//! `handeye driver ur-rtde` against a controller written from the maker's guide.

use std::path::Path;

use handeye_driver::message::{Ability, ArmMessage, FromDriver, ToDriver};
use handeye_driver::testing::{Output, RtdeRobot, RtdeScript};
use handeye_geometry::testing::python;
use nalgebra::{UnitQuaternion, Vector3};

use super::Talk;

fn start(python: &Path, robot: &RtdeRobot) -> Talk {
    Talk::run(python, "ur_rtde.py", &["--host", &robot.address().ip().to_string(), "--arm", "ur5e"])
}

fn robot(change: impl FnOnce(&mut RtdeScript)) -> RtdeRobot {
    let mut script = RtdeScript::default();
    change(&mut script);
    RtdeRobot::start(script).expect("port 30004 of some loopback address")
}

fn vector(name: &str) -> [f64; 6] {
    match RtdeScript::default().outputs[name] {
        Output::Vector6(values) => values,
        ref other => panic!("{name} is {other:?}"),
    }
}

/// The controller's `x y z rx ry rz`, as in a message of the driver.
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
    let Some(python) = python() else { return };
    let robot = robot(|_| {});
    let mut talk = start(&python, &robot);
    let hello = talk.hello();
    assert_eq!(hello.can, [Ability::State, Ability::Joints]);
    assert!(hello.name.contains(&robot.address().ip().to_string()), "{}", hello.name);
    assert_eq!(hello.arm, Some(ArmMessage::Name("ur5e".into())));
    assert_eq!(hello.joints.len(), 6);
    let state = talk.state();
    assert_eq!(&state.joints_rad.expect("joints")[..], vector("actual_q"));
    assert_is_pose(&state.base_from_tip.expect("the TCP"), vector("actual_TCP_pose"));
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
fn a_pong_shows_the_clock_of_the_controller() {
    let Some(python) = python() else { return };
    let robot = robot(|_| {});
    let mut talk = start(&python, &robot);
    talk.hello();
    let before = talk.state().stamp;
    talk.say(&ToDriver::Ping { id: 9 });
    let pong = talk.wait(|message, _| match message {
        FromDriver::Pong(pong) => Some(pong),
        _ => None,
    });
    let after = talk.state().stamp;
    assert_eq!(pong.id, 9);
    // It is not before a state that was sent before the ping; what follows it is delayed by the transfer and at most
    // one period.
    assert!(pong.stamp >= before - 0.001 && pong.stamp <= after + 5.0, "{before} {} {after}", pong.stamp);
    talk.bye();
}

#[test]
fn nothing_moves_the_arm() {
    let Some(python) = python() else { return };
    let robot = robot(|_| {});
    let mut talk = start(&python, &robot);
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
    let Some(python) = python() else { return };
    let cases: [(&str, RtdeRobot); 3] = [
        (
            "[actual_TCP_speed, robot_mode]",
            robot(|script| script.outputs.retain(|name, _| !["actual_TCP_speed", "robot_mode"].contains(name))),
        ),
        ("sent nothing for 2.0 s", robot(|script| script.silent_after = Some(60))),
        ("closed the connection", robot(|script| script.closes_after = Some(60))),
    ];
    for (expected, robot) in cases {
        let text = start(&python, &robot).error();
        assert!(text.contains(expected), "{text:?} does not say {expected:?}");
    }
}

#[test]
fn a_controller_that_is_not_there_is_named_with_its_port() {
    let Some(python) = python() else { return };
    let gone = robot(|_| {}).address();
    let text = Talk::run(&python, "ur_rtde.py", &["--host", &gone.ip().to_string()]).error();
    assert!(text.contains(&gone.to_string()) && text.contains("Services"), "{text}");
}

#[test]
fn an_arm_that_is_switched_off_has_no_pose_until_it_is_switched_on() {
    let Some(python) = python() else { return };
    let robot = robot(|script| {
        script.outputs.insert("robot_mode", Output::Int(3));
    });
    let mut talk = start(&python, &robot);
    talk.hello();
    talk.wait(|message, _| match message {
        FromDriver::Log(log) => log.text.contains("switched off (POWER_OFF)").then_some(()),
        FromDriver::State(state) => panic!("{state:?}"),
        _ => None,
    });
    talk.say(&ToDriver::Ping { id: 1 });
    talk.wait(|message, _| match message {
        FromDriver::Pong(_) => Some(()),
        FromDriver::State(state) => panic!("{state:?}"),
        _ => None,
    });
    robot.set("robot_mode", Output::Int(7));
    talk.state();
    talk.bye();
}
