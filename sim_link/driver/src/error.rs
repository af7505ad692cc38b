//! Errors of requests to a driver.

use std::time::Duration;

use super::message::Ability;
use super::spec::BadSpec;
use super::wire::WireError;

/// Why a request to a driver failed. Each error names the driver.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum DriverError {
    /// The text does not name a driver.
    #[error(transparent)]
    Spec(#[from] BadSpec),
    /// The program cannot be started.
    #[error("the driver `{command}` cannot be started: {why}")]
    Start {
        /// The command line of the driver.
        command: String,
        /// The error of the operating system.
        why: String,
    },
    /// Nobody answers at the address.
    #[error("no driver listens at tcp://{address}: {why}")]
    Connect {
        /// HOST:PORT.
        address: String,
        /// The error of the operating system.
        why: String,
    },
    /// It worked and is gone, or it never became ready. Starting it again is worth a try.
    #[error("the driver `{driver}` {why}")]
    Gone {
        /// Its command or address.
        driver: String,
        /// How it ended.
        why: Ending,
    },
    /// Its start goes on.
    #[error("the driver `{driver}` is being prepared: {what}")]
    Preparing {
        /// Its command or address.
        driver: String,
        /// What is being done, as the driver reports it.
        what: String,
    },
    /// The driver does not report that it can.
    #[error("the driver `{driver}` cannot do this: it has no `{ability}` in `can`")]
    Cannot {
        /// Its command or address.
        driver: String,
        /// The ability that is needed.
        ability: Ability,
    },
    /// The arm in `hello` is not usable.
    #[error("the driver `{driver}`: arm: {why}")]
    Arm {
        /// Its command or address.
        driver: String,
        /// What is wrong.
        why: String,
    },
    /// Motion is not allowed.
    #[error("the driver `{driver}` is read-only{since}: allow it to move the arm first", since = since(why.as_ref()))]
    NotArmed {
        /// Its command or address.
        driver: String,
        /// Why it is no longer armed, where the driver has reported that.
        why: Option<String>,
    },
    /// A motion is under way.
    #[error("the driver `{driver}` moves the arm already")]
    Busy {
        /// Its command or address.
        driver: String,
    },
    /// The driver refuses.
    #[error("the driver `{driver}` refuses {what}: {why}")]
    Refused {
        /// Its command or address.
        driver: String,
        /// The request.
        what: &'static str,
        /// The reason as the driver reports it.
        why: String,
    },
    /// A request was not answered in time. The connection is closed where the arm might move.
    #[error("the driver `{driver}` has not answered {what} within {seconds} s", seconds = after.as_secs_f64())]
    NoAnswer {
        /// Its command or address.
        driver: String,
        /// The request.
        what: &'static str,
        /// How long it waited.
        after: Duration,
    },
}

fn since(why: Option<&String>) -> String {
    why.map(|why| format!(" ({why})")).unwrap_or_default()
}

impl DriverError {
    /// Whether the connection is over, so that only starting it again can help.
    pub fn is_gone(&self) -> bool {
        matches!(self, Self::Gone { .. } | Self::Start { .. } | Self::Connect { .. })
    }
}

/// How a connection to a driver ended.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum Ending {
    /// The process ended by itself.
    #[error("ended ({status}){last}", last = last(last_line.as_ref()))]
    Exited {
        /// Its exit status, in the words of the system.
        status: String,
        /// The last line that it printed to standard error.
        last_line: Option<String>,
    },
    /// It closed its output, or the connection.
    #[error("closed the connection{last}", last = last(last_line.as_ref()))]
    Closed {
        /// The last line that it printed to standard error.
        last_line: Option<String>,
    },
    /// It sent something that breaks the protocol.
    #[error("broke the protocol: {0}")]
    Broken(WireError),
    /// It reported that it cannot go on.
    #[error("gave up: {0}")]
    GaveUp(String),
    /// No answer to `hello`.
    #[error("has not answered `hello` within {seconds} s{last}", seconds = after.as_secs_f64(), last = last(last_line.as_ref()))]
    NoHello {
        /// How long it waited.
        after: Duration,
        /// The last line that it printed to standard error.
        last_line: Option<String>,
    },
    /// No answer to pings.
    #[error("has not answered a `ping` for {seconds} s", seconds = after.as_secs_f64())]
    Silent {
        /// For how long.
        after: Duration,
    },
    /// It does not read what it is sent.
    #[error("does not read what it is sent")]
    NotReading,
    /// It did not stop a motion when it was asked to.
    #[error("did not come to rest after `stop`; the connection was closed")]
    DoesNotStop,
    /// This program closed it.
    #[error("was closed")]
    ClosedHere,
}

/// The last words of a driver, where it had any.
fn last(line: Option<&String>) -> String {
    line.map(|line| format!(": {line}")).unwrap_or_default()
}
