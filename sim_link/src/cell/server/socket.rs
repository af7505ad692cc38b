//! The socket of the server and the loop around it.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::CellError;
use super::clients::Peer;
use super::engine::{Due, Engine, Outgoing};

/// Messages that are taken in before passes and replies get their turn.
const MESSAGES_PER_TURN: usize = 64;

/// Above this the socket closes the connection; requests that are merely too long get an error.
const MAX_FRAME_BYTES: i64 = 16 << 20;

/// Messages that wait per connection in either direction. A client has one request under way; one that sends more
/// without reading must not fill the memory with images.
const QUEUE: i32 = 16;

/// Replies that wait for connections that are full, and how long until they are tried again.
const MAX_WAITING: usize = 64;
const RETRY_MS: i64 = 1;

/// A connection that does not answer a ping for so long is gone although nobody closed it: a pulled plug.
const HEARTBEAT: Duration = Duration::from_secs(5);
const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(15);

fn system(operation: &'static str) -> impl Fn(zmq::Error) -> CellError {
    move |error| CellError::System { operation, reason: error.to_string() }
}

/// Ends a [`Loop`] from another thread.
pub(super) struct Stopper(Mutex<zmq::Socket>);

impl std::fmt::Debug for Stopper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Stopper")
    }
}

impl Stopper {
    /// Makes the loop end. Calling it again does nothing.
    pub fn stop(&self) {
        let socket = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        // Without a receiver the loop has ended already; a full queue means that it has been told.
        if let Err(error) = socket.send("stop", zmq::DONTWAIT) {
            tracing::debug!(%error, "the cell's loop was not there to be stopped");
        }
    }
}

/// Socket, engine, and what connects them.
pub(super) struct Loop {
    // Sockets come before their context: it waits for them when it is dropped.
    router: zmq::Socket,
    monitor: zmq::Socket,
    stop: zmq::Socket,
    engine: Engine,
    peers: Peers,
    /// Replies that did not fit into their connection's queue.
    waiting: Vec<Outgoing>,
    endpoint: String,
    started: Instant,
}

impl Loop {
    /// Binds the socket.
    pub fn bind(engine: Engine, bind: &str, port: u16) -> Result<(Self, Stopper), CellError> {
        let context = zmq::Context::new();
        let router = context.socket(zmq::ROUTER).map_err(system("making a socket"))?;
        configure(&router).map_err(system("configuring a socket"))?;
        let monitor = watch(&context, &router).map_err(system("watching connections"))?;
        let (stop, stopper) = stop_pair(&context).map_err(system("making a socket"))?;
        let address = if port == 0 { format!("tcp://{bind}:*") } else { format!("tcp://{bind}:{port}") };
        router.bind(&address).map_err(|error| match error {
            zmq::Error::EADDRINUSE => CellError::PortInUse { bind: bind.to_owned(), port },
            other => CellError::Bind { bind: bind.to_owned(), port, reason: other.to_string() },
        })?;
        let endpoint = match router.get_last_endpoint() {
            Ok(Ok(endpoint)) => endpoint,
            Ok(Err(_)) | Err(_) => address,
        };
        let started = Instant::now();
        let serving =
            Self { router, monitor, stop, engine, peers: Peers::default(), waiting: Vec::new(), endpoint, started };
        Ok((serving, Stopper(Mutex::new(stopper))))
    }

    /// Where it listens.
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Serves until it is told to stop.
    pub fn run(mut self) {
        loop {
            let [requests, connections, stop] = match self.wait() {
                Ok(ready) => ready,
                Err(zmq::Error::EINTR) => continue,
                Err(error) => return tracing::error!(%error, "the cell's sockets have failed"),
            };
            if stop {
                return;
            }
            if connections {
                self.note_disconnections();
            }
            if requests {
                self.take_in();
            }
            self.engine.turn(self.started.elapsed());
            self.reply();
        }
    }

    fn wait(&self) -> zmq::Result<[bool; 3]> {
        let timeout_ms = match self.engine.due() {
            Due::Now => 0,
            Due::Never => -1,
            // Up to the next millisecond, or the loop would spin through the last one.
            Due::At(time) => {
                let left = time.saturating_sub(self.started.elapsed());
                i64::try_from(left.as_micros().div_ceil(1000)).unwrap_or(i64::MAX)
            }
        };
        let retries_soon = !self.waiting.is_empty() && !(0..=RETRY_MS).contains(&timeout_ms);
        let timeout_ms = if retries_soon { RETRY_MS } else { timeout_ms };
        let mut items = [&self.router, &self.monitor, &self.stop].map(|socket| socket.as_poll_item(zmq::POLLIN));
        zmq::poll(&mut items, timeout_ms)?;
        Ok([items[0].is_readable(), items[1].is_readable(), items[2].is_readable()])
    }

    fn take_in(&mut self) {
        for _ in 0..MESSAGES_PER_TURN {
            let Ok(mut frames) = receive(&self.router) else { return };
            // Identity, empty delimiter, payload; anything else is not a request, and has no place for a reply.
            let [peer, delimiter, payload] = &mut frames[..] else { continue };
            if !delimiter.is_empty() {
                continue;
            }
            let peer = peer.to_vec();
            // The number of the connection, which libzmq attaches to every message.
            if let Some(file) = payload.gets("__fd").and_then(|text| text.parse().ok()) {
                self.note_connection(file, &peer);
            }
            self.engine.receive(&peer, payload, self.started.elapsed());
            self.reply();
        }
    }

