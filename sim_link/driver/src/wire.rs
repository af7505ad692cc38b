//! Framing: lines and the bytes that follow them, with limits. What is held is bounded whatever a driver sends.

use std::fmt;
use std::io::{BufRead, Read};

use super::message::{BadMessage, FromDriver};

/// Longest line in bytes, its end included.
pub const MAX_LINE: usize = 65_536;
/// Most bytes that follow a line: an image of 22 million pixels in colour.
pub(crate) const MAX_BYTES: u64 = 67_108_864;
/// Bytes are taken in pieces of this size, so that what is promised and does not come takes no memory.
const PIECE: u64 = 1 << 20;
/// Characters of a line that are shown.
const SHOWN: usize = 160;

/// A message as it came.
#[derive(Debug, Clone, PartialEq)]
pub struct Incoming {
    /// Number of the line in the conversation, counted from 1.
    pub number: u64,
    /// The line, for messages about it.
    pub line: String,
    /// The message.
    pub message: FromDriver,
    /// Bytes that followed it; none after a message of an unknown type, where bytes are skipped.
    pub bytes: Vec<u8>,
}

/// A message that breaks the protocol, with the line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error("message {number}: {problem}: {excerpt}")]
pub struct WireError {
    /// Number of the line in the conversation, counted from 1.
    pub number: u64,
    /// Beginning of the line.
    pub excerpt: Excerpt,
    /// What is wrong.
    pub problem: WireProblem,
}

/// What is wrong with a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum WireProblem {
    /// No end of line within [`MAX_LINE`].
    #[error("longer than {MAX_LINE} bytes: data such as images follow a line as bytes")]
    TooLong,
    /// The output ended within a line.
    #[error("the output ended before the end of the line")]
    CutLine,
    /// The output ended within the bytes that follow a line.
    #[error("the output ended after {got} of {need} bytes")]
    CutBytes {
        /// Bytes received.
        got: u64,
        /// Bytes announced.
        need: u64,
    },
    #[error("not UTF-8")]
    /// Bytes that are not UTF-8.
    NotText,
    /// No message where one has to be, behind the bytes of another.
    #[error("{what}: it follows the {bytes} bytes of the message before, of which there may be more or fewer")]
    AfterBytes {
        /// Number of bytes that were taken.
        bytes: u64,
        /// What is wrong with what follows.
        what: Box<WireProblem>,
    },
    /// More bytes than [`MAX_BYTES`].
    #[error("{got} bytes are to follow, at most {MAX_BYTES}")]
    TooManyBytes {
        /// Bytes announced.
        got: u64,
    },
    /// The message itself.
    #[error(transparent)]
    Message(#[from] BadMessage),
    /// A message in the wrong place of the conversation, or bytes that are not an image.
    #[error("{0}")]
    Conversation(String),
    /// The system cannot read.
    #[error("it cannot be read: {0}")]
    Unreadable(String),
}

/// The beginning of a line, safe to show.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excerpt(String);

impl Excerpt {
    /// Excerpt of the bytes of a line. Bytes that are not UTF-8 become �.
    pub(crate) fn of(line: &[u8]) -> Self {
        let mut shown = String::new();
        for chunk in line.trim_ascii().utf8_chunks() {
            for character in chunk.valid().chars() {
                if shown.len() >= SHOWN {
                    return Self(shown + "…");
                }
                if character.is_control() { shown.extend(character.escape_default()) } else { shown.push(character) }
            }
            if !chunk.invalid().is_empty() {
                shown.push(char::REPLACEMENT_CHARACTER);
            }
        }
        Self(shown)
    }
}

impl fmt::Display for Excerpt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

handeye_wording::plain_values!(Excerpt);

/// Reads the messages of a driver. After an error it is not known where the next message begins.
#[derive(Debug)]
pub(crate) struct MessageReader<R> {
    source: R,
    number: u64,
    line: Vec<u8>,
    /// Number of bytes that followed the previous line.
    bytes_before: u64,
}

impl<R: BufRead> MessageReader<R> {
    /// From the beginning of a conversation.
    pub fn new(source: R) -> Self {
        Self { source, number: 0, line: Vec::new(), bytes_before: 0 }
    }

    /// The next message; `None` once the output has ended where a message could begin. Blocks until then.
    ///
    /// # Errors
    /// [`WireError`] with the line that is wrong.
    pub fn read(&mut self) -> Result<Option<Incoming>, WireError> {
        let bytes = std::mem::take(&mut self.bytes_before);
        self.read_next().map_err(|error| match error.problem {
            what @ (WireProblem::NotText
            | WireProblem::TooLong
            | WireProblem::Message(BadMessage::Empty | BadMessage::Chatter | BadMessage::NotJson { .. }))
                if bytes > 0 =>
            {
                WireError { problem: WireProblem::AfterBytes { bytes, what: Box::new(what) }, ..error }
            }
            _ => error,
        })
    }

    fn read_next(&mut self) -> Result<Option<Incoming>, WireError> {
        self.number += 1;
        self.line.clear();
        let limit = MAX_LINE as u64;
        let taken = self.source.by_ref().take(limit).read_until(b'\n', &mut self.line);
        taken.map_err(|error| self.error(WireProblem::Unreadable(error.to_string())))?;
        if self.line.is_empty() {
            return Ok(None);
        }
        if self.line.last() != Some(&b'\n') {
            let is_long = self.line.len() >= MAX_LINE;
            return Err(self.error(if is_long { WireProblem::TooLong } else { WireProblem::CutLine }));
        }
        let Ok(line) = std::str::from_utf8(&self.line) else { return Err(self.error(WireProblem::NotText)) };
        let line = line.trim_ascii_end().to_owned();
        let (message, count) = FromDriver::parse(&line).map_err(|bad| self.error(bad.into()))?;
        if count > MAX_BYTES {
            return Err(self.error(WireProblem::TooManyBytes { got: count }));
        }
        let is_kept = !matches!(message, FromDriver::Unknown(_));
        let bytes = self.bytes(count, is_kept)?;
        self.bytes_before = count;
        Ok(Some(Incoming { number: self.number, line, message, bytes }))
    }

    fn bytes(&mut self, count: u64, is_kept: bool) -> Result<Vec<u8>, WireError> {
        let mut bytes = Vec::new();
        let mut got = 0;
        while got < count {
            let mut piece = self.source.by_ref().take(PIECE.min(count - got));
            let taken = if is_kept {
                piece.read_to_end(&mut bytes).map(|taken| taken as u64)
            } else {
                std::io::copy(&mut piece, &mut std::io::sink())
            };
            match taken {
                Ok(0) => return Err(self.error(WireProblem::CutBytes { got, need: count })),
                Ok(taken) => got += taken,
                Err(error) => return Err(self.error(WireProblem::Unreadable(error.to_string()))),
            }
        }
        Ok(bytes)
    }

    fn error(&self, problem: WireProblem) -> WireError {
        WireError { number: self.number, excerpt: Excerpt::of(&self.line), problem }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "wire_tests.rs"]
mod tests;
