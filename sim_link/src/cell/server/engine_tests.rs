use std::f64::consts::FRAC_PI_2;

use ciborium::Value;
use proptest::prelude::{any, proptest};

use super::*;
use crate::cell::scene::Scene;
use crate::wire::{self, Reader as _};

/// An engine with its clock and what it has answered.
struct Bench {
    engine: Engine,
    now: Duration,
    replies: Vec<Outgoing>,
}

const A: &str = "client a";
const B: &str = "client b";

fn floats(values: &[f64]) -> Value {
    wire::floats(values.iter().copied())
}

fn peer(uuid: &str) -> Peer {
    uuid.as_bytes().to_vec()
}

fn request(uuid: &str, func: &str, args: Vec<Value>) -> Vec<u8> {
    let count = Value::from(args.len() as u64);
    wire::encode(&wire::map([
        ("func", Value::from(func)),
        ("args", Value::Array(args)),
        ("argsL", count),
        ("uuid", Value::from(uuid)),
    ]))
}

impl Bench {
    fn new() -> Self {
        Self::with(&Scene::default(), false)
    }

    fn with(scene: &Scene, real_time: bool) -> Self {
        let cell = Cell::new(scene, None, Some(real_time)).expect("valid scene");
        Self { engine: Engine::new(cell), now: Duration::ZERO, replies: Vec::new() }
    }

    fn send(&mut self, uuid: &str, func: &str, args: Vec<Value>) {
        self.engine.receive(&peer(uuid), &request(uuid, func, args), self.now);
    }

    /// The reply to `uuid` if there is one.
    fn reply(&mut self, uuid: &str) -> Option<Value> {
        self.replies.extend(self.engine.take_outgoing());
        let at = self.replies.iter().position(|(to, _)| *to == peer(uuid))?;
        Some(wire::decode(&self.replies.remove(at).1).expect("replies decode"))
    }

    /// Turns, as the loop of the server would take them, until there is a reply or nothing left to do.
    fn await_reply(&mut self, uuid: &str) -> Option<Value> {
        for _ in 0..100_000 {
            if let Some(reply) = self.reply(uuid) {
                return Some(reply);
            }
            match self.engine.due() {
                Due::Never => return None,
                Due::At(time) => self.now = self.now.max(time),
                Due::Now => {}
            }
            self.engine.turn(self.now);
        }
        None
    }

    fn call(&mut self, uuid: &str, func: &str, args: Vec<Value>) -> Value {
        self.send(uuid, func, args);
        let reply = self.await_reply(uuid).unwrap_or_else(|| panic!("{func} was not answered"));
        reply.get("ret").unwrap_or_else(|| panic!("{func} failed: {reply:?}")).clone()
    }

    /// The single value that a call returns.
    fn get(&mut self, func: &str, args: Vec<Value>) -> Value {
        match self.call(A, func, args).list() {
            Some([value]) => value.clone(),
            other => panic!("{func} returned {other:?}"),
        }
    }

    fn error(&mut self, func: &str, args: Vec<Value>) -> String {
        self.send(A, func, args);
        let reply = self.await_reply(A).expect("answered");
        reply.get("err").and_then(|text| text.text()).unwrap_or_else(|| panic!("{func} gave {reply:?}")).to_owned()
    }

    fn time_s(&self) -> f64 {
        self.engine.cell.world.simulation().time_s()
    }

    fn joints(&self) -> Vec<f64> {
        let cell = &self.engine.cell;
        cell.stage.joints.iter().map(|&h| cell.world.tree.joint(h).expect("joint").position_rad()).collect()
    }

    fn arm(&self) -> Value {
        wire::integers(self.engine.cell.stage.joints)
    }
}

