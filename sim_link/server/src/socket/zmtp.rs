//! ZMTP 3, the protocol between ZeroMQ sockets, as far as a server of requests needs it ([RFC
//! 23](https://rfc.zeromq.org/spec/23/), [RFC 37](https://rfc.zeromq.org/spec/37/)). No socket, no clock.
//!
//! ZeroMQ's own library also talks to peers of version 1, which begin with the length of a message. Nearly every text
//! is such a beginning, so that a web page could command the cell by an HTTP request with the right bytes in its body.
//! Here a connection has to begin with the signature of version 3, whose first byte no browser can be made to send
//! first.

use crate::message::MAX_REQUEST_BYTES;

/// What either side sends first: signature, version 3.1, mechanism NULL, no server of security.
pub const GREETING: [u8; GREETING_BYTES] = {
    let mut greeting = [0; GREETING_BYTES];
    greeting[0] = 0xff;
    greeting[9] = 0x7f;
    greeting[10] = 3;
    greeting[11] = 1;
    let mut at = 0;
    while at < MECHANISM.len() {
        greeting[12 + at] = MECHANISM[at];
        at += 1;
    }
    greeting
};

/// What this side sends when it has seen the other's greeting.
pub const READY: [u8; 43] = *b"\x04\x29\x05READY\x0bSocket-Type\x00\x00\x00\x06ROUTER\x08Identity\x00\x00\x00\x00";

/// Asks the other side for a sign of life, without a time to live.
pub const PING: [u8; 9] = *b"\x04\x07\x04PING\x00\x00";

const GREETING_BYTES: usize = 64;
const MECHANISM: [u8; 20] = *b"NULL\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0";

/// The socket types that send requests with an empty delimiter.
const ASKING_SOCKETS: [&[u8]; 3] = [b"REQ", b"DEALER", b"ROUTER"];

/// Frames that are longer end the connection; shorter requests that are too long get an error.
const MAX_FRAME_BYTES: u64 = 16 << 20;

/// Longest command: none is longer than the list of properties of a socket.
const MAX_COMMAND_BYTES: u64 = 4096;

/// Longest context of a ping, which its answer repeats.
const MAX_CONTEXT_BYTES: usize = 16;

const MORE: u8 = 1;
const LONG: u8 = 2;
const COMMAND: u8 = 4;

/// Why a connection is not served.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Violation {
    /// It does not begin as ZeroMQ sockets of version 3 do: a web page, another program, a socket of 2012.
    #[error("it is no ZeroMQ socket of version 3")]
    OtherProtocol,
    /// It wants to identify itself.
    #[error("it asks for a mechanism of security other than NULL")]
    Mechanism,
    /// It is a subscriber or the like.
    #[error("its socket is of a type that sends no requests")]
    SocketType,
    /// A length, a flag or a command makes no sense, or a frame is longer than any request.
    #[error("it sent a frame that makes no sense")]
    Frame,
}

/// A decoded part of the stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// The greeting is right: [`READY`] is due.
    Greeted,
    /// The other side is ready.
    Ready,
    /// A request: what follows the empty delimiter.
    Request(Vec<u8>),
    /// A request that is too long, with its length; nothing of it was kept.
    TooLong(usize),
    /// These bytes answer a ping.
    Pong(Vec<u8>),
}

/// Position of the decoder in the stream of bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Greeting,
    Flags,
    Length { flags: u8 },
    Body { flags: u8, left: u64 },
}

/// Reads what one connection sends, in pieces of any size. Keeps at most one request.
#[derive(Debug)]
pub struct Decoder {
    stage: Stage,
    is_ready: bool,
    pings: bool,
    /// Received bytes of the greeting, a length or a command.
    kept: Vec<u8>,
    message: Message,
}

/// The message whose frames are coming in.
#[derive(Debug, Default)]
struct Message {
    frames: usize,
    has_delimiter: bool,
    request_bytes: usize,
    /// Received bytes of the second frame.
    request: Vec<u8>,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { stage: Stage::Greeting, is_ready: false, pings: false, kept: Vec::new(), message: Message::default() }
    }
}

