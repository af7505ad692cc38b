//! The client against servers that misbehave, over real sockets on this machine.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ciborium::Value;
use handeye_coppeliasim::{CallOptions, CancelToken, Connection, ConnectionOptions, Endpoint, LinkError};
use handeye_wire::{self as wire, MAX_MESSAGE_BYTES, Reader as _};

/// Longest wait of a test for something that takes milliseconds; only a failure takes this long.
const PATIENCE: Duration = Duration::from_secs(20);

fn options() -> ConnectionOptions {
    ConnectionOptions {
        reply_timeout: PATIENCE,
        total_timeout: PATIENCE,
        seed: Some(1),
        ..ConnectionOptions::default()
    }
}

fn ret(values: Vec<Value>) -> Value {
    wire::map([("ret", Value::Array(values))])
}

fn ask(func: &str) -> Value {
    wire::map([("func", Value::from(func)), ("args", Value::Map(Vec::new()))])
}

fn func(request: &Value) -> &str {
    request.get("func").and_then(|f| f.text()).expect("every request has a function")
}

/// One ROUTER socket, so that a server can answer late, or not, or disappear.
struct Peer {
    socket: zmq::Socket,
    port: u16,
}

impl Peer {
    fn bind(port: Option<u16>) -> Self {
        let socket = zmq::Context::new().socket(zmq::ROUTER).expect("a socket");
        socket.set_linger(0).expect("an option");
        socket.set_rcvtimeo(PATIENCE.as_millis() as i32).expect("an option");
        let address = port.map_or("tcp://127.0.0.1:*".to_owned(), |port| format!("tcp://127.0.0.1:{port}"));
        let started = Instant::now();
        // The system may hold the port of a socket that has just been closed for a moment.
        while let Err(error) = socket.bind(&address) {
            assert!(started.elapsed() < PATIENCE, "{address}: {error}");
            std::thread::yield_now();
        }
        let bound = socket.get_last_endpoint().expect("an option").expect("text");
        let port = bound.rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");
        Self { socket, port }
    }

    /// The next request, with where to send its reply.
    fn next(&self) -> (Vec<u8>, Value) {
        let mut parts = self.socket.recv_multipart(0).expect("a request in time");
        let payload = parts.pop().expect("a payload");
        assert_eq!(parts.len(), 2, "identity and delimiter come before the payload");
        (parts.swap_remove(0), wire::decode(&payload).expect("requests are valid"))
    }

    fn say(&self, to: &[u8], reply: &Value) {
        self.say_bytes(to, &wire::encode(reply));
    }

    fn say_bytes(&self, to: &[u8], reply: &[u8]) {
        self.socket.send_multipart([to, &[], reply], 0).expect("the client is there");
    }
}

/// Runs a server on a thread; joining it propagates its failures.
fn serve(server: impl FnOnce(Peer) + Send + 'static) -> (Endpoint, JoinHandle<()>) {
    let peer = Peer::bind(None);
    let endpoint = Endpoint::local(peer.port);
    (endpoint, std::thread::spawn(move || server(peer)))
}

fn connect(endpoint: &Endpoint, options: ConnectionOptions) -> Connection {
    Connection::connect(endpoint, options).expect("an address")
}

fn join(server: JoinHandle<()>) {
    if let Err(panic) = server.join() {
        std::panic::resume_unwind(panic);
    }
}

fn done(receiver: &Receiver<()>) {
    receiver.recv_timeout(PATIENCE).expect("in time");
}

fn pair() -> (Sender<()>, Receiver<()>) {
    channel()
}

#[test]
fn a_server_that_never_answers_is_a_timeout_and_the_next_call_works() {
    let (timed_out, was_timed_out) = pair();
    let (endpoint, server) = serve(move |peer| {
        let (to, first) = peer.next();
        done(&was_timed_out);
        // Too late: it must not be taken for the reply to the next call.
        peer.say(&to, &ret(vec![Value::from("late")]));
        let (to, second) = peer.next();
        assert_eq!(first.get("uuid"), second.get("uuid"), "the record on the server stays the client's");
        peer.say(&to, &ret(vec![Value::from("in time")]));
    });
    let mut connection = connect(&endpoint, options());
    let limit = Duration::from_millis(200);
    let limits = CallOptions { reply_timeout: Some(limit), ..CallOptions::default() };
    let started = Instant::now();
    let error = connection.call_with("sim.x", vec![], &limits).expect_err("silence");
    assert!(matches!(&error, LinkError::Timeout { call, after } if call == "sim.x" && *after >= limit), "{error}");
    assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
    timed_out.send(()).expect("the server listens");
    assert_eq!(connection.call("sim.y", vec![]).expect("answered").text(0), Ok("in time"));
    drop(connection);
    join(server);
}

