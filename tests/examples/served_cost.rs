//! What the workbench in a browser costs: bytes, processor time and delay, compared with the desktop window on a screen
//! without a graphics card. A page here is a program that reports at once that a frame is shown; ten more watch.
//!
//! `cargo run --release -p handeye_tests --example served_cost`

use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::{Arm, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// How long each is measured.
const LONG: Duration = Duration::from_secs(15);

/// Clock ticks per second, in which the system counts processor time.
const TICKS: f64 = 100.0;

struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ended = self.0.kill().and_then(|()| self.0.wait()).is_ok();
    }
}

/// Processor time of a process \[s\].
fn processor_s(id: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    let rest = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
    rest.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / TICKS
}

/// The binary; an example is in a folder next to it.
fn binary() -> PathBuf {
    let binary = handeye_tests::handeye_binary();
    if binary.is_file() { binary } else { binary.with_file_name("../handeye") }
}

fn handeye(command: &str, home: &Path, cell: &str) -> Command {
    let mut handeye = Command::new(binary());
    handeye
        .args([command, "--quiet", "--rerun", "off", "--connect", cell])
        .env("HOME", home)
        .env("XDG_CONFIG_HOME", home.join("config"))
        .env("XDG_DATA_HOME", home.join("data"));
    handeye
}

/// A page: counts what comes.
struct Page {
    socket: WebSocket<TcpStream>,
    bytes: u64,
    frames: u64,
    images: u64,
}

impl Page {
    fn open(address: &str, name: &str) -> anyhow::Result<Self> {
        let mut request = format!("ws://{address}/socket?page={name}").into_client_request()?;
        request.headers_mut().insert("origin", HeaderValue::from_str(&format!("http://{address}"))?);
        let (socket, _) = tungstenite::client(request, TcpStream::connect(address)?)?;
        let mut page = Self { socket, bytes: 0, frames: 0, images: 0 };
        page.say(&json!({"t": "screen", "width": 1440.0, "height": 900.0, "scale": 1.0}))?;
        Ok(page)
    }

    fn say(&mut self, reported: &Value) -> anyhow::Result<()> {
        Ok(self.socket.send(Message::text(reported.to_string()))?)
    }

    /// Waits for a frame and reports that it is shown; returns whether it brought a live image.
    fn frame(&mut self) -> anyhow::Result<bool> {
        loop {
            let message = self.socket.read()?;
            self.bytes += message.len() as u64;
            let Message::Binary(bytes) = message else { continue };
            let end = 4 + u32::from_le_bytes(bytes[..4].try_into()?) as usize;
            let head: Value = serde_json::from_slice(&bytes[4..end])?;
            self.say(&json!({"t": "shown", "number": head["number"]}))?;
            self.frames += 1;
            let has_image = head["textures"].as_array().is_some_and(|all| all.iter().any(|one| one["jpeg"] == true));
            self.images += u64::from(has_image);
            return Ok(has_image);
        }
    }

    fn measure(&mut self, name: &str, process: u32) -> anyhow::Result<f64> {
        let (bytes, frames, images) = (self.bytes, self.frames, self.images);
        let (began, processor) = (Instant::now(), processor_s(process));
        while began.elapsed() < LONG {
            self.frame()?;
        }
        let (took, used) = (began.elapsed().as_secs_f64(), processor_s(process) - processor);
        let images = (self.images - images) as f64;
        let per_image_ms = 1e3 * used / images.max(1.0);
        println!(
            "{name}: {:.0} kB/s, {:.1} frames/s, {:.1} images/s, {:.0} % of a processor, {per_image_ms:.1} ms per image",
            (self.bytes - bytes) as f64 / took / 1e3,
            (self.frames - frames) as f64 / took,
            images / took,
            100.0 * used / took,
        );
        Ok(per_image_ms)
    }
}

