use proptest::prelude::*;

use super::*;

/// What a REQ socket of ZeroMQ 4 sends before its first request.
fn introduction() -> Vec<u8> {
    let mut bytes = GREETING.to_vec();
    bytes.extend_from_slice(b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x03REQ");
    bytes
}

fn request(payload: &[u8]) -> Vec<u8> {
    let mut bytes = reply_head(payload.len());
    bytes.extend_from_slice(payload);
    bytes
}

/// All events of bytes that arrive in pieces of a size.
fn read(bytes: &[u8], piece: usize) -> Result<Vec<Event>, Violation> {
    let mut decoder = Decoder::default();
    let mut events = Vec::new();
    for mut piece in bytes.chunks(piece) {
        while let Some(event) = decoder.read(&mut piece)? {
            events.push(event);
        }
    }
    Ok(events)
}

#[test]
fn requests_are_read_however_they_are_cut() {
    let long = vec![7; 300];
    let mut bytes = introduction();
    bytes.extend(request(b"short"));
    // A ping comes between two frames of one message.
    bytes.extend_from_slice(b"\x01\x00\x04\x09\x04PING\x00\x01ab");
    bytes.extend_from_slice(&request(&long)[2..]);
    bytes.extend(request(b""));
    let pong = b"\x04\x07\x04PONGab".to_vec();
    let expected = [
        Event::Greeted,
        Event::Ready,
        Event::Request(b"short".to_vec()),
        Event::Pong(pong),
        Event::Request(long),
        Event::Request(Vec::new()),
    ];
    for piece in [1, 2, 3, 64, 1000] {
        assert_eq!(read(&bytes, piece).as_deref(), Ok(&expected[..]), "in pieces of {piece}");
    }
}

#[test]
fn a_message_without_the_place_for_a_reply_is_no_request() {
    let mut bytes = introduction();
    bytes.extend_from_slice(b"\x00\x03abc");
    bytes.extend_from_slice(b"\x01\x01x\x00\x01y");
    bytes.extend_from_slice(b"\x01\x00\x01\x01a\x01\x01b\x00\x01c");
    bytes.extend(request(b"good"));
    let events = read(&bytes, 5).expect("nothing wrong");
    assert_eq!(events[2..], [Event::Request(b"good".to_vec())]);
}

#[test]
fn whoever_does_not_begin_like_a_socket_of_version_3_is_refused_at_the_first_byte_that_says_so() {
    let first_bytes = |bytes: &[u8]| {
        let mut decoder = Decoder::default();
        (1..=bytes.len()).find(|&count| decoder.read(&mut &bytes[count - 1..count]).is_err())
    };
    assert_eq!(first_bytes(b"POST / HTTP/1.1\r\n"), Some(1));
    // The unversioned protocol: the length of an empty identity, then messages.
    assert_eq!(first_bytes(b"\x01\x00\x01\x01\x05\x00hello"), Some(1));
    // A long identity of the unversioned protocol begins like a signature.
    assert_eq!(first_bytes(b"\xff\x00\x00\x00\x00\x00\x00\x01\x00\x00"), Some(10));
    // Versions 1 and 2 of the versioned one.
    for version in [0, 1, 2] {
        let mut greeting = GREETING;
        greeting[10] = version;
        assert_eq!(first_bytes(&greeting), Some(11));
    }
    let mut greeting = GREETING;
    greeting[12..17].copy_from_slice(b"PLAIN");
    assert_eq!(read(&greeting, 64), Err(Violation::Mechanism));
    let mut subscriber = GREETING.to_vec();
    subscriber.extend_from_slice(b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB");
    assert_eq!(read(&subscriber, 64), Err(Violation::SocketType));
    // A request before the introduction.
    let mut hasty = GREETING.to_vec();
    hasty.extend(request(b"x"));
    assert_eq!(read(&hasty, 64), Err(Violation::Frame));
}

#[test]
fn a_request_over_the_limit_is_counted_and_not_kept_and_a_far_longer_frame_is_refused() {
    let bytes = MAX_REQUEST_BYTES + 1;
    let mut decoder = Decoder::default();
    let introduction = introduction();
    let mut input = &introduction[..];
    while decoder.read(&mut input).expect("right").is_some() {}
    let long = request(&vec![1; bytes]);
    let (most, last) = long.split_at(long.len() - 1);
    assert_eq!(decoder.read(&mut &most[..]), Ok(None));
    assert!(decoder.held_bytes() < 100 && decoder.is_amid());
    assert_eq!(decoder.read(&mut &last[..]), Ok(Some(Event::TooLong(bytes))));
    assert!(!decoder.is_amid());
    let mut far_longer = &b"\x01\x00\x02\x00\x00\x00\x00\x7f\x00\x00\x00"[..];
    assert_eq!(decoder.read(&mut far_longer), Err(Violation::Frame));
}

#[test]
fn what_this_side_sends_is_what_this_side_reads() {
    let mut bytes = GREETING.to_vec();
    bytes.extend_from_slice(&READY);
    bytes.extend_from_slice(&PING);
    let pong = b"\x04\x05\x04PONG".to_vec();
    assert_eq!(read(&bytes, 64), Ok(vec![Event::Greeted, Event::Ready, Event::Pong(pong)]));
}

proptest! {
    #[test]
    fn no_bytes_bring_it_down_or_make_it_hoard(tail in proptest::collection::vec(any::<u8>(), 0..400), piece in 1_usize..50) {
        let mut bytes = introduction();
        bytes.extend(tail);
        let mut decoder = Decoder::default();
        for mut piece in bytes.chunks(piece) {
            loop {
                match decoder.read(&mut piece) {
                    Ok(Some(_)) => {}
                    Ok(None) => break,
                    Err(_) => return Ok(()),
                }
            }
        }
        prop_assert!(decoder.held_bytes() < 4096);
    }
}
