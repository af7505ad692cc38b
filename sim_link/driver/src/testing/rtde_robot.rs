//! A controller of Universal Robots as far as RTDE is concerned, written from the manufacturer's guide: it sends what a
//! client requests.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::rtde_wire::{self as wire, Unpacker};

/// What the controller reports and how it misbehaves.
#[derive(Debug, Clone)]
pub struct RtdeScript {
    /// Major, minor, bug fix, build.
    pub software: [u32; 4],
    /// Outputs by name; all others are of the type NOT_FOUND.
    pub outputs: BTreeMap<&'static str, Output>,
    /// After this many values the stream stops, and the connection stays open.
    pub silent_after: Option<usize>,
    /// After this many values the connection is closed.
    pub closes_after: Option<usize>,
}

/// A value of an output.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// The time since the controller was started, `DOUBLE`.
    Time,
    /// `VECTOR6D`.
    Vector6([f64; 6]),
    /// `INT32`.
    Int(i32),
    /// `UINT32`.
    Uint(u32),
    /// `UINT64`.
    Long(u64),
}

impl Output {
    fn type_name(&self) -> &'static str {
        match self {
            Self::Time => "DOUBLE",
            Self::Vector6(_) => "VECTOR6D",
            Self::Int(_) => "INT32",
            Self::Uint(_) => "UINT32",
            Self::Long(_) => "UINT64",
        }
    }

    fn write(&self, time_s: f64, to: &mut Vec<u8>) {
        match self {
            Self::Time => to.extend(time_s.to_be_bytes()),
            Self::Vector6(values) => values.iter().for_each(|value| to.extend(value.to_be_bytes())),
            Self::Int(value) => to.extend(value.to_be_bytes()),
            Self::Uint(value) => to.extend(value.to_be_bytes()),
            Self::Long(value) => to.extend(value.to_be_bytes()),
        }
    }
}

impl Default for RtdeScript {
    /// A UR5e at rest with a tool, software 5.15.
    fn default() -> Self {
        let outputs = [
            ("timestamp", Output::Time),
            ("actual_q", Output::Vector6([0.31, -1.42, 1.63, -1.74, -1.55, 0.26])),
            ("actual_qd", Output::Vector6([0.0; 6])),
            ("actual_TCP_pose", Output::Vector6([0.4123, -0.1876, 0.3219, 2.1, -2.2, 0.15])),
            ("actual_TCP_speed", Output::Vector6([0.0; 6])),
            ("robot_mode", Output::Int(7)),
            ("safety_mode", Output::Int(1)),
            ("tcp_offset", Output::Vector6([0.001, -0.002, 0.123, 0.1, 0.2, -0.3])),
            ("runtime_state", Output::Uint(1)),
            ("robot_status_bits", Output::Uint(3)),
            ("safety_status_bits", Output::Uint(1)),
            ("actual_digital_input_bits", Output::Long(5)),
        ];
        Self { software: [5, 15, 0, 1], outputs: outputs.into(), silent_after: None, closes_after: None }
    }
}

