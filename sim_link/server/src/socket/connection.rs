//! One connection: what comes in, what goes out, and what of it waits in memory.

use std::collections::VecDeque;
use std::io::{ErrorKind, IoSlice, Read as _, Write as _};
use std::time::Duration;

use mio::net::TcpStream;

use super::zmtp::{self, Decoder, Event, Violation};

/// How long a connection may take to introduce itself.
const HANDSHAKE_LIMIT: Duration = Duration::from_secs(10);

/// A client's request.
#[derive(Debug, PartialEq, Eq)]
pub enum Incoming {
    Request(Vec<u8>),
    /// A request of this many bytes, which was discarded.
    TooLong(usize),
}

/// Why a connection has ended.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum CloseReason {
    /// The other side closed it.
    #[error("the other side closed it")]
    Closed,
    /// The operating system reports that it is broken.
    #[error("it is broken: {0}")]
    Broken(ErrorKind),
    /// The other side does not behave like a client.
    #[error(transparent)]
    Violation(#[from] Violation),
    /// The other side sent no introduction.
    #[error("it did not introduce itself within {HANDSHAKE_LIMIT:?}")]
    NoIntroduction,
    /// The other side no longer answers.
    #[error("it does not answer pings")]
    Silent,
    /// It holds what others need.
    #[error("it does not read its replies, and they fill the memory that there is for all replies")]
    Slowest,
}

/// A connection. Times are those of the server's clock.
#[derive(Debug)]
pub struct Connection {
    stream: TcpStream,
    silence: Duration,
    decoder: Decoder,
    /// Received bytes that were not decoded yet, from `read` on.
    inbox: Vec<u8>,
    read: usize,
    outbox: VecDeque<Parcel>,
    may_read: bool,
    may_write: bool,
    opened: Duration,
    heard: Duration,
    pinged: Option<Duration>,
    /// Since when the rest of something is due.
    amid_since: Option<Duration>,
}

/// Bytes on their way out.
#[derive(Debug)]
struct Parcel {
    head: Vec<u8>,
    body: Vec<u8>,
    sent: usize,
    since: Duration,
}

impl Parcel {
    fn rest(&self) -> [IoSlice<'_>; 2] {
        let head = self.sent.min(self.head.len());
        [IoSlice::new(&self.head[head..]), IoSlice::new(&self.body[self.sent - head..])]
    }

    fn is_sent(&self) -> bool {
        self.sent == self.head.len() + self.body.len()
    }

    fn held_bytes(&self) -> usize {
        self.head.capacity() + self.body.capacity()
    }
}

impl Connection {
    /// A connection that was made just now, and is closed when it leaves a ping unanswered for `silence`.
    pub fn new(stream: TcpStream, silence: Duration, now: Duration) -> Self {
        let mut connection = Self {
            stream,
            silence,
            decoder: Decoder::default(),
            inbox: Vec::new(),
            read: 0,
            outbox: VecDeque::new(),
            may_read: true,
            may_write: true,
            opened: now,
            heard: now,
            pinged: None,
            amid_since: None,
        };
        connection.post(&zmtp::GREETING, Vec::new(), now);
        connection
    }

    /// The operating system reports that it can go on.
    pub fn note(&mut self, event: &mio::event::Event) {
        self.may_read |= event.is_readable() || event.is_read_closed() || event.is_error();
        self.may_write |= event.is_writable() || event.is_write_closed() || event.is_error();
    }

    /// Whether [`Self::next_request`] has something to do.
    pub fn has_work(&self) -> bool {
        self.outbox.is_empty() && (self.may_read || self.read < self.inbox.len())
    }

    /// The next request, if one is there. None is taken while a reply waits to be read: who sends without reading gets
    /// no further.
    ///
    /// # Errors
    /// [`CloseReason`], when there will be no more.
    pub fn next_request(&mut self, scratch: &mut [u8], now: Duration) -> Result<Option<Incoming>, CloseReason> {
        while self.has_work() {
            if self.read == self.inbox.len() && !self.receive(scratch, now)? {
                return Ok(None);
            }
            let mut rest = &self.inbox[self.read..];
            let event = self.decoder.read(&mut rest)?;
            self.read = self.inbox.len() - rest.len();
            if self.read == self.inbox.len() {
                (self.inbox, self.read) = (Vec::new(), 0);
            }
            self.amid_since = self.decoder.is_amid().then(|| self.amid_since.unwrap_or(now));
            match event {
                None | Some(Event::Ready) => {}
                Some(Event::Greeted) => self.post(&zmtp::READY, Vec::new(), now),
                Some(Event::Pong(answer)) => self.post(&answer, Vec::new(), now),
                Some(Event::Request(request)) => return Ok(Some(Incoming::Request(request))),
                Some(Event::TooLong(bytes)) => return Ok(Some(Incoming::TooLong(bytes))),
            }
            self.flush()?;
        }
        Ok(None)
    }

