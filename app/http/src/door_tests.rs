use std::convert::Infallible;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream as Socket;
use std::time::Instant;

use axum::body::Bytes;
use axum::routing::get;
use tokio::runtime::{Builder, Runtime};

use super::*;

/// Longer than anything takes on a busy machine.
const SOON: Duration = Duration::from_mins(1);

const HONEST: &str = "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";

fn runtime() -> Runtime {
    Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a thread")
}

/// A door that answers hello.
fn hello(runtime: &Runtime, limits: Limits) -> Door {
    Door::open(runtime.handle(), limits, Router::new().route("/", get("hello"))).expect("a port")
}

fn connect(door: &Door) -> Socket {
    let socket = Socket::connect(door.address()).expect("it listens");
    socket.set_read_timeout(Some(SOON)).expect("set");
    socket
}

/// Reads until this text has arrived, or until the end.
fn read_until(socket: &mut Socket, wanted: &str) -> String {
    let mut reported = Vec::new();
    let mut piece = [0; 4096];
    loop {
        match socket.read(&mut piece) {
            Ok(count) if count > 0 => reported.extend_from_slice(&piece[..count]),
            Ok(_) => break,
            Err(error) => match error.kind() {
                ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => break,
                _ => panic!("{error}: {}", String::from_utf8_lossy(&reported)),
            },
        }
        if String::from_utf8_lossy(&reported).contains(wanted) {
            break;
        }
    }
    String::from_utf8_lossy(&reported).into_owned()
}

fn ask(door: &Door, request: &str) -> String {
    let mut socket = connect(door);
    socket.write_all(request.as_bytes()).expect("sent");
    read_until(&mut socket, "hello")
}

#[test]
fn a_request_by_another_name_or_from_another_page_is_refused() {
    let runtime = runtime();
    let door = hello(&runtime, Limits { idle: Duration::from_millis(200), ..Limits::USUAL });
    assert!(ask(&door, HONEST).starts_with("HTTP/1.1 200"));
    for head in [
        "Host: evil.example",
        "Host: evil.example:9876",
        "Host: 127.0.0.1\r\nOrigin: http://evil.example",
        "Host: 127.0.0.1\r\nOrigin: null",
        "X-Host: 127.0.0.1",
    ] {
        let answer = ask(&door, &format!("GET / HTTP/1.1\r\n{head}\r\n\r\n"));
        assert!(answer.starts_with("HTTP/1.1 403") && !answer.contains("hello"), "{head}: {answer}");
    }
}

#[test]
fn a_connection_without_a_whole_request_is_given_up() {
    let runtime = runtime();
    let door = hello(&runtime, Limits { idle: Duration::from_millis(200), ..Limits::USUAL });
    // Nothing; the beginning of a head; the beginning of HTTP/2; a request, and then the beginning of another.
    for begun in ["", "GET / HT", "PRI * HTTP/2.0\r\n\r\nSM", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"] {
        let mut socket = connect(&door);
        socket.write_all(begun.as_bytes()).expect("sent");
        // Reading ends because the connection does, long before the read timeout.
        assert!(!read_until(&mut socket, "hello").contains("hello"), "{begun:?}");
    }
    let mut socket = connect(&door);
    socket.write_all(format!("{HONEST}GET / HT").as_bytes()).expect("sent");
    assert!(read_until(&mut socket, "hello").contains("hello"));
    assert_eq!(read_until(&mut socket, "hello"), "");
}

#[test]
fn a_head_that_comes_letter_by_letter_has_no_longer_than_one_that_does_not_come() {
    let runtime = runtime();
    let idle = Duration::from_millis(300);
    let door = hello(&runtime, Limits { idle, ..Limits::USUAL });
    let mut socket = connect(&door);
    socket.set_read_timeout(Some(Duration::from_millis(20))).expect("set");
    let began = Instant::now();
    // Each letter is in time; all of them together are not.
    socket.write_all(b"GET / HTTP/1.1\r\nX-Slow: ").expect("sent");
    loop {
        assert!(began.elapsed() < SOON, "it may go on for ever");
        let mut byte = [0];
        match socket.read(&mut byte) {
            Ok(0) => break,
            Ok(_) => panic!("an answer to half a request"),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_reset) => break,
        }
        if socket.write_all(b"a").is_err() {
            break;
        }
    }
    assert!(began.elapsed() >= idle, "it had its time");
}

