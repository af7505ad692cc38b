//! A rosbridge, written from its protocol's specification, with topics that a test fills.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// The time that stamps begin at.
const EPOCH_S: f64 = 1_700_000_000.0;

type Make = Arc<dyn Fn(f64) -> Value + Send + Sync>;

/// What is published on a topic.
#[derive(Clone)]
pub struct Topic {
    kind: String,
    /// `None` for one that is latched: its message is sent once to each subscriber.
    period: Option<Duration>,
    make: Make,
}

impl Topic {
    /// Messages of a type, `period` apart; `make` has the time in seconds.
    pub fn every(kind: &str, period: Duration, make: impl Fn(f64) -> Value + Send + Sync + 'static) -> Self {
        Self { kind: kind.to_owned(), period: Some(period), make: Arc::new(make) }
    }

    /// One message.
    pub fn latched(kind: &str, message: Value) -> Self {
        Self { kind: kind.to_owned(), period: None, make: Arc::new(move |_| message.clone()) }
    }
}

impl std::fmt::Debug for Topic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Topic").field("kind", &self.kind).field("period", &self.period).finish_non_exhaustive()
    }
}

type Topics = Arc<Mutex<BTreeMap<String, Topic>>>;

/// The server, listening on the loopback interface until it is dropped.
#[derive(Debug)]
pub struct RosbridgeServer {
    address: SocketAddr,
    topics: Topics,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RosbridgeServer {
    /// On any free port.
    pub fn start(topics: BTreeMap<String, Topic>) -> std::io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let topics = Arc::new(Mutex::new(topics));
        let ended = Arc::new(AtomicBool::new(false));
        let (shared, end) = (Arc::clone(&topics), Arc::clone(&ended));
        let thread = thread::Builder::new().name("rosbridge".into()).spawn(move || {
            let start = Instant::now();
            let mut clients = Vec::new();
            while let Ok((stream, _)) = listener.accept() {
                if end.load(Ordering::Relaxed) {
                    break;
                }
                let (topics, end) = (Arc::clone(&shared), Arc::clone(&end));
                // A client that leaves ends its connection with an error.
                clients.push(thread::spawn(move || drop(serve(stream, &topics, &end, start))));
            }
            for client in clients {
                drop(client.join());
            }
        })?;
        Ok(Self { address, topics, ended, thread: Some(thread) })
    }

    /// `ws://127.0.0.1:PORT`.
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }

    /// The port that it listens on.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// Publishes a topic from now on, or another in its place.
    pub fn set(&self, name: &str, topic: Topic) {
        self.topics.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), topic);
    }

    /// No longer publishes a topic.
    pub fn remove(&self, name: &str) {
        self.topics.lock().unwrap_or_else(PoisonError::into_inner).remove(name);
    }
}

impl Drop for RosbridgeServer {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        // Wakes the thread that accepts.
        drop(TcpStream::connect(self.address));
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

struct Subscription {
    throttle: Duration,
    fragment_size: Option<usize>,
    due: Instant,
    is_sent: bool,
}

type Subscriptions = BTreeMap<String, Subscription>;

fn serve(
    stream: TcpStream,
    topics: &Topics,
    ended: &AtomicBool,
    start: Instant,
) -> Result<(), Box<tungstenite::Error>> {
    stream.set_nodelay(true).map_err(boxed)?;
    let Ok(mut socket) = tungstenite::accept(stream) else { return Ok(()) };
    socket.get_ref().set_read_timeout(Some(Duration::from_millis(2))).map_err(boxed)?;
    let mut subscriptions = Subscriptions::new();
    while !ended.load(Ordering::Relaxed) {
        match socket.read() {
            Ok(Message::Text(text)) => answer(&mut socket, topics, &mut subscriptions, &text)?,
            Ok(Message::Close(_)) => return Ok(()),
            Ok(_) => {}
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(Box::new(error)),
        }
        let topics = topics.lock().unwrap_or_else(PoisonError::into_inner).clone();
        for (name, subscription) in &mut subscriptions {
            let Some(topic) = topics.get(name) else { continue };
            let now = Instant::now();
            let is_due = if topic.period.is_some() { now >= subscription.due } else { !subscription.is_sent };
            if !is_due {
                continue;
            }
            subscription.is_sent = true;
            subscription.due = now + topic.period.unwrap_or_default().max(subscription.throttle);
            let message = (topic.make)(EPOCH_S + start.elapsed().as_secs_f64());
            let publish = json!({"op": "publish", "topic": name, "msg": message});
            send(&mut socket, &publish, subscription.fragment_size)?;
        }
    }
    Ok(())
}

fn boxed(error: std::io::Error) -> Box<tungstenite::Error> {
    Box::new(error.into())
}

fn send(
    socket: &mut WebSocket<TcpStream>,
    message: &Value,
    fragment_size: Option<usize>,
) -> Result<(), Box<tungstenite::Error>> {
    let text = message.to_string();
    let Some(size) = fragment_size.filter(|size| *size > 0 && text.len() > *size) else {
        return socket.send(Message::text(text)).map_err(Box::new);
    };
    let letters: Vec<char> = text.chars().collect();
    let pieces: Vec<String> = letters.chunks(size).map(|piece| piece.iter().collect()).collect();
    for (num, data) in pieces.iter().enumerate() {
        let fragment = json!({"op": "fragment", "id": "7", "data": data, "num": num, "total": pieces.len()});
        socket.send(Message::text(fragment.to_string())).map_err(Box::new)?;
    }
    Ok(())
}

fn answer(
    socket: &mut WebSocket<TcpStream>,
    topics: &Topics,
    subscriptions: &mut Subscriptions,
    text: &str,
) -> Result<(), Box<tungstenite::Error>> {
    let Ok(message) = serde_json::from_str::<Value>(text) else { return Ok(()) };
    let topics = topics.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let name = message["topic"].as_str().unwrap_or_default().to_owned();
    match message["op"].as_str() {
        Some("subscribe") => match topics.get(&name) {
            None => {
                let text = format!("subscribe: Cannot infer topic type for topic {name} as it is not yet advertised");
                send(socket, &json!({"op": "status", "level": "error", "msg": text, "id": message["id"]}), None)
            }
            Some(topic) if message["type"].as_str().is_some_and(|kind| kind != topic.kind) => {
                let text = format!("subscribe: {name} is of the type {}", topic.kind);
                send(socket, &json!({"op": "status", "level": "error", "msg": text, "id": message["id"]}), None)
            }
            Some(_) => {
                let throttle = Duration::from_millis(message["throttle_rate"].as_u64().unwrap_or(0));
                let fragment_size = message["fragment_size"].as_u64().and_then(|size| usize::try_from(size).ok());
                let due = Instant::now();
                subscriptions.insert(name, Subscription { throttle, fragment_size, due, is_sent: false });
                Ok(())
            }
        },
        Some("unsubscribe") => {
            subscriptions.remove(&name);
            Ok(())
        }
        Some("call_service") => {
            let values = match message["service"].as_str() {
                Some("/rosapi/topics") => json!({
                    "topics": topics.keys().collect::<Vec<_>>(),
                    "types": topics.values().map(|topic| &topic.kind).collect::<Vec<_>>(),
                }),
                _ => json!({}),
            };
            let service = &message["service"];
            let id = &message["id"];
            send(
                socket,
                &json!({"op": "service_response", "id": id, "service": service, "values": values, "result": true}),
                None,
            )
        }
        _ => Ok(()),
    }
}
