//! The WebSocket to rosbridge, and what comes over it.

use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::{Value, json};
use tungstenite::http::Uri;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{HandshakeError, Message, WebSocket};

use super::fragments::{Fragment, Fragments};
use super::{MAX_MESSAGE, PORT, RosbridgeError};

/// How long a connection or a piece of writing may take.
const PATIENCE: Duration = Duration::from_secs(4);
/// How often rosbridge is asked whether it is still there.
const PING: Duration = Duration::from_secs(2);
/// So long without a byte, and it is not.
const SILENCE: Duration = Duration::from_secs(6);

/// What rosbridge says.
#[derive(Debug)]
pub(super) enum Incoming {
    /// A message on a topic; the text is the whole object, with the message in its field `msg`.
    Publish { topic: String, text: String },
    /// A line about something that does not work as it should.
    Status { level: String, text: String },
    /// The answer to a call of a service.
    Response { id: String, values: Value },
}

#[derive(Deserialize)]
struct Operation {
    op: String,
    #[serde(default)]
    topic: String,
    #[serde(default)]
    level: String,
}

/// A topic as it is asked for.
#[derive(Debug, Clone)]
pub(super) struct Subscription {
    pub topic: String,
    /// Least time between two messages in ms; those between are left out by rosbridge.
    pub throttle_ms: u32,
    /// Messages that rosbridge keeps for a reader that is slow.
    pub queue: u32,
}

/// A connection to rosbridge.
pub(super) struct Link {
    socket: WebSocket<TcpStream>,
    fragments: Fragments,
    fragment_size: Option<u32>,
    heard: Instant,
    pinged: Instant,
}

impl std::fmt::Debug for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Link").finish_non_exhaustive()
    }
}

impl Link {
    /// Connects. Messages longer than `fragment_size` bytes are asked for in pieces.
    pub fn connect(url: &str, fragment_size: Option<u32>) -> Result<Self, RosbridgeError> {
        let bad = |why: &str| RosbridgeError::Url { url: url.to_owned(), why: why.to_owned() };
        let uri: Uri = url.parse().map_err(|error| bad(&format!("{error}")))?;
        match uri.scheme_str() {
            Some("ws") => {}
            Some("wss") => return Err(bad("encrypted connections are not supported, a tunnel to its port is a way")),
            _ => return Err(bad("it does not begin with ws://")),
        }
        let host = uri.host().filter(|host| !host.is_empty()).ok_or_else(|| bad("it names no host"))?;
        let port = uri.port_u16().unwrap_or(PORT);
        let unreachable = |why: String| RosbridgeError::Unreachable { url: url.to_owned(), why };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let found = (host, port).to_socket_addrs().map_err(|error| unreachable(error.to_string()))?;
        let mut why = "the name has no address".to_owned();
        for address in found {
            let stream = match TcpStream::connect_timeout(&address, PATIENCE) {
                Ok(stream) => stream,
                Err(error) => {
                    why = error.to_string();
                    continue;
                }
            };
            return Self::over(stream, &uri, fragment_size).map_err(unreachable);
        }
        Err(unreachable(why))
    }

    fn over(stream: TcpStream, uri: &Uri, fragment_size: Option<u32>) -> Result<Self, String> {
        let text = |error: std::io::Error| error.to_string();
        stream.set_nodelay(true).map_err(text)?;
        stream.set_read_timeout(Some(PATIENCE)).map_err(text)?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(text)?;
        let config = WebSocketConfig::default().max_message_size(Some(MAX_MESSAGE)).max_frame_size(Some(MAX_MESSAGE));
        let (socket, _) =
            tungstenite::client::client_with_config(uri, stream, Some(config)).map_err(|error| match error {
                HandshakeError::Interrupted(_) => {
                    format!("it accepts connections and does not answer for {PATIENCE:?}")
                }
                HandshakeError::Failure(error) => format!("what answers there is no rosbridge ({error})"),
            })?;
        let now = Instant::now();
        Ok(Self { socket, fragments: Fragments::default(), fragment_size, heard: now, pinged: now })
    }

