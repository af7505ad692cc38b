//! A connection to a controller that reads a stream of values.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use super::sample::{OUTPUTS, Sample, TCP_OFFSET};
use super::wire::{self, Body, Unpacker};
use super::{PORT, RtdeError};

/// What a controller answers to a variable that it does not have.
const NOT_FOUND: &str = "NOT_FOUND";
/// Packages that may come before an answer: messages for people, and values of an interrupted stream.
const MOST_BEFORE_AN_ANSWER: usize = 1000;

/// Where the controller is, and how often it is to send.
#[derive(Debug, Clone)]
pub struct RtdeOptions {
    /// Its address or name.
    pub host: String,
    /// Its port: [`PORT`].
    pub port: u16,
    /// Values a second. Controllers of CB3 give at most 125, those of the e-Series 500.
    pub frequency_hz: f64,
    /// How long a connection, an answer or the next values may take.
    pub patience: Duration,
}

impl RtdeOptions {
    /// 125 times a second, with a patience of 2 s.
    pub fn new(host: impl Into<String>) -> Self {
        Self { host: host.into(), port: PORT, frequency_hz: 125.0, patience: Duration::from_secs(2) }
    }
}

/// A controller that sends.
#[derive(Debug)]
pub struct RtdeClient {
    stream: TcpStream,
    unpacker: Unpacker,
    patience: Duration,
    controller: [u32; 4],
    recipe: u8,
    has_tcp_offset: bool,
    messages: Vec<String>,
}

impl RtdeClient {
    /// Connects, agrees on version 2 of the protocol, says what is wanted, and starts the stream.
    ///
    /// # Errors
    /// [`RtdeError`] says at which of these it ended.
    pub fn connect(options: &RtdeOptions) -> Result<Self, RtdeError> {
        let mut client = Self {
            stream: connect(options)?,
            unpacker: Unpacker::default(),
            patience: options.patience,
            controller: [0; 4],
            recipe: 0,
            has_tcp_offset: false,
            messages: Vec::new(),
        };
        let accepted =
            client.ask(wire::REQUEST_PROTOCOL_VERSION, &2_u16.to_be_bytes(), "the version of the protocol")?;
        if accepted.first() != Some(&1) {
            return Err(RtdeError::ProtocolRefused);
        }
        let version = client.ask(wire::GET_CONTROLLER_VERSION, &[], "the version of the controller")?;
        let mut fields = Body::new(&version, "the version of the controller");
        for number in &mut client.controller {
            *number = u32::from_be_bytes(fields.bytes()?);
        }
        client.set_up(options.frequency_hz)?;
        let started = client.ask(wire::START, &[], "the start of the stream")?;
        if started.first() != Some(&1) {
            return Err(RtdeError::NotStarted { why: client.messages.join("; ") });
        }
        Ok(client)
    }

    /// Major, minor, bug fix and build of the controller's software.
    pub fn controller(&self) -> [u32; 4] {
        self.controller
    }

    /// What the controller said to people since the last call.
    pub fn take_messages(&mut self) -> Vec<String> {
        std::mem::take(&mut self.messages)
    }

    /// The next values.
    ///
    /// # Errors
    /// [`RtdeError::Silent`] if none come in time, [`RtdeError::Closed`] and the like if none will.
    pub fn next_sample(&mut self) -> Result<Sample, RtdeError> {
        let deadline = Instant::now() + self.patience;
        loop {
            let (kind, body) = self.receive(deadline, "its values are awaited")?;
            if kind != wire::DATA {
                self.keep(kind, &body);
                continue;
            }
            match body.split_first() {
                Some((&recipe, values)) if recipe == self.recipe => return Sample::read(values, self.has_tcp_offset),
                Some((recipe, _)) => {
                    return Err(RtdeError::malformed(format!("values of recipe {recipe}, which was not asked for")));
                }
                None => return Err(RtdeError::malformed("an empty data package".into())),
            }
        }
    }