fn limits(vel: f64) -> [(&'static str, Value); 3] {
    [("maxVel", floats(&[vel; 6])), ("maxAccel", floats(&[4.0; 6])), ("maxJerk", floats(&[40.0; 6]))]
}

fn to_config(bench: &Bench, target: [f64; 6], vel: f64) -> Value {
    wire::map([("joints", bench.arm()), ("targetPos", floats(&target))].into_iter().chain(limits(vel)))
}

const GOAL: [f64; 6] = [0.5, 0.6, -0.9, 0.1, 1.2, -0.3];

#[test]
fn functions_and_constants_are_listed_as_clients_expect() {
    let mut bench = Bench::new();
    assert_eq!(bench.call(A, "zmqRemoteApi.require", vec![Value::from("sim")]), Value::Map(vec![]));
    let info = bench.get("zmqRemoteApi.info", vec![Value::from("sim")]);
    assert_eq!(info.get("getObject"), Some(&wire::map([("func", Value::Map(vec![]))])));
    assert_eq!(info.get("handle_world"), Some(&wire::map([("const", Value::from(-1))])));
    assert_eq!(info.get("simulation_advancing_running"), Some(&wire::map([("const", Value::from(17))])));
    let truth = bench.get("zmqRemoteApi.info", vec![Value::from("handeye")]);
    assert!(truth.get("truth").is_some() && truth.get("getObject").is_none());
    assert_eq!(bench.error("zmqRemoteApi.info", vec![Value::from("simGLTF")]), "module 'simGLTF' not found");
}

#[test]
fn wrong_calls_are_told_so_in_the_simulators_words() {
    let mut bench = Bench::new();
    let path = "354: in sim._getObject: object does not exist, or alias/path is ill formatted.";
    assert_eq!(bench.error("sim.getObject", vec![Value::from("/nope")]), path);
    assert_eq!(bench.error("sim.foo", vec![]), "No such function: sim.foo");
    assert_eq!(bench.error("foo", vec![]), "No such function: foo");
    assert_eq!(bench.error("sim.handle_world", vec![]), "attempt to call a number value (upvalue 'func')");
    let missing = "354: in sim.getObjectPose: object does not exist.";
    assert_eq!(bench.error("sim.getObjectPose", vec![Value::from(9999)]), missing);
    let few = "354: in sim.getObjectPose: the function requires more arguments.";
    assert_eq!(bench.error("sim.getObjectPose", vec![]), few);
    let arm = Value::from(bench.engine.cell.stage.arm);
    let joint = "354: in sim.getJointPosition: object is not a joint.";
    assert_eq!(bench.error("sim.getJointPosition", vec![arm.clone()]), joint);
    let sensor = "354: in sim.getVisionSensorImg: object is not a vision sensor.";
    assert_eq!(bench.error("sim.getVisionSensorImg", vec![arm.clone()]), sensor);
    let text = "354: in sim.getObjectPose: argument 2 is not an integer.";
    assert_eq!(bench.error("sim.getObjectPose", vec![arm.clone(), Value::from("x")]), text);
    let nan = "354: in sim.setObjectPosition: invalid data.";
    assert_eq!(bench.error("sim.setObjectPosition", vec![arm.clone(), floats(&[f64::NAN, 0.0, 0.0])]), nan);
    let size = "354: in sim.setObjectPosition: incorrect table size.";
    assert_eq!(bench.error("sim.setObjectPosition", vec![arm, floats(&[1.0])]), size);
}

#[test]
fn a_missing_object_is_minus_one_for_those_who_ask_for_no_error() {
    let mut bench = Bench::new();
    let options = wire::map([("noError", Value::from(true))]);
    assert_eq!(bench.get("sim.getObject", vec![Value::from("/nope"), options]), Value::from(-1));
}

#[test]
fn setters_take_both_orders_of_arguments() {
    let mut bench = Bench::new();
    let dummy = bench.get("sim.createDummy", vec![Value::from(0.01), Value::Null]);
    bench.call(A, "sim.setObjectPosition", vec![dummy.clone(), Value::from(-1), floats(&[1.0, 2.0, 3.0])]);
    assert_eq!(bench.get("sim.getObjectPosition", vec![dummy.clone()]).numbers(), Some(vec![1.0, 2.0, 3.0]));
    bench.call(A, "sim.setObjectPosition", vec![dummy.clone(), wire::integers([4, 5, 6])]);
    assert_eq!(bench.get("sim.getObjectPosition", vec![dummy, Value::from(-1)]).numbers(), Some(vec![4.0, 5.0, 6.0]));
}

#[test]
fn an_idle_stepping_client_freezes_time_and_each_step_moves_it_by_one_pass() {
    let mut bench = Bench::new();
    assert_eq!(bench.get("sim.setStepping", vec![Value::from(true)]), Value::from(0));
    bench.call(A, "sim.startSimulation", vec![]);
    assert_eq!(bench.engine.due(), Due::At(Duration::from_millis(600_001)), "nothing but the idle limit is due");
    for pass in 1..=5 {
        bench.call(A, "sim.step", vec![]);
        assert_eq!(bench.time_s(), f64::from(pass) * 0.05);
        assert_eq!(bench.call(B, "sim.getSimulationTime", vec![]).numbers(), Some(vec![bench.time_s()]));
    }
    assert_eq!(bench.get("sim.setStepping", vec![Value::from(true)]), Value::from(1));
    assert_eq!(bench.get("sim.setStepping", vec![Value::from(false)]), Value::from(2));
    assert_eq!(bench.get("sim.setStepping", vec![Value::from(false)]), Value::from(1));
    assert_eq!(bench.engine.due(), Due::Now, "nobody steps any more, so time runs");
}

#[test]
fn a_pass_waits_for_every_stepping_client() {
    let mut bench = Bench::new();
    for uuid in [A, B] {
        bench.call(uuid, "sim.setStepping", vec![Value::from(true)]);
    }
    bench.call(A, "sim.startSimulation", vec![]);
    bench.send(A, "sim.step", vec![]);
    for _ in 0..10 {
        bench.engine.turn(bench.now);
    }
    assert_eq!((bench.time_s(), bench.reply(A)), (0.0, None));
    bench.send(B, "sim.step", vec![]);
    assert!(bench.await_reply(A).is_some() && bench.await_reply(B).is_some());
    assert_eq!(bench.time_s(), 0.05);
}

#[test]
fn a_step_returns_at_once_while_nothing_advances() {
    let mut bench = Bench::new();
    assert_eq!(bench.call(A, "sim.step", vec![]), Value::Map(vec![]));
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.pauseSimulation", vec![]);
    for _ in 0..3 {
        bench.engine.turn(bench.now);
    }
    let paused_at = bench.time_s();
    assert_eq!(bench.call(A, "sim.step", vec![Value::from(true)]), Value::Map(vec![]));
    assert_eq!(bench.time_s(), paused_at);
}

#[test]
fn stopping_the_simulation_ends_stepping_and_waits_for_the_end_if_asked() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.step", vec![]);
    bench.call(B, "sim.stopSimulation", vec![Value::from(true)]);
    assert_eq!(bench.get("sim.getSimulationState", vec![]), Value::from(0));
    assert_eq!(bench.get("sim.setStepping", vec![Value::from(false)]), Value::from(0));
}

