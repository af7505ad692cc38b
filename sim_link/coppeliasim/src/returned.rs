//! Return values of a call, read as what they are meant to be.

use ciborium::Value;

use super::convert::{self, ConvertError};
use super::error::LinkError;
use handeye_geometry::frames::Pose;
use handeye_wire::{self as wire, Reader};

/// The values that a call returned, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Returned {
    call: String,
    values: Vec<Value>,
}

impl Returned {
    pub(super) fn new(call: &str, values: Vec<Value>) -> Self {
        Self { call: call.to_owned(), values }
    }

    /// The bare values.
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// Any number at `index`.
    ///
    /// # Errors
    /// [`LinkError::UnexpectedReply`], as for all readers here, when it cannot be read so.
    pub(crate) fn number(&self, index: usize) -> Result<f64, LinkError> {
        self.read(index, "a number", Reader::number)
    }

    /// An integer at `index`.
    ///
    /// # Errors
    /// As [`Self::number`].
    pub fn integer(&self, index: usize) -> Result<i64, LinkError> {
        self.read(index, "an integer", Reader::integer)
    }

    /// A boolean at `index`; a number counts as true unless it is zero.
    ///
    /// # Errors
    /// As [`Self::number`].
    pub(crate) fn boolean(&self, index: usize) -> Result<bool, LinkError> {
        self.read(index, "a boolean", |value| value.boolean().or_else(|| value.integer().map(|v| v != 0)))
    }

    /// Text at `index`.
    ///
    /// # Errors
    /// As [`Self::number`].
    pub fn text(&self, index: usize) -> Result<&str, LinkError> {
        self.values.get(index).and_then(|value| value.text()).ok_or_else(|| self.unexpected(index, "text"))
    }

    /// Bytes at `index`; a server without declared types sends some as text.
    ///
    /// # Errors
    /// As [`Self::number`].
    pub fn blob(&self, index: usize) -> Result<&[u8], LinkError> {
        self.values.get(index).and_then(|value| value.blob()).ok_or_else(|| self.unexpected(index, "bytes"))
    }

    /// An array of numbers at `index`.
    ///
    /// # Errors
    /// As [`Self::number`].
    pub(crate) fn numbers(&self, index: usize) -> Result<Vec<f64>, LinkError> {
        self.read(index, "an array of numbers", Reader::numbers)
    }

    /// An array of `N` numbers at `index`.
    ///
    /// # Errors
    /// As [`Self::number`], also for another length.
    pub(crate) fn exactly<const N: usize>(&self, index: usize) -> Result<[f64; N], LinkError> {
        let numbers = self.numbers(index)?;
        let got = numbers.len();
        <[f64; N]>::try_from(numbers).ok().ok_or_else(|| LinkError::UnexpectedReply {
            call: self.call.clone(),
            expected: format!("{N} numbers"),
            got: format!("{got} numbers"),
        })
    }

    /// A map at `index`, moved out.
    ///
    /// # Errors
    /// As [`Self::number`].
    pub(crate) fn into_map(mut self, index: usize) -> Result<Value, LinkError> {
        match self.values.get_mut(index) {
            Some(value @ Value::Map(_)) => Ok(std::mem::replace(value, Value::Null)),
            _ => Err(self.unexpected(index, "a map")),
        }
    }

    /// A CoppeliaSim pose (7 numbers) at `index`, stated to be `dst_from_src`.
    ///
    /// # Errors
    /// As [`Self::number`]; [`LinkError::BadValue`] when it is not a rigid transform.
    pub(crate) fn pose<Dst, Src>(&self, index: usize) -> Result<Pose<Dst, Src>, LinkError> {
        self.checked(convert::pose_from_seven(&self.exactly::<7>(index)?))
    }

    /// The image size `[width, height]` at `index`.
    ///
    /// # Errors
    /// As [`Self::number`]; [`LinkError::BadValue`] when it is not a valid size.
    pub(crate) fn resolution(&self, index: usize) -> Result<(u32, u32), LinkError> {
        let [width, height] = self.exactly::<2>(index)?;
        self.checked(convert::resolution(width, height))
    }

    /// Names the call in an error of conversion.
    pub(super) fn checked<T>(&self, result: Result<T, ConvertError>) -> Result<T, LinkError> {
        result.map_err(|source| LinkError::BadValue { call: self.call.clone(), source })
    }

    fn read<T>(
        &self,
        index: usize,
        expected: &'static str,
        read: impl FnOnce(&Value) -> Option<T>,
    ) -> Result<T, LinkError> {
        self.values.get(index).and_then(read).ok_or_else(|| self.unexpected(index, expected))
    }

    fn unexpected(&self, index: usize, expected: &'static str) -> LinkError {
        let got = self.values.get(index).map_or("nothing", wire::type_name);
        LinkError::UnexpectedReply {
            call: self.call.clone(),
            expected: format!("{expected} as value {}", index + 1),
            got: got.to_owned(),
        }
    }
}
