use handeye_geometry::frames::{Base, Pose, Tip};

use super::*;
use crate::testing::{Answer, Log, args, connection, func, ret};
use handeye_wire::{self as wire, Reader};

const OBJECT: ObjectHandle = ObjectHandle(45);

fn sim(server: impl FnMut(&Value) -> Answer + Send + 'static) -> (Sim, Log) {
    let (connection, log) = connection(server);
    (Sim::new(connection), log)
}

fn answering(values: Vec<Value>) -> (Sim, Log) {
    sim(move |_| ret(values.clone()))
}

fn only_request(log: &Log) -> Value {
    let mut requests = log.requests();
    assert_eq!(requests.len(), 1, "{requests:?}");
    requests.remove(0)
}

#[test]
fn objects_are_found_by_path_and_index() {
    let (mut sim, log) = answering(vec![Value::from(28)]);
    assert_eq!(sim.get_object_index("/UR5/joint", 3), Ok(ObjectHandle(28)));
    let request = only_request(&log);
    assert_eq!(func(&request), "sim.getObject");
    assert_eq!(args(&request), [Value::from("/UR5/joint"), wire::map([("index", Value::from(3))])]);
}

#[test]
fn an_object_that_is_not_there_is_none_only_where_it_may_be() {
    let (mut sim, log) = answering(vec![Value::from(-1)]);
    assert_eq!(sim.find_object("/nope"), Ok(None));
    assert_eq!(args(&only_request(&log))[1].get("noError"), Some(&Value::from(true)));
    assert_eq!(sim.get_object_parent(OBJECT), Ok(None));
}

