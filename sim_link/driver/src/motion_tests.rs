use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

use serde_json::{Value, json};

use super::*;
use crate::{DriverOptions, DriverSpec};

/// Where the one joint of a driver is at a stamp, once it has reported that its motion is done.
type After = fn(f64) -> f64;

/// A driver that sends a state for every message that it receives, each 0.05 s later on its clock, and answers every request
/// with `done` at once. Time passes only with messages; pings come five times a second.
fn driver(after: After) -> Driver {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let output = Arc::new(Mutex::new(stream.try_clone().unwrap()));
        // Either end may be gone first.
        let _gone = converse(stream, &output, after).is_err();
    });
    let spec: DriverSpec = address.parse().unwrap();
    let options = DriverOptions { ping_every: std::time::Duration::from_millis(10), ..DriverOptions::default() };
    Driver::start(&spec, &options, &CancelToken::default()).unwrap()
}

fn converse(stream: TcpStream, output: &Mutex<TcpStream>, after: After) -> std::io::Result<()> {
    let say = |message: &Value| writeln!(output.lock().unwrap(), "{message}");
    let (mut stamp, mut done_at) = (100.0, None);
    for line in BufReader::new(stream).lines() {
        let heard: Value = serde_json::from_str(&line?)?;
        stamp += 0.05;
        let id = heard["id"].clone();
        match heard["type"].as_str().unwrap_or_default() {
            "hello" => say(&json!({
                "type": "hello", "protocol": 1, "name": "liar", "can": ["state", "joints", "move_joints"],
                "joints": [{"name": "turn", "kind": "revolute"}]
            }))?,
            "ping" => {
                let joint = done_at.map_or(0.0, |at| after(stamp - at));
                let tip = json!({"translation_m": [0.5, 0, 0.3], "rotation_xyzw": [0, 0, 0, 1]});
                say(&json!({"type": "pong", "id": id, "stamp": stamp}))?;
                say(&json!({"type": "state", "stamp": stamp, "joints_rad": [joint], "base_from_tip": tip}))?;
            }
            "arm" => say(&json!({"type": "done", "id": id}))?,
            "move" => {
                done_at = Some(stamp);
                say(&json!({"type": "accepted", "id": id}))?;
                say(&json!({"type": "done", "id": id}))?;
            }
            _ => {}
        }
    }
    Ok(())
}

fn moved(after: After) -> MoveEnd {
    let driver = driver(after);
    driver.arm(true).unwrap();
    driver.move_to(&Goal::Joints([0.6].into()), 0.5, &CancelToken::default()).unwrap()
}

#[test]
fn a_motion_is_over_when_the_states_say_so_whatever_the_driver_says() {
    // It sends `done` as soon as it has begun, and gets there.
    assert_eq!(moved(|after_s| after_s.min(0.6)), MoveEnd::Arrived);
    let MoveEnd::NotThere(Moved::Joint { index: 0, from, to }) = moved(|after_s| -after_s) else {
        panic!("it turns on")
    };
    assert!(from - to > 0.05, "from {from} to {to}");
    let stopped_short = MoveEnd::NotThere(Moved::Joint { index: 0, from: 0.6, to: 0.2 });
    assert_eq!(moved(|after_s| after_s.min(0.2)), stopped_short);
}
