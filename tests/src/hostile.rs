//! What malicious programs send to a cell.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use ciborium::Value;
use handeye_wire as wire;

/// A request of the remote API.
pub fn request(uuid: &str, func: &str, args: Vec<Value>) -> Vec<u8> {
    wire::encode(&wire::map([("func", Value::from(func)), ("args", Value::Array(args)), ("uuid", Value::from(uuid))]))
}

/// A request as ZeroMQ sockets sent it before 2012: an empty delimiter and a short frame.
///
/// # Panics
/// For a request of more than 250 bytes.
pub fn unversioned(request: &[u8]) -> Vec<u8> {
    assert!(request.len() <= 250, "it would need another kind of frame");
    [&[1, 1, request.len() as u8 + 1, 0], request].concat()
}

/// The body of an HTTP request with these first lines which an unversioned socket takes for a request of the remote API.
///
/// It reads the text as frames: a length, flags, and as many bytes less one. The last of them ends somewhere in the body.
pub fn body_after(http_head: &[u8], request: &[u8], bytes: usize) -> Vec<u8> {
    let mut at = 0;
    while at < http_head.len() {
        at += 1 + usize::from(http_head[at]);
    }
    let mut body = vec![0; at - http_head.len()];
    // The end of whatever message the text was the beginning of.
    body.extend_from_slice(&[1, 0]);
    body.extend(unversioned(request));
    body.resize(bytes, 0);
    body
}

/// Performs the handshake of a ZeroMQ socket, and receives the peer's.
///
/// # Panics
/// When the peer is not such a socket.
pub fn introduce(stream: &mut TcpStream) {
    let mut greeting = [0_u8; 64];
    greeting[0] = 0xff;
    greeting[9] = 0x7f;
    greeting[10] = 3;
    greeting[12..16].copy_from_slice(b"NULL");
    stream.write_all(&greeting).expect("sent");
    stream.write_all(b"\x04\x1c\x05READY\x0bSocket-Type\x00\x00\x00\x06DEALER").expect("sent");
    // Greeting, then the length of its handshake, which is short.
    let mut theirs = [0; 66];
    stream.read_exact(&mut theirs).expect("a greeting");
    stream.read_exact(&mut vec![0; usize::from(theirs[65])]).expect("an introduction");
}

/// A request of less than 256 bytes as ZeroMQ sockets send it today.
pub fn framed(request: &[u8]) -> Vec<u8> {
    [&[1, 0, 0, request.len() as u8], request].concat()
}
