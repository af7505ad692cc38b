//! Arguments of a call, read the way the simulator reads them, with its messages for the wrong ones.

use ciborium::Value;

use handeye_cell::world::{Handle, WorldError};
use handeye_motion::MotionError;
use handeye_wire::Reader;

/// A call that failed, in the simulator's words.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ApiError {
    /// Fewer arguments than the function needs.
    #[error("the function requires more arguments.")]
    TooFewArguments,
    /// An argument of another type.
    #[error("argument {number} is not {expected}.")]
    WrongType {
        /// Number of the argument, counted from 1.
        number: usize,
        /// What it should be.
        expected: &'static str,
    },
    /// A list with too few or too many numbers.
    #[error("incorrect table size.")]
    WrongSize,
    /// The world refuses.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A motion that cannot be planned.
    #[error("{0}.")]
    Motion(#[from] MotionError),
    /// A field of a map.
    #[error("{problem} '{name}' field.")]
    Field {
        /// `missing`, `invalid`, or both.
        problem: &'static str,
        name: &'static str,
    },
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

/// The arguments of a call. Positions count from 0 here and from 1 in messages.
#[derive(Debug, Clone, PartialEq)]
pub struct Args(Vec<Value>);

impl Args {
    /// Wraps what a request carried.
    pub fn new(values: Vec<Value>) -> Self {
        Self(values)
    }

    /// Number of arguments.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The argument, if there is one that is not null.
    pub fn get(&self, at: usize) -> Option<&Value> {
        self.0.get(at).filter(|value| !matches!(value, Value::Null))
    }

    fn read<'a, T>(
        &'a self,
        at: usize,
        expected: &'static str,
        read: impl FnOnce(&'a Value) -> Option<T>,
    ) -> Result<T, ApiError> {
        let value = self.0.get(at).ok_or(ApiError::TooFewArguments)?;
        read(value).ok_or(ApiError::WrongType { number: at + 1, expected })
    }

    fn read_or<'a, T>(
        &'a self,
        at: usize,
        expected: &'static str,
        default: T,
        read: impl FnOnce(&'a Value) -> Option<T>,
    ) -> Result<T, ApiError> {
        if self.get(at).is_none() { Ok(default) } else { self.read(at, expected, read) }
    }

    /// An object handle: an integer, or a float that is one.
    ///
    /// # Errors
    /// Missing, or not an integer.
    pub fn handle(&self, at: usize) -> Result<Handle, ApiError> {
        self.integer(at)
    }

    /// An integer.
    ///
    /// # Errors
    /// Missing, or not an integer.
    pub fn integer(&self, at: usize) -> Result<i64, ApiError> {
        self.read(at, "an integer", Reader::integer)
    }

    /// An integer, or a default.
    ///
    /// # Errors
    /// Not an integer.
    pub fn integer_or(&self, at: usize, default: i64) -> Result<i64, ApiError> {
        self.read_or(at, "an integer", default, Reader::integer)
    }

    /// A number.
    ///
    /// # Errors
    /// Missing, or not a number.
    pub fn number(&self, at: usize) -> Result<f64, ApiError> {
        self.read(at, "a number", Reader::number)
    }

    /// A number, or a default.
    ///
    /// # Errors
    /// Not a number.
    pub fn number_or(&self, at: usize, default: f64) -> Result<f64, ApiError> {
        self.read_or(at, "a number", default, Reader::number)
    }

    /// A boolean, or a default; numbers count as they do in C.
    ///
    /// # Errors
    /// Neither.
    pub fn boolean_or(&self, at: usize, default: bool) -> Result<bool, ApiError> {
        self.read_or(at, "a boolean", default, |value| value.boolean().or_else(|| value.number().map(|n| n != 0.0)))
    }

    /// A boolean; numbers count as they do in C.
    ///
    /// # Errors
    /// Missing, or neither.
    pub fn boolean(&self, at: usize) -> Result<bool, ApiError> {
        self.read(at, "a boolean", |value| value.boolean().or_else(|| value.number().map(|n| n != 0.0)))
    }

    /// A text.
    ///
    /// # Errors
    /// Missing, or not text.
    pub fn text(&self, at: usize) -> Result<&str, ApiError> {
        self.read(at, "a string", Reader::text)
    }

    /// Bytes.
    ///
    /// # Errors
    /// Missing, or neither bytes nor text.
    pub fn blob(&self, at: usize) -> Result<&[u8], ApiError> {
        self.read(at, "a string/buffer", Reader::blob)
    }

    /// Whether the argument is a list or a map.
    pub fn is_table(&self, at: usize) -> bool {
        matches!(self.0.get(at), Some(Value::Array(_) | Value::Map(_)))
    }

    /// A map; a missing one and an empty list count as empty.
    ///
    /// # Errors
    /// Anything else.
    pub fn map_or_empty(&self, at: usize) -> Result<Fields<'_>, ApiError> {
        self.read_or(at, "a table", Fields(&[]), |value| match value {
            Value::Map(entries) => Some(Fields(entries)),
            Value::Array(items) if items.is_empty() => Some(Fields(&[])),
            _ => None,
        })
    }

    /// A list of numbers.
    ///
    /// # Errors
    /// Missing, or not one.
    pub fn numbers(&self, at: usize) -> Result<Vec<f64>, ApiError> {
        self.read(at, "a table", Reader::numbers)
    }

    /// A list of numbers, if the argument is there.
    ///
    /// # Errors
    /// Something else is there.
    pub fn optional_numbers(&self, at: usize) -> Result<Option<Vec<f64>>, ApiError> {
        if self.get(at).is_none() { Ok(None) } else { self.numbers(at).map(Some) }
    }

    /// Exactly `N` numbers.
    ///
    /// # Errors
    /// Missing, not a list, or of another length.
    pub fn array<const N: usize>(&self, at: usize) -> Result<[f64; N], ApiError> {
        self.numbers(at)?.try_into().ok().ok_or(ApiError::WrongSize)
    }

    /// A list of handles.
    ///
    /// # Errors
    /// Missing, or not one.
    pub fn handles(&self, at: usize) -> Result<Vec<Handle>, ApiError> {
        self.read(at, "a table", |value| value.list()?.iter().map(Reader::integer).collect())
    }

    /// The name of a callback, if the argument is one.
    pub fn callback(&self, at: usize) -> Option<String> {
        self.get(at).and_then(callback_name)
    }
}