#[test]
fn nobody_at_the_address_is_told_from_a_silent_server() {
    let free = Peer::bind(None).port;
    let endpoint = Endpoint::local(free);
    let limit = Duration::from_millis(200);
    let mut connection = connect(&endpoint, ConnectionOptions { reply_timeout: limit, ..options() });
    // However long the call may take: no server is there to receive it.
    let limits = CallOptions::long(PATIENCE, &CancelToken::default());
    let error = connection.call_with("sim.moveToConfig", vec![], &limits).expect_err("nobody");
    assert!(matches!(&error, LinkError::Unreachable { .. }), "{error}");
    let text = error.to_string();
    assert!(text.contains(&endpoint.to_string()) && text.contains("add-on"), "{text}");
}

#[test]
fn something_else_at_the_address_is_told_from_a_silent_server() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let endpoint = Endpoint::local(listener.local_addr().expect("bound").port());
    let mut connection = connect(&endpoint, options());
    let limits = CallOptions { reply_timeout: Some(Duration::from_millis(200)), ..CallOptions::default() };
    let error = connection.call_with("sim.x", vec![], &limits).expect_err("not ZeroMQ");
    assert!(matches!(error, LinkError::Unreachable { .. }), "{error}");
}

#[test]
fn a_client_may_be_there_before_its_server() {
    let port = Peer::bind(None).port;
    let client = std::thread::spawn(move || connect(&Endpoint::local(port), options()).call("sim.x", vec![]));
    let peer = Peer::bind(Some(port));
    let (to, _request) = peer.next();
    peer.say(&to, &ret(vec![Value::from(3)]));
    let reply = client.join().expect("no panic").expect("answered");
    assert_eq!(reply.integer(0), Ok(3));
}

#[test]
fn garbage_is_named_and_the_next_call_works() {
    let (endpoint, server) = serve(|peer| {
        for garbage in [&b"\xff\xff\xff"[..], b"", b"\x82\x01"] {
            let (to, _) = peer.next();
            peer.say_bytes(&to, garbage);
        }
        let (to, _) = peer.next();
        peer.socket.send_multipart([&to[..], &[], b"\xa0", b"\xa0"], 0).expect("the client is there");
        let (to, _) = peer.next();
        peer.say(&to, &ret(vec![Value::from(1)]));
    });
    let mut connection = connect(&endpoint, options());
    for _ in 0..3 {
        let error = connection.call("sim.x", vec![]).expect_err("garbage");
        assert!(matches!(error, LinkError::Malformed { .. }), "{error}");
    }
    let error = connection.call("sim.x", vec![]).expect_err("two parts");
    assert!(matches!(error, LinkError::UnexpectedReply { .. }), "{error}");
    assert_eq!(connection.call("sim.x", vec![]).expect("answered").integer(0), Ok(1));
    drop(connection);
    join(server);
}

#[test]
fn a_server_that_dies_in_a_long_silent_call_is_noticed_at_once_and_found_again() {
    let (pending, is_pending) = pair();
    let (endpoint, server) = serve(move |peer| {
        let _request = peer.next();
        pending.send(()).expect("the test listens");
        // Dropping the peer is what the end of its process does to its connections.
    });
    let port = endpoint.port();
    let (restarted, is_restarted) = pair();
    let client = std::thread::spawn(move || {
        let mut connection = connect(&endpoint, options());
        let cancel = CancelToken::default();
        let move_options = CallOptions::long(Duration::from_secs(30), &cancel);
        let error = connection.call_with("sim.moveToConfig", vec![], &move_options).expect_err("died");
        let noticed = Instant::now();
        let epoch = connection.epoch();
        done(&is_restarted);
        (error, noticed, epoch, connection.call("sim.x", vec![]).map(|reply| reply.integer(0)))
    });
    done(&is_pending);
    join(server);
    let died = Instant::now();
    let peer = Peer::bind(Some(port));
    restarted.send(()).expect("the client listens");
    let (to, request) = peer.next();
    assert_eq!(func(&request), "sim.x");
    assert!(request.get("ver").is_some(), "a new server has to be introduced to the client");
    peer.say(&to, &ret(vec![Value::from(7)]));
    let (error, noticed, epoch, next) = client.join().expect("no panic");
    assert_eq!(error, LinkError::Disconnected { call: "sim.moveToConfig".to_owned() });
    assert!(noticed.saturating_duration_since(died) < Duration::from_secs(2));
    assert_eq!(epoch, 1, "whoever relied on state of the server has to set it again");
    assert_eq!(next, Ok(Ok(7)));
}

