//! Random and mutated messages: the decoders do not panic, and the server still works.
//!
//! `HANDEYE_FUZZ` sets the number of messages, a million if not given.

use std::time::Duration;

use ciborium::Value;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::{ConnectionOptions, Endpoint, Sim};
use handeye_server::{CellConfig, CellServer};
use handeye_wire as wire;
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

fn count() -> usize {
    std::env::var("HANDEYE_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(1_000_000)
}

/// Requests and replies as really sent, to be mutated.
fn seeds() -> Vec<Vec<u8>> {
    let request = |func: &str, args: Vec<Value>| {
        wire::encode(&wire::map([
            ("func", Value::from(func)),
            ("argsL", Value::from(args.len() as u64)),
            ("args", Value::Array(args)),
            ("uuid", Value::from("c06b3832-5008-4cbb-b372-46ff92cacfe5")),
            ("ver", Value::from(2)),
            ("lang", Value::from("fuzz")),
            ("timeout", Value::from(1)),
        ]))
    };
    let index = wire::map([("index", Value::from(3))]);
    vec![
        request("zmqRemoteApi.info", vec![Value::from("sim")]),
        request("sim.getObject", vec![Value::from("/UR5/joint"), index]),
        request("sim.setObjectPose", vec![Value::from(3), wire::floats([0.0; 7]), Value::from(-1)]),
        request(
            "sim.moveToConfig",
            vec![wire::map([("joints", wire::integers([3])), ("targetPos", wire::floats([0.1]))])],
        ),
        request("sim.getVisionSensorImg", vec![Value::from(12), Value::from(0), Value::Null, wire::integers([0, 0])]),
        request("sim.addLog", vec![Value::from(450), Value::from("text@func")]),
        request("_*executed*_", vec![Value::Bool(true)]),
        wire::encode(&wire::map([("ret", Value::Array(vec![Value::Bytes(vec![1; 300]), wire::integers([10, 10])]))])),
        wire::encode(&wire::map([("err", Value::from("354: in sim._getObject: object does not exist."))])),
    ]
}

/// A seed with a few bytes changed, cut, duplicated, or pure noise.
fn mutated(seeds: &[Vec<u8>], rng: &mut impl Rng) -> Vec<u8> {
    let mut bytes = seeds[rng.random_range(0..seeds.len())].clone();
    match rng.random_range(0..5) {
        0 => bytes = (0..rng.random_range(0..64)).map(|_| rng.random()).collect(),
        1 => bytes.truncate(rng.random_range(0..bytes.len())),
        2 => {
            let at = rng.random_range(0..bytes.len());
            let part: Vec<u8> = bytes[at..].to_vec();
            bytes.extend(part);
        }
        _ => {}
    }
    for _ in 0..rng.random_range(0..4) {
        if !bytes.is_empty() {
            let at = rng.random_range(0..bytes.len());
            bytes[at] = rng.random();
        }
    }
    bytes
}

#[test]
fn a_million_bad_messages_do_not_panic_the_decoder() {
    let seeds = seeds();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut readable = 0;
    for _ in 0..count() {
        readable += usize::from(wire::decode(&mutated(&seeds, &mut rng)).is_ok());
    }
    println!("{} messages, {readable} of them still CBOR", count());
    assert!(readable > 0, "the mutations leave nothing that gets past the first byte");
}

#[test]
fn the_server_still_serves_after_a_million_bad_messages() {
    let server = CellServer::start(CellConfig {
        real_time: Some(false),
        ..CellConfig::new(Scene::reference().expect("built in"))
    })
    .expect("starts");
    let context = zmq::Context::new();
    let socket = context.socket(zmq::DEALER).expect("a socket");
    socket.set_linger(0).expect("valid");
    socket.set_sndtimeo(60_000).expect("valid");
    socket.connect(&server.endpoint()).expect("connects");
    let seeds = seeds();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for i in 0..count() {
        let message = mutated(&seeds, &mut rng);
        // Some without the empty frame that a REQ socket puts before its message.
        if i % 50 == 0 {
            socket.send(message, 0).expect("taken");
        } else {
            socket.send_multipart([Vec::new(), message], 0).expect("taken");
        }
        while socket.recv_multipart(zmq::DONTWAIT).is_ok() {}
    }
    let endpoint: Endpoint = server.endpoint().parse().expect("an endpoint");
    let patient = ConnectionOptions {
        reply_timeout: Duration::from_mins(1),
        total_timeout: Duration::from_mins(1),
        heartbeat: None,
        ..ConnectionOptions::default()
    };
    let mut sim = Sim::connect(&endpoint, patient).expect("connects");
    sim.get_object("/UR5/Tip").expect("the server still answers");
    let memory_kib = resident_kib();
    println!("resident after the flood: {memory_kib} KiB");
    assert!(memory_kib < 2 << 20, "{memory_kib} KiB");
}

/// Resident memory of this process; 0 if the system does not report it.
fn resident_kib() -> u64 {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|text| text.lines().find_map(|l| l.strip_prefix("VmRSS:")).map(str::to_owned))
        .and_then(|line| line.trim().trim_end_matches(" kB").parse().ok())
        .unwrap_or(0)
}