/// The name in a text that denotes a function of the client.
pub fn callback_name(value: &Value) -> Option<String> {
    value.text()?.strip_suffix("@func").map(str::to_owned)
}

/// The fields of a map argument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fields<'a>(&'a [(Value, Value)]);

impl<'a> Fields<'a> {
    /// The fields of a map value.
    pub fn of(value: &'a Value) -> Option<Self> {
        match value {
            Value::Map(entries) => Some(Self(entries)),
            Value::Array(items) if items.is_empty() => Some(Self(&[])),
            _ => None,
        }
    }

    /// Every field as it came.
    pub fn entries(&self) -> &'a [(Value, Value)] {
        self.0
    }

    /// A field, unless it is absent or null.
    pub fn get(&self, name: &str) -> Option<&'a Value> {
        let (_, value) = self.0.iter().find(|(key, _)| key.text() == Some(name))?;
        (!matches!(value, Value::Null)).then_some(value)
    }

    fn read<T>(&self, name: &'static str, read: impl FnOnce(&'a Value) -> Option<T>) -> Result<Option<T>, ApiError> {
        match self.get(name) {
            None => Ok(None),
            Some(value) => read(value).map(Some).ok_or(ApiError::Field { problem: "invalid", name }),
        }
    }

    /// An integer.
    ///
    /// # Errors
    /// Something else is there.
    pub fn integer(&self, name: &'static str) -> Result<Option<i64>, ApiError> {
        self.read(name, Reader::integer)
    }

    /// A number.
    ///
    /// # Errors
    /// Something else is there.
    pub fn number(&self, name: &'static str) -> Result<Option<f64>, ApiError> {
        self.read(name, Reader::number)
    }

    /// A boolean.
    ///
    /// # Errors
    /// Something else is there.
    pub fn boolean(&self, name: &'static str) -> Result<Option<bool>, ApiError> {
        self.read(name, Reader::boolean)
    }

    /// A text.
    ///
    /// # Errors
    /// Something else is there.
    pub fn text(&self, name: &'static str) -> Result<Option<&'a str>, ApiError> {
        self.read(name, Reader::text)
    }

    /// A list of numbers.
    ///
    /// # Errors
    /// Something else is there.
    pub fn numbers(&self, name: &'static str) -> Result<Option<Vec<f64>>, ApiError> {
        self.read(name, Reader::numbers)
    }

    /// A list of exactly `count` numbers.
    ///
    /// # Errors
    /// Something else is there.
    pub fn numbers_of(&self, name: &'static str, count: usize) -> Result<Option<Vec<f64>>, ApiError> {
        match self.numbers(name)? {
            Some(values) if values.len() != count => Err(ApiError::Field { problem: "invalid", name }),
            values => Ok(values),
        }
    }

    /// A list of handles.
    ///
    /// # Errors
    /// Something else is there.
    pub fn handles(&self, name: &'static str) -> Result<Option<Vec<Handle>>, ApiError> {
        self.read(name, |value| value.list()?.iter().map(Reader::integer).collect())
    }

    /// The name of a callback.
    pub fn callback(&self, name: &str) -> Option<String> {
        self.get(name).and_then(callback_name)
    }
}
