use std::f64::consts::FRAC_PI_2;

use super::*;

/// What is left of a pose or an angle (m or rad) by the last iteration of inverse kinematics and by rounding; a solver
/// that stops at a precision of 1e-6 misses it by far.
const ROUNDING: f64 = 1e-10;

#[test]
fn a_move_ends_exactly_at_its_target_and_others_are_served_meanwhile() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.send(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 1.0)]);
    let mut seen = Vec::new();
    let done = loop {
        if let Some(reply) = bench.reply(A) {
            break reply;
        }
        bench.turn();
        seen.push(bench.call(B, "sim.getJointPosition", vec![Value::from(bench.engine.cell.stage.joints[0])]));
    };
    assert_eq!(bench.joints(), GOAL);
    assert!(seen.len() > 10, "only {} looks during the move", seen.len());
    let state = &done.get("ret").and_then(Reader::list).expect("a map")[0];
    assert_eq!(state.get("pos").and_then(Reader::numbers), Some(GOAL.to_vec()));
    assert_eq!(state.get("vel").and_then(Reader::numbers), Some(vec![0.0; 6]));
    for field in [
        "joints",
        "accel",
        "targetPos",
        "targetVel",
        "maxVel",
        "minVel",
        "maxJerk",
        "minAccel",
        "flags",
        "timeStep",
        "timeLeft",
    ] {
        assert!(state.get(field).is_some(), "{field}");
    }
    assert!(state.get("callback").is_none() && state.get("ruckigObj").is_none());
}

#[test]
fn a_move_in_a_stopped_simulation_jumps_along_in_no_time() {
    let mut bench = Bench::new();
    bench.call(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 1.0)]);
    assert_eq!(bench.joints(), GOAL);
    assert_eq!((bench.time_s(), bench.now), (0.0, Duration::ZERO));
}

#[test]
fn time_step_and_flags_of_a_prepared_move_are_the_simulators() {
    let mut bench = Bench::new();
    let stated = |bench: &mut Bench, params: Value| {
        let state = bench.get("sim.moveToConfig_init", vec![params]);
        let number = |field: &str| state.get(field).and_then(Reader::number).expect("a number");
        (number("timeStep"), number("flags"))
    };
    let limited = to_config(&bench, GOAL, 1.0);
    assert_eq!(stated(&mut bench, limited), (0.0, f64::from(0x300)));
    let free = wire::map([("joints", bench.arm()), ("targetPos", floats(&GOAL))]);
    assert_eq!(stated(&mut bench, free), (10.0, f64::from(0x303)));
}

#[test]
fn an_endless_move_in_a_stopped_simulation_keeps_nobody_waiting() {
    let mut bench = Bench::new();
    bench.send(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 1e-4)]);
    bench.turn();
    assert_eq!(bench.reply(A), None);
    bench.send(B, "sim.getSimulationState", vec![]);
    assert!(bench.reply(B).is_some());
    bench.send(B, "handeye.stop", vec![]);
    assert!(bench.await_reply(A).is_some());
}

#[test]
fn a_move_is_cut_off_by_the_end_of_the_simulation() {
    let mut bench = Bench::new();
    let start = bench.joints();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.send(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 0.1)]);
    for _ in 0..5 {
        bench.turn();
    }
    assert_ne!(bench.joints(), start);
    bench.call(B, "sim.stopSimulation", vec![Value::from(true)]);
    assert!(bench.await_reply(A).is_some());
    assert_eq!(bench.joints(), start, "what was before the start is restored, and stays");
}

