use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use super::*;
use crate::lasting::Recording;
use crate::stream::Stream;

/// Longer than anything takes on a busy machine.
const SOON: Duration = Duration::from_mins(1);

/// Size of an empty recording \[bytes\]; a refusal is shorter.
const A_RECORDING: usize = 1000;

/// The response to a call of the service as a browser makes it: the head, and as much of the rest as shows whether there
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
    let mut reported = Vec::new();
    let mut piece = [0; 4096];
    loop {
        let end = reported.windows(4).position(|four| four == b"\r\n\r\n");
        if let Some(end) = end {
            let head = String::from_utf8_lossy(&reported[..end]).into_owned();
            let rest = reported.len() - end - 4;
            if !head.starts_with("HTTP/1.1 200") || rest > A_RECORDING {
                return (head, rest);
            }
        }
        match socket.read(&mut piece).expect("an answer") {
            0 => return (String::from_utf8_lossy(&reported).into_owned(), 0),
            count => reported.extend_from_slice(&piece[..count]),
        }
    }
}

#[test]
fn a_recording_is_read_by_programs_and_pages_of_this_machine_only() {
    let server = Server::start(&Arc::default()).expect("a server");
    let recording = Recording { id: "one".to_owned(), name: "One".to_owned(), folder: None };
    let mut stream = Stream::open(&server.target(), &recording).expect("a stream");
    stream.begin().expect("written");
    stream.flush().expect("taken");
    let url = server.url();
    for headers in ["Host: 127.0.0.1", "Host: localhost:1\r\nOrigin: http://127.0.0.1:1234"] {
        let (head, bytes) = call(&url, "ReadMessages", headers);
        assert!(head.starts_with("HTTP/1.1 200") && bytes > A_RECORDING, "{headers}: {bytes} bytes, {head}");
    }
    for headers in [
        "Host: evil.example",
        "Host: 127.0.0.1\r\nOrigin: http://evil.example",
        "Host: 127.0.0.1\r\nOrigin: https://rerun.io",
    ] {
        let (head, bytes) = call(&url, "ReadMessages", headers);
        assert!(head.starts_with("HTTP/1.1 403") && bytes < A_RECORDING, "{headers}: {bytes} bytes, {head}");
    }
}

#[test]
fn nobody_writes_into_a_recording_from_outside() {
    let server = Server::start(&Arc::default()).expect("a server");
    for method in ["WriteMessages", "WriteTable", "ReadTables"] {
        let (head, _) = call(&server.url(), method, "Host: 127.0.0.1");
        assert!(head.starts_with("HTTP/1.1 404"), "{method}: {head}");
    }
}

#[test]
fn the_port_closes_when_the_server_ends_and_writing_to_them_is_no_error() {
    let server = Server::start(&Arc::default()).expect("a server");
    let target = server.target();
    let url = server.url();
    let address = url.strip_prefix("rerun+http://").and_then(|rest| rest.strip_suffix("/proxy")).expect("an address");
    let mut guest = TcpStream::connect(address).expect("it listens");
    guest.set_read_timeout(Some(SOON)).expect("set");
    drop(server);
    assert!(matches!(guest.read(&mut [0]), Ok(0) | Err(_)), "the connection is closed");
    let Target::Viewers { lasting, .. } = target else { panic!("not for viewers") };
    lasting.0.flush_blocking(SOON).expect("taken");
}

fn get(server: &Server, path: &str) -> String {
    let page = server.page();
    let address = page.strip_prefix("http://").and_then(|rest| rest.split('/').next()).expect("an address");
    let mut client = TcpStream::connect(address).expect("it listens");
    let request = format!("GET {path} HTTP/1.1\r\nHost: localhost:1\r\nConnection: close\r\n\r\n");
    client.write_all(request.as_bytes()).expect("sent");
    let mut answer = Vec::new();
    client.read_to_end(&mut answer).expect("an answer");
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn the_page_names_no_other_machine_and_forbids_the_browser_to_ask_one() {
    let server = Server::start(&Arc::default()).expect("a server");
    let page = server.page();
    let encoded = server.url().replace('+', "%2B").replace(':', "%3A").replace('/', "%2F");
    assert!(page.starts_with("http://127.0.0.1:") && page.ends_with(&format!("&url={encoded}")), "{page}");
    let index = get(&server, "/rerun/?url=x");
    let (head, html) = index.split_once("\r\n\r\n").expect("head and body");
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    let head = head.to_ascii_lowercase();
    assert!(head.contains("default-src 'none'"), "{head}");
    assert!(head.contains("connect-src 'self' data: blob:;"), "{head}");
    assert!(html.contains("the_canvas_id") && html.contains("favicon.ico"));
    assert!(!html.contains("fonts.g"), "fonts are asked for elsewhere");
    // The page alone redirects to where the recording is.
    let there = get(&server, "/rerun/");
    assert!(
        there.starts_with("HTTP/1.1 303") && there.contains("url=rerun%2Bhttp%3A%2F%2Flocalhost%3A1%2Fproxy"),
        "{there}"
    );
}

#[test]
fn files_of_the_viewer_come_whole_and_others_are_not_there() {
    let server = Server::start(&Arc::default()).expect("a server");
    let wasm = get(&server, "/rerun/re_viewer_bg.wasm");
    assert!(wasm.contains("application/wasm") && wasm.len() > 1_000_000, "{} bytes", wasm.len());
    for path in ["/", "/rerun/../Cargo.toml", "/etc/passwd", "/rerun/sw.js"] {
        assert!(get(&server, path).starts_with("HTTP/1.1 404"), "{path}");
    }
}
