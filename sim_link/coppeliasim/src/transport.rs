//! The seam between the protocol and the socket, and the socket.

use std::time::{Duration, Instant};

use super::endpoint::Endpoint;
use super::error::LinkError;
use handeye_wire::MAX_REPLY_BYTES;

/// How long a last message may keep a closing socket alive. A server on this machine takes it in under a millisecond,
/// on a busy one in a tenth of a second; one that has gone must not delay the end of the program.
const FAREWELL: Duration = Duration::from_millis(500);

/// When a connection breaks, the library reports at once that it tries again, unless it has closed the connection
/// itself because of a message that is too long. Only its own thread has to run for that.
const RETRY_NEWS: Duration = Duration::from_millis(250);

/// Pause before a refused connection is tried again: short, because a person waits for the server to come up.
const RECONNECT_MS: i32 = 50;

/// Name of the monitors of the sockets, within a context.
const MONITOR: &str = "inproc://monitor";

/// Why a transport has no message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TransportFault {
    /// The peer has gone since the request was sent; its reply will never come.
    Disconnected,
    /// The reply is longer than [`MAX_REPLY_BYTES`], or not what a ZeroMQ socket sends.
    TooLong,
    /// The reply has more than one part, which the remote API never sends.
    ManyParts(usize),
    /// The socket library refused.
    Refused(String),
}

/// Carries requests to a server and replies back, strictly in turn.
pub trait Transport: Send {
    /// Sends a request. Exactly one reply is due before the next one, unless [`Transport::reset`] intervenes.
    ///
    /// # Errors
    /// [`TransportFault`]; the request is then lost.
    fn send(&mut self, message: &[u8]) -> Result<(), TransportFault>;

    /// Waits up to `wait` for the reply; `None` when it has not come.
    ///
    /// # Errors
    /// [`TransportFault`] as soon as it is certain that no reply will come.
    fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, TransportFault>;

    /// Gives the reply that is due up, so that the next request can be sent. A late reply is never delivered.
    fn reset(&mut self);

    /// Sends a message without waiting for a reply, as far as possible without blocking, and resets.
    fn send_last(&mut self, message: &[u8]);

    /// Whether a server is connected, as far as is known since the last reset.
    fn connected(&mut self) -> bool;

    /// Whether a connection that was made since the last reset has ended. The next request then goes out over another one.
    fn ended(&mut self) -> bool;
}

/// A REQ socket over TCP that notices when its server dies.
///
/// The socket is made on first use and destroyed by every fault, because a REQ socket that waits for a lost reply can
/// do nothing else ever again. A monitor reports a closed connection at once; ZMTP heartbeats, which the server's
/// socket library answers on its own, report a host that vanished without closing it.
pub struct ZmqTransport {
    // Declared before the context: sockets have to be closed when the context is.
    channel: Option<Channel>,
    context: zmq::Context,
    endpoint: Endpoint,
    heartbeat: Option<Duration>,
    serial: u64,
    /// The last connection that was made has ended, and none was made since.
    lost: bool,
}

/// The meaning of a refused connection.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Refusal {
    /// The server is not up yet.
    NotYet,
    /// The server has gone: the connection before was made, and has ended.
    Gone,
}

struct Channel {
    request: zmq::Socket,
    monitor: zmq::Socket,
    serial: u64,
    awaiting_reply: bool,
    shaken_hands: bool,
    refusal: Refusal,
    lost_since: Option<Instant>,
    retries: bool,
}

impl ZmqTransport {
    /// Prepares to connect; nothing is sent yet, and the server need not run yet.
    ///
    /// `heartbeat` is the time after which a silent host counts as gone, or `None` for no heartbeats.
    pub fn new(endpoint: &Endpoint, heartbeat: Option<Duration>) -> Self {
        Self {
            channel: None,
            context: zmq::Context::new(),
            endpoint: endpoint.clone(),
            heartbeat,
            serial: 0,
            lost: false,
        }
    }

    /// Makes the socket, so that an address that can never work is known before the first call.
    ///
    /// # Errors
    /// [`LinkError::Socket`].
    pub(crate) fn open(&mut self) -> Result<(), LinkError> {
        self.ready().map(|_| ()).map_err(|fault| LinkError::Socket {
            endpoint: self.endpoint.to_string(),
            reason: match fault {
                TransportFault::Refused(reason) => reason,
                other => format!("{other:?}"),
            },
        })
    }

    fn ready(&mut self) -> Result<&mut Channel, TransportFault> {
        let lost = self.ended();
        let usable = !lost && self.channel.as_ref().is_some_and(|channel| !channel.awaiting_reply);
        if !usable {
            self.channel = None;
            self.serial += 1;
            let mut channel = Channel::connect(&self.context, &self.endpoint, self.heartbeat, self.serial)
                .map_err(|error| TransportFault::Refused(error.to_string()))?;
            channel.refusal = if self.lost { Refusal::Gone } else { Refusal::NotYet };
            self.channel = Some(channel);
        }
        self.channel.as_mut().ok_or(TransportFault::Disconnected)
    }
}