#[test]
fn a_callback_moves_instead_of_the_server_may_call_back_and_holds_time() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let fields = [("targetPos", floats(&[1.0])), ("pos", floats(&[0.0])), ("callback", Value::from("cb_7f@func"))];
    let fast = [("maxVel", floats(&[2.0])), ("maxAccel", floats(&[9.0])), ("maxJerk", floats(&[90.0]))];
    bench.send(A, "sim.moveToConfig", vec![wire::map(fields.into_iter().chain(fast))]);
    let mut calls = 0;
    loop {
        let reply = bench.await_reply(A).expect("goes on");
        if reply.get("ret").is_some() {
            break;
        }
        assert_eq!(reply.get("func").and_then(Reader::text), Some("cb_7f"));
        let before = bench.time_s();
        for _ in 0..5 {
            bench.turn();
        }
        // A call from inside the callback, and one that waits for a pass.
        assert_eq!(bench.call(A, "sim.getSimulationTime", vec![]).numbers(), Some(vec![before]));
        if calls == 2 {
            bench.call(A, "sim.step", vec![]);
            assert!((bench.time_s() - before - 0.05).abs() < 1e-12);
        }
        bench.send(A, "_*executed*_", vec![Value::from(false)]);
        calls += 1;
    }
    assert!(calls > 10, "{calls} calls");
}

#[test]
fn a_callback_that_returns_something_true_ends_the_move() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let move_to = wire::map([
        ("pos", floats(&[0.0])),
        ("targetPos", floats(&[1.0])),
        ("maxVel", floats(&[0.1])),
        ("maxAccel", floats(&[1.0])),
        ("maxJerk", floats(&[1.0])),
        ("callback", Value::from("cb@func")),
    ]);
    bench.send(A, "sim.moveToConfig", vec![move_to]);
    assert!(bench.await_reply(A).expect("called back").get("func").is_some());
    bench.send(A, "_*executed*_", vec![Value::from(true)]);
    assert!(bench.await_reply(A).expect("returns").get("ret").is_some());
}

#[test]
fn the_positional_form_calls_back_with_three_lists_and_returns_four_values() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let one = || floats(&[5.0]);
    let args = vec![
        Value::from(-1),
        floats(&[0.0]),
        Value::Null,
        Value::Null,
        one(),
        floats(&[50.0]),
        floats(&[500.0]),
        floats(&[1.0]),
        Value::Null,
        Value::from("cb@func"),
        Value::from("aux"),
    ];
    bench.send(A, "sim.moveToConfig", args);
    let end = loop {
        let reply = bench.await_reply(A).expect("goes on");
        match reply.get("args").and_then(Reader::list) {
            None => break reply,
            Some([pos, vel, accel, aux]) => {
                assert!(pos.numbers().is_some() && vel.numbers().is_some() && accel.numbers().is_some());
                assert_eq!(aux.text(), Some("aux"));
            }
            Some(other) => panic!("called with {other:?}"),
        }
        bench.send(A, "_*executed*_", vec![]);
    };
    let ret = end.get("ret").and_then(Reader::list).expect("values").to_vec();
    assert_eq!((ret.len(), ret[0].numbers()), (4, Some(vec![1.0])));
}

#[test]
fn a_client_can_step_a_move_itself() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    let mut state = bench.get("sim.moveToConfig_init", vec![to_config(&bench, GOAL, 2.0)]);
    let mut steps = 0;
    loop {
        let values = bench.call(A, "sim.moveToConfig_step", vec![state.clone()]);
        let [result, next] = values.list().expect("two values") else { panic!("{values:?}") };
        state = next.clone();
        bench.call(A, "sim.step", vec![]);
        steps += 1;
        if result.integer() == Some(1) {
            break;
        }
        assert_eq!(result.integer(), Some(0));
    }
    assert_eq!(bench.joints(), GOAL);
    assert!(steps > 5);
    bench.call(A, "sim.moveToConfig_cleanup", vec![state.clone()]);
    assert!(bench.error("sim.moveToConfig_step", vec![state]).contains("ruckigObj"));
}

