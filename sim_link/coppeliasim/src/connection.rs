//! One conversation with a remote API server: calls, time limits, recovery.

use std::cell::Cell;
use std::time::{Duration, Instant};

use ciborium::Value;

use super::endpoint::Endpoint;
use super::error::LinkError;
use super::options::{CallOptions, ConnectionOptions};
use super::protocol::{
    self, ClientIds, END, EXECUTED, REPEAT, REQUIRE, ReplyError, Sender, ServerMessage, UNKNOWN_FUNCTION, WAIT,
};
use super::returned::Returned;
use super::standstill::Standstill;
use super::transport::{Transport, TransportFault, ZmqTransport};
use handeye_geometry::progress::CancelToken;
use handeye_wire::WireError;

/// The module of the simulator's functions, and how their names begin.
const MODULE: &str = "sim";
const MODULE_PREFIX: &str = "sim.";

/// Longest stretch of waiting without a look at the cancel token.
const SLICE: Duration = Duration::from_millis(20);

/// A client of one server. Belongs to one thread at a time: it can be sent to another, not shared.
///
/// A call that ends without a reply (time out, lost connection, cancelled, nonsense) closes the socket, so that the next
/// call starts on a new one. The client id stays, and with it the server's record of this client (stepping mode, locks);
/// unless the server was left in the middle of a conversation, waiting for this client and perhaps holding the
/// simulation, or the call was cancelled or ran past its total time: then the record is ended and a new id taken.
/// [`Connection::epoch`] shows when state on the server may have been lost.
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own")]
pub struct Connection {
    transport: Box<dyn Transport>,
    endpoint: Endpoint,
    options: ConnectionOptions,
    ids: ClientIds,
    uuid: String,
    introduced: bool,
    /// Names of the module are known to resolve, or were asked to: see [`Connection::converse`].
    loaded: bool,
    /// The server has sent messages that can be read.
    has_spoken: bool,
    contacted: bool,
    epoch: u64,
}

/// A call under way.
struct Exchange<'a> {
    func: &'a str,
    reply_timeout: Duration,
    total_timeout: Duration,
    started: Instant,
    cancel: Option<&'a CancelToken>,
    grace: Duration,
    /// When the token was first seen raised.
    cancelled_at: Cell<Option<Instant>>,
    /// The server has asked this client for something, so it waits for an answer inside the call.
    asked: bool,
    awaits_pass: bool,
    standstill: Standstill,
}

impl Exchange<'_> {
    /// Whether the call was cancelled and had its time to end.
    fn is_cancelled(&self) -> bool {
        if !self.cancel.is_some_and(CancelToken::is_cancelled) {
            return false;
        }
        let since = self.cancelled_at.get().unwrap_or_else(Instant::now);
        self.cancelled_at.set(Some(since));
        since.elapsed() >= self.grace
    }
}

impl Connection {
    /// Prepares a connection over TCP. The server may be started later; the first call finds out.
    ///
    /// # Errors
    /// [`LinkError::Socket`] when no socket can be made for the address.
    pub fn connect(endpoint: &Endpoint, options: ConnectionOptions) -> Result<Self, LinkError> {
        let mut transport = ZmqTransport::new(endpoint, options.heartbeat);
        transport.open()?;
        Ok(Self::over(Box::new(transport), endpoint, options))
    }

    /// A connection over any transport; `endpoint` only appears in messages.
    pub fn over(transport: Box<dyn Transport>, endpoint: &Endpoint, options: ConnectionOptions) -> Self {
        let mut ids = ClientIds::new(options.seed);
        let uuid = ids.draw();
        Self {
            transport,
            endpoint: endpoint.clone(),
            options,
            ids,
            uuid,
            introduced: false,
            loaded: false,
            has_spoken: false,
            contacted: false,
            epoch: 0,
        }
    }

    /// Address of the server.
    pub(crate) fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Longest duration of a call without its own limit.
    pub(crate) fn total_timeout(&self) -> Duration {
        self.options.total_timeout
    }

    /// Whether the server is connected, as far as is known without a request: after a call that was answered, `false`
    /// means that it has gone since.
    pub fn is_connected(&mut self) -> bool {
        self.transport.connected()
    }

    /// Whether the server is a cell in this process.
    pub fn is_of_own_cell(&self) -> bool {
        self.options.is_own_cell
    }

    /// The error for a conversation that broke off in a call.
    pub(super) fn broken_off(&self, call: &str) -> LinkError {
        let (call, after) = (call.to_owned(), self.options.reply_timeout);
        if self.options.is_own_cell {
            LinkError::OwnCellSilent { call, after }
        } else {
            LinkError::Disconnected { call }
        }
    }

    /// This client's id.
    pub fn uuid(&self) -> &str {
        &self.uuid
    }

    /// Grows whenever the server may have lost this client's state (stepping mode, locks).
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Calls a function of the server by its dotted name, with the connection's time limits.
    ///
    /// # Errors
    /// Any [`LinkError`] of a conversation; [`LinkError::Remote`] when the server refuses.
    pub fn call(&mut self, func: &str, args: Vec<Value>) -> Result<Returned, LinkError> {
        self.call_with(func, args, &CallOptions::default())
    }

