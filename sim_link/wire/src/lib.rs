//! Messages of the remote API as bytes: CBOR in and out, with limits, and lenient readers for its values.
//!
//! CoppeliaSim writes floats at any width, integers where a float is meant, text or bytes for strings, and an empty
//! map for an empty list. The readers of [`Reader`] accept all of these; the writers emit definite lengths, no tags,
//! null rather than undefined.
//!
//! ```
//! use ciborium::Value;
//! use handeye_wire::{decode, encode};
//!
//! let call = Value::Map(vec![("func".into(), "sim.getSimulationTime".into())]);
//! assert_eq!(decode(&encode(&call))?, call);
//! # Ok::<(), handeye_wire::WireError>(())
//! ```
//!
//! Never depends on a socket, a client or a cell.

#![warn(missing_docs)]

pub mod axes;

use ciborium::Value;

/// Nesting that real messages never reach; it bounds the stack of the decoder.
const MAX_DEPTH: usize = 32;

/// Largest message accepted: a 4k RGB image and room to spare.
pub const MAX_MESSAGE_BYTES: usize = 64 << 20;

/// Longest reply that a client reads. A little over the limit of a message is still read, and refused with its length;
/// far over it is not worth the memory.
pub const MAX_REPLY_BYTES: usize = 2 * MAX_MESSAGE_BYTES;

/// Bytes that are not one CBOR item, or an item of the wrong shape.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum WireError {
    /// Longer than [`MAX_MESSAGE_BYTES`].
    #[error("message of {bytes} bytes is over the limit of {MAX_MESSAGE_BYTES} bytes")]
    TooLarge {
        /// Its size.
        bytes: usize,
    },
    /// Not CBOR, cut short, or nested too deeply.
    #[error("message is not valid CBOR: {reason}")]
    Malformed {
        /// The error of the decoder.
        reason: String,
    },
    /// A second item, or garbage, follows the first.
    #[error("{bytes} stray bytes follow the message")]
    TrailingBytes {
        /// Number of bytes.
        bytes: usize,
    },
    /// A value is not of the requested type.
    #[error("{what}: expected {expected}, got {got}")]
    WrongType {
        /// Place in the message.
        what: String,
        /// Requested type.
        expected: &'static str,
        /// What was found.
        got: &'static str,
    },
}

/// Decodes exactly one CBOR item.
///
/// # Errors
/// [`WireError`]; never panics and never allocates more than a small multiple of `bytes.len()`.
pub fn decode(bytes: &[u8]) -> Result<Value, WireError> {
    if bytes.len() > MAX_MESSAGE_BYTES {
        return Err(WireError::TooLarge { bytes: bytes.len() });
    }
    let mut rest = bytes;
    let value = ciborium::de::from_reader_with_recursion_limit(&mut rest, MAX_DEPTH)
        .map_err(|error: ciborium::de::Error<std::io::Error>| WireError::Malformed { reason: error.to_string() })?;
    if rest.is_empty() { Ok(value) } else { Err(WireError::TrailingBytes { bytes: rest.len() }) }
}

/// Encodes one item.
pub fn encode(value: &Value) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing a `Value` into memory has no failing path; an empty message would be refused by any receiver.
    if let Err(error) = ciborium::into_writer(value, &mut bytes) {
        tracing::error!(%error, "a message could not be encoded");
        bytes.clear();
    }
    bytes
}

/// A map with text keys.
pub fn map<'a>(entries: impl IntoIterator<Item = (&'a str, Value)>) -> Value {
    Value::Map(entries.into_iter().map(|(k, v)| (Value::from(k), v)).collect())
}

/// An array of floats.
pub fn floats(values: impl IntoIterator<Item = f64>) -> Value {
    Value::Array(values.into_iter().map(Value::Float).collect())
}

/// An array of integers.
pub fn integers(values: impl IntoIterator<Item = i64>) -> Value {
    Value::Array(values.into_iter().map(Value::from).collect())
}

/// Name of a value's type, for messages.
pub fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Integer(_) => "an integer",
        Value::Float(_) => "a float",
        Value::Text(_) => "text",
        Value::Bytes(_) => "bytes",
        Value::Array(_) => "an array",
        Value::Map(_) => "a map",
        _ => "a tagged value",
    }
}

