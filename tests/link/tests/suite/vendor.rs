//! The vendor's own servers, replayed: their answers to this very client, byte by byte.
//!
//! `tests/data/coppeliasim-VERSION.txt` is a conversation with the remote API server of that version connected to the built-in
//! cell: a line for each message with `R`eceived or `S`ent by the server, and the bytes. It is recorded again by running the
//! ignored test with `HANDEYE_VENDOR_SERVER` naming a server whose simulation runs, and `HANDEYE_VENDOR_VERSION` its version.
//! The client's ids come from a seed, so it sends the same requests in the replay, or the test fails.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use handeye_coppeliasim::cell::{CellClient, CellPaths};
use handeye_coppeliasim::{
    CancelToken, Connection, ConnectionOptions, Endpoint, LinkError, MotionLimits, Sim, Transport, TransportFault,
    ZmqTransport,
};

const VERSIONS: [&str; 3] = ["4.7", "4.10", "newest"];

/// Plays the server's part of a conversation.
struct Replay {
    /// What the server received, and its answer.
    turns: VecDeque<(Vec<u8>, Vec<u8>)>,
    reply: Option<Vec<u8>>,
}

impl Transport for Replay {
    fn send(&mut self, message: &[u8]) -> Result<(), TransportFault> {
        let (recorded, reply) = self.turns.pop_front().expect("the conversation goes on");
        assert_eq!(String::from_utf8_lossy(message), String::from_utf8_lossy(&recorded));
        assert_eq!(message, recorded);
        self.reply = Some(reply);
        Ok(())
    }

    fn receive(&mut self, _wait: Duration) -> Result<Option<Vec<u8>>, TransportFault> {
        Ok(self.reply.take())
    }

    fn reset(&mut self) {
        panic!("the conversation is broken off");
    }

    fn send_last(&mut self, _message: &[u8]) {}

    fn connected(&mut self) -> bool {
        true
    }

    fn ended(&mut self) -> bool {
        false
    }
}

fn recorded(version: &str) -> VecDeque<(Vec<u8>, Vec<u8>)> {
    let file = format!("{}/tests/data/coppeliasim-{version}.txt", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(Path::new(&file)).expect("a recording");
    let messages: Vec<(bool, Vec<u8>)> = text
        .lines()
        .map(|line| {
            let (direction, hex) = line.split_once(' ').expect("a direction and bytes");
            let bytes = (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).expect("hex"));
            (direction == "R", bytes.collect())
        })
        .collect();
    messages
        .chunks_exact(2)
        .map(|turn| {
            assert!(turn[0].0 && !turn[1].0, "a request, and its reply");
            (turn[0].1.clone(), turn[1].1.clone())
        })
        .collect()
}

/// Connects, finds the arm, moves it, and stops.
fn converse(transport: Box<dyn Transport>, endpoint: &Endpoint) -> Result<(), LinkError> {
    let options = |seed| ConnectionOptions { seed: Some(seed), ..ConnectionOptions::default() };
    let control = Sim::new(Connection::over(transport, endpoint, options(7)));
    // Images exceed what a recording keeps.
    let unused = Sim::new(Connection::over(Box::new(ZmqTransport::new(endpoint, None)), endpoint, options(8)));
    let mut cell = CellClient::over(control, unused, &CellPaths::default())?;
    cell.arm().kinematics()?.expect("it is the UR5");
    let mut goal = cell.arm().joint_values()?;
    goal[5] += 0.02;
    cell.arm().move_to_joints(&goal, &MotionLimits::uniform(6, 1.0, 4.0, 40.0), &CancelToken::default())?;
    assert_eq!(cell.arm().joint_values()?, goal);
    cell.arm().stop()
}

#[test]
fn recorded_servers_of_the_vendor_are_understood() {
    let endpoint = Endpoint::default();
    for version in VERSIONS {
        let outcome = converse(Box::new(Replay { turns: recorded(version), reply: None }), &endpoint);
        assert_eq!(outcome, Ok(()), "{version}");
    }
}

/// Its recording ends with its first answer.
#[test]
fn a_recorded_server_before_4_7_is_refused() {
    let replay = Replay { turns: recorded("4.6"), reply: None };
    let error = converse(Box::new(replay), &Endpoint::default()).expect_err("too old");
    assert_eq!(error.to_string(), "this is CoppeliaSim 4.6.0, and 4.7 or newer is needed: update CoppeliaSim");
}

/// A transport that records all messages.
struct Recorder {
    inner: ZmqTransport,
    file: Arc<Mutex<String>>,
}

impl Recorder {
    fn note(&self, direction: char, bytes: &[u8]) {
        let mut file = self.file.lock().expect("no panic");
        file.push(direction);
        file.push(' ');
        for byte in bytes {
            write!(file, "{byte:02x}").expect("there is room");
        }
        file.push('\n');
    }
}

impl Transport for Recorder {
    fn send(&mut self, message: &[u8]) -> Result<(), TransportFault> {
        self.note('R', message);
        self.inner.send(message)
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, TransportFault> {
        let received = self.inner.receive(wait)?;
        if let Some(bytes) = &received {
            self.note('S', bytes);
        }
        Ok(received)
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn send_last(&mut self, message: &[u8]) {
        self.inner.send_last(message);
    }

    fn connected(&mut self) -> bool {
        self.inner.connected()
    }

    fn ended(&mut self) -> bool {
        self.inner.ended()
    }
}

#[test]
#[ignore = "records the server that HANDEYE_VENDOR_SERVER names"]
fn a_server_of_the_vendor_is_recorded() {
    let named = |variable: &str| std::env::var(variable).expect("the server and its version are named");
    let (address, version) = (named("HANDEYE_VENDOR_SERVER"), named("HANDEYE_VENDOR_VERSION"));
    let endpoint: Endpoint = address.parse().expect("an address");
    let file = Arc::default();
    let recorder = Recorder { inner: ZmqTransport::new(&endpoint, None), file: Arc::clone(&file) };
    converse(Box::new(recorder), &endpoint).expect("it works");
    let path = format!("{}/tests/data/coppeliasim-{version}.txt", env!("CARGO_MANIFEST_DIR"));
    std::fs::write(path, &*file.lock().expect("no panic")).expect("it is written");
}