/// A connection whose server answered once and then died, which is known here by now.
fn connection_to_the_dead() -> (Endpoint, Connection) {
    let (answered, is_answered) = pair();
    let (endpoint, server) = serve(move |peer| {
        let (to, _) = peer.next();
        peer.say(&to, &ret(Vec::new()));
        done(&is_answered);
    });
    let mut connection = connect(&endpoint, options());
    connection.call("sim.setStepping", vec![]).expect("an answer");
    answered.send(()).expect("the server listens");
    join(server);
    let deadline = Instant::now() + PATIENCE;
    while connection.is_connected() {
        assert!(Instant::now() < deadline, "nobody notices that the server has gone");
    }
    (endpoint, connection)
}

#[test]
fn a_connection_that_ends_between_two_calls_is_known_to_have_lost_what_the_server_kept() {
    let (endpoint, mut connection) = connection_to_the_dead();
    let peer = Peer::bind(Some(endpoint.port()));
    let server = std::thread::spawn(move || {
        let (to, request) = peer.next();
        assert!(request.get("ver").is_some(), "a new server has to be introduced to the client");
        peer.say(&to, &ret(Vec::new()));
        peer
    });
    connection.call("sim.x", vec![]).expect("an answer");
    assert_eq!(connection.epoch(), 1, "whoever relied on state of the server has to set it again");
    drop(server.join().expect("no panic"));
}

#[test]
fn a_server_that_died_is_reported_by_every_call_at_once_until_it_is_back() {
    let (endpoint, mut connection) = connection_to_the_dead();
    // Not after the reply timeout: the controller of the arm has to know at once.
    for _ in 0..3 {
        let error = connection.call("sim.x", vec![]).expect_err("the server has gone");
        assert_eq!(error, LinkError::Disconnected { call: "sim.x".to_owned() });
    }
    let peer = Peer::bind(Some(endpoint.port()));
    let client = std::thread::spawn(move || connection.call("sim.x", vec![]));
    let (to, _) = peer.next();
    peer.say(&to, &ret(vec![Value::from(2)]));
    let reply = client.join().expect("no panic").expect("answered");
    assert_eq!(reply.integer(0), Ok(2));
}

/// A plain TCP peer that completes ZeroMQ's handshake by hand and then does what a library would not.
fn by_hand(then: impl FnOnce(TcpStream) + Send + 'static) -> (Endpoint, JoinHandle<()>) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let endpoint = Endpoint::local(listener.local_addr().expect("bound").port());
    let server = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        let mut greeting = [0u8; 64];
        greeting[0] = 0xff;
        greeting[9] = 0x7f;
        greeting[10] = 3;
        greeting[12..16].copy_from_slice(b"NULL");
        stream.write_all(&greeting).expect("sent");
        let mut theirs = [0u8; 64];
        stream.read_exact(&mut theirs).expect("a greeting");
        stream.write_all(b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x03REP").expect("sent");
        then(stream);
    });
    (endpoint, server)
}

#[test]
fn a_host_that_vanishes_without_a_word_is_noticed_within_two_seconds() {
    let (finished, is_finished) = pair();
    // The frozen host does not even answer heartbeats: its connection stays open until the client gives up.
    let (endpoint, server) = by_hand(move |_stream| done(&is_finished));
    let mut connection = connect(&endpoint, options());
    let started = Instant::now();
    let cancel = CancelToken::default();
    let error = connection
        .call_with("sim.moveToConfig", vec![], &CallOptions::long(Duration::from_secs(30), &cancel))
        .expect_err("vanished");
    assert_eq!(error, LinkError::Disconnected { call: "sim.moveToConfig".to_owned() });
    assert!(started.elapsed() < Duration::from_secs(2), "{:?}", started.elapsed());
    finished.send(()).expect("the server listens");
    join(server);
}

#[test]
fn a_reply_far_over_the_limit_is_named_and_not_taken_for_the_end_of_the_server() {
    let (finished, is_finished) = pair();
    let (endpoint, server) = by_hand(move |mut stream| {
        let (mut seen, mut piece) = (Vec::new(), [0; 1000]);
        while !seen.windows(5).any(|window| window == b"sim.x") {
            let count = stream.read(&mut piece).expect("a request");
            seen.extend_from_slice(&piece[..count]);
        }
        // The head of a frame of 3 GB; the client has no need to see more of it.
        stream.write_all(b"\x01\x00\x02\x00\x00\x00\x00\xb0\x00\x00\x00").expect("sent");
        done(&is_finished);
    });
    let mut connection = connect(&endpoint, options());
    let error = connection.call("sim.x", vec![]).expect_err("too large");
    assert_eq!(error, LinkError::ReplyTooLarge { call: "sim.x".to_owned(), bytes: None });
    assert!(error.to_string().contains("over the limit of 64 MiB"), "{error}");
    finished.send(()).expect("the server listens");
    join(server);
}