#[test]
fn in_real_time_a_pass_comes_every_time_step_and_a_pause_is_not_made_up_for() {
    let mut bench = Bench::with(&Scene::default(), true);
    bench.call(A, "sim.startSimulation", vec![]);
    let start = bench.now;
    bench.engine.turn(bench.now);
    for _ in 0..20 {
        bench.now += Duration::from_millis(10);
        bench.engine.turn(bench.now);
    }
    assert_eq!(bench.now - start, Duration::from_millis(200));
    assert!((bench.time_s() - 0.25).abs() < 1e-12, "{}", bench.time_s());
    bench.now += Duration::from_secs(10);
    for _ in 0..10 {
        bench.engine.turn(bench.now);
    }
    assert!(bench.time_s() < 0.4, "{}", bench.time_s());
}

#[test]
fn a_lock_holds_time_and_does_not_lock_its_owner_out() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.acquireLock", vec![]);
    let locked_at = bench.time_s();
    for _ in 0..10 {
        bench.engine.turn(bench.now);
    }
    assert_eq!(bench.time_s(), locked_at);
    bench.call(A, "sim.step", vec![]);
    assert!((bench.time_s() - locked_at - 0.05).abs() < 1e-12);
    bench.call(A, "sim.releaseLock", vec![]);
    assert_eq!(bench.engine.due(), Due::Now);
}

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
        bench.engine.turn(bench.now);
        seen.push(bench.call(B, "sim.getJointPosition", vec![Value::from(bench.engine.cell.stage.joints[0])]));
    };
    assert_eq!(bench.joints(), GOAL);
    assert!(seen.len() > 10, "only {} looks during the move", seen.len());
    let state = &done.get("ret").and_then(|ret| ret.list()).expect("a map")[0];
    assert_eq!(state.get("pos").and_then(|v| v.numbers()), Some(GOAL.to_vec()));
    assert_eq!(state.get("vel").and_then(|v| v.numbers()), Some(vec![0.0; 6]));
    for field in ["joints", "accel", "targetPos", "targetVel", "maxVel", "minVel", "maxJerk", "minAccel", "flags", "timeStep", "timeLeft"] {
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
fn an_endless_move_in_a_stopped_simulation_keeps_nobody_waiting() {
    let mut bench = Bench::new();
    bench.send(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 1e-4)]);
    bench.engine.turn(bench.now);
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
        bench.engine.turn(bench.now);
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
        assert_eq!(reply.get("func").and_then(|f| f.text()), Some("cb_7f"));
        let before = bench.time_s();
        for _ in 0..5 {
            bench.engine.turn(bench.now);
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
        match reply.get("args").and_then(|args| args.list()) {
            None => break reply,
            Some([pos, vel, accel, aux]) => {
                assert!(pos.numbers().is_some() && vel.numbers().is_some() && accel.numbers().is_some());
                assert_eq!(aux.text(), Some("aux"));
            }
            Some(other) => panic!("called with {other:?}"),
        }
        bench.send(A, "_*executed*_", vec![]);
    };
    let ret = end.get("ret").and_then(|ret| ret.list()).expect("values").to_vec();
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