impl Decoder {
    /// Whether the other side has sent its introduction.
    pub fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Whether the other side knows pings, which came with version 3.1.
    pub fn knows_pings(&self) -> bool {
        self.pings
    }

    /// Whether a part of a message has come and the rest is due.
    pub fn is_amid(&self) -> bool {
        self.stage != Stage::Flags || self.message.frames > 0
    }

    /// Bytes in memory.
    pub fn held_bytes(&self) -> usize {
        self.kept.capacity() + self.message.request.capacity()
    }

    /// Reads on until something is complete or `input` is used up.
    ///
    /// # Errors
    /// [`Violation`]; the connection is then to be closed.
    pub fn read(&mut self, input: &mut &[u8]) -> Result<Option<Event>, Violation> {
        while !input.is_empty() {
            let event = match self.stage {
                Stage::Greeting => self.read_greeting(input)?,
                Stage::Flags => {
                    let flags = input[0];
                    *input = &input[1..];
                    self.begin_frame(flags)?;
                    None
                }
                Stage::Length { flags } => self.read_length(flags, input)?,
                Stage::Body { flags, left } => self.read_body(flags, left, input)?,
            };
            if event.is_some() {
                return Ok(event);
            }
        }
        Ok(None)
    }

    fn read_greeting(&mut self, input: &mut &[u8]) -> Result<Option<Event>, Violation> {
        take(input, GREETING_BYTES - self.kept.len(), &mut self.kept);
        // As early as it can be seen: the request of a web page is shorter than a greeting, and would be waited for.
        let is = |at: usize, good: fn(u8) -> bool| self.kept.get(at).is_none_or(|&byte| good(byte));
        if !(is(0, |byte| byte == 0xff) && is(9, |byte| byte & 1 == 1) && is(10, |byte| byte >= 3)) {
            return Err(Violation::OtherProtocol);
        }
        if self.kept.len() < GREETING_BYTES {
            return Ok(None);
        }
        if self.kept[12..32] != MECHANISM {
            return Err(Violation::Mechanism);
        }
        self.pings = self.kept[10] > 3 || self.kept[11] >= 1;
        self.kept = Vec::new();
        self.stage = Stage::Flags;
        Ok(Some(Event::Greeted))
    }

    fn begin_frame(&mut self, flags: u8) -> Result<(), Violation> {
        let is_command = flags & COMMAND != 0;
        let is_known = flags & !(MORE | LONG | COMMAND) == 0;
        // The first frame is the introduction, and a command is a single frame.
        if !is_known || (is_command && flags & MORE != 0) || (!is_command && !self.is_ready) {
            return Err(Violation::Frame);
        }
        self.stage = Stage::Length { flags };
        Ok(())
    }

    fn read_length(&mut self, flags: u8, input: &mut &[u8]) -> Result<Option<Event>, Violation> {
        let wanted = if flags & LONG == 0 { 1 } else { 8 };
        take(input, wanted - self.kept.len(), &mut self.kept);
        if self.kept.len() < wanted {
            return Ok(None);
        }
        let length = self.kept.drain(..).fold(0, |length: u64, byte| length << 8 | u64::from(byte));
        let limit = if flags & COMMAND == 0 { MAX_FRAME_BYTES } else { MAX_COMMAND_BYTES };
        if length > limit {
            return Err(Violation::Frame);
        }
        self.stage = Stage::Body { flags, left: length };
        if flags & COMMAND == 0 {
            self.message.frames += 1;
            match self.message.frames {
                1 => self.message.has_delimiter = length == 0,
                2 => self.message.request_bytes = length as usize,
                // It was none.
                _ => self.message.request = Vec::new(),
            }
        }
        if length == 0 { self.finish_frame(flags) } else { Ok(None) }
    }