/// Lenient views of a [`Value`]; `None` when it cannot be read so.
pub trait Reader {
    /// Any number.
    fn number(&self) -> Option<f64>;
    /// An integer, or a float without fraction.
    fn integer(&self) -> Option<i64>;
    /// `true` or `false`.
    fn boolean(&self) -> Option<bool>;
    /// Text, or bytes that are UTF-8.
    fn text(&self) -> Option<&str>;
    /// Bytes, or the bytes of a text.
    fn blob(&self) -> Option<&[u8]>;
    /// An array; an empty map counts as an empty one.
    fn list(&self) -> Option<&[Value]>;
    /// An array of numbers.
    fn numbers(&self) -> Option<Vec<f64>>;
    /// The value under a text key of a map.
    fn get(&self, key: &str) -> Option<&Value>;
}

impl Reader for Value {
    fn number(&self) -> Option<f64> {
        match self {
            Self::Float(v) => Some(*v),
            Self::Integer(v) => Some(i128::from(*v) as f64),
            _ => None,
        }
    }

    fn integer(&self) -> Option<i64> {
        match self {
            Self::Integer(v) => i64::try_from(i128::from(*v)).ok(),
            Self::Float(v) if v.fract() == 0.0 && v.abs() < 9e15 => Some(*v as i64),
            _ => None,
        }
    }

    fn boolean(&self) -> Option<bool> {
        match self {
            Self::Bool(v) => Some(*v),
            _ => None,
        }
    }

    fn text(&self) -> Option<&str> {
        match self {
            Self::Text(v) => Some(v),
            Self::Bytes(v) => std::str::from_utf8(v).ok(),
            _ => None,
        }
    }

    fn blob(&self) -> Option<&[u8]> {
        match self {
            Self::Bytes(v) => Some(v),
            Self::Text(v) => Some(v.as_bytes()),
            _ => None,
        }
    }

    fn list(&self) -> Option<&[Value]> {
        match self {
            Self::Array(v) => Some(v),
            Self::Map(v) if v.is_empty() => Some(&[]),
            _ => None,
        }
    }

    fn numbers(&self) -> Option<Vec<f64>> {
        self.list()?.iter().map(Reader::number).collect()
    }

    fn get(&self, key: &str) -> Option<&Value> {
        match self {
            Self::Map(entries) => entries.iter().find(|(k, _)| k.text() == Some(key)).map(|(_, v)| v),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_float_width_and_integers_read_as_numbers() {
        // [0.5 half, 0.5 single, 0.5 double, 5] as the simulator's encoder writes them.
        let bytes = [0x84, 0xf9, 0x38, 0x00, 0xfa, 0x3f, 0x00, 0x00, 0x00, 0xfb, 0x3f, 0xe0, 0, 0, 0, 0, 0, 0, 0x05];
        assert_eq!(decode(&bytes).expect("valid").numbers(), Some(vec![0.5, 0.5, 0.5, 5.0]));
    }

    #[test]
    fn an_empty_map_is_an_empty_list() {
        assert_eq!(decode(&[0xa0]).expect("valid").list(), Some(&[][..]));
    }

    #[test]
    fn stray_bytes_and_truncation_are_errors() {
        assert_eq!(decode(&[0x01, 0x02]), Err(WireError::TrailingBytes { bytes: 1 }));
        assert!(matches!(decode(&[0x82, 0x01]), Err(WireError::Malformed { .. })));
        assert!(matches!(decode(&[]), Err(WireError::Malformed { .. })));
    }

    #[test]
    fn a_length_that_the_message_does_not_have_costs_no_memory() {
        // A byte string and an array that claim 2^40 elements.
        for head in [0x5b, 0x9b] {
            let bytes = [head, 0, 0, 1, 0, 0, 0, 0, 0];
            assert!(matches!(decode(&bytes), Err(WireError::Malformed { .. })));
        }
    }

    #[test]
    fn deep_nesting_is_refused_without_exhausting_the_stack() {
        assert!(matches!(decode(&vec![0x81; 1_000_000]), Err(WireError::Malformed { .. })));
    }
}