fn tip_pose(bench: &mut Bench) -> Vec<f64> {
    let tip = Value::from(bench.engine.cell.stage.tip);
    bench.get("sim.getObjectPose", vec![tip]).numbers().expect("seven numbers")
}

fn to_pose(bench: &mut Bench, pose: &[f64], more: Vec<(&'static str, Value)>) -> Value {
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
        bench.engine.turn(bench.now);
        passes += 1;
        let tip = bench.engine.cell.stage.tip;
        let at = bench.call(B, "sim.getObjectPosition", vec![Value::from(tip)]);
        let at = at.list().expect("one value")[0].numbers().expect("three numbers");
        // Precision that the solver is asked for, with room for its last iteration.
        assert!((at[1] - start[1]).abs() < 1e-5 && (at[0] - start[0] + at[2] - start[2]).abs() < 1e-5, "{at:?}");
    }
    assert!(passes > 5);
    for (reached, wanted) in tip_pose(&mut bench).iter().zip(&goal) {
        assert!((reached - wanted).abs() < 1e-5);
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
    assert!(state.get("dist").and_then(|d| d.number()).expect("there") > 0.3);
    let position = bench.get("sim.getObjectPosition", vec![dummy]).numbers().expect("three numbers");
    // The arm stands at 0.025 m.
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
        bench.engine.turn(bench.now);
        path.push(bench.joints()[0]);
    }
    bench.call(B, "handeye.stop", vec![]);
    let reply = loop {
        if let Some(reply) = bench.reply(A) {
            break reply;
        }
        bench.engine.turn(bench.now);
        path.push(bench.joints()[0]);
    };
    let speeds: Vec<f64> = path.windows(2).map(|pair| (pair[1] - pair[0]) / 0.05).collect();
    assert!(speeds.iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v)), "{speeds:?}");
    // Mean acceleration over two passes: the limit, never more.
    assert!(speeds.windows(2).all(|pair| (pair[1] - pair[0]).abs() / 0.05 <= 4.0 + 1e-6), "{speeds:?}");
    let rest = *path.last().expect("moved");
    assert!(rest < 1.5, "went on to {rest}");
    let state = &reply.get("ret").and_then(|ret| ret.list()).expect("a map")[0];
    assert_eq!(state.get("pos").and_then(|p| p.numbers()).expect("numbers")[0], rest);
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
        bench.engine.turn(bench.now);
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
        bench.engine.turn(bench.now);
    }
    bench.engine.disconnected(&peer(A), bench.now);
    // The pass that it had asked for still comes.
    bench.engine.turn(bench.now);
    let frozen_at = bench.time_s();
    bench.engine.turn(bench.now);
    assert_eq!(bench.time_s(), frozen_at, "it may come back with a new socket");
    bench.now += Duration::from_millis(2100);
    for _ in 0..100 {
        bench.engine.turn(bench.now);
    }
    assert!(bench.time_s() > frozen_at + 2.0);
    assert!(bench.joints()[0] < 1.6, "went on to {}", bench.joints()[0]);
    assert!(bench.engine.orphans.is_empty());
}

