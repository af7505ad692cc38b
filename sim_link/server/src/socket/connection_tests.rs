use std::net::{TcpListener, TcpStream as Blocking};

use super::*;

/// A connection and its other end, on a clock that goes where the test wants it.
struct Pair {
    here: Connection,
    there: Blocking,
    scratch: Vec<u8>,
}

const START: Duration = Duration::from_secs(100);

fn after(seconds: u64) -> Duration {
    START + Duration::from_secs(seconds)
}

impl Pair {
    fn new() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let there = Blocking::connect(listener.local_addr().expect("bound")).expect("connects");
        there.set_read_timeout(Some(Duration::from_secs(20))).expect("an option");
        let (here, _) = listener.accept().expect("connected");
        here.set_nonblocking(true).expect("an option");
        Self {
            here: Connection::new(TcpStream::from_std(here), Duration::from_secs(15), START),
            there,
            scratch: vec![0; 1 << 16],
        }
    }

    /// As a socket of version 3.0 or 3.1.
    fn introduced(minor: u8) -> Self {
        let mut pair = Self::new();
        let mut greeting = zmtp::GREETING;
        greeting[11] = minor;
        pair.say(&greeting);
        pair.say(b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x03REQ");
        while !pair.here.decoder.is_ready() {
            assert_eq!(pair.turn(START), Ok(None));
        }
        pair.hear(zmtp::GREETING.len() + zmtp::READY.len());
        pair
    }

    fn say(&mut self, bytes: &[u8]) {
        self.there.write_all(bytes).expect("taken");
    }

    fn hear(&mut self, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        self.there.read_exact(&mut bytes).expect("in time");
        bytes
    }

    /// One turn of the loop, in which the operating system reports that everything can go on.
    fn turn(&mut self, now: Duration) -> Result<Option<Incoming>, CloseReason> {
        (self.here.may_read, self.here.may_write) = (true, true);
        self.here.resume(now)?;
        self.here.flush()?;
        self.here.next_request(&mut self.scratch, now)
    }

    /// Turns until there is a request.
    fn request(&mut self, now: Duration) -> Incoming {
        loop {
            if let Some(request) = self.turn(now).expect("alive") {
                return request;
            }
        }
    }
}

fn framed(request: &[u8]) -> Vec<u8> {
    [zmtp::reply_head(request.len()), request.to_vec()].concat()
}

#[test]
fn whoever_does_not_introduce_itself_is_let_go() {
    let mut pair = Pair::new();
    pair.say(&zmtp::GREETING[..40]);
    assert_eq!(pair.turn(after(9)), Ok(None));
    assert_eq!(pair.here.look_after(after(9)), Ok(()));
    assert_eq!(pair.here.due(), Some(after(10)));
    assert_eq!(pair.here.look_after(after(10)), Err(CloseReason::NoIntroduction));
}

#[test]
fn a_silent_client_is_asked_for_a_sign_of_life_and_then_given_up() {
    let mut pair = Pair::introduced(1);
    assert_eq!(pair.here.look_after(after(4)), Ok(()));
    assert_eq!(pair.here.look_after(after(5)), Ok(()));
    assert_eq!(pair.hear(zmtp::PING.len()), zmtp::PING);
    pair.say(b"\x04\x05\x04PONG");
    while pair.here.pinged.is_some() {
        assert_eq!(pair.turn(after(15)), Ok(None));
    }
    assert_eq!(pair.here.look_after(after(19)), Ok(()));
    assert_eq!(pair.here.look_after(after(20)), Ok(()));
    assert_eq!(pair.hear(zmtp::PING.len()), zmtp::PING);
    assert_eq!(pair.here.look_after(after(34)), Ok(()));
    assert_eq!(pair.here.look_after(after(35)), Err(CloseReason::Silent));
}

#[test]
fn a_client_of_version_3_0_is_not_asked_what_it_does_not_know() {
    let mut pair = Pair::introduced(0);
    assert_eq!(pair.here.due(), None);
    assert_eq!(pair.here.look_after(after(3600)), Ok(()));
    pair.say(&framed(b"still there"));
    assert_eq!(pair.request(after(3600)), Incoming::Request(b"still there".to_vec()));
}

#[test]
fn who_does_not_read_gets_no_further_and_holds_one_reply_until_it_reads() {
    const REPLY: usize = 32 << 20;
    let mut pair = Pair::introduced(1);
    pair.say(&framed(b"first"));
    pair.say(&framed(b"second"));
    assert_eq!(pair.request(START), Incoming::Request(b"first".to_vec()));
    assert_eq!(pair.here.waiting_since(), None);
    pair.here.send(vec![7; REPLY], after(1)).expect("alive");
    assert_eq!(pair.turn(after(2)), Ok(None), "the second request has to wait");
    assert!((REPLY..REPLY + (1 << 20)).contains(&pair.here.held_bytes()), "{}", pair.here.held_bytes());
    assert_eq!(pair.here.waiting_since(), Some(after(1)));

    let mut reader = pair.there.try_clone().expect("another handle");
    let reading = std::thread::spawn(move || {
        let mut reply = vec![0; zmtp::reply_head(REPLY).len() + REPLY];
        reader.read_exact(&mut reply).map(|()| reply)
    });
    assert_eq!(pair.request(after(3)), Incoming::Request(b"second".to_vec()));
    let reply = reading.join().expect("no panic").expect("all of it");
    assert!(reply.ends_with(&[7; 1000]));
    assert!(pair.here.held_bytes() < 1000, "{}", pair.here.held_bytes());
    assert_eq!(pair.here.waiting_since(), None);
}

#[test]
fn a_reply_that_trickles_out_is_a_sign_of_life() {
    let mut pair = Pair::introduced(1);
    pair.here.send(vec![7; 32 << 20], START).expect("alive");
    assert_eq!(pair.here.look_after(after(6)), Ok(()), "a ping waits behind the reply");
    // Somebody reads, if slowly: enough for the system to take more.
    for _ in 0..64 {
        pair.hear(1 << 16);
        assert_eq!(pair.turn(after(20)), Ok(None));
    }
    assert_eq!(pair.here.look_after(after(21)), Ok(()));
    assert_eq!(pair.here.look_after(after(25)), Ok(()));
    assert_eq!(pair.here.look_after(after(40)), Err(CloseReason::Silent), "and then nobody");
}

#[test]
fn a_request_that_does_not_come_whole_keeps_the_server_waiting() {
    let mut pair = Pair::introduced(1);
    let request = framed(&[1; 5000]);
    pair.say(&request[..4000]);
    while pair.here.held_bytes() < 3000 {
        assert_eq!(pair.turn(after(2)), Ok(None));
    }
    assert_eq!(pair.here.waiting_since(), Some(after(2)));
    pair.say(&request[4000..]);
    assert_eq!(pair.request(after(3)), Incoming::Request(vec![1; 5000]));
    assert_eq!(pair.here.waiting_since(), None);
}
