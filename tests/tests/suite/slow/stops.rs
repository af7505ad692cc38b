//! STOP at a page, while the workbench has to draw the worst frames that a page can cause.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::{Arm, CellPaths, JOG_JOINT_SPEED_RAD_S};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint, MotionLimits};
use handeye_tests::CellProcess;
use handeye_tests::served::Served;
use rand::{RngExt as _, SeedableRng as _};
use serde_json::{Value, json};
use tungstenite::Message;

/// From STOP to an arm at rest, by the clock of the cell \[s\], on a machine that is not busy.
const AT_REST_S: f64 = 0.3;

/// How many stops at a page of the workbench that draws. Half as many go, alternating with them, through a second workbench
/// that has nothing to draw: the same path, on the same machine at the same time. Other load of the machine delays stops of
/// both; waiting for a frame delays those of the first.
const STOPS: usize = 50;

/// How many standard deviations more late stops the first may have than twice those of the second. If a stop of either is late
/// with the same small probability, the difference has a variance of twice the number of late stops: more than four occur by
/// chance once in thirty thousand runs.
const DEVIATIONS: f64 = 4.0;

/// Passes of the cell, short enough to resolve the time to rest \[s\].
const TIME_STEP_S: &str = "0.01";

/// Share of the fastest speed at which the workbench moves an arm behind an address.
const SHARE: f64 = 0.25;

/// An arm that does not move for this long \[s\] is at rest.
const STILL_S: f64 = 0.15;

/// Bytes that are pasted at once: as many as fit in a message.
const PASTED: usize = 60_000;

/// Longer than anything takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(4);

type Page = tungstenite::WebSocket<std::net::TcpStream>;

fn tell(page: &mut Page, what: &Value) {
    page.send(Message::text(what.to_string())).expect("sent");
}

fn key(name: &str, modifiers: u8, down: bool) -> Value {
    json!({"e": "key", "key": name, "down": down, "modifiers": modifiers})
}

/// A page that has the palette open and pastes into it as fast as frames come, on the largest supported screen. On each
/// request it presses Esc once.
fn burden(mut page: Page, ends: &AtomicBool, escapes: &AtomicU64, frames: &AtomicU64) {
    tell(&mut page, &json!({"t": "screen", "width": 8000.0, "height": 8000.0, "scale": 2.0, "touch": false}));
    tell(&mut page, &json!({"t": "reads", "reads": true}));
    page.get_ref().set_read_timeout(Some(Duration::from_millis(5))).expect("set");
    let words = "Wide letters of every kind ÄÖÜ äöü ";
    let text = words.repeat(PASTED / words.len());
    let open =
        |name, modifiers| json!({"t": "input", "events": [key(name, modifiers, true), key(name, modifiers, false)]});
    tell(&mut page, &open("k", 2));
    let mut pressed = 0;
    while !ends.load(Ordering::Acquire) {
        if escapes.load(Ordering::Acquire) > pressed {
            pressed += 1;
            tell(&mut page, &open("Escape", 0));
            tell(&mut page, &open("k", 2));
        }
        let message = match page.read() {
            Ok(message) => message,
            Err(tungstenite::Error::Io(_)) => continue,
            Err(error) => panic!("the page is closed: {error}"),
        };
        if let Message::Binary(bytes) = message {
            let end = 4 + u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
            let head: Value = serde_json::from_slice(&bytes[4..end]).expect("JSON");
            tell(&mut page, &json!({"t": "shown", "number": head["number"]}));
            tell(&mut page, &json!({"t": "input", "events": [{"e": "paste", "text": text}]}));
            frames.fetch_add(1, Ordering::AcqRel);
        }
    }
}

/// Signals that the test has ended, also if it fails: otherwise the drawing thread would be waited for.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Another client of the cell.
fn arm(cell: &CellProcess) -> Arm {
    let endpoint = Endpoint::local(cell.port());
    Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default()).expect("a cell")
}

fn time_s(arm: &mut Arm) -> f64 {
    arm.sim().get_simulation_time().expect("a call")
}

/// Time and joints of one and the same pass.
fn seen(arm: &mut Arm) -> (f64, JointValues) {
    let deadline = Instant::now() + PATIENCE;
    let mut before_s = time_s(arm);
    loop {
        assert!(Instant::now() < deadline, "no call is answered within a pass");
        let joints = arm.joint_values().expect("a call");
        let after_s = time_s(arm);
        if after_s <= before_s {
            return (after_s, joints);
        }
        before_s = after_s;
    }
}