#[test]
fn a_client_that_comes_back_with_a_new_socket_keeps_its_stepping() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.engine.disconnected(&peer(A), bench.now);
    bench.now += Duration::from_millis(500);
    bench.engine.receive(&b"new socket".to_vec(), &request(A, "sim.getSimulationTime", vec![]), bench.now);
    bench.now += Duration::from_secs(60);
    for _ in 0..5 {
        bench.engine.turn(bench.now);
    }
    assert_eq!(bench.time_s(), 0.0);
}

#[test]
fn a_client_that_vanishes_inside_its_callback_releases_time() {
    let mut bench = Bench::new();
    bench.call(B, "sim.startSimulation", vec![]);
    bench.send(A, "sim.testCB", vec![Value::from(1), Value::from("cb@func"), Value::from(2)]);
    assert!(bench.reply(A).expect("called back").get("func").is_some());
    let before = bench.time_s();
    bench.engine.turn(bench.now);
    assert_eq!(bench.time_s(), before);
    bench.engine.disconnected(&peer(A), bench.now);
    bench.engine.turn(bench.now);
    assert!(bench.time_s() > before);
}

#[test]
fn a_silent_client_is_forgotten_after_the_time_that_it_named() {
    let mut bench = Bench::new();
    let hello = wire::map([
        ("func", Value::from("sim.setStepping")),
        ("args", Value::Array(vec![Value::from(true)])),
        ("uuid", Value::from(A)),
        ("timeout", Value::from(5)),
    ]);
    bench.engine.receive(&peer(A), &wire::encode(&hello), bench.now);
    bench.call(B, "sim.startSimulation", vec![]);
    bench.now += Duration::from_secs(4);
    bench.engine.turn(bench.now);
    assert_eq!(bench.time_s(), 0.0);
    assert_eq!(bench.engine.due(), Due::At(Duration::from_millis(5001)));
    bench.now = Duration::from_millis(5001);
    bench.engine.turn(bench.now);
    assert!(bench.time_s() > 0.0);
}

#[test]
fn the_end_message_frees_a_client_and_is_answered_with_an_empty_map() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(B, "sim.startSimulation", vec![]);
    bench.send(A, "_*end*_", vec![]);
    assert_eq!(bench.reply(A), Some(Value::Map(vec![])));
    assert_eq!(bench.engine.due(), Due::Now);
}

#[test]
fn one_client_may_have_several_sockets_with_a_call_under_way_on_each() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    for socket in 0..5_u8 {
        let wait = request(A, "sim.wait", vec![Value::from(0.05 * f64::from(socket))]);
        bench.engine.receive(&vec![socket], &wait, bench.now);
    }
    for _ in 0..10 {
        bench.engine.turn(bench.now);
    }
    bench.replies.extend(bench.engine.take_outgoing());
    let mut answered: Vec<Peer> = bench.replies.iter().map(|(peer, _)| peer.clone()).collect();
    answered.sort();
    assert_eq!(answered, (0..5_u8).map(|socket| vec![socket]).collect::<Vec<_>>());
}

#[test]
fn requests_without_id_without_function_and_with_code_have_their_own_answers() {
    let mut bench = Bench::new();
    let mut answer = |request: Value| {
        bench.engine.receive(&peer(A), &wire::encode(&request), Duration::ZERO);
        bench.reply(A).expect("answered")
    };
    let mismatch = answer(wire::map([("func", Value::from("sim.step")), ("args", Value::Array(vec![]))]));
    assert_eq!(mismatch.get("success"), Some(&Value::from(false)));
    assert!(mismatch.get("error").and_then(|e| e.text()).expect("text").contains("version does not match"));
    let uuid = || ("uuid", Value::from(A));
    assert_eq!(answer(wire::map([uuid()])), Value::Map(vec![]));
    assert!(answer(wire::map([uuid(), ("eval", Value::from("return 1"))])).get("err").is_some());
    assert!(answer(wire::map([uuid(), ("func", Value::from("_*executed*_"))])).get("err").is_some());
    assert!(answer(Value::from(3)).get("err").is_some());
}