    /// [`Connection::call`] with separate limits.
    ///
    /// # Errors
    /// As [`Connection::call`].
    pub fn call_with(&mut self, func: &str, args: Vec<Value>, options: &CallOptions) -> Result<Returned, LinkError> {
        let started = Instant::now();
        let mut exchange = Exchange {
            func,
            reply_timeout: options.reply_timeout.unwrap_or(self.options.reply_timeout),
            total_timeout: options.total_timeout.unwrap_or(self.options.total_timeout),
            started,
            cancel: options.cancel.as_ref(),
            grace: options.grace,
            cancelled_at: Cell::new(None),
            asked: false,
            awaits_pass: options.awaits_pass,
            standstill: Standstill::begin(started),
        };
        // Between two calls it went without a word: the server may have forgotten this client since.
        if self.transport.ended() {
            self.drop_exchange();
        }
        self.converse(&mut exchange, args).map(|values| Returned::new(func, values))
    }

    /// Has the server forget this client, its stepping mode and its locks, and goes on as a new one.
    pub fn renew(&mut self) {
        self.contacted |= self.transport.connected();
        if self.contacted {
            let farewell = protocol::request(END, Vec::new(), &self.sender(None));
            self.transport.send_last(&farewell);
        } else {
            self.transport.reset();
        }
        self.uuid = self.ids.draw();
        (self.introduced, self.loaded) = (false, false);
        // The server knows nothing of the new client yet.
        self.contacted = false;
        self.epoch += 1;
    }

    /// A call from its request to its result.
    ///
    /// Servers after CoppeliaSim 4.10 know names of the module only once some client has had it loaded, and forget that
    /// when they are started again. So a name that is not known is called again with the module loaded.
    fn converse(&mut self, exchange: &mut Exchange<'_>, args: Vec<Value>) -> Result<Vec<Value>, LinkError> {
        let mut message = self.request(exchange.func, args);
        // The request, to be sent again with the module loaded.
        let mut unloaded = (!self.loaded && exchange.func.starts_with(MODULE_PREFIX)).then(|| message.clone());
        let mut loading = None;
        loop {
            let reply = self.exchange(exchange, &message)?;
            let is_answer = matches!(reply, ServerMessage::Returned { .. } | ServerMessage::Failed { .. });
            if is_answer && let Some(original) = loading.take() {
                // Whether it could be loaded is shown by the call itself.
                self.loaded = true;
                message = original;
                continue;
            }
            match reply {
                ServerMessage::Returned { values } => {
                    self.loaded |= unloaded.is_some();
                    return Ok(values);
                }
                ServerMessage::Failed { message: text } if unloaded.is_some() && text.starts_with(UNKNOWN_FUNCTION) => {
                    loading = unloaded.take();
                    message = self.request(REQUIRE, vec![Value::from(MODULE)]);
                }
                // The reply of a server that does not know the call that it was asked to continue.
                ServerMessage::Failed { message: text } if exchange.asked && text.contains(EXECUTED) => {
                    return Err(LinkError::Forgotten { call: exchange.func.to_owned() });
                }
                ServerMessage::Failed { message } => {
                    return Err(LinkError::Remote { call: exchange.func.to_owned(), message });
                }
                ServerMessage::OldProtocol => {
                    return Err(self.give_up(exchange, LinkError::TooOld { version: None }));
                }
                ServerMessage::Ask { func } => {
                    exchange.asked = true;
                    let (repeats, waits) = (func == REPEAT, func == WAIT);
                    // A call that is to be repeated has not begun, one that waits may be at work unless it is for a pass.
                    if (repeats || (waits && exchange.awaits_pass))
                        && let Some(after) = exchange.standstill.heard(Instant::now())
                    {
                        return Err(self.give_up(exchange, LinkError::Held { after }));
                    }
                    if !repeats && !waits {
                        tracing::debug!(callback = func, "the server asked for a callback, and there is none here");
                    }
                    if !repeats {
                        message = self.request(EXECUTED, Vec::new());
                    }
                }
                ServerMessage::Nothing => {
                    return Err(self.unexpected(exchange, "a result", "an empty map".to_owned()));
                }
            }
        }
    }

    /// Sends one message and waits for its reply.
    fn exchange(&mut self, exchange: &Exchange<'_>, message: &[u8]) -> Result<ServerMessage, LinkError> {
        self.check_limits(exchange, exchange.asked)?;
        if let Err(fault) = self.transport.send(message) {
            return Err(self.fault(exchange, fault));
        }
        let sent = Instant::now();
        loop {
            self.check_limits(exchange, true)?;
            let waited = sent.elapsed();
            // A call may allow a long silence of a connected server, but not a lost connection.
            let connected = self.transport.connected();
            let limit =
                if connected { exchange.reply_timeout } else { exchange.reply_timeout.min(self.options.reply_timeout) };
            let left = limit.saturating_sub(waited);
            let left_of_all = exchange.total_timeout.saturating_sub(exchange.started.elapsed());
            let received = self.transport.receive(left.min(left_of_all).min(SLICE));
            self.contacted |= self.transport.connected();
            match received {
                Ok(Some(bytes)) => return self.read(exchange, &bytes),
                // Late only after a last look: this process may have been the one that was held up.
                Ok(None) if left.is_zero() => {
                    let late = self.late(exchange, waited);
                    return Err(self.give_up(exchange, late));
                }
                Ok(None) => {}
                Err(fault) => return Err(self.fault(exchange, fault)),
            }
        }
    }

