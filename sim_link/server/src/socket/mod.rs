//! The socket of the server and the loop around it.
//!
//! The remote API uses a ROUTER socket of ZeroMQ. This is a separate implementation, because the library's does not
//! report the memory of its replies and cannot close a single connection: a client that requests images and reads none
//! would use up both without limit.

mod connection;
mod zmtp;

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use mio::net::TcpListener;
use mio::{Events, Interest, Poll, Token, Waker};

use super::CellError;
use super::clients::Peer;
use super::engine::{Due, Engine};
use super::message::BadRequest;
use connection::{CloseReason, Connection, Incoming};

/// Connections at a time; a workbench has three.
const MAX_CONNECTIONS: usize = 256;

/// What all connections together may hold in memory: replies that are not read yet, and requests that have not come
/// whole. A reply has 32 MB at most. The connection that has kept the server waiting longest is closed first.
const BUDGET_BYTES: usize = 64 << 20;

/// Requests of one connection before the others get their turn.
const REQUESTS_PER_TURN: usize = 16;

/// How much is read at a time.
const READ_BYTES: usize = 64 << 10;

const LISTENER: Token = Token(0);
const STOP: Token = Token(1);
const FIRST_CONNECTION: usize = 2;

fn system(operation: &'static str) -> impl Fn(std::io::Error) -> CellError {
    move |error| CellError::System { operation, reason: error.to_string() }
}

/// Ends a [`Loop`] from another thread.
#[derive(Debug)]
pub(super) struct Stopper(Waker);

impl Stopper {
    /// Makes the loop end. Calling it again does nothing.
    pub fn stop(&self) {
        if let Err(error) = self.0.wake() {
            tracing::error!(%error, "the cell could not be told to stop");
        }
    }
}

/// Socket, engine, and what connects them.
pub(super) struct Loop {
    poll: Poll,
    listener: TcpListener,
    address: SocketAddr,
    connections: BTreeMap<Token, Connection>,
    next_token: usize,
    silence: Duration,
    engine: Engine,
    started: Instant,
    scratch: Vec<u8>,
}