#[test]
fn cancelling_ends_a_long_silent_call_and_tells_the_server() {
    let (pending, is_pending) = pair();
    let (endpoint, server) = serve(move |peer| {
        let (_, request) = peer.next();
        pending.send(()).expect("the test listens");
        // The server is notified that the client has cancelled the motion, although it never answered.
        let (_, farewell) = peer.next();
        assert_eq!(func(&farewell), "_*end*_");
        assert_eq!(farewell.get("uuid"), request.get("uuid"));
    });
    let cancel = CancelToken::default();
    let token = cancel.clone();
    let client = std::thread::spawn(move || {
        let mut connection = connect(&endpoint, options());
        let limits = CallOptions::long(Duration::from_secs(30), &token);
        let error = connection.call_with("sim.moveToConfig", vec![], &limits).expect_err("cancelled");
        (error, Instant::now())
    });
    done(&is_pending);
    let cancelled = Instant::now();
    cancel.cancel();
    let (error, ended) = client.join().expect("no panic");
    assert_eq!(error, LinkError::Cancelled { call: "sim.moveToConfig".to_owned() });
    // 50 ms are promised; the rest is for a busy machine.
    assert!(ended.saturating_duration_since(cancelled) < Duration::from_millis(500), "{:?}", ended - cancelled);
    join(server);
}

#[test]
fn a_client_that_gives_up_again_and_again_is_heard_every_time() {
    const ROUNDS: usize = 20;
    let (pending, is_pending) = channel::<CancelToken>();
    let tokens: Vec<CancelToken> = (0..ROUNDS).map(|_| CancelToken::default()).collect();
    let for_server = tokens.clone();
    let (endpoint, server) = serve(move |peer| {
        let uuid = |request: &Value| request.get("uuid").and_then(|id| id.text()).expect("an id").to_owned();
        let (mut calls, mut farewells) = (Vec::new(), Vec::new());
        // A farewell takes its own path and may arrive after the next call.
        while farewells.len() < ROUNDS {
            let (to, request) = peer.next();
            if func(&request) == "_*end*_" {
                farewells.push(uuid(&request));
                continue;
            }
            let token = for_server[calls.len()].clone();
            calls.push(uuid(&request));
            if calls.len() % 2 == 0 {
                // Cancel in the middle of a conversation, while it is the client's turn to answer.
                token.cancel();
                peer.say(&to, &ask("_*wait*_"));
            } else {
                pending.send(token).expect("the test listens");
            }
        }
        calls.sort();
        farewells.sort();
        assert_eq!(calls, farewells);
        calls.dedup();
        assert_eq!(calls.len(), ROUNDS, "every call is on a record of its own");
    });
    let client = std::thread::spawn(move || {
        let mut connection = connect(&endpoint, options());
        for token in &tokens {
            let limits = CallOptions::long(PATIENCE, token);
            let error = connection.call_with("sim.moveToConfig", vec![], &limits).expect_err("cancelled");
            assert!(matches!(error, LinkError::Cancelled { .. }), "{error}");
        }
    });
    for token in is_pending {
        token.cancel();
    }
    client.join().expect("no panic");
    join(server);
}

#[test]
fn a_thousand_requests_to_wait_are_waited_for() {
    let (endpoint, server) = serve(|peer| {
        let (mut to, request) = peer.next();
        assert_eq!(func(&request), "sim.step");
        for _ in 0..1000 {
            peer.say(&to, &ask("_*wait*_"));
            let (next, bounce) = peer.next();
            assert_eq!(func(&bounce), "_*executed*_");
            to = next;
        }
        peer.say(&to, &wire::map([("ret", Value::Map(Vec::new()))]));
    });
    let mut connection = connect(&endpoint, options());
    assert!(connection.call("sim.step", vec![]).expect("done").values().is_empty());
    drop(connection);
    join(server);
}

