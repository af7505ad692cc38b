//! A transport for tests: a closure answers each request, and everything that passes is written down.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ciborium::Value;

use super::connection::Connection;
use super::endpoint::Endpoint;
use super::options::ConnectionOptions;
use super::transport::{Transport, TransportFault};
use handeye_wire::{self as wire, Reader as _};

/// What the server does with a request.
pub enum Answer {
    /// Replies with a message.
    Say(Value),
    /// Replies with bytes.
    Raw(Vec<u8>),
    /// Does not reply.
    Silence,
    /// Goes away.
    Fault(TransportFault),
}

/// What happened to the transport.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    Sent(Value),
    SentLast(Value),
    Reset,
}

/// The events, to be inspected afterwards.
#[derive(Clone, Default)]
pub struct Log(Arc<Mutex<Vec<Event>>>);

impl Log {
    fn push(&self, event: Event) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(event);
    }

    pub(crate) fn events(&self) -> Vec<Event> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The requests in order.
    pub(crate) fn requests(&self) -> Vec<Value> {
        let sent = |event| match event {
            Event::Sent(request) => Some(request),
            _ => None,
        };
        self.events().into_iter().filter_map(sent).collect()
    }

    /// The functions called, in order.
    pub(crate) fn functions(&self) -> Vec<String> {
        self.requests().iter().map(|request| func(request).to_owned()).collect()
    }
}

/// The function of a request.
pub fn func(request: &Value) -> &str {
    request.get("func").and_then(Value::as_text).expect("every request has a function")
}

/// The arguments of a request.
pub fn args(request: &Value) -> &[Value] {
    request.get("args").and_then(|args| args.list()).expect("every request has arguments")
}

struct Fake {
    server: Box<dyn FnMut(&Value) -> Answer + Send>,
    pending: Option<Answer>,
    log: Log,
}

impl Transport for Fake {
    fn send(&mut self, message: &[u8]) -> Result<(), TransportFault> {
        assert!(self.pending.is_none(), "a request was sent while a reply was due");
        let request = wire::decode(message).expect("requests are valid");
        self.log.push(Event::Sent(request.clone()));
        self.pending = Some((self.server)(&request));
        Ok(())
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, TransportFault> {
        assert!(wait <= Duration::from_millis(50), "nobody looks at the cancel token for {wait:?}");
        match self.pending.take().expect("nothing is received before something is sent") {
            Answer::Say(value) => Ok(Some(wire::encode(&value))),
            Answer::Raw(bytes) => Ok(Some(bytes)),
            Answer::Silence => {
                self.pending = Some(Answer::Silence);
                Ok(None)
            }
            Answer::Fault(fault) => Err(fault),
        }
    }

    fn reset(&mut self) {
        self.pending = None;
        self.log.push(Event::Reset);
    }

    fn send_last(&mut self, message: &[u8]) {
        self.pending = None;
        self.log.push(Event::SentLast(wire::decode(message).expect("requests are valid")));
    }

    fn connected(&mut self) -> bool {
        true
    }

    fn ended(&mut self) -> bool {
        false
    }
}

/// A connection to a closure.
pub fn connection(server: impl FnMut(&Value) -> Answer + Send + 'static) -> (Connection, Log) {
    let log = Log::default();
    let options = ConnectionOptions {
        reply_timeout: Duration::from_millis(30),
        total_timeout: Duration::from_millis(300),
        seed: Some(7),
        ..ConnectionOptions::default()
    };
    let fake = Fake { server: Box::new(server), pending: None, log: log.clone() };
    (Connection::over(Box::new(fake), &Endpoint::default(), options), log)
}

/// `{ret: values}`.
pub fn ret(values: impl IntoIterator<Item = Value>) -> Answer {
    Answer::Say(wire::map([("ret", Value::Array(values.into_iter().collect()))]))
}

/// `{err: text}`.
pub fn err(message: &str) -> Answer {
    Answer::Say(wire::map([("err", Value::from(message))]))
}

/// `{func: name, args: {}}`.
pub fn ask(name: &str) -> Answer {
    Answer::Say(wire::map([("func", Value::from(name)), ("args", Value::Map(Vec::new()))]))
}
