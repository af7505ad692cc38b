mod arms;
mod board;
mod calls;
mod fuzz;
mod motions;

use ciborium::Value;

use super::super::clients::{MAX_CLIENTS, MAX_CLIENTS_PER_CONNECTION};
use super::*;
use handeye_cell::scene::Scene;
use handeye_wire::{self as wire, Reader};

/// An engine with its clock and what it has answered.
struct Bench {
    engine: Engine,
    now: Duration,
    replies: Vec<Outgoing>,
    /// Number of requests to wait.
    waits: usize,
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
        Self { engine: Engine::new(cell, Registry::new()), now: Duration::ZERO, replies: Vec::new(), waits: 0 }
    }

    fn send(&mut self, uuid: &str, func: &str, args: Vec<Value>) {
        self.engine.receive(&peer(uuid), &request(uuid, func, args), self.now);
    }

    /// Takes the engine's messages. Clients that are asked to wait confirm that, as all of the vendor's do; `true` if
    /// there were any.
    fn listen(&mut self) -> bool {
        let (asked, reported): (Vec<_>, Vec<_>) =
            self.engine.take_outgoing().into_iter().partition(|(_, bytes)| *bytes == message::wait());
        self.replies.extend(reported);
        self.waits += asked.len();
        for (to, _) in &asked {
            let uuid = self.engine.clients.connection_mut(to).map(|c| c.uuid.clone()).unwrap_or_default();
            self.engine.receive(to, &request(&uuid, "_*executed*_", vec![]), self.now);
        }
        !asked.is_empty()
    }

    /// A turn of the server's loop, later than any request is waited for.
    fn turn(&mut self) {
        self.listen();
        self.now += REQUEST_GRACE * 2;
        self.engine.turn(self.now);
    }

    /// The reply to `uuid` if there is one.
    fn reply(&mut self, uuid: &str) -> Option<Value> {
        if self.replies.is_empty() {
            self.listen();
        }
        let at = self.replies.iter().position(|(to, _)| *to == peer(uuid))?;
        Some(wire::decode(&self.replies.remove(at).1).expect("replies decode"))
    }

    /// Turns, as the loop of the server would take them, until there is a reply or nothing left to do.
    fn await_reply(&mut self, uuid: &str) -> Option<Value> {
        for _ in 0..100_000 {
            let is_lively = self.listen();
            if let Some(reply) = self.reply(uuid) {
                return Some(reply);
            }
            if is_lively {
                continue;
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
        reply.get("err").and_then(Reader::text).unwrap_or_else(|| panic!("{func} gave {reply:?}")).to_owned()
    }

    /// Whether a pass comes by itself, as soon as there are no more requests.
    fn is_pass_near(&self) -> bool {
        matches!(self.engine.due(), Due::At(time) if time <= self.now + REQUEST_GRACE * 2)
    }

    fn time_s(&self) -> f64 {
        self.engine.cell.world.simulation().time_s()
    }

    fn joints(&self) -> Vec<f64> {
        let cell = &self.engine.cell;
        cell.stage.joints.iter().map(|&h| cell.world.tree.joint(h).expect("joint").position_rad()).collect()
    }

    fn arm(&self) -> Value {
        wire::integers(self.engine.cell.stage.joints.iter().copied())
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
    assert!(bench.is_pass_near(), "nobody steps now, so time runs");
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
        bench.turn();
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
        bench.turn();
    }
    let paused_at = bench.time_s();
    assert_eq!(bench.call(A, "sim.step", vec![Value::from(true)]), Value::Map(vec![]));
    assert_eq!(bench.time_s(), paused_at);
}

#[test]
fn a_client_hears_in_every_pass_of_a_long_call_that_it_goes_on() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.call(A, "sim.wait", vec![Value::from(1.02)]);
    // Twenty-one passes of 0.05 s.
    assert_eq!(bench.waits, 21);

    // In real time: 7 s without a pass, which the vendor's clients would not wait for in silence.
    bench.call(A, "sim.stopSimulation", vec![Value::from(true)]);
    bench.waits = 0;
    let before = bench.now;
    bench.call(A, "sim.wait", vec![Value::from(7.0), Value::from(false)]);
    assert!(bench.now >= before + Duration::from_secs(7));
    assert!((7..10).contains(&bench.waits), "{} times in 7 s", bench.waits);
}

#[test]
fn a_client_whose_pass_is_held_by_another_hears_that_its_call_goes_on() {
    let mut bench = Bench::new();
    bench.call(B, "sim.acquireLock", vec![]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.send(A, "sim.step", vec![]);
    for _ in 0..8 {
        bench.listen();
        bench.now += Duration::from_secs(1);
        bench.engine.turn(bench.now);
    }
    assert_eq!((bench.reply(A), bench.time_s()), (None, 0.0));
    assert_eq!(bench.waits, 9, "at once, and every second");
}

#[test]
fn a_client_that_does_not_say_that_it_waits_is_forgotten_in_time() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.engine.receive(&peer(A), &request(A, "sim.step", vec![]), bench.now);
    // It dies: the question whether it waits is not answered, and its idle limit passes.
    bench.engine.take_outgoing();
    bench.now += Duration::from_mins(11);
    bench.engine.turn(bench.now);
    assert!(bench.engine.clients.records.is_empty());
}