#[test]
fn clients_and_their_calls_are_limited_and_idle_ones_make_room() {
    let mut bench = Bench::new();
    for index in 0..MAX_CLIENTS + 10 {
        bench.now += Duration::from_millis(1);
        bench.call(&format!("idle {index}"), "sim.getSimulationState", vec![]);
    }
    assert_eq!(bench.engine.clients.len(), MAX_CLIENTS);
    for index in 0..MAX_CLIENTS {
        bench.call(&format!("busy {index}"), "sim.setStepping", vec![Value::from(true)]);
    }
    assert!(bench.error("sim.getSimulationState", vec![]).contains("64 clients at a time"));
    bench.engine.forget("busy 0");
    bench.call(A, "sim.startSimulation", vec![]);
    for _ in 0..MAX_CALLS {
        bench.send(A, "sim.step", vec![]);
    }
    assert_eq!(bench.reply(A), None);
    bench.send(A, "sim.step", vec![]);
    assert!(bench.reply(A).expect("refused").get("err").is_some());
}

#[test]
fn truth_is_what_the_objects_say_in_opencvs_axes() {
    let mut bench = Bench::new();
    let truth = bench.get("handeye.truth", vec![]);
    let numbers = |name: &str| truth.get(name).and_then(|v| v.numbers()).expect("numbers");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (a, b) in numbers("tip_from_camera").iter().zip([0.05, 0.0, 0.0, 0.0, 0.0, half, half]) {
        assert!((a - b).abs() < 1e-12);
    }
    let focal = truth.get("intrinsics").and_then(|i| i.get("fx")).and_then(|f| f.number()).expect("a number");
    assert!((focal - 589.3667).abs() < 1e-4);
    let mut moved = numbers("base_from_target");
    moved[1] -= 0.1;
    bench.call(A, "handeye.setBoardPose", vec![floats(&moved)]);
    let read = bench.get("handeye.truth", vec![]).get("base_from_target").and_then(|v| v.numbers()).expect("numbers");
    for (a, b) in read.iter().zip(&moved) {
        assert!((a - b).abs() < 1e-12);
    }
}

#[test]
fn buffers_are_background_before_the_first_pass_and_come_with_the_full_resolution() {
    let mut bench = Bench::new();
    let camera = Value::from(bench.engine.cell.stage.camera);
    let image = bench.call(A, "sim.getVisionSensorImg", vec![camera.clone()]);
    let [pixels, size] = image.list().expect("two values") else { panic!("two values") };
    let pixels = pixels.blob().expect("bytes");
    assert_eq!((pixels.len(), size), (640 * 480 * 3, &wire::integers([640, 480])));
    assert!(pixels.chunks(3).all(|pixel| pixel == [182, 196, 214]));
    let crop = vec![camera.clone(), Value::from(1), Value::from(0.0), wire::integers([10, 20]), wire::integers([4, 2])];
    let part = bench.call(A, "sim.getVisionSensorImg", crop);
    let [pixels, size] = part.list().expect("two values") else { panic!("two values") };
    assert_eq!((pixels.blob(), size), (Some(&[197_u8; 8][..]), &wire::integers([640, 480])));
    let beyond = vec![camera, Value::from(0), Value::from(0.0), wire::integers([639, 0]), wire::integers([2, 1])];
    assert!(bench.error("sim.getVisionSensorImg", beyond).ends_with("invalid arguments."));
    let depth = bench.get("sim.getObject", vec![Value::from("/UR5/3D_camera/depth")]);
    for (options, far) in [(1, 3.5_f32), (0, 1.0)] {
        let depths = bench.call(A, "sim.getVisionSensorDepth", vec![depth.clone(), Value::from(options)]);
        let bytes = depths.list().expect("two values")[0].blob().expect("bytes").to_vec();
        assert_eq!(bytes.len(), 640 * 480 * 4);
        assert!(bytes.chunks(4).all(|b| b == far.to_le_bytes()));
    }
}

#[test]
fn a_vision_sensor_tells_its_lens_by_parameters_and_properties() {
    let mut bench = Bench::new();
    let camera = Value::from(bench.engine.cell.stage.camera);
    let angle = bench.get("sim.getObjectFloatParam", vec![camera.clone(), Value::from(1004)]).number().expect("a number");
    assert!((angle - 57.0_f64.to_radians()).abs() < 1e-12);
    assert_eq!(bench.get("sim.getObjectInt32Param", vec![camera.clone(), Value::from(1002)]), Value::from(640));
    let planes = bench.get("sim.getFloatArrayProperty", vec![camera.clone(), Value::from("clippingPlanes")]);
    assert_eq!(planes.numbers(), Some(vec![0.01, 3.5]));
    assert_eq!(bench.call(A, "sim.getObjectFloatParam", vec![camera, Value::from(7)]), Value::Map(vec![]));
}