#[test]
fn five_hundred_connections_that_ask_nothing_lock_nobody_out() {
    let runtime = runtime();
    // They would be waited for without end: their number is bounded instead.
    let door = hello(&runtime, Limits { idle: SOON, ..Limits::USUAL });
    let dribbling: Vec<Socket> = (0..500)
        .map(|_| {
            let mut socket = connect(&door);
            // Those that were closed to make room are gone already.
            let _sent = socket.write_all(b"GET / HTTP/1.1\r\nHo").is_ok();
            socket
        })
        .collect();
    assert!(ask(&door, HONEST).starts_with("HTTP/1.1 200"));
    for socket in &dribbling {
        socket.set_nonblocking(true).expect("set");
    }
    let is_open = |mut socket: &Socket| socket.read(&mut [0]).is_err_and(|error| error.kind() == ErrorKind::WouldBlock);
    let began = Instant::now();
    // The last of them may still be closing.
    while dribbling.iter().filter(|socket| is_open(socket)).count() > Limits::USUAL.connections {
        assert!(began.elapsed() < SOON / 2, "more are held than there is room for");
        std::thread::yield_now();
    }
}

#[test]
fn those_who_are_served_are_not_given_up_for_those_who_are_not() {
    let runtime = runtime();
    let limits = Limits { connections: 3, idle: Duration::from_millis(200), ..Limits::USUAL };
    // An answer that continues, like a live recording.
    let (more, rest) = watch::channel(());
    let answer = move || {
        let mut rest = rest.clone();
        async move {
            let later = async move {
                let _changed = rest.changed().await.is_ok();
                Ok::<_, Infallible>(Bytes::from_static(b"later"))
            };
            let first = tokio_stream::once(Ok(Bytes::from_static(b"first")));
            let later = tokio_stream::StreamExt::then(tokio_stream::once(later), |later| later);
            let stream = tokio_stream::StreamExt::chain(first, later);
            Body::from_stream(stream)
        }
    };
    let door = Door::open(runtime.handle(), limits, Router::new().route("/", get(answer))).expect("a port");
    let mut watching = connect(&door);
    watching.write_all(HONEST.as_bytes()).expect("sent");
    assert!(read_until(&mut watching, "first").contains("first"));
    // Longer than a connection may be without a request.
    let mut idle = connect(&door);
    assert_eq!(read_until(&mut idle, "first"), "");
    // And more of them than there is room for.
    let others: Vec<Socket> = (0..10).map(|_| connect(&door)).collect();
    let mut another = connect(&door);
    another.write_all(HONEST.as_bytes()).expect("sent");
    assert!(read_until(&mut another, "first").contains("first"));
    more.send(()).expect("still watched");
    assert!(read_until(&mut watching, "later").contains("later"));
    drop(others);
}

#[test]
fn an_answer_that_nobody_takes_is_given_up() {
    let runtime = runtime();
    let limits = Limits { stalled: Duration::from_millis(200), idle: SOON, ..Limits::USUAL };
    // More than the system buffers for a client that does not read.
    let routes = Router::new().route("/", get(|| async { vec![0; 64 << 20] }));
    let door = Door::open(runtime.handle(), limits, routes).expect("a port");
    let mut socket = connect(&door);
    socket.write_all(HONEST.as_bytes()).expect("sent");
    // Sending remains possible until the connection is closed.
    let began = Instant::now();
    socket.set_nonblocking(true).expect("set");
    while socket.write(b"\n").map_or_else(|error| error.kind() == ErrorKind::WouldBlock, |_| true) {
        assert!(began.elapsed() < SOON, "it is held for ever");
        std::thread::yield_now();
    }
}