#[test]
fn mistakes_in_a_move_are_named() {
    let mut bench = Bench::new();
    let mut error = |fields: Vec<(&str, Value)>| bench.error("sim.moveToConfig", vec![wire::map(fields)]);
    let prefix = "354: in sim.moveToConfig: ";
    assert_eq!(error(vec![]), format!("{prefix}missing or invalid 'targetPos' field."));
    let target = || ("targetPos", floats(&[1.0]));
    assert_eq!(error(vec![target()]), format!("{prefix}missing field: either 'pos' or 'joints' is required."));
    let pos = || ("pos", floats(&[0.0]));
    assert_eq!(error(vec![target(), pos(), ("maxVel", floats(&[1.0]))]), format!("{prefix}missing 'maxAccel' field."));
    let both = ("maxVel", floats(&[1.0, 1.0]));
    assert_eq!(error(vec![target(), pos(), both]), format!("{prefix}invalid 'maxVel' field."));
    let grain = ("timeStep", Value::from(0.000_15));
    assert_eq!(error(vec![target(), pos(), grain]), format!("{prefix}invalid 'timeStep' field."));
    let zero = vec![("maxVel", floats(&[0.0])), ("maxAccel", floats(&[1.0])), ("maxJerk", floats(&[1.0]))];
    let fields = [target(), pos()].into_iter().chain(zero).collect();
    assert!(error(fields).contains("must be finite and positive"));
}

pub(super) fn tip_pose(bench: &mut Bench) -> Vec<f64> {
    let tip = Value::from(bench.engine.cell.stage.tip);
    bench.get("sim.getObjectPose", vec![tip]).numbers().expect("seven numbers")
}

pub(super) fn to_pose(bench: &mut Bench, pose: &[f64], more: Vec<(&'static str, Value)>) -> Value {
    let target = bench.get("sim.getObject", vec![Value::from("/UR5/Target")]);
    let ik = wire::map([("tip", Value::from(bench.engine.cell.stage.tip)), ("target", target)]);
    let limits = [("maxVel", floats(&[0.5; 4])), ("maxAccel", floats(&[1.0; 4])), ("maxJerk", floats(&[10.0; 4]))];
    wire::map([("ik", ik), ("targetPose", floats(pose))].into_iter().chain(limits).chain(more))
}

#[test]
fn the_tip_follows_its_target_on_a_straight_line() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let start = tip_pose(&mut bench);
    let mut goal = start.clone();
    goal[0] += 0.05;
    goal[2] -= 0.05;
    let params = to_pose(&mut bench, &goal, vec![]);
    bench.send(A, "sim.moveToPose", vec![params]);
    let mut passes = 0;
    while bench.reply(A).is_none() {
        bench.turn();
        passes += 1;
        let tip = bench.engine.cell.stage.tip;
        let at = bench.call(B, "sim.getObjectPosition", vec![Value::from(tip)]);
        let at = at.list().expect("one value")[0].numbers().expect("three numbers");
        assert!(
            (at[1] - start[1]).abs() < ROUNDING && (at[0] - start[0] + at[2] - start[2]).abs() < ROUNDING,
            "{at:?}"
        );
    }
    assert!(passes > 5);
    for (reached, wanted) in tip_pose(&mut bench).iter().zip(&goal) {
        assert!((reached - wanted).abs() < ROUNDING);
    }
}

/// Two programs that go to the same poses on other ways get the same images, and so the same calibration, bit for bit.
#[test]
fn the_arm_stands_the_same_for_a_pose_of_the_tip_from_wherever_it_came() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let mut goal = tip_pose(&mut bench);
    goal[2] -= 0.02;
    let rest: Vec<Vec<f64>> = [[0.04, 0.01, 0.0], [-0.03, 0.05, 0.06]]
        .map(|sideways| {
            let mut start = goal.clone();
            start.iter_mut().zip(sideways).for_each(|(at, by)| *at += by);
            for pose in [&start, &goal] {
                let params = to_pose(&mut bench, pose, vec![]);
                bench.call(A, "sim.moveToPose", vec![params]);
            }
            bench.joints()
        })
        .into();
    for (one, other) in rest[0].iter().zip(&rest[1]) {
        assert!((one - other).abs() < ROUNDING, "{rest:?}");
    }
}

#[test]
fn an_unreachable_pose_raises_nothing_and_leaves_the_arm_where_it_was_reachable() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let mut goal = tip_pose(&mut bench);
    goal[2] += 3.0;
    let params = to_pose(&mut bench, &goal, vec![]);
    bench.call(A, "sim.moveToPose", vec![params]);
    assert!(bench.joints().iter().all(|q| q.is_finite()));
    assert!(tip_pose(&mut bench)[2] < goal[2] - 1.0);
}