    /// Ends the call when it is cancelled or too long; `under_way`: whether the server knows of it.
    fn check_limits(&mut self, exchange: &Exchange<'_>, under_way: bool) -> Result<(), LinkError> {
        let cancelled = exchange.is_cancelled() || self.options.shutdown.is_cancelled();
        let elapsed = exchange.started.elapsed();
        if !cancelled && elapsed < exchange.total_timeout {
            return Ok(());
        }
        let error = if cancelled {
            LinkError::Cancelled { call: exchange.func.to_owned() }
        } else {
            self.late(exchange, elapsed)
        };
        if under_way {
            // The server may still be busy with the call, for example a motion: it ends with this client's record.
            self.renew();
        }
        Err(error)
    }

    fn read(&mut self, exchange: &Exchange<'_>, bytes: &[u8]) -> Result<ServerMessage, LinkError> {
        let call = || exchange.func.to_owned();
        let error = match protocol::parse(bytes) {
            Ok(message) => {
                self.has_spoken = true;
                return Ok(message);
            }
            Err(ReplyError::Wire(WireError::TooLarge { bytes })) => {
                LinkError::ReplyTooLarge { call: call(), bytes: Some(bytes) }
            }
            Err(ReplyError::Wire(source)) => LinkError::Malformed { call: call(), source, has_spoken: self.has_spoken },
            Err(ReplyError::Shape { expected, got }) => {
                LinkError::UnexpectedReply { call: call(), expected: expected.to_owned(), got }
            }
        };
        Err(self.give_up(exchange, error))
    }

    fn request(&mut self, func: &str, args: Vec<Value>) -> Vec<u8> {
        let introduces = (!self.introduced).then_some("rust");
        self.introduced = true;
        protocol::request(func, args, &self.sender(introduces))
    }

    fn sender(&self, introduces: Option<&'static str>) -> Sender<'_> {
        Sender { uuid: &self.uuid, idle_timeout_s: self.options.idle_timeout_s, introduces }
    }

    fn late(&mut self, exchange: &Exchange<'_>, after: Duration) -> LinkError {
        let call = exchange.func.to_owned();
        match (self.transport.connected(), self.options.is_own_cell) {
            (true, true) => LinkError::OwnCellSilent { call, after },
            (false, true) => LinkError::OwnCellEnded { call },
            (true, false) => LinkError::Timeout { call, after },
            (false, false) => LinkError::Unreachable { call, endpoint: self.endpoint.clone(), after },
        }
    }

    fn fault(&mut self, exchange: &Exchange<'_>, fault: TransportFault) -> LinkError {
        let call = exchange.func.to_owned();
        let error = match fault {
            TransportFault::Disconnected if self.options.is_own_cell => LinkError::OwnCellEnded { call },
            TransportFault::Disconnected => LinkError::Disconnected { call },
            TransportFault::TooLong => LinkError::ReplyTooLarge { call, bytes: None },
            TransportFault::ManyParts(parts) => LinkError::UnexpectedReply {
                call,
                expected: "a message of one part".to_owned(),
                got: format!("{parts} parts"),
            },
            TransportFault::Refused(reason) => LinkError::Socket { endpoint: self.endpoint.to_string(), reason },
        };
        if matches!(error, LinkError::Disconnected { .. } | LinkError::OwnCellEnded { .. }) {
            // Whatever comes back on that address may be another server.
            self.has_spoken = false;
            self.drop_exchange();
            return error;
        }
        self.give_up(exchange, error)
    }

    fn unexpected(&mut self, exchange: &Exchange<'_>, expected: &str, got: String) -> LinkError {
        let error = LinkError::UnexpectedReply { call: exchange.func.to_owned(), expected: expected.to_owned(), got };
        self.give_up(exchange, error)
    }

    /// Leaves a call that the server may not have left.
    fn give_up(&mut self, exchange: &Exchange<'_>, error: LinkError) -> LinkError {
        if exchange.asked {
            self.renew();
        } else {
            self.drop_exchange();
        }
        error
    }

    fn drop_exchange(&mut self) {
        self.transport.reset();
        (self.introduced, self.loaded) = (false, false);
        self.epoch += 1;
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        if self.contacted {
            let farewell = protocol::request(END, Vec::new(), &self.sender(None));
            self.transport.send_last(&farewell);
        }
    }
}

#[cfg(test)]
#[path = "connection_tests.rs"]
mod tests;
