//! A bad network between a program and its clients: slow, with a long round trip, packet loss, and interruptions.
//!
//! TCP hides a lost packet: later data waits until it was retransmitted. So every segment here is queued on a line of
//! limited rate, is in flight for half of a round trip, and a lost one delays all later ones for as long as a sender waits
//! before the retransmission: one and a half round trips, and at least the 200 ms of Linux (RFC 6298).

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Most bytes of a segment on Ethernet.
const SEGMENT: usize = 1460;
/// Limit of segments in flight, as with a usual buffer of a router.
const UNDER_WAY: usize = 64;
/// Minimum time before a retransmission.
const AGAIN: Duration = Duration::from_millis(200);

/// The properties of a network.
#[derive(Debug, Clone, Copy)]
pub struct Quality {
    /// Bits per second, in each direction.
    pub bits_per_s: f64,
    /// To the other end and back.
    pub round_trip: Duration,
    /// Share of the segments that are lost.
    pub loss: f64,
    /// Seed of the choice of those.
    pub seed: u64,
}

/// A network with a program behind it.
pub struct Network {
    address: SocketAddr,
    link: Arc<Link>,
}

struct Link {
    quality: Quality,
    /// Disconnected: nothing arrives, and neither end is notified.
    is_cut: Mutex<bool>,
    mended: Condvar,
    has_ended: AtomicBool,
    /// When the line of each direction is free again.
    free: [Mutex<Instant>; 2],
}

impl Network {
    /// Listens on an address of its own, for connections to a program.
    ///
    /// # Panics
    /// When no port is free.
    pub fn to(program: SocketAddr, quality: Quality) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        let now = Instant::now();
        let link = Arc::new(Link {
            quality,
            is_cut: Mutex::new(false),
            mended: Condvar::new(),
            has_ended: AtomicBool::new(false),
            free: [Mutex::new(now), Mutex::new(now)],
        });
        let shared = Arc::clone(&link);
        std::thread::spawn(move || {
            for (number, near) in (0..).zip(listener.incoming().map_while(Result::ok)) {
                if shared.has_ended.load(Ordering::Relaxed) {
                    break;
                }
                let Ok(far) = TcpStream::connect(program) else { continue };
                for (direction, from, to) in [(0, &near, &far), (1, &far, &near)] {
                    if let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) {
                        carry(&shared, 2 * number + direction, from, to);
                    }
                }
            }
        });
        Self { address, link }
    }

    /// Where the program is, over this network.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Nothing arrives any more, without notice to either end.
    pub fn cut(&self) {
        *self.link.is_cut.lock().unwrap_or_else(PoisonError::into_inner) = true;
    }

    /// Everything that was in flight arrives.
    pub fn mend(&self) {
        *self.link.is_cut.lock().unwrap_or_else(PoisonError::into_inner) = false;
        self.link.mended.notify_all();
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.link.has_ended.store(true, Ordering::Relaxed);
        self.mend();
        // The thread that waits for connections notices it with one more.
        let _woken = TcpStream::connect(self.address).is_ok();
    }
}

/// Carries the data of one end to the other, on threads of its own.
fn carry(link: &Arc<Link>, number: u64, from: TcpStream, to: TcpStream) {
    let (sender, receiver) = sync_channel(UNDER_WAY);
    let (sending, delivering) = (Arc::clone(link), Arc::clone(link));
    std::thread::spawn(move || sending.send(number, from, &sender));
    std::thread::spawn(move || delivering.deliver(to, &receiver));
}

impl Link {
    fn send(&self, number: u64, mut from: TcpStream, sender: &SyncSender<(Instant, Vec<u8>)>) {
        let Quality { bits_per_s, round_trip, loss, seed } = self.quality;
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ number);
        let mut segment = [0; SEGMENT];
        let mut last = Instant::now();
        while let Ok(count @ 1..) = from.read(&mut segment) {
            let takes = Duration::from_secs_f64(8.0 * count as f64 / bits_per_s);
            let gone = {
                let mut free = self.free[(number % 2) as usize].lock().unwrap_or_else(PoisonError::into_inner);
                *free = (*free).max(Instant::now()) + takes;
                *free
            };
            let mut arrives = gone + round_trip / 2;
            if random.random::<f64>() < loss {
                arrives += (round_trip * 3 / 2).max(AGAIN);
            }
            last = arrives.max(last);
            if sender.send((last, segment[..count].to_vec())).is_err() {
                break;
            }
        }
    }

    fn deliver(&self, mut to: TcpStream, receiver: &Receiver<(Instant, Vec<u8>)>) {
        for (arrives, segment) in receiver {
            std::thread::sleep(arrives.saturating_duration_since(Instant::now()));
            let cut = self.is_cut.lock().unwrap_or_else(PoisonError::into_inner);
            let whole = self.mended.wait_while(cut, |cut| *cut).unwrap_or_else(PoisonError::into_inner);
            drop(whole);
            if to.write_all(&segment).is_err() {
                break;
            }
        }
        let _closed = to.shutdown(Shutdown::Both).is_ok();
    }
}