fn main() -> anyhow::Result<()> {
    let home = tempfile::tempdir()?;
    let mut cell = Command::new(binary()).args(["cell", "--quiet", "--port", "0"]).stdout(Stdio::piped()).spawn()?;
    let mut line = String::new();
    BufReader::new(cell.stdout.take().expect("its output")).read_line(&mut line)?;
    let cell = (Ends(cell), line.trim().trim_start_matches("listening on ").to_owned());
    // Images come while time advances.
    let endpoint: Endpoint = cell.1.parse()?;
    let mut arm = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default())?;
    arm.sim().start_simulation()?;

    let mut served = handeye("serve", home.path(), &cell.1).args(["--port", "0"]).stdout(Stdio::piped()).spawn()?;
    let mut line = String::new();
    BufReader::new(served.stdout.take().expect("its output")).read_line(&mut line)?;
    let address = line.trim().trim_start_matches("the workbench is at http://").trim_end_matches('/').to_owned();
    let served = Ends(served);
    let id = served.0.id();

    let mut page = Page::open(&address, "driver")?;
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(4) {
        page.frame()?;
    }
    let one = page.measure("one page", id)?;

    // The pointer moves on and off a button. A frame that was in flight already counts, so that this is a lower bound.
    let mut delays = Vec::new();
    for turn in 0..60 {
        let at = if turn % 2 == 0 { [90.0, 140.0] } else { [700.0, 25.0] };
        let began = Instant::now();
        page.say(&json!({"t": "input", "events": [{"e": "move", "at": at}]}))?;
        page.frame()?;
        delays.push(1e3 * began.elapsed().as_secs_f64());
    }
    delays.sort_by(f64::total_cmp);
    println!("input to the next frame: median {:.1} ms, 95 % {:.1} ms", delays[30], delays[57]);

    let ends = Arc::new(AtomicBool::new(false));
    let counts = Arc::new(Mutex::new(Vec::new()));
    let watchers: Vec<_> = (0..10)
        .map(|number| {
            let (address, ends, counts) = (address.clone(), Arc::clone(&ends), Arc::clone(&counts));
            std::thread::spawn(move || -> anyhow::Result<()> {
                let mut page = Page::open(&address, &format!("watcher{number}"))?;
                while !ends.load(Ordering::Relaxed) {
                    page.frame()?;
                }
                counts.lock().expect("no panic").push(page.images);
                Ok(())
            })
        })
        .collect();
    page.measure("the page that drives beside ten that watch", id)?;
    ends.store(true, Ordering::Relaxed);
    for watcher in watchers {
        let _ended = watcher.join().is_ok();
    }

    drop((page, served));
    let mut screen = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", "1440x900x24", "-nolisten", "tcp"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let mut number = String::new();
    BufReader::new(screen.stdout.take().expect("its output")).read_line(&mut number)?;
    let _screen = Ends(screen);
    let mut window = handeye("gui", home.path(), &cell.1);
    window
        .env("DISPLAY", format!(":{}", number.trim()))
        .env("LIBGL_ALWAYS_SOFTWARE", "1")
        .env("RUST_LOG", "handeye_ui::live::textures=trace")
        .env_remove("WAYLAND_DISPLAY")
        .stderr(Stdio::piped());
    let mut window = window.spawn()?;
    let log = BufReader::new(window.stderr.take().expect("its log"));
    let window = Ends(window);
    let images = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&images);
    std::thread::spawn(move || {
        let shown = log.lines().map_while(Result::ok).filter(|line| line.contains("image shown"));
        shown.for_each(|_| _ = counted.fetch_add(1, Ordering::Relaxed));
    });
    std::thread::sleep(Duration::from_secs(6));
    let before = (processor_s(window.0.id()), images.load(Ordering::Relaxed));
    std::thread::sleep(LONG);
    let used = processor_s(window.0.id()) - before.0;
    let images = (images.load(Ordering::Relaxed) - before.1) as f64;
    let (share, desktop) = (used / LONG.as_secs_f64(), 1e3 * used / images.max(1.0));
    println!(
        "the desktop window: {:.1} images/s, {:.0} % of a processor, {desktop:.1} ms per image",
        images / LONG.as_secs_f64(),
        100.0 * share
    );
    println!("served : desktop = 1 : {:.1} per image", desktop / one);
    Ok(())
}
