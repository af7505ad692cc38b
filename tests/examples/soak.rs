//! Resource use of `handeye serve` over a long time: it tracks the board of the built-in cell and records, while a page shows
//! all of it. Prints threads, memory and frames once a minute; the growth after the first five minutes is the result.
//!
//! `cargo run --release -p handeye_tests --example soak [MINUTES]`; 30 if not given.

use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// Until one-time allocations are done, and limited buffers are full.
const FIRST: Duration = Duration::from_mins(5);

/// Longest wait for a control.
const PATIENCE: Duration = Duration::from_mins(4);

struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ended = self.0.kill().and_then(|()| self.0.wait()).is_ok();
    }
}

/// The binary; an example is in a folder next to it.
fn binary() -> PathBuf {
    let binary = handeye_tests::handeye_binary();
    if binary.is_file() { binary } else { binary.with_file_name("../handeye") }
}

/// A user's page: shows every frame, and presses controls by name.
struct Page {
    socket: WebSocket<TcpStream>,
    controls: Vec<Value>,
    frames: u64,
}

impl Page {
    fn open(address: &str) -> anyhow::Result<Self> {
        let mut request = format!("ws://{address}/socket?page=soak").into_client_request()?;
        request.headers_mut().insert("origin", HeaderValue::from_str(&format!("http://{address}"))?);
        let (socket, _) = tungstenite::client(request, TcpStream::connect(address)?)?;
        let mut page = Self { socket, controls: Vec::new(), frames: 0 };
        page.say(&json!({"t": "screen", "width": 1440.0, "height": 900.0, "scale": 1.0}))?;
        page.say(&json!({"t": "reads", "reads": true}))?;
        Ok(page)
    }

    fn say(&mut self, reported: &Value) -> anyhow::Result<()> {
        Ok(self.socket.send(Message::text(reported.to_string()))?)
    }

    /// Takes in a message.
    fn hear(&mut self) -> anyhow::Result<()> {
        match self.socket.read()? {
            Message::Binary(bytes) => {
                let end = 4 + u32::from_le_bytes(bytes[..4].try_into()?) as usize;
                let head: Value = serde_json::from_slice(&bytes[4..end])?;
                self.frames += 1;
                self.say(&json!({"t": "shown", "number": head["number"]}))
            }
            Message::Text(text) => {
                let stated: Value = serde_json::from_str(&text)?;
                if let Some(controls) = stated["controls"].as_array() {
                    self.controls.clone_from(controls);
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Presses a button, once it exists and can be pressed.
    fn press(&mut self, label: &str) -> anyhow::Result<()> {
        let began = Instant::now();
        loop {
            let is_it = |control: &&Value| {
                control["role"] == "button"
                    && control["enabled"] == true
                    && control["label"].as_str().is_some_and(|says| says.ends_with(label))
            };
            if let Some(id) = self.controls.iter().find(is_it).map(|control| control["id"].clone()) {
                return self.say(&json!({"t": "input", "events": [{"e": "control", "id": id, "press": true}]}));
            }
            ensure!(began.elapsed() < PATIENCE, "there is no {label:?} among {:#?}", self.controls);
            self.hear()?;
        }
    }
}

/// Threads of a process, and its memory \[MB\].
fn held(id: u32) -> anyhow::Result<(u64, f64)> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status"))?;
    let number = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name));
        line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok()).with_context(|| name.to_owned())
    };
    Ok((number("Threads:")? as u64, number("VmRSS:")? / 1024.0))
}

fn main() -> anyhow::Result<()> {
    let minutes: u64 = std::env::args().nth(1).map_or(Ok(30), |text| text.parse())?;
    let home = tempfile::tempdir()?;
    let session = home.path().join("session");
    let made =
        Command::new(binary()).args(["auto", "--quiet", "--out"]).arg(&session).stdout(Stdio::null()).status()?;
    ensure!(made.success(), "no calibration: {made}");
    let mut served = Command::new(binary())
        .args(["serve", "--quiet", "--port", "0", "--session"])
        .arg(&session)
        .env("HOME", home.path())
        .env("XDG_CONFIG_HOME", home.path().join("config"))
        .env("XDG_DATA_HOME", home.path().join("data"))
        .stdout(Stdio::piped())
        .spawn()?;
    let mut line = String::new();
    BufReader::new(served.stdout.take().context("its output")?).read_line(&mut line)?;
    let address = line.trim().trim_start_matches("the workbench is at http://").trim_end_matches('/').to_owned();
    let served = Ends(served);
    let id = served.0.id();

    let mut page = Page::open(&address)?;
    page.press("Track")?;
    page.press("Start tracking")?;
    page.press("Stop tracking").context("it does not track")?;
    page.press("Start tracking")?;
    // What is sent for screen readers is not usually sent to a page.
    page.say(&json!({"t": "reads", "reads": false}))?;

    println!("{:>7} {:>8} {:>7} {:>8}", "minutes", "threads", "MB", "frames");
    let began = Instant::now();
    let (mut next, mut first) = (Duration::ZERO, None);
    while began.elapsed() <= Duration::from_mins(minutes) {
        page.hear()?;
        if began.elapsed() < next {
            continue;
        }
        let (threads, megabytes) = held(id)?;
        println!("{:>7.0} {threads:>8} {megabytes:>7.1} {:>8}", began.elapsed().as_secs_f64() / 60.0, page.frames);
        if first.is_none() && began.elapsed() >= FIRST {
            first = Some((threads, megabytes));
        }
        next += Duration::from_mins(1);
    }
    if let Some((threads, megabytes)) = first {
        let (now, megabytes_now) = held(id)?;
        println!("since minute 5: {:+} threads, {:+.1} MB", now as i64 - threads as i64, megabytes_now - megabytes);
    }
    Ok(())
}
