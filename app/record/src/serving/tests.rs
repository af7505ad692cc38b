use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use super::*;
use crate::lasting::Recording;
use crate::stream::Stream;

/// Longer than anything takes on a busy machine.
const SOON: Duration = Duration::from_mins(1);

/// What a recording has before anything has happened \[bytes\]; all that is refused says less.
const A_RECORDING: usize = 1000;

/// What comes after a call of the service as a browser makes it: the head, and as much of the rest as says whether there
/// is a recording in it.
fn call(url: &str, method: &str, headers: &str) -> (String, usize) {
    let address = url.strip_prefix("rerun+http://").and_then(|rest| rest.strip_suffix("/proxy")).expect("an address");
    let mut socket = TcpStream::connect(address).expect("it listens");
    socket.set_read_timeout(Some(SOON)).expect("set");
    let head = format!(
        "POST /rerun.sdk_comms.v1alpha1.MessageProxyService/{method} HTTP/1.1\r\n{headers}\r\nContent-Type: \
         application/grpc-web+proto\r\nX-Grpc-Web: 1\r\nContent-Length: 5\r\n\r\n"
    );
    socket.write_all(head.as_bytes()).expect("sent");
    socket.write_all(&[0; 5]).expect("sent");
    let mut said = Vec::new();
    let mut piece = [0; 4096];
    loop {
        let end = said.windows(4).position(|four| four == b"\r\n\r\n");
        if let Some(end) = end {
            let head = String::from_utf8_lossy(&said[..end]).into_owned();
            let rest = said.len() - end - 4;
            if !head.starts_with("HTTP/1.1 200") || rest > A_RECORDING {
                return (head, rest);
            }
        }
        match socket.read(&mut piece).expect("an answer") {
            0 => return (String::from_utf8_lossy(&said).into_owned(), 0),
            count => said.extend_from_slice(&piece[..count]),
        }
    }
}

#[test]
fn a_recording_is_read_by_programs_and_pages_of_this_machine_only() {
    let servers = Servers::start().expect("servers");
    let recording = Recording { id: "one".to_owned(), name: "One".to_owned(), folder: None };
    let mut stream = Stream::open(&servers.target(), &recording).expect("a stream");
    stream.begin().expect("written");
    stream.flush().expect("taken");
    let [lasting, _live] = servers.urls();
    for headers in ["Host: 127.0.0.1", "Host: localhost:1\r\nOrigin: http://127.0.0.1:1234"] {
        let (head, bytes) = call(&lasting, "ReadMessages", headers);
        assert!(head.starts_with("HTTP/1.1 200") && bytes > A_RECORDING, "{headers}: {bytes} bytes, {head}");
    }
    for headers in [
        "Host: evil.example",
        "Host: 127.0.0.1\r\nOrigin: http://evil.example",
        "Host: 127.0.0.1\r\nOrigin: https://rerun.io",
    ] {
        let (head, bytes) = call(&lasting, "ReadMessages", headers);
        assert!(head.starts_with("HTTP/1.1 403") && bytes < A_RECORDING, "{headers}: {bytes} bytes, {head}");
    }
}

#[test]
fn nobody_writes_into_a_recording_from_outside() {
    let servers = Servers::start().expect("servers");
    for url in servers.urls() {
        for method in ["WriteMessages", "WriteTable", "ReadTables"] {
            let (head, _) = call(&url, method, "Host: 127.0.0.1");
            assert!(head.starts_with("HTTP/1.1 404"), "{method}: {head}");
        }
    }
}

#[test]
fn ports_close_when_the_servers_end_and_writing_to_them_is_no_error() {
    let servers = Servers::start().expect("servers");
    let target = servers.target();
    let [url, _] = servers.urls();
    let address = url.strip_prefix("rerun+http://").and_then(|rest| rest.strip_suffix("/proxy")).expect("an address");
    let mut guest = TcpStream::connect(address).expect("it listens");
    guest.set_read_timeout(Some(SOON)).expect("set");
    drop(servers);
    assert!(matches!(guest.read(&mut [0]), Ok(0) | Err(_)), "the connection is closed");
    let Target::Viewers { lasting, .. } = target else { panic!("not for viewers") };
    lasting.0.flush_blocking(SOON).expect("taken");
}