#[test]
fn an_object_moves_relative_to_another() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let dummy = bench.get("sim.createDummy", vec![Value::from(0.01)]);
    let params = wire::map([
        ("object", dummy.clone()),
        ("relObject", Value::from(bench.engine.cell.stage.arm)),
        ("targetPose", floats(&[0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0])),
        ("metric", floats(&[1.0, 1.0, 1.0, 0.1])),
        ("maxVel", floats(&[1.0])),
        ("maxAccel", floats(&[5.0])),
        ("maxJerk", floats(&[50.0])),
    ]);
    let state = bench.get("sim.moveToPose", vec![params]);
    assert!(state.get("dist").and_then(Reader::number).expect("there") > 0.3);
    let position = bench.get("sim.getObjectPosition", vec![dummy]).numbers().expect("three numbers");
    // The arm is at 0.025 m.
    for (a, b) in position.iter().zip([0.1, 0.2, 0.325]) {
        assert!((a - b).abs() < 1e-9);
    }
}

#[test]
fn a_stop_brakes_within_the_limits_and_the_call_returns_where_the_arm_rests() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.send(A, "sim.moveToConfig", vec![to_config(&bench, [3.0, 0.785, -1.047, 0.0, FRAC_PI_2, 0.0], 1.0)]);
    let mut path = vec![bench.joints()[0]];
    for _ in 0..20 {
        bench.turn();
        path.push(bench.joints()[0]);
    }
    bench.call(B, "handeye.stop", vec![]);
    let reply = loop {
        if let Some(reply) = bench.reply(A) {
            break reply;
        }
        bench.turn();
        path.push(bench.joints()[0]);
    };
    let speeds: Vec<f64> = path.windows(2).map(|pair| (pair[1] - pair[0]) / 0.05).collect();
    assert!(speeds.iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v)), "{speeds:?}");
    // Mean acceleration over two passes: the limit, never more.
    assert!(speeds.windows(2).all(|pair| (pair[1] - pair[0]).abs() / 0.05 <= 4.0 + 1e-6), "{speeds:?}");
    let rest = *path.last().expect("moved");
    assert!(rest < 1.5, "went on to {rest}");
    let state = &reply.get("ret").and_then(Reader::list).expect("a map")[0];
    assert_eq!(state.get("pos").and_then(Reader::numbers).expect("numbers")[0], rest);
}

#[test]
fn a_stop_ends_a_move_of_the_tip_too() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let start = tip_pose(&mut bench);
    let mut goal = start.clone();
    goal[2] -= 0.3;
    let params = to_pose(&mut bench, &goal, vec![]);
    bench.send(A, "sim.moveToPose", vec![params]);
    for _ in 0..8 {
        bench.turn();
    }
    bench.call(B, "handeye.stop", vec![]);
    assert!(bench.await_reply(A).expect("returns").get("ret").is_some());
    let rest = tip_pose(&mut bench)[2];
    assert!(rest < start[2] - 0.01 && rest > goal[2] + 0.05, "from {} to {rest}", start[2]);
}

#[test]
fn a_client_that_vanishes_during_a_move_leaves_a_braking_arm_and_no_frozen_time() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(B, "sim.startSimulation", vec![]);
    bench.send(A, "sim.moveToConfig", vec![to_config(&bench, [3.0, 0.785, -1.047, 0.0, FRAC_PI_2, 0.0], 1.0)]);
    for _ in 0..20 {
        bench.turn();
    }
    bench.engine.disconnected(&peer(A), bench.now);
    // The pass that it had requested still comes.
    bench.turn();
    let frozen_at = bench.time_s();
    bench.turn();
    assert_eq!(bench.time_s(), frozen_at, "it may come back with a new socket");
    bench.now += Duration::from_millis(2100);
    for _ in 0..100 {
        bench.turn();
    }
    assert!(bench.time_s() > frozen_at + 2.0);
    assert!(bench.joints()[0] < 1.6, "went on to {}", bench.joints()[0]);
    assert!(bench.engine.orphans.is_empty());
}