#[test]
fn a_pass_waits_a_moment_for_further_requests() {
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    bench.turn();
    let before = bench.time_s();
    for _ in 0..3 {
        bench.call(A, "sim.getSimulationTime", vec![]);
        bench.engine.turn(bench.now);
        assert_eq!(bench.time_s(), before, "calls in a row see one instant");
    }
    bench.engine.turn(bench.now + REQUEST_GRACE);
    assert!(bench.time_s() > before);
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
    assert_eq!(bench.now, start + Duration::from_millis(200));
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
        bench.turn();
    }
    assert_eq!(bench.time_s(), locked_at);
    bench.call(A, "sim.step", vec![]);
    assert!((bench.time_s() - locked_at - 0.05).abs() < 1e-12);
    bench.call(A, "sim.releaseLock", vec![]);
    assert!(bench.is_pass_near());
}

#[test]
fn a_client_that_comes_back_with_a_new_socket_keeps_its_stepping() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(A, "sim.startSimulation", vec![]);
    bench.engine.disconnected(&peer(A), bench.now);
    bench.now += Duration::from_millis(500);
    bench.engine.receive(&b"new socket".to_vec(), &request(A, "sim.getSimulationTime", vec![]), bench.now);
    bench.now += Duration::from_mins(1);
    for _ in 0..5 {
        bench.turn();
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
    bench.turn();
    assert_eq!(bench.time_s(), before);
    bench.engine.disconnected(&peer(A), bench.now);
    bench.turn();
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
    bench.turn();
    assert_eq!(bench.time_s(), 0.0);
    assert_eq!(bench.engine.due(), Due::At(Duration::from_millis(5001)));
    bench.now = Duration::from_millis(5001);
    bench.turn();
    assert!(bench.time_s() > 0.0);
}

#[test]
fn of_clients_that_are_forgotten_those_that_held_the_simulation_are_reported() {
    let mut bench = Bench::new();
    bench.call(A, "sim.getSimulationTime", vec![]);
    bench.now += Duration::from_hours(1);
    assert_eq!(bench.engine.forget_silent(bench.now), [""; 0], "it waited for work");
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.now += Duration::from_hours(1);
    assert_eq!(bench.engine.forget_silent(bench.now), [A]);
    assert_eq!(bench.engine.forget_silent(bench.now), [""; 0], "it is forgotten");
}

#[test]
fn the_end_message_frees_a_client_and_is_answered_with_an_empty_map() {
    let mut bench = Bench::new();
    bench.call(A, "sim.setStepping", vec![Value::from(true)]);
    bench.call(B, "sim.startSimulation", vec![]);
    bench.send(A, "_*end*_", vec![]);
    assert_eq!(bench.reply(A), Some(Value::Map(vec![])));
    assert!(bench.is_pass_near());
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
        bench.turn();
    }
    bench.listen();
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
    assert!(mismatch.get("error").and_then(Reader::text).expect("text").contains("version does not match"));
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
    assert_eq!(bench.engine.clients.records.len(), MAX_CLIENTS);
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
fn the_ids_of_one_connection_take_only_their_share_and_go_with_it() {
    let mut bench = Bench::new();
    let crowd = peer("crowd");
    let mut refused = 0;
    for index in 0..2 * MAX_CLIENTS {
        let stepping = request(&format!("id {index}"), "sim.setStepping", vec![Value::from(true)]);
        bench.engine.receive(&crowd, &stepping, bench.now);
        let reply = wire::decode(&bench.engine.take_outgoing().remove(0).1).expect("a reply");
        refused += usize::from(reply.get("err").is_some());
    }
    assert_eq!(bench.engine.clients.records.len(), MAX_CLIENTS_PER_CONNECTION);
    assert_eq!(refused, 2 * MAX_CLIENTS - MAX_CLIENTS_PER_CONNECTION);
    bench.call(A, "sim.startSimulation", vec![]);
    // All of them are gone with their connection, not only the last one with a message: no client holds the passes now.
    bench.engine.disconnected(&crowd, bench.now);
    bench.now += Duration::from_secs(3);
    bench.turn();
    bench.turn();
    assert_eq!(bench.engine.clients.records.len(), 1);
    assert!(bench.time_s() > 0.0);
}

#[test]
fn a_connection_may_change_its_id_as_often_as_it_likes() {
    let mut bench = Bench::new();
    for index in 0..2 * MAX_CLIENTS {
        bench.now += Duration::from_millis(1);
        let state = request(&format!("id {index}"), "sim.getSimulationState", vec![]);
        bench.engine.receive(&peer("one"), &state, bench.now);
        let reply = wire::decode(&bench.engine.take_outgoing().remove(0).1).expect("a reply");
        assert!(reply.get("ret").is_some(), "{reply:?}");
    }
}
