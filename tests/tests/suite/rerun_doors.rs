//! Who has access to a recording that is shown in a browser: programs and pages of this machine, in limited numbers.

use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use handeye_tests::handeye_binary;

/// Longer than anything takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(2);

/// Size of a recording that nobody else may get \[bytes\]; a refusal is shorter.
const A_RECORDING: usize = 10_000;

const READ: &str = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages";

/// A session that is over and still served.
struct Shown {
    process: Child,
    /// Port of the page and of the recording.
    port: u16,
}

impl Drop for Shown {
    fn drop(&mut self) {
        let _ended = self.process.kill().and_then(|()| self.process.wait()).is_ok();
    }
}

impl Shown {
    fn start(folder: &std::path::Path) -> Self {
        let mut process = Command::new(handeye_binary())
            .args(["auto", "--quiet", "--rerun", "web", "--out"])
            .arg(folder.join("session"))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary is built: cargo build -p handeye_app");
        let lines = BufReader::new(process.stderr.take().expect("its messages")).lines();
        let mut lines = lines.map_while(Result::ok);
        let line = lines.find(|line| line.contains("until Ctrl-C")).expect("it is shown");
        let ports: Vec<u16> = line
            .replace("%3A", ":")
            .split("127.0.0.1:")
            .skip(1)
            .filter_map(|rest| rest.split(|letter: char| !letter.is_ascii_digit()).next()?.parse().ok())
            .collect();
        let &[port, of_recording] = ports.as_slice() else { panic!("{line}") };
        assert_eq!(port, of_recording, "a browser needs to reach one alone");
        Self { process, port }
    }

    /// A value of the process by its name in the system.
    fn number(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).expect("it runs");
        let line = status.lines().find_map(|line| line.strip_prefix(name)).expect("a number");
        line.trim_start_matches(':').split_whitespace().next().and_then(|it| it.parse().ok()).expect("a number")
    }
}

fn connect(port: u16) -> TcpStream {
    let socket = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    socket.set_read_timeout(Some(PATIENCE)).expect("set");
    socket
}

/// Reads until there is a recording, or the end; returns what was read.
fn read(socket: &mut TcpStream) -> Vec<u8> {
    let mut reported = Vec::new();
    let mut piece = vec![0; 16 * 1024];
    while reported.len() < A_RECORDING {
        match socket.read(&mut piece) {
            Ok(0) => break,
            Ok(count) => reported.extend_from_slice(&piece[..count]),
            Err(error) if error.kind() == ErrorKind::ConnectionReset => break,
            Err(error) => panic!("{error} after {:?}", String::from_utf8_lossy(&reported)),
        }
    }
    reported
}

/// Sends a request like a page: the status line, and how much came.
fn asked_by_a_page(port: u16, headers: &str) -> (String, usize) {
    let mut socket = connect(port);
    let head = format!(
        "POST {READ} HTTP/1.1\r\n{headers}\r\nConnection: close\r\nContent-Type: application/grpc-web+proto\r\nX-Grpc-Web: \
         1\r\nContent-Length: 5\r\n\r\n\0\0\0\0\0"
    );
    socket.write_all(head.as_bytes()).expect("sent");
    let reported = read(&mut socket);
    (String::from_utf8_lossy(&reported).lines().next().unwrap_or_default().to_owned(), reported.len())
}

/// A frame of HTTP/2 on stream 1, or on stream 0 for settings.
fn frame(kind: u8, flags: u8, content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u32).to_be_bytes();
    let stream = u8::from(kind != 4);
    let mut frame = vec![length[1], length[2], length[3], kind, flags, 0, 0, 0, stream];
    frame.extend_from_slice(content);
    frame
}

/// Sends a request like the native viewer, over HTTP/2, with the name in `:authority`: how much came.
fn asked_by_a_viewer(port: u16, authority: &str) -> usize {
    // Headers by their index in the table of HPACK, with literal values.
    let mut headers = vec![0x83, 0x86];
    for (name, value) in [(&[0x04][..], READ), (&[0x01][..], authority), (&[0x0f, 0x10][..], "application/grpc")] {
        headers.extend_from_slice(name);
        headers.push(value.len() as u8);
        headers.extend_from_slice(value.as_bytes());
    }
    headers.extend_from_slice(b"\0\x02te\x08trailers");
    let mut request = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_vec();
    request.extend(frame(4, 0, &[]));
    request.extend(frame(1, 4, &headers));
    request.extend(frame(0, 1, &[0; 5]));
    let mut socket = connect(port);
    socket.write_all(&request).expect("sent");
    let mut taken = 0;
    while taken < A_RECORDING {
        let mut head = [0; 9];
        if socket.read_exact(&mut head).is_err() {
            break;
        }
        let length = u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize;
        socket.read_exact(&mut vec![0; length]).expect("a whole frame");
        let (kind, ends) = (head[3], head[4] & 1 == 1);
        match kind {
            0 => taken += length,
            // Settings have to be acknowledged.
            4 if !ends => socket.write_all(&frame(4, 1, &[])).expect("sent"),
            3 | 7 => break,
            _ => {}
        }
        if ends && kind < 2 {
            break;
        }
    }
    taken
}