impl Loop {
    /// Binds the socket.
    pub fn bind(engine: Engine, bind: &str, port: u16, silence: Duration) -> Result<(Self, Stopper), CellError> {
        let mut listener = listen(bind, port)?;
        let address = listener.local_addr().map_err(system("asking for its address"))?;
        let poll = Poll::new().map_err(system("making a poll"))?;
        let registry = poll.registry();
        registry.register(&mut listener, LISTENER, Interest::READABLE).map_err(system("watching a socket"))?;
        let waker = Waker::new(registry, STOP).map_err(system("making a waker"))?;
        let serving = Self {
            poll,
            listener,
            address,
            connections: BTreeMap::new(),
            next_token: FIRST_CONNECTION,
            silence,
            engine,
            started: Instant::now(),
            scratch: vec![0; READ_BYTES],
        };
        Ok((serving, Stopper(waker)))
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until it is stopped.
    pub fn run(mut self) {
        let mut events = Events::with_capacity(MAX_CONNECTIONS);
        loop {
            match self.poll.poll(&mut events, self.timeout()) {
                Ok(()) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return tracing::error!(%error, "the cell's sockets have failed"),
            }
            for event in &events {
                match event.token() {
                    STOP => return,
                    LISTENER => self.accept(),
                    token => {
                        let resumed = self.connections.get_mut(&token).map(|connection| {
                            connection.note(event);
                            connection.resume(self.started.elapsed())
                        });
                        self.close_if(token, resumed.unwrap_or(Ok(())));
                    }
                }
            }
            self.take_in();
            self.engine.turn(self.started.elapsed());
            self.reply();
            self.look_after();
        }
    }

    fn timeout(&self) -> Option<Duration> {
        if self.connections.values().any(Connection::has_work) {
            return Some(Duration::ZERO);
        }
        let engine = match self.engine.due() {
            Due::Now => return Some(Duration::ZERO),
            Due::At(time) => Some(time),
            Due::Never => None,
        };
        let next = self.connections.values().filter_map(Connection::due).chain(engine).min();
        next.map(|time| time.saturating_sub(self.started.elapsed()))
    }

    fn accept(&mut self) {
        loop {
            let mut stream = match self.listener.accept() {
                Ok((stream, _from)) => stream,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => return tracing::warn!(%error, "a connection could not be taken"),
            };
            if self.connections.len() >= MAX_CONNECTIONS {
                tracing::warn!(MAX_CONNECTIONS, "there are as many connections as there may be: another is refused");
                continue;
            }
            let token = Token(self.next_token);
            self.next_token += 1;
            // Replies are short, and each is waited for.
            let watched = stream.set_nodelay(true).and_then(|()| {
                self.poll.registry().register(&mut stream, token, Interest::READABLE | Interest::WRITABLE)
            });
            if let Err(error) = watched {
                tracing::debug!(%error, "a connection was gone before it was served");
                continue;
            }
            let now = self.started.elapsed();
            let connection = self.connections.entry(token).or_insert(Connection::new(stream, self.silence, now));
            let greeted = connection.flush();
            self.close_if(token, greeted);
        }
    }

    /// Takes some requests of each connection in and answers what can be answered at once.
    fn take_in(&mut self) {
        let busy = |(token, connection): (&Token, &Connection)| connection.has_work().then_some(*token);
        for token in self.connections.iter().filter_map(busy).collect::<Vec<_>>() {
            for _ in 0..REQUESTS_PER_TURN {
                let now = self.started.elapsed();
                let Some(connection) = self.connections.get_mut(&token) else { break };
                match connection.next_request(&mut self.scratch, now) {
                    Ok(Some(Incoming::Request(request))) => self.engine.receive(&peer(token), &request, now),
                    Ok(Some(Incoming::TooLong(bytes))) => {
                        self.engine.refuse(&peer(token), &BadRequest::TooLong { bytes });
                    }
                    Ok(None) => break,
                    Err(gone) => {
                        self.close(token, &gone);
                        break;
                    }
                }
                self.reply();
            }
            // After each: together they may send more in one turn than there is room for.
            self.keep_within_budget();
        }
    }

    /// Sends what the engine has answered.
    fn reply(&mut self) {
        let replies = self.engine.take_outgoing();
        if replies.is_empty() {
            return;
        }
        for (peer, reply) in replies {
            let now = self.started.elapsed();
            let Some(token) = token(&peer) else { continue };
            let Some(connection) = self.connections.get_mut(&token) else { continue };
            let sent = connection.send(reply, now);
            self.close_if(token, sent);
        }
        self.keep_within_budget();
    }

    fn keep_within_budget(&mut self) {
        while self.connections.values().map(Connection::held_bytes).sum::<usize>() > BUDGET_BYTES {
            let waiting = |(token, connection): (&Token, &Connection)| Some((connection.waiting_since()?, *token));
            let Some((_since, slowest)) = self.connections.iter().filter_map(waiting).min() else { return };
            self.close(slowest, &CloseReason::Slowest);
        }
    }

    fn look_after(&mut self) {
        let now = self.started.elapsed();
        let is_due = |(token, connection): (&Token, &Connection)| {
            connection.due().is_some_and(|due| due <= now).then_some(*token)
        };
        for token in self.connections.iter().filter_map(is_due).collect::<Vec<_>>() {
            let alive = self.connections.get_mut(&token).map_or(Ok(()), |connection| connection.look_after(now));
            self.close_if(token, alive);
        }
    }

    fn close_if(&mut self, token: Token, outcome: Result<(), CloseReason>) {
        if let Err(gone) = outcome {
            self.close(token, &gone);
        }
    }

    fn close(&mut self, token: Token, why: &CloseReason) {
        if self.connections.remove(&token).is_none() {
            return;
        }
        match why {
            CloseReason::Closed | CloseReason::Broken(_) => tracing::debug!(%why, "a connection has ended"),
            CloseReason::Slowest => tracing::warn!(%why, "a connection is closed"),
            CloseReason::Violation(_) | CloseReason::NoIntroduction | CloseReason::Silent => {
                tracing::info!(%why, "a connection is closed");
            }
        }
        self.engine.disconnected(&peer(token), self.started.elapsed());
    }
}

/// A socket that listens on an address or a host name; `*` means all addresses, as in ZeroMQ.
fn listen(bind: &str, port: u16) -> Result<TcpListener, CellError> {
    let host = match bind {
        "*" => "0.0.0.0",
        // Brackets belong to the port, not to the address.
        bind => bind.strip_prefix('[').and_then(|bind| bind.strip_suffix(']')).unwrap_or(bind),
    };
    let listener = std::net::TcpListener::bind((host, port)).map_err(|error| match error.kind() {
        ErrorKind::AddrInUse => CellError::PortInUse { bind: bind.to_owned(), port },
        _ => CellError::Bind { bind: bind.to_owned(), port, reason: error.to_string() },
    })?;
    listener.set_nonblocking(true).map_err(system("configuring a socket"))?;
    Ok(TcpListener::from_std(listener))
}

/// The name of a connection for the engine.
fn peer(token: Token) -> Peer {
    token.0.to_be_bytes().to_vec()
}

fn token(peer: &Peer) -> Option<Token> {
    Some(Token(usize::from_be_bytes(peer[..].try_into().ok()?)))
}