    fn read_body(&mut self, flags: u8, left: u64, input: &mut &[u8]) -> Result<Option<Event>, Violation> {
        let count = usize::try_from(left).unwrap_or(usize::MAX).min(input.len());
        let (piece, rest) = input.split_at(count);
        if flags & COMMAND != 0 {
            self.kept.extend_from_slice(piece);
        } else if self.message.frames == 2 && self.message.request_bytes <= MAX_REQUEST_BYTES {
            self.message.request.extend_from_slice(piece);
        }
        *input = rest;
        let left = left - count as u64;
        self.stage = Stage::Body { flags, left };
        if left == 0 { self.finish_frame(flags) } else { Ok(None) }
    }

    fn finish_frame(&mut self, flags: u8) -> Result<Option<Event>, Violation> {
        self.stage = Stage::Flags;
        if flags & COMMAND != 0 {
            let command = std::mem::take(&mut self.kept);
            return self.command(&command);
        }
        if flags & MORE != 0 {
            return Ok(None);
        }
        let message = std::mem::take(&mut self.message);
        // Anything else is not a request, and has no place for a reply.
        if message.frames != 2 || !message.has_delimiter {
            return Ok(None);
        }
        Ok(Some(if message.request_bytes > MAX_REQUEST_BYTES {
            Event::TooLong(message.request_bytes)
        } else {
            Event::Request(message.request)
        }))
    }

    fn command(&mut self, command: &[u8]) -> Result<Option<Event>, Violation> {
        let (&length, rest) = command.split_first().ok_or(Violation::Frame)?;
        let (name, data) = rest.split_at_checked(usize::from(length)).ok_or(Violation::Frame)?;
        match name {
            b"READY" if !self.is_ready => {
                let socket = property(data, b"Socket-Type")?;
                if !socket.is_some_and(|socket| ASKING_SOCKETS.contains(&socket)) {
                    return Err(Violation::SocketType);
                }
                self.is_ready = true;
                Ok(Some(Event::Ready))
            }
            _ if !self.is_ready => Err(Violation::Frame),
            b"READY" | b"ERROR" => Err(Violation::Frame),
            // Two bytes of time to live, then what is to be repeated.
            b"PING" => match data.get(2..) {
                Some(context) if context.len() <= MAX_CONTEXT_BYTES => Ok(Some(Event::Pong(pong(context)))),
                _ => Err(Violation::Frame),
            },
            _ => Ok(None),
        }
    }
}

/// Moves up to `count` bytes from the input to the end of `kept`.
fn take(input: &mut &[u8], count: usize, kept: &mut Vec<u8>) {
    let (taken, rest) = input.split_at(count.min(input.len()));
    kept.extend_from_slice(taken);
    *input = rest;
}

/// The value of a property of a socket; names are compared as the protocol does, whatever their case.
fn property<'a>(mut data: &'a [u8], wanted: &[u8]) -> Result<Option<&'a [u8]>, Violation> {
    let mut found = None;
    while let Some((&length, rest)) = data.split_first() {
        let (name, rest) = rest.split_at_checked(usize::from(length)).ok_or(Violation::Frame)?;
        let (length, rest) = rest.split_first_chunk::<4>().ok_or(Violation::Frame)?;
        let length = usize::try_from(u32::from_be_bytes(*length)).map_err(|_too_long| Violation::Frame)?;
        let (value, rest) = rest.split_at_checked(length).ok_or(Violation::Frame)?;
        if name.eq_ignore_ascii_case(wanted) {
            found = Some(value);
        }
        data = rest;
    }
    Ok(found)
}

fn pong(context: &[u8]) -> Vec<u8> {
    let mut pong = vec![COMMAND, 5 + context.len() as u8, 4];
    pong.extend_from_slice(b"PONG");
    pong.extend_from_slice(context);
    pong
}

/// Prefix of a reply of this many bytes: the delimiter and the head of the frame.
pub fn reply_head(bytes: usize) -> Vec<u8> {
    let mut head = vec![MORE, 0];
    match u8::try_from(bytes) {
        Ok(short) => head.extend_from_slice(&[0, short]),
        Err(_long) => {
            head.push(LONG);
            head.extend_from_slice(&(bytes as u64).to_be_bytes());
        }
    }
    head
}

#[cfg(test)]
#[path = "zmtp_tests.rs"]
mod tests;
