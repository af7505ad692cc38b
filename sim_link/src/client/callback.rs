//! Closures that the server calls in the middle of a call.

use ciborium::Value;

use super::connection::Connection;
use super::error::LinkError;
use super::options::CallOptions;
use super::returned::Returned;

/// A registered closure.
pub(super) type Callback =
    Box<dyn FnMut(&mut CallbackScope<'_>, &[Value]) -> Result<Vec<Value>, LinkError> + Send + 'static>;

/// Name under which the server knows a callback; see [`CallbackName::to_argument`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CallbackName(pub(super) String);

/// What a callback may do while it runs: further calls, on the same connection, within the limits of the outer call.
pub struct CallbackScope<'a> {
    connection: &'a mut Connection,
    options: CallOptions,
}

impl<'a> CallbackScope<'a> {
    pub(super) fn new(connection: &'a mut Connection, options: CallOptions) -> Self {
        Self { connection, options }
    }

    /// A call nested in the one that runs the callback.
    ///
    /// # Errors
    /// As [`Connection::call`]. If the conversation broke, the outer call fails with the same error, whatever the
    /// callback makes of it.
    pub fn call(&mut self, func: &str, args: Vec<Value>) -> Result<Returned, LinkError> {
        self.connection.call_with(func, args, &self.options)
    }
}