/// When the arm has last moved, once it is at rest.
fn last_moved_s(arm: &mut Arm) -> f64 {
    let (mut moved_s, mut joints) = seen(arm);
    loop {
        let (now_s, now) = seen(arm);
        if now != joints {
            (moved_s, joints) = (now_s, now);
        }
        if now_s - moved_s > STILL_S {
            return moved_s;
        }
    }
}

fn until_moving(arm: &mut Arm, from: &JointValues) {
    let deadline = Instant::now() + PATIENCE;
    while arm.joint_values().expect("a call") == *from {
        assert!(Instant::now() < deadline, "the arm does not move");
    }
}

#[test]
fn stop_at_a_page_waits_for_no_frame() {
    let cell = CellProcess::start(&["--time-step", TIME_STEP_S]);
    let mut watch = arm(&cell);
    watch.sim().start_simulation().expect("it starts");
    let served = Served::start(&["--connect", &Endpoint::local(cell.port()).to_string()]);
    let idle = Served::start(&["--connect", &Endpoint::local(cell.port()).to_string()]);
    let (ends, escapes, frames) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
    let driver = served.page("driver");
    std::thread::scope(|scope| {
        let over = Over(&ends);
        scope.spawn(|| burden(driver, &ends, &escapes, &frames));
        // What moves the arm: a client whose motions the window does not control.
        let mut mover = arm(&cell);
        let start = watch.joint_values().expect("a call");
        let limits = MotionLimits::uniform(6, JOG_JOINT_SPEED_RAD_S * SHARE, 2.0, 20.0);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(35);
        let deadline = Instant::now() + PATIENCE;
        while frames.load(Ordering::Acquire) < 3 {
            assert!(Instant::now() < deadline, "there are no frames");
        }
        let (began, drawn) = (Instant::now(), frames.load(Ordering::Acquire));
        let (mut took, mut beside) = (Vec::new(), Vec::new());
        for trial in 0..STOPS + STOPS / 2 {
            // A silent page is disconnected: each trial has its own.
            let mut page = match trial % 3 {
                0 => Some(served.page("watcher")),
                1 => None,
                _ => Some(idle.page("watcher")),
            };
            let at = watch.joint_values().expect("a call");
            let mut goal = start;
            goal[0] += if at[0] > start[0] { -2.0 } else { 2.0 };
            let limits = limits.clone();
            let moving = scope.spawn(move || {
                // It is stopped before it arrives.
                let _stopped = mover.move_to_joints(&goal, &limits, &CancelToken::default()).is_ok();
                mover
            });
            until_moving(&mut watch, &at);
            let until_s = time_s(&mut watch) + random.random_range(0.0..0.2);
            while time_s(&mut watch) < until_s {}
            let pressed_s = time_s(&mut watch);
            if let Some(page) = &mut page {
                tell(page, &json!({"t": "stop"}));
            } else {
                escapes.fetch_add(1, Ordering::AcqRel);
            }
            let times = if trial % 3 == 2 { &mut beside } else { &mut took };
            times.push(last_moved_s(&mut watch) - pressed_s);
            mover = moving.join().expect("it ends");
        }
        let drawn = frames.load(Ordering::Acquire) - drawn;
        drop(over);
        for times in [&mut took, &mut beside] {
            times.sort_by(f64::total_cmp);
        }
        println!(
            "{drawn} frames of {:.2} s each; at rest after {:.3} s in the median, {:.3} s at most, of the cell's time; through \
             the workbench that draws nothing, {:.3} s and {:.3} s",
            began.elapsed().as_secs_f64() / drawn.max(1) as f64,
            took[STOPS / 2],
            took[STOPS - 1],
            beside[STOPS / 4],
            beside[STOPS / 2 - 1]
        );
        let [late, late_beside] = [&took, &beside].map(|times| times.iter().filter(|s| **s > AT_REST_S).count() as f64);
        assert!(
            late - 2.0 * late_beside <= DEVIATIONS * (2.0 * (late + late_beside)).sqrt(),
            "{took:?}\nbeside: {beside:?}"
        );
        // If half of them are late, a busy machine is no explanation: braking itself takes half of the time.
        assert!(took[STOPS / 2] <= AT_REST_S, "{took:?}\nbeside: {beside:?}");
    });
}