impl Channel {
    fn connect(
        context: &zmq::Context,
        endpoint: &Endpoint,
        heartbeat: Option<Duration>,
        serial: u64,
    ) -> zmq::Result<Self> {
        let request = context.socket(zmq::REQ)?;
        request.set_linger(0)?;
        request.set_reconnect_ivl(RECONNECT_MS)?;
        request.set_maxmsgsize(MAX_REPLY_BYTES as i64)?;
        request.set_ipv6(endpoint.is_ipv6())?;
        if let Some(silence) = heartbeat {
            let third = i32::try_from(silence.as_millis() / 3).unwrap_or(i32::MAX).max(1);
            request.set_heartbeat_ivl(third)?;
            request.set_heartbeat_timeout(third.saturating_mul(2))?;
        }
        let name = format!("{MONITOR}-{serial}");
        let events =
            [zmq::SocketEvent::HANDSHAKE_SUCCEEDED, zmq::SocketEvent::DISCONNECTED, zmq::SocketEvent::CONNECT_RETRIED];
        request.monitor(&name, events.into_iter().fold(0, |all, event| all | event as i32))?;
        let monitor = context.socket(zmq::PAIR)?;
        monitor.set_linger(0)?;
        // The library's I/O thread blocks on a monitor that is full, and with it every socket of this context.
        monitor.set_rcvhwm(0)?;
        monitor.connect(&name)?;
        request.connect(&endpoint.to_string())?;
        Ok(Self {
            request,
            monitor,
            serial,
            awaiting_reply: false,
            shaken_hands: false,
            refusal: Refusal::NotYet,
            lost_since: None,
            retries: false,
        })
    }

    /// Takes the pending events of the monitor.
    fn listen_to_monitor(&mut self) {
        while let Ok(parts) = self.monitor.recv_multipart(zmq::DONTWAIT) {
            let Some([low, high]) = parts.first().and_then(|head| head.first_chunk::<2>()) else { continue };
            let event = u16::from_ne_bytes([*low, *high]);
            if event == zmq::SocketEvent::HANDSHAKE_SUCCEEDED as u16 {
                self.shaken_hands = true;
            } else if event == zmq::SocketEvent::DISCONNECTED as u16 && self.shaken_hands {
                // Before the handshake it is only an attempt that failed: the library tries again by itself.
                self.lost_since = self.lost_since.or_else(|| Some(Instant::now()));
            } else if event == zmq::SocketEvent::CONNECT_RETRIED as u16 {
                self.retries |= self.lost_since.is_some() || (self.refusal == Refusal::Gone && !self.shaken_hands);
            }
        }
    }

    /// Why there will be no reply, as soon as that is certain.
    fn fault(&self) -> Option<TransportFault> {
        match self.lost_since {
            _ if self.retries => Some(TransportFault::Disconnected),
            Some(since) if since.elapsed() > RETRY_NEWS => Some(TransportFault::TooLong),
            _ => None,
        }
    }

    fn take_reply(&mut self) -> Result<Option<Vec<u8>>, TransportFault> {
        match self.request.recv_multipart(zmq::DONTWAIT) {
            Ok(mut parts) => {
                self.awaiting_reply = false;
                match (parts.len(), parts.pop()) {
                    (1, Some(message)) => Ok(Some(message)),
                    (count, _) => Err(TransportFault::ManyParts(count)),
                }
            }
            Err(zmq::Error::EAGAIN | zmq::Error::EINTR) => Ok(None),
            Err(error) => Err(TransportFault::Refused(error.to_string())),
        }
    }
}

impl Drop for Channel {
    /// A request socket that lingers, or is not reaped yet, still reports events, and the library's I/O thread would
    /// wait forever for a monitor that nobody reads now. So the reports are switched off first: they go to a second
    /// monitor, which receives nothing.
    fn drop(&mut self) {
        if let Err(error) = self.request.monitor(&format!("{MONITOR}-{}-off", self.serial), 0) {
            tracing::debug!(%error, "the monitor of a socket could not be switched off");
        }
    }
}

impl Transport for ZmqTransport {
    fn send(&mut self, message: &[u8]) -> Result<(), TransportFault> {
        let channel = self.ready()?;
        channel.request.send(message, zmq::DONTWAIT).map_err(|error| TransportFault::Refused(error.to_string()))?;
        channel.awaiting_reply = true;
        Ok(())
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, TransportFault> {
        let channel = self.channel.as_mut().ok_or(TransportFault::Disconnected)?;
        let mut items = [channel.request.as_poll_item(zmq::POLLIN), channel.monitor.as_poll_item(zmq::POLLIN)];
        let wait_ms = i64::try_from(wait.as_micros().div_ceil(1000)).unwrap_or(i64::MAX);
        match zmq::poll(&mut items, wait_ms) {
            Ok(_) | Err(zmq::Error::EINTR) => {}
            Err(error) => return Err(TransportFault::Refused(error.to_string())),
        }
        channel.listen_to_monitor();
        // A reply that arrived before the connection broke is still a reply.
        let reply = channel.take_reply()?;
        let fault = channel.fault().filter(|_| reply.is_none());
        self.lost = fault == Some(TransportFault::Disconnected) || (self.lost && !channel.shaken_hands);
        fault.map_or(Ok(reply), Err)
    }

    fn reset(&mut self) {
        self.channel = None;
    }

    fn send_last(&mut self, message: &[u8]) {
        let sent = self.ready().and_then(|channel| {
            channel
                .request
                .set_linger(FAREWELL.as_millis() as i32)
                .and_then(|()| channel.request.send(message, zmq::DONTWAIT))
                .map_err(|error| TransportFault::Refused(error.to_string()))
        });
        if let Err(fault) = sent {
            tracing::debug!(?fault, "the server was not told that this client leaves");
        }
        self.channel = None;
    }

    fn connected(&mut self) -> bool {
        self.channel.as_mut().is_some_and(|channel| {
            channel.listen_to_monitor();
            channel.shaken_hands && channel.lost_since.is_none()
        })
    }

    fn ended(&mut self) -> bool {
        let ended = self.channel.as_mut().is_some_and(|channel| {
            channel.listen_to_monitor();
            channel.lost_since.is_some()
        });
        self.lost |= ended;
        ended
    }
}