#[test]
fn a_recording_is_not_given_to_pages_that_gave_this_machine_another_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let shown = Shown::start(folder.path());
    let (mut honest, mut forged) = (usize::MAX, 0);
    let port = shown.port;
    for headers in ["Host: 127.0.0.1", "Host: localhost", "Host: 127.0.0.1\r\nOrigin: http://127.0.0.1:80"] {
        let (status, bytes) = asked_by_a_page(port, headers);
        assert!(status.contains(" 200 ") && bytes >= A_RECORDING, "{headers}: {status}, {bytes} bytes");
        honest = honest.min(bytes);
    }
    let here = asked_by_a_viewer(port, "127.0.0.1");
    assert!(here >= A_RECORDING, "{here} bytes");
    for headers in [
        "Host: evil.example",
        "Host: evil.example:9876\r\nOrigin: http://evil.example:9876",
        "Host: 127.0.0.1\r\nOrigin: http://evil.example",
        "Host: 127.0.0.1\r\nOrigin: null",
    ] {
        let (status, bytes) = asked_by_a_page(port, headers);
        assert!(status.contains(" 403 ") && bytes < A_RECORDING, "{headers}: {status}, {bytes} bytes");
        forged = forged.max(bytes);
    }
    let elsewhere = asked_by_a_viewer(port, "evil.example");
    assert!(elsewhere < A_RECORDING, "{elsewhere} bytes");
    println!("{honest} bytes and more by its own name, {forged} at the most by another");
    for (headers, expected) in [("Host: 127.0.0.1", " 200 "), ("Host: evil.example", " 403 ")] {
        let mut socket = connect(shown.port);
        let head = format!("GET /rerun/?x=1 HTTP/1.1\r\n{headers}\r\nConnection: close\r\n\r\n");
        socket.write_all(head.as_bytes()).expect("sent");
        let reported = String::from_utf8_lossy(&read(&mut socket)).into_owned();
        assert!(reported.lines().next().is_some_and(|line| line.contains(expected)), "{headers}: {reported}");
        assert_eq!(reported.contains("the_canvas_id"), expected == " 200 ", "{headers}");
    }
}

#[test]
fn connections_that_ask_nothing_hold_neither_threads_nor_memory_and_lock_nobody_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let shown = Shown::start(folder.path());
    let (threads, kilobytes) = (shown.number("Threads"), shown.number("VmRSS"));
    let port = shown.port;
    let mut dribbling = Vec::new();
    for n in 0..500 {
        let mut socket = connect(port);
        // Those that were closed to make room are gone already. Half of them begin with HTTP/2.
        let begun = if n % 2 == 0 { "GET / HTTP/1.1\r\nHost: 127" } else { "PRI * HTTP/2.0\r\n\r\nSM" };
        let _sent = socket.write_all(begun.as_bytes()).is_ok();
        dribbling.push(socket);
    }
    // While they are connected, and as soon as without them.
    let mut socket = connect(port);
    socket.write_all(b"GET /rerun/?x=1 HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n").expect("sent");
    assert!(read(&mut socket).starts_with(b"HTTP/1.1 200"));
    let (status, bytes) = asked_by_a_page(port, "Host: 127.0.0.1");
    assert!(status.contains(" 200 ") && bytes >= A_RECORDING, "{status}, {bytes} bytes");
    let (threads_now, kilobytes_now) = (shown.number("Threads"), shown.number("VmRSS"));
    println!(
        "{} connections: {threads} threads before, {threads_now} now; {} MB before, {} MB now",
        dribbling.len(),
        kilobytes / 1024,
        kilobytes_now / 1024
    );
    // Served clients may need a few threads; idle ones need none, however many they are.
    assert!(threads_now <= threads + 8, "{threads} {threads_now}");
    // The size of a recording that is sent, and of the heads of a hundred requests.
    assert!(kilobytes_now < kilobytes + 64 * 1024, "{kilobytes} {kilobytes_now}");
}