#[test]
fn signals_and_logs_are_kept_within_bounds() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStringSignal", vec![Value::from("s"), Value::Bytes(vec![0, 255])]);
    assert_eq!(bench.get("sim.getStringSignal", vec![Value::from("s")]), Value::Bytes(vec![0, 255]));
    assert_eq!(bench.call(A, "sim.getInt32Signal", vec![Value::from("s")]), Value::Map(vec![]));
    let long = Value::Bytes(vec![0; super::super::cell::MAX_SIGNAL_BYTES + 1]);
    assert!(bench.error("sim.setStringSignal", vec![Value::from("s"), long]).contains("bytes in a signal"));
    let refused = (0..1000).find(|i| {
        bench.send(A, "sim.setInt32Signal", vec![Value::from(format!("{i}")), Value::from(1)]);
        bench.reply(A).expect("answered").get("err").is_some()
    });
    assert_eq!(refused, Some(255));
    for line in 0..1000 {
        bench.call(A, "sim.addLog", vec![Value::from(450), Value::from(format!("{line}"))]);
    }
    assert_eq!(bench.engine.cell().log.len(), 200);
    bench.call(A, "sim.addLog", vec![Value::from(450), Value::Null]);
    assert!(bench.error("sim.addLog", vec![Value::from(420), Value::from("oh")]).ends_with("oh"));
}

#[test]
fn twenty_thousand_mutated_requests_break_nothing() {
    use rand::{Rng as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let params = to_pose(&mut bench, &[0.1, -0.1, 0.8, 0.0, 0.0, 0.0, 1.0], vec![]);
    let options = wire::map([("index", Value::from(3)), ("proxy", Value::from(16))]);
    let seeds = [
        request(A, "sim.getObject", vec![Value::from("/UR5/joint[0]{2}"), options]),
        request(A, "sim.setObjectPose", vec![Value::from(16), floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])]),
        request(A, "sim.setObjectParent", vec![Value::from(18), Value::from(20), Value::from(true)]),
        request(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 1.0)]),
        request(A, "sim.moveToPose", vec![params]),
        request(A, "sim.getVisionSensorImg", vec![Value::from(15), Value::from(3), Value::from(0.5), floats(&[0.0, 1.0]), floats(&[9.0, 9.0])]),
        request(A, "sim.removeObjects", vec![wire::integers([15, 16, 17])]),
        request(A, "sim.createDummy", vec![Value::from(0.01)]),
        request(A, "sim.setJointTargetPosition", vec![Value::from(16), Value::from(1.0), floats(&[1.0, 1.0, 1.0])]),
        request(A, "sim.testCB", vec![Value::from(1), Value::from("f@func"), Value::from(2), Value::from(3)]),
        request(A, "_*executed*_", vec![Value::from(1)]),
        request(A, "sim.wait", vec![Value::from(1.0), Value::from(false)]),
        request(A, "sim.setStepping", vec![Value::from(true)]),
    ];
    for round in 0..20_000_u64 {
        let mut bytes = seeds[(rng.next_u32() as usize) % seeds.len()].clone();
        for _ in 0..=rng.next_u32() % 4 {
            let at = (rng.next_u32() as usize) % bytes.len();
            match rng.next_u32() % 4 {
                0 => bytes[at] = rng.next_u32() as u8,
                1 => bytes[at] ^= 1 << (rng.next_u32() % 8),
                2 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, rng.next_u32() as u8),
            }
        }
        bench.now += Duration::from_millis(1);
        let socket = vec![(round % 7) as u8];
        bench.engine.receive(&socket, &bytes, bench.now);
        if round % 50 == 0 {
            bench.engine.turn(bench.now);
            bench.engine.disconnected(&socket, bench.now);
        }
        bench.engine.take_outgoing();
    }
    bench.now += Duration::from_secs(100_000);
    bench.engine.turn(bench.now);
    assert_eq!(bench.call("fresh client", "sim.getSimulationState", vec![]).list().map(<[Value]>::len), Some(1));
}

proptest! {
    #[test]
    fn no_bytes_at_all_make_the_engine_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut bench = Bench::new();
        bench.engine.receive(&peer(A), &bytes, Duration::ZERO);
        assert!(bench.reply(A).is_some());
    }
}
