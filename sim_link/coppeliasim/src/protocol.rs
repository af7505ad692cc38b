//! Messages of the remote API, version 2 of its protocol: requests to bytes, bytes to messages of the server.

use ciborium::Value;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use handeye_wire::{self as wire, Reader as _, WireError};

/// Answer to a callback or to a request to wait.
pub(super) const EXECUTED: &str = "_*executed*_";
/// The client leaves; the server forgets its state.
pub(super) const END: &str = "_*end*_";
/// The server asks to be polled again: it is not done.
pub(super) const WAIT: &str = "_*wait*_";
/// The server asks for the last request again: it could not process it.
pub(super) const REPEAT: &str = "_*repeat*_";
/// Has the server load a module, so that its functions can be called by name.
pub(super) const REQUIRE: &str = "zmqRemoteApi.require";
/// Start of the error text for a name that the server does not know.
pub(super) const UNKNOWN_FUNCTION: &str = "No such function";
/// Part of the error text for a path that leads to no object: "object does not exist, or alias/path is ill formatted" in
/// newer versions, "Object does not exist" in older ones; in lower case.
pub(super) const NO_SUCH_OBJECT: &str = "object does not exist";

/// Who sends a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sender<'a> {
    /// The client's id.
    pub uuid: &'a str,
    /// Seconds without a message after which the server may forget the client. Sent with every request: a server that
    /// has forgotten a client makes a new record of it with the next one, without asking for this.
    pub idle_timeout_s: u32,
    /// Language of the client, for the vendor's statistics; only with its first message.
    pub introduces: Option<&'static str>,
}

pub(super) fn request(func: &str, args: Vec<Value>, sender: &Sender<'_>) -> Vec<u8> {
    let count = args.len() as u64;
    let mut entries = vec![
        ("func", Value::from(func)),
        ("args", Value::Array(args)),
        // Lets the server keep trailing and inner nulls.
        ("argsL", Value::from(count)),
        ("uuid", Value::from(sender.uuid)),
    ];
    if let Some(lang) = sender.introduces {
        entries.push(("ver", Value::from(2)));
        entries.push(("lang", Value::from(lang)));
    }
    entries.push(("timeout", Value::from(sender.idle_timeout_s)));
    wire::encode(&wire::map(entries))
}

/// A message of the server.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ServerMessage {
    /// The call is done.
    Returned { values: Vec<Value> },
    /// The call failed, with the server's text.
    Failed { message: String },
    /// The server speaks version 1 of the protocol, as CoppeliaSim 4.2 to 4.5 do.
    OldProtocol,
    /// The client shall run a callback, wait, or repeat; with what arguments does not matter.
    Ask { func: String },
    /// An empty map: the reply to a farewell.
    Nothing,
}

/// Why bytes are not a [`ServerMessage`].
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ReplyError {
    Wire(WireError),
    Shape { expected: &'static str, got: String },
}

/// Reads a reply.
///
/// # Errors
/// [`ReplyError`]; never panics, whatever the bytes.
pub(super) fn parse(bytes: &[u8]) -> Result<ServerMessage, ReplyError> {
    let mut entries = match wire::decode(bytes).map_err(ReplyError::Wire)? {
        Value::Map(entries) => entries,
        other => return Err(shape("a map", &other)),
    };
    let empty = entries.is_empty();
    let mut take = |key: &str| {
        let at = entries.iter().position(|(name, _)| name.text() == Some(key))?;
        Some(entries.swap_remove(at).1)
    };
    // Only replies of version 1 state whether the call succeeded.
    if take("success").is_some() {
        return Ok(ServerMessage::OldProtocol);
    }
    if let Some(func) = take("func") {
        let func = text(func, "text in `func`")?;
        return Ok(ServerMessage::Ask { func });
    }
    if let Some(err) = take("err") {
        return Ok(ServerMessage::Failed { message: text(err, "text in `err`")? });
    }
    if let Some(ret) = take("ret") {
        return Ok(ServerMessage::Returned { values: list(ret, "an array in `ret`")? });
    }
    if empty {
        return Ok(ServerMessage::Nothing);
    }
    let names: Vec<String> = entries.iter().take(8).map(|(name, _)| name.text().unwrap_or("?").to_owned()).collect();
    Err(ReplyError::Shape {
        expected: "a map with `ret`, `err` or `func`",
        got: format!("a map with {}", names.join(", ")),
    })
}

fn shape(expected: &'static str, got: &Value) -> ReplyError {
    ReplyError::Shape { expected, got: wire::type_name(got).to_owned() }
}

fn list(value: Value, expected: &'static str) -> Result<Vec<Value>, ReplyError> {
    match value {
        Value::Array(values) => Ok(values),
        Value::Map(entries) if entries.is_empty() => Ok(Vec::new()),
        other => Err(shape(expected, &other)),
    }
}

fn text(value: Value, expected: &'static str) -> Result<String, ReplyError> {
    match value {
        Value::Text(text) => Ok(text),
        // The server writes text that is not plain ASCII as bytes.
        Value::Bytes(bytes) => Ok(String::from_utf8_lossy(&bytes).into_owned()),
        other => Err(shape(expected, &other)),
    }
}

/// Draws client ids (UUID version 4).
pub(super) struct ClientIds(ChaCha8Rng);

impl ClientIds {
    /// From a seed, for runs that can be repeated, or else from the system's entropy.
    pub(super) fn new(seed: Option<u64>) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed.unwrap_or_else(rand::random)))
    }

    pub(super) fn draw(&mut self) -> String {
        let bits: u128 = self.0.random();
        // Version 4 in the 13th digit, variant 10 in the two top bits of the 17th (RFC 9562, section 5.4).
        let bits = bits & !(0xf << 76) | (0x4 << 76);
        let bits = bits & !(0x3 << 62) | (0x2 << 62);
        let hex = format!("{bits:032x}");
        [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-")
    }
}

#[cfg(test)]
#[path = "protocol_tests.rs"]
mod tests;