    /// The system gives the numbers of closed connections to new ones. The news that the old one has ended is there
    /// before the first message of the new one, but may not have been read.
    fn note_connection(&mut self, file: u32, peer: &Peer) {
        if self.peers.is_known(file, peer) {
            return;
        }
        self.note_disconnections();
        if let Some(previous) = self.peers.insert(file, peer) {
            self.engine.disconnected(&previous, self.started.elapsed());
        }
    }

    fn note_disconnections(&mut self) {
        while let Ok(frames) = receive(&self.monitor) {
            let Some(&[low, high, a, b, c, d]) = frames.first().map(|event| &event[..]) else { continue };
            if u16::from_ne_bytes([low, high]) != zmq::SocketEvent::DISCONNECTED.to_raw() {
                continue;
            }
            if let Some(peer) = self.peers.closed(u32::from_ne_bytes([a, b, c, d])) {
                self.engine.disconnected(&peer, self.started.elapsed());
            }
        }
    }

    /// Sends what the engine has answered, in its order, and keeps what a connection does not take yet.
    ///
    /// A connection counts as full until its reader's news of what was read arrive here, which under load is now and
    /// then later than the next request: refusals are normal, and the reply goes out a moment later.
    fn reply(&mut self) {
        self.waiting.extend(self.engine.take_outgoing());
        let mut full: Vec<Peer> = Vec::new();
        for (peer, bytes) in std::mem::take(&mut self.waiting) {
            if full.contains(&peer) {
                self.waiting.push((peer, bytes));
                continue;
            }
            match self.router.send(&peer[..], zmq::SNDMORE | zmq::DONTWAIT) {
                Ok(()) => self.send_body(bytes),
                Err(zmq::Error::EAGAIN) => {
                    full.push(peer.clone());
                    self.waiting.push((peer, bytes));
                }
                Err(error) => tracing::debug!(%error, "a reply has no one to go to"),
            }
        }
        self.drop_hoards();
    }

    /// The rest of a message whose first frame was taken, which means that all of it is.
    fn send_body(&self, bytes: Vec<u8>) {
        let rest = self.router.send("", zmq::SNDMORE | zmq::DONTWAIT);
        if let Err(error) = rest.and_then(|()| self.router.send(bytes, zmq::DONTWAIT)) {
            tracing::warn!(%error, "a reply was cut short");
        }
    }

    /// Whoever sends requests without reading the replies loses the oldest of them.
    fn drop_hoards(&mut self) {
        let excess = self.waiting.len().saturating_sub(MAX_WAITING);
        if excess > 0 {
            tracing::warn!(excess, "replies that nobody reads are dropped");
            self.waiting.drain(..excess);
        }
    }
}

fn configure(router: &zmq::Socket) -> zmq::Result<()> {
    router.set_linger(0)?;
    router.set_maxmsgsize(MAX_FRAME_BYTES)?;
    router.set_rcvhwm(QUEUE)?;
    router.set_sndhwm(QUEUE)?;
    router.set_heartbeat_ivl(HEARTBEAT.as_millis() as i32)?;
    router.set_heartbeat_timeout(HEARTBEAT_TIMEOUT.as_millis() as i32)?;
    router.set_router_mandatory(true)?;
    router.set_router_handover(true)
}

/// A socket that tells of connections that end.
fn watch(context: &zmq::Context, router: &zmq::Socket) -> zmq::Result<zmq::Socket> {
    let address = unique("cell-monitor");
    router.monitor(&address, i32::from(zmq::SocketEvent::DISCONNECTED.to_raw()))?;
    let monitor = context.socket(zmq::PAIR)?;
    monitor.set_linger(0)?;
    monitor.connect(&address)?;
    Ok(monitor)
}

fn stop_pair(context: &zmq::Context) -> zmq::Result<(zmq::Socket, zmq::Socket)> {
    let address = unique("cell-stop");
    let (inner, outer) = (context.socket(zmq::PAIR)?, context.socket(zmq::PAIR)?);
    inner.set_linger(0)?;
    outer.set_linger(0)?;
    inner.bind(&address)?;
    outer.connect(&address)?;
    Ok((inner, outer))
}

fn unique(name: &str) -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    format!("inproc://{name}-{}", COUNT.fetch_add(1, Ordering::Relaxed))
}

/// All frames of a message that is there; at most a few are kept.
fn receive(socket: &zmq::Socket) -> zmq::Result<Vec<zmq::Message>> {
    const MAX_FRAMES: usize = 4;
    let mut frames = Vec::new();
    loop {
        let frame = socket.recv_msg(zmq::DONTWAIT)?;
        let more = frame.get_more();
        if frames.len() < MAX_FRAMES {
            frames.push(frame);
        }
        if !more {
            return Ok(frames);
        }
    }
}

/// Which connection of the system belongs to which peer of the socket: the system tells of the end of a connection by
/// its number, the socket names peers by their identity.
#[derive(Debug, Default)]
struct Peers {
    by_file: BTreeMap<u32, Peer>,
}

impl Peers {
    fn is_known(&self, file: u32, peer: &Peer) -> bool {
        self.by_file.get(&file) == Some(peer)
    }

    /// Notes a connection and gives the peer that had its number, which is gone.
    fn insert(&mut self, file: u32, peer: &Peer) -> Option<Peer> {
        self.by_file.insert(file, peer.clone())
    }

    /// A connection has ended. Gives the peer that is gone with it.
    fn closed(&mut self, file: u32) -> Option<Peer> {
        self.by_file.remove(&file)
    }
}