#[test]
fn a_slow_drip_of_requests_to_wait_is_alive_but_not_for_ever() {
    let (stop, stopped) = channel::<()>();
    let (endpoint, server) = serve(move |peer| {
        let (mut to, _) = peer.next();
        loop {
            // Slower than a reply, faster than the limit of silence.
            if stopped.recv_timeout(Duration::from_millis(20)).is_ok() {
                return;
            }
            peer.say(&to, &ask("_*wait*_"));
            let (next, bounce) = peer.next();
            if func(&bounce) == "_*end*_" {
                return;
            }
            to = next;
        }
    });
    let mut connection = connect(&endpoint, options());
    let total = Duration::from_millis(400);
    let limits = CallOptions {
        reply_timeout: Some(Duration::from_millis(300)),
        total_timeout: Some(total),
        ..CallOptions::default()
    };
    let error = connection.call_with("sim.moveToConfig", vec![], &limits).expect_err("endless");
    assert!(matches!(&error, LinkError::Timeout { after, .. } if *after >= total), "{error}");
    // The server may have left by itself, at the farewell.
    let _left = stop.send(());
    join(server);
}

#[test]
fn a_request_that_the_server_could_not_take_is_repeated_unchanged() {
    let (endpoint, server) = serve(|peer| {
        let (to, first) = peer.next();
        peer.say(&to, &ask("_*repeat*_"));
        let (to, second) = peer.next();
        assert_eq!(first, second);
        peer.say(&to, &ret(vec![Value::from(2)]));
    });
    let mut connection = connect(&endpoint, options());
    assert_eq!(connection.call("sim.x", vec![Value::from(1)]).expect("done").integer(0), Ok(2));
    drop(connection);
    join(server);
}

#[test]
fn a_big_image_arrives_and_a_message_over_the_limit_is_refused() {
    // A 4k RGB image, and one byte string over the limit of a message.
    const BIG: usize = 3840 * 2160 * 3;
    let (endpoint, server) = serve(|peer| {
        let (to, _) = peer.next();
        peer.say(&to, &ret(vec![Value::Bytes(vec![7; BIG])]));
        let (to, _) = peer.next();
        peer.say_bytes(&to, &vec![0x40; MAX_MESSAGE_BYTES + 1]);
        let (to, _) = peer.next();
        peer.say(&to, &ret(vec![Value::from(1)]));
    });
    let mut connection = connect(&endpoint, options());
    let image = connection.call("sim.getVisionSensorImg", vec![]).expect("done");
    assert_eq!(image.blob(0).map(<[u8]>::len), Ok(BIG));
    let error = connection.call("sim.x", vec![]).expect_err("too large");
    assert!(
        matches!(error, LinkError::ReplyTooLarge { bytes: Some(bytes), .. } if bytes == MAX_MESSAGE_BYTES + 1),
        "{error}"
    );
    assert!(error.to_string().contains("over the limit of 64 MiB"), "{error}");
    assert_eq!(connection.call("sim.x", vec![]).expect("answered").integer(0), Ok(1));
    drop(connection);
    join(server);
}

#[test]
fn the_server_sees_a_client_leave() {
    let (endpoint, server) = serve(|peer| {
        let (to, request) = peer.next();
        peer.say(&to, &ret(vec![]));
        let (_, farewell) = peer.next();
        assert_eq!(func(&farewell), "_*end*_");
        assert_eq!(farewell.get("uuid"), request.get("uuid"));
    });
    let mut connection = connect(&endpoint, options());
    connection.call("sim.x", vec![]).expect("answered");
    drop(connection);
    join(server);
}

#[test]
fn leaving_a_server_that_has_gone_does_not_take_long() {
    let (endpoint, server) = serve(|peer| {
        let (to, _) = peer.next();
        peer.say(&to, &ret(vec![]));
        // The reply has to be sent before the socket closes, and no farewell is in the way.
        let _farewell = peer.next();
    });
    let mut connection = connect(&endpoint, options());
    connection.call("sim.x", vec![]).expect("answered");
    connection.renew();
    join(server);
    let started = Instant::now();
    drop(connection);
    assert!(started.elapsed() < Duration::from_secs(1), "{:?}", started.elapsed());
}

#[test]
fn a_server_that_restarted_between_two_calls_is_found_by_the_second() {
    let (endpoint, server) = serve(|peer| {
        let (to, _) = peer.next();
        peer.say(&to, &ret(vec![Value::from(1)]));
        let _farewell_of_the_old_record = peer.next();
    });
    let mut connection = connect(&endpoint, options());
    connection.call("sim.x", vec![]).expect("answered");
    connection.renew();
    join(server);
    let peer = Peer::bind(Some(endpoint.port()));
    let client = std::thread::spawn(move || connection.call("sim.x", vec![]));
    let (to, _) = peer.next();
    peer.say(&to, &ret(vec![Value::from(2)]));
    let reply = client.join().expect("no panic").expect("answered");
    assert_eq!(reply.integer(0), Ok(2));
}