    /// Takes what the system has; `false` when it has nothing.
    fn receive(&mut self, scratch: &mut [u8], now: Duration) -> Result<bool, CloseReason> {
        loop {
            match self.stream.read(scratch) {
                Ok(0) => return Err(CloseReason::Closed),
                Ok(count) => {
                    self.inbox = scratch[..count].to_vec();
                    self.hear(now);
                    return Ok(true);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    self.may_read = false;
                    return Ok(false);
                }
                Err(error) => return Err(CloseReason::Broken(error.kind())),
            }
        }
    }

    fn hear(&mut self, now: Duration) {
        (self.heard, self.pinged) = (now, None);
    }

    /// Sends a reply, as far as the other side takes it now, and keeps the rest.
    ///
    /// # Errors
    /// [`CloseReason`].
    pub fn send(&mut self, reply: Vec<u8>, now: Duration) -> Result<(), CloseReason> {
        let head = zmtp::reply_head(reply.len());
        self.post(&head, reply, now);
        self.flush()
    }

    fn post(&mut self, head: &[u8], body: Vec<u8>, since: Duration) {
        self.outbox.push_back(Parcel { head: head.to_vec(), body, sent: 0, since });
    }

    /// Sends what waits, as far as the other side takes it now.
    ///
    /// # Errors
    /// [`CloseReason`].
    pub fn flush(&mut self) -> Result<(), CloseReason> {
        while self.may_write
            && let Some(parcel) = self.outbox.front_mut()
        {
            match self.stream.write_vectored(&parcel.rest()) {
                Ok(0) => return Err(CloseReason::Closed),
                Ok(count) => parcel.sent += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.may_write = false,
                Err(error) => return Err(CloseReason::Broken(error.kind())),
            }
            if parcel.is_sent() {
                self.outbox.pop_front();
            }
        }
        Ok(())
    }

    /// Goes on sending after the operating system reported that it can. Free space in the buffer is a sign of life: the
    /// other side reads.
    ///
    /// # Errors
    /// [`CloseReason`].
    pub fn resume(&mut self, now: Duration) -> Result<(), CloseReason> {
        if self.may_write && !self.outbox.is_empty() {
            self.hear(now);
            self.flush()?;
        }
        Ok(())
    }

    /// Bytes in memory for it.
    pub fn held_bytes(&self) -> usize {
        let out: usize = self.outbox.iter().map(Parcel::held_bytes).sum();
        self.inbox.capacity() + self.decoder.held_bytes() + out
    }

    /// Since when it has kept the server waiting: for taking its oldest reply, or for the rest of a request.
    pub fn waiting_since(&self) -> Option<Duration> {
        self.outbox.front().map(|parcel| parcel.since).into_iter().chain(self.amid_since).min()
    }

    /// When [`Self::look_after`] has something to do.
    pub fn due(&self) -> Option<Duration> {
        if !self.decoder.is_ready() {
            return Some(self.opened + HANDSHAKE_LIMIT);
        }
        // Asked after a third of it, so that what is alive has answered long before.
        let next = self.pinged.map_or(self.heard + self.silence / 3, |pinged| pinged + self.silence);
        self.decoder.knows_pings().then_some(next)
    }

    /// Sends a ping to a silent client, and closes the connection to one that does not answer.
    ///
    /// # Errors
    /// [`CloseReason`].
    pub fn look_after(&mut self, now: Duration) -> Result<(), CloseReason> {
        if self.due().is_none_or(|due| now < due) {
            return Ok(());
        }
        if !self.decoder.is_ready() {
            return Err(CloseReason::NoIntroduction);
        }
        if self.pinged.is_some() {
            return Err(CloseReason::Silent);
        }
        self.pinged = Some(now);
        self.post(&zmtp::PING, Vec::new(), now);
        self.flush()
    }
}

#[cfg(test)]
#[path = "connection_tests.rs"]
mod tests;