    /// Asks for a topic, or again for it.
    pub fn subscribe(&mut self, subscription: &Subscription) -> Result<(), RosbridgeError> {
        let Subscription { topic, throttle_ms, queue } = subscription;
        let mut message = json!({
            "op": "subscribe", "id": format!("handeye:{topic}"), "topic": topic,
            "throttle_rate": throttle_ms, "queue_length": queue, "compression": "none",
        });
        if let Some(size) = self.fragment_size {
            message["fragment_size"] = size.into();
        }
        self.send(&message)
    }

    /// Calls a service without arguments.
    pub fn call(&mut self, service: &str, id: &str) -> Result<(), RosbridgeError> {
        self.send(&json!({"op": "call_service", "id": id, "service": service}))
    }

    fn send(&mut self, message: &Value) -> Result<(), RosbridgeError> {
        self.socket.send(Message::text(message.to_string())).map_err(|error| closed(&error))
    }

    /// What comes next, until a deadline; `None` when nothing does.
    pub fn receive(&mut self, deadline: Instant) -> Result<Option<Incoming>, RosbridgeError> {
        loop {
            let now = Instant::now();
            if now.duration_since(self.heard) > SILENCE {
                return Err(RosbridgeError::Silent { seconds: SILENCE.as_secs() });
            }
            if now.duration_since(self.pinged) > PING {
                self.pinged = now;
                self.socket.send(Message::Ping(tungstenite::Bytes::new())).map_err(|error| closed(&error))?;
            }
            let left = deadline.saturating_duration_since(now);
            if left.is_zero() {
                return Ok(None);
            }
            self.socket.get_ref().set_read_timeout(Some(left)).map_err(|error| closed(&error.into()))?;
            let message = match self.socket.read() {
                Ok(message) => message,
                Err(tungstenite::Error::Io(error))
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) =>
                {
                    continue;
                }
                Err(error) => return Err(closed(&error)),
            };
            self.heard = Instant::now();
            let text = match message {
                Message::Text(text) => text.to_string(),
                Message::Close(_) => return Err(RosbridgeError::Closed { why: String::new() }),
                Message::Binary(_) | Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => continue,
            };
            if let Some(incoming) = self.read(text, true)? {
                return Ok(Some(incoming));
            }
        }
    }

    /// A piece of a piece is nothing.
    fn read(&mut self, text: String, may_be_piece: bool) -> Result<Option<Incoming>, RosbridgeError> {
        let operation: Operation = serde_json::from_str(&text).map_err(RosbridgeError::malformed)?;
        match operation.op.as_str() {
            "publish" => Ok(Some(Incoming::Publish { topic: operation.topic, text })),
            "fragment" if may_be_piece => {
                let fragment: Fragment = serde_json::from_str(&text).map_err(RosbridgeError::malformed)?;
                self.fragments.push(fragment)?.map_or(Ok(None), |whole| self.read(whole, false))
            }
            "status" => {
                let value: Value = serde_json::from_str(&text).map_err(RosbridgeError::malformed)?;
                let text = value["msg"].as_str().map_or_else(|| value["msg"].to_string(), str::to_owned);
                Ok(Some(Incoming::Status { level: operation.level, text }))
            }
            "service_response" => {
                let mut value: Value = serde_json::from_str(&text).map_err(RosbridgeError::malformed)?;
                let id = value["id"].as_str().unwrap_or_default().to_owned();
                Ok(Some(Incoming::Response { id, values: value["values"].take() }))
            }
            _ => Ok(None),
        }
    }
}

fn closed(error: &tungstenite::Error) -> RosbridgeError {
    match error {
        tungstenite::Error::ConnectionClosed | tungstenite::Error::AlreadyClosed => {
            RosbridgeError::Closed { why: String::new() }
        }
        tungstenite::Error::Capacity(error) => RosbridgeError::malformed(format!(
            "{error}: name a topic of smaller or compressed images, or give --fragment-size"
        )),
        error => RosbridgeError::Closed { why: format!(": {error}") },
    }
}