#[test]
fn a_pose_is_set_with_its_frame_before_the_value_and_handles_as_integers() {
    let (mut sim, log) = answering(vec![]);
    let pose = Pose::<Base, Tip>::from_translation_xyzw([0.1, 0.2, 0.3], [0.0, 0.0, 0.0, 1.0]);
    sim.set_object_pose(OBJECT, ObjectHandle::WORLD, &pose).expect("answered");
    let request = only_request(&log);
    assert_eq!(func(&request), "sim.setObjectPose");
    assert_eq!(args(&request)[..2], [Value::from(45), Value::from(-1)]);
    assert_eq!(args(&request)[2].numbers(), Some(vec![0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn getters_always_name_the_frame() {
    let (mut sim, log) = answering(vec![wire::floats([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])]);
    let pose: Pose<Base, Tip> = sim.get_object_pose(OBJECT, ObjectHandle::WORLD).expect("a pose");
    assert_eq!(pose, Pose::identity());
    assert_eq!(args(&only_request(&log)), [Value::from(45), Value::from(-1)]);
}

#[test]
fn a_pose_that_is_none_is_refused_with_the_name_of_the_call() {
    let (mut sim, _log) = answering(vec![wire::floats([f64::NAN; 7])]);
    let error = sim.get_object_pose::<Base, Tip>(OBJECT, ObjectHandle::WORLD).expect_err("not a pose");
    assert!(matches!(&error, LinkError::BadValue { call, .. } if call == "sim.getObjectPose"), "{error}");
    let (mut sim, _log) = answering(vec![wire::floats([0.0; 6])]);
    let error = sim.get_object_pose::<Base, Tip>(OBJECT, ObjectHandle::WORLD).expect_err("not a pose");
    assert!(matches!(error, LinkError::UnexpectedReply { .. }), "{error}");
}

#[test]
fn the_end_of_a_simulation_is_waited_for() {
    let mut codes = [17, 21, 22, 0].into_iter();
    let (mut sim, log) = sim(move |request| match func(request) {
        "sim.getSimulationState" => ret([Value::from(codes.next().expect("nobody asks after the end"))]),
        _ => ret([]),
    });
    sim.stop_simulation_and_wait().expect("it ends");
    let functions = log.functions();
    assert_eq!(functions[0], "sim.stopSimulation");
    assert_eq!(functions.iter().filter(|name| *name == "sim.getSimulationState").count(), 4);
}

#[test]
fn the_second_number_of_an_interval_is_its_length() {
    let (mut sim, _log) = answering(vec![Value::from(false), wire::floats([-1.0, 3.0])]);
    let interval = sim.get_joint_interval(OBJECT).expect("an interval");
    assert_eq!(interval, JointInterval { cyclic: false, min: -1.0, max: 2.0 });
}

#[test]
fn images_come_with_row_0_on_top() {
    // 1 × 2, the bottom row first.
    let (mut sim, _log) = answering(vec![Value::Bytes(b"abcdef".to_vec()), wire::integers([1, 2])]);
    let image = sim.get_vision_sensor_image(OBJECT).expect("an image");
    assert_eq!(image.as_raw(), b"defabc");
}

#[test]
fn depth_is_asked_for_in_metres() {
    let bytes: Vec<u8> = [0.5f32, 3.5].iter().flat_map(|d| d.to_le_bytes()).collect();
    let (mut sim, log) = answering(vec![Value::Bytes(bytes), wire::integers([1, 2])]);
    let depth = sim.get_vision_sensor_depth(OBJECT).expect("a depth image");
    assert_eq!(depth.metres, [3.5, 0.5]);
    assert_eq!(args(&only_request(&log))[1], Value::from(1));
}

#[test]
fn a_sensor_with_another_amount_of_pixels_is_an_error() {
    let (mut sim, _log) = answering(vec![Value::Bytes(vec![0; 7]), wire::integers([1, 2])]);
    assert!(matches!(sim.get_vision_sensor_image(OBJECT), Err(LinkError::BadValue { .. })));
    let (mut sim, _log) = answering(vec![Value::Bytes(vec![]), wire::integers([0, 0])]);
    assert!(matches!(sim.get_vision_sensor_image(OBJECT), Err(LinkError::BadValue { .. })));
}

#[test]
fn a_view_angle_that_the_object_does_not_have_is_an_error() {
    let (mut sim, _log) = sim(|request| match func(request) {
        "sim.getVisionSensorRes" => ret([wire::integers([640, 480])]),
        _ => ret([]),
    });
    assert!(matches!(sim.get_sensor_optics(OBJECT), Err(LinkError::UnexpectedReply { .. })));
}

#[test]
fn the_optics_of_the_reference_sensor_give_its_focal_length() {
    let (mut sim, _log) = sim(|request| match (func(request), args(request).get(1).and_then(Reader::integer)) {
        ("sim.getVisionSensorRes", _) => ret([wire::integers([640, 480])]),
        ("sim.getObjectInt32Param", Some(1018)) => ret([Value::from(1)]),
        ("sim.getObjectFloatParam", Some(1004)) => ret([Value::Float(57.0_f64.to_radians())]),
        ("sim.getObjectFloatParam", Some(1000)) => ret([Value::Float(0.01)]),
        ("sim.getObjectFloatParam", Some(1001)) => ret([Value::Float(3.5)]),
        other => panic!("{other:?}"),
    });
    let optics = sim.get_sensor_optics(OBJECT).expect("optics");
    assert_eq!((optics.near_m, optics.far_m), (0.01, 3.5));
    // f = 320 / tan(28.5°)
    approx::assert_relative_eq!(optics.intrinsics().fx, 589.3667, epsilon = 1e-4);
}

#[test]
fn simulation_states_are_told_apart() {
    for (code, expected) in [
        (0, Some(SimulationState::Stopped)),
        (8, Some(SimulationState::Paused)),
        (16, Some(SimulationState::Running)),
        (17, Some(SimulationState::Running)),
        (19, Some(SimulationState::Running)),
        (22, Some(SimulationState::Running)),
        (5, None),
        (-1, None),
    ] {
        let (mut sim, _log) = answering(vec![Value::from(code)]);
        assert_eq!(sim.get_simulation_state().ok(), expected, "{code}");
    }
}

fn motion() -> PoseMotion {
    PoseMotion {
        tip: ObjectHandle(7),
        target: ObjectHandle(8),
        target_pose: Pose::from_translation_xyzw([0.1, 0.2, 0.3], [0.0, 0.0, 1.0, 0.0]),
        limits: MotionLimits::uniform(4, 30.0, 1.5, 1.0),
    }
}

#[test]
fn the_state_of_a_motion_goes_back_as_it_came() {
    // With what the vendor's server puts into it: integer keys, an empty table, a handle, floats without fraction.
    let state = Value::Map(vec![
        (Value::from("simToIkMap"), Value::Map(vec![(Value::from(15), Value::from(3))])),
        (Value::from("vel"), wire::floats([0.0, 1.0])),
        (Value::from("ruckigObj"), Value::from(4)),
        (Value::from("auxData"), Value::Map(vec![])),
    ]);
    let sent = state.clone();
    let mut turn = 0;
    let (mut sim, log) = sim(move |_| {
        turn += 1;
        match turn {
            1 => ret([sent.clone()]),
            2 => ret([Value::from(0), sent.clone()]),
            3 => ret([Value::from(1), sent.clone()]),
            _ => ret([]),
        }
    });
    let mut moving = sim.move_to_pose_init(&motion()).expect("started");
    assert_eq!(sim.move_to_pose_step(&mut moving), Ok(MotionStatus::Running));
    assert_eq!(sim.move_to_pose_step(&mut moving), Ok(MotionStatus::Done));
    sim.move_to_pose_cleanup(moving).expect("done");
    for request in &log.requests()[1..] {
        assert_eq!(args(request), std::slice::from_ref(&state), "{}", func(request));
    }
}

#[test]
fn a_motion_generator_that_gives_up_is_an_error() {
    let state = || wire::map([("vel", Value::Array(vec![]))]);
    let mut turn = 0;
    let (mut sim, _log) = sim(move |_| {
        turn += 1;
        if turn == 1 { ret([state()]) } else { ret([Value::from(-3), state()]) }
    });
    let mut moving = sim.move_to_pose_init(&motion()).expect("started");
    assert!(matches!(sim.move_to_pose_step(&mut moving), Err(LinkError::MotionFailed { code: -3, .. })));
}

#[test]
fn a_motion_to_a_pose_names_tip_and_target_and_no_metric() {
    let (mut sim, log) = answering(vec![Value::Map(vec![])]);
    sim.move_to_pose(&motion(), &CallOptions::default()).expect("done");
    let request = only_request(&log);
    let params = &args(&request)[0];
    assert_eq!(params.get("ik"), Some(&wire::map([("tip", Value::from(7)), ("target", Value::from(8))])));
    assert_eq!(params.get("targetPose").and_then(Reader::numbers), Some(vec![0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0]));
    for (key, value) in [("maxVel", 30.0), ("maxAccel", 1.5), ("maxJerk", 1.0)] {
        assert_eq!(params.get(key).and_then(Reader::numbers), Some(vec![value; 4]), "{key}");
    }
    assert!(params.get("metric").is_none() && params.get("callback").is_none());
}

#[test]
fn limits_that_are_none_are_refused_before_anything_is_sent() {
    let (mut sim, log) = answering(vec![]);
    for limits in [
        MotionLimits::uniform(4, 0.0, 1.0, 1.0),
        MotionLimits::uniform(4, 1.0, f64::NAN, 1.0),
        MotionLimits::uniform(4, 1.0, 1.0, -1.0),
        MotionLimits::uniform(3, 1.0, 1.0, 1.0),
    ] {
        let error = sim.move_to_pose(&PoseMotion { limits, ..motion() }, &CallOptions::default()).expect_err("bad");
        assert!(matches!(error, LinkError::BadMotion { .. }), "{error}");
    }
    assert!(log.events().is_empty());
}