    /// Asks for all outputs, and without the one that older software does not have if it is refused.
    fn set_up(&mut self, frequency_hz: f64) -> Result<(), RtdeError> {
        for with_tcp_offset in [true, false] {
            let outputs: Vec<_> = OUTPUTS.into_iter().chain(with_tcp_offset.then_some(TCP_OFFSET)).collect();
            let names: Vec<_> = outputs.iter().map(|(name, _)| *name).collect();
            let mut body = frequency_hz.to_be_bytes().to_vec();
            body.extend_from_slice(names.join(",").as_bytes());
            let answer = self.ask(wire::SETUP_OUTPUTS, &body, "the types of its outputs")?;
            let Some((&recipe, types)) = answer.split_first() else {
                return Err(RtdeError::malformed("an empty answer to the names of outputs".into()));
            };
            let text = wire::one_line(types);
            let types: Vec<_> = text.split(',').map(str::trim).collect();
            if with_tcp_offset && types.len() == outputs.len() && types.last() == Some(&NOT_FOUND) {
                continue;
            }
            let missing: Vec<_> =
                names.iter().zip(&types).filter(|(_, kind)| **kind == NOT_FOUND).map(|(name, _)| *name).collect();
            if !missing.is_empty() {
                return Err(RtdeError::NotFound { names: missing.join(", ") });
            }
            let expected: Vec<_> = outputs.iter().map(|(_, kind)| *kind).collect();
            if types != expected {
                return Err(RtdeError::Types { got: text, expected: expected.join(",") });
            }
            self.recipe = recipe;
            self.has_tcp_offset = with_tcp_offset;
            return Ok(());
        }
        Err(RtdeError::malformed("no answer to the names of outputs".into()))
    }

    /// Sends a package and waits for the answer of the same type.
    fn ask(&mut self, kind: u8, body: &[u8], during: &'static str) -> Result<Vec<u8>, RtdeError> {
        self.stream.write_all(&wire::package(kind, body)?).map_err(|error| broken(&error))?;
        let deadline = Instant::now() + self.patience;
        for _ in 0..MOST_BEFORE_AN_ANSWER {
            let (got, body) = self.receive(deadline, during)?;
            if got == kind {
                return Ok(body);
            }
            self.keep(got, &body);
        }
        Err(RtdeError::malformed(format!("{MOST_BEFORE_AN_ANSWER} packages came instead of {during}")))
    }

    fn keep(&mut self, kind: u8, body: &[u8]) {
        const MOST: usize = 20;
        if kind == wire::TEXT_MESSAGE && self.messages.len() < MOST {
            self.messages.push(wire::text_message(body));
        }
    }

    fn receive(&mut self, deadline: Instant, during: &'static str) -> Result<(u8, Vec<u8>), RtdeError> {
        let mut buffer = [0; 4096];
        loop {
            if let Some(package) = self.unpacker.next_package()? {
                return Ok(package);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(RtdeError::Silent { waited: self.patience, during });
            }
            self.stream.set_read_timeout(Some(left)).map_err(|error| broken(&error))?;
            match self.stream.read(&mut buffer) {
                Ok(0) => return Err(RtdeError::Closed),
                Ok(count) => self.unpacker.push(&buffer[..count]),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => {}
                    ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => return Err(RtdeError::Closed),
                    _ => return Err(broken(&error)),
                },
            }
        }
    }
}

fn connect(options: &RtdeOptions) -> Result<TcpStream, RtdeError> {
    let address = format!("{}:{}", options.host, options.port);
    let unreachable = |why: String| RtdeError::Unreachable { address: address.clone(), why };
    let found =
        (options.host.as_str(), options.port).to_socket_addrs().map_err(|error| unreachable(error.to_string()))?;
    let mut why = "the name has no address".to_owned();
    for socket in found {
        match TcpStream::connect_timeout(&socket, options.patience) {
            Ok(stream) => {
                stream.set_nodelay(true).map_err(|error| broken(&error))?;
                stream.set_write_timeout(Some(options.patience)).map_err(|error| broken(&error))?;
                return Ok(stream);
            }
            Err(error) => why = error.to_string(),
        }
    }
    Err(unreachable(why))
}

fn broken(error: &std::io::Error) -> RtdeError {
    RtdeError::Broken { why: error.to_string() }
}