/// The controller, listening on the loopback interface until it is dropped.
#[derive(Debug)]
pub struct RtdeRobot {
    address: SocketAddr,
    script: Arc<Mutex<RtdeScript>>,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RtdeRobot {
    /// On port 30004, which `ur_rtde` alone reads, of an address of the loopback interface where it is free.
    #[expect(clippy::needless_pass_by_value, reason = "the server keeps it")]
    pub fn start(script: RtdeScript) -> std::io::Result<Self> {
        let mut last = None;
        for host in 2..=254 {
            match Self::start_at((Ipv4Addr::new(127, 0, 0, host), wire::PORT).into(), script.clone()) {
                Ok(robot) => return Ok(robot),
                Err(error) => last = Some(error),
            }
        }
        Err(last.unwrap_or_else(|| ErrorKind::AddrInUse.into()))
    }

    fn start_at(address: SocketAddr, script: RtdeScript) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let script = Arc::new(Mutex::new(script));
        let ended = Arc::new(AtomicBool::new(false));
        let (shared, end) = (Arc::clone(&script), Arc::clone(&ended));
        let thread = thread::Builder::new().name("rtde-robot".into()).spawn(move || {
            let mut clients = Vec::new();
            while let Ok((stream, _)) = listener.accept() {
                if end.load(Ordering::Relaxed) {
                    break;
                }
                let (script, end) = (Arc::clone(&shared), Arc::clone(&end));
                clients.push(thread::spawn(move || {
                    // A client that leaves ends its connection with an error.
                    drop(Client::new(stream, script, end).run());
                }));
            }
            for client in clients {
                drop(client.join());
            }
        })?;
        Ok(Self { address, script, ended, thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Another value of an output, from now on.
    pub fn set(&self, name: &'static str, value: Output) {
        self.script.lock().unwrap_or_else(PoisonError::into_inner).outputs.insert(name, value);
    }
}

impl Drop for RtdeRobot {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        // Wakes the thread that accepts.
        drop(TcpStream::connect(self.address));
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

/// One client's connection.
struct Client {
    stream: TcpStream,
    script: Arc<Mutex<RtdeScript>>,
    ended: Arc<AtomicBool>,
    started: Option<Instant>,
    recipe: Vec<String>,
    period: Duration,
    sent: usize,
}

const RECIPE: u8 = 1;

impl Client {
    fn new(stream: TcpStream, script: Arc<Mutex<RtdeScript>>, ended: Arc<AtomicBool>) -> Self {
        let period = Duration::from_millis(8);
        Self { stream, script, ended, started: None, recipe: Vec::new(), period, sent: 0 }
    }

    fn script(&self) -> RtdeScript {
        self.script.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn run(&mut self) -> std::io::Result<()> {
        let mut unpacker = Unpacker::default();
        let mut buffer = [0; 4096];
        let mut next = Instant::now();
        self.stream.set_nodelay(true)?;
        while !self.ended.load(Ordering::Relaxed) {
            let wait = next.saturating_duration_since(Instant::now()).max(Duration::from_micros(100));
            self.stream.set_read_timeout(Some(wait))?;
            match self.stream.read(&mut buffer) {
                Ok(0) => return Ok(()),
                Ok(count) => unpacker.push(&buffer[..count]),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return Err(error),
            }
            while let Some((kind, body)) = unpacker.next_package()? {
                self.answer(kind, &body)?;
            }
            if Instant::now() >= next {
                next = Instant::now() + self.period;
                if self.started.is_some() && !self.send_values()? {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    fn send(&mut self, kind: u8, body: &[u8]) -> std::io::Result<()> {
        let bytes = wire::package(kind, body)?;
        self.stream.write_all(&bytes)
    }

    fn answer(&mut self, kind: u8, body: &[u8]) -> std::io::Result<()> {
        let script = self.script();
        match kind {
            wire::REQUEST_PROTOCOL_VERSION => {
                let accepted = body == [0, 2] || body == [0, 1];
                self.send(kind, &[u8::from(accepted)])
            }
            wire::GET_CONTROLLER_VERSION => {
                self.send(kind, &script.software.iter().flat_map(|number| number.to_be_bytes()).collect::<Vec<_>>())
            }
            wire::SETUP_OUTPUTS => {
                let (frequency, names) = body.split_first_chunk::<8>().ok_or(ErrorKind::InvalidData)?;
                let frequency = f64::from_be_bytes(*frequency);
                self.period = Duration::from_secs_f64(1.0 / frequency.clamp(1.0, 500.0));
                // Other clients end the list with a comma.
                self.recipe = String::from_utf8_lossy(names)
                    .split(',')
                    .filter(|name| !name.is_empty())
                    .map(str::to_owned)
                    .collect();
                let types: Vec<_> = self.recipe.iter().map(|name| type_of(&script, name)).collect();
                let recipe = if types.contains(&"NOT_FOUND") { 0 } else { RECIPE };
                self.send(kind, &[&[recipe][..], types.join(",").as_bytes()].concat())
            }
            wire::SETUP_INPUTS => {
                let types: Vec<_> = String::from_utf8_lossy(body).split(',').map(|_| "NOT_FOUND").collect();
                self.send(kind, &[&[0][..], types.join(",").as_bytes()].concat())
            }
            wire::START => {
                // A message for people may come at any time.
                self.send(wire::TEXT_MESSAGE, b"\x05hello\x04RTDE\x03")?;
                self.started = Some(Instant::now());
                self.send(kind, &[1])
            }
            wire::PAUSE => {
                self.started = None;
                self.send(kind, &[1])
            }
            _ => Ok(()),
        }
    }

    /// False when the connection is to be closed.
    fn send_values(&mut self) -> std::io::Result<bool> {
        let script = self.script();
        if script.closes_after.is_some_and(|most| self.sent >= most) {
            return Ok(false);
        }
        if script.silent_after.is_some_and(|most| self.sent >= most) {
            return Ok(true);
        }
        let time_s = 1000.0 + self.started.map_or(0.0, |start| start.elapsed().as_secs_f64());
        let mut body = vec![RECIPE];
        for name in &self.recipe {
            if let Some(output) = script.outputs.get(name.as_str()) {
                output.write(time_s, &mut body);
            }
        }
        self.sent += 1;
        self.send(wire::DATA, &body)?;
        Ok(true)
    }
}

fn type_of(script: &RtdeScript, name: &str) -> &'static str {
    script.outputs.get(name).map_or("NOT_FOUND", Output::type_name)
}
