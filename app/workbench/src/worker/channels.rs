//! How threads hand something to each other. The sender never waits.
//!
//! | | |
//! | --- | --- |
//! | [`LatestSlot`] | the newest value, of something that is only of interest while it is new; with a [`Bell`] for whoever waits for it |
//! | [`Requests`] | a queue with a limit, of what has to be done once each |
//! | [`Counter`] | what is asked for until it is done, however often: a stop |

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};

use super::shared::Busy;

/// Holds the newest value only. A value that was not taken before the next one came is dropped and counted: a slow
/// window shows fewer images, never old ones, and the sender never waits.
#[derive(Debug)]
pub(crate) struct LatestSlot<T> {
    inner: Mutex<Inner<T>>,
}

#[derive(Debug)]
struct Inner<T> {
    newest: Option<T>,
    dropped: u64,
}

impl<T> Default for LatestSlot<T> {
    fn default() -> Self {
        Self { inner: Mutex::new(Inner { newest: None, dropped: 0 }) }
    }
}

impl<T> LatestSlot<T> {
    /// Replaces the previous value.
    pub fn put(&self, value: T) {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let replaced = inner.newest.replace(value);
        inner.dropped += u64::from(replaced.is_some());
        drop(inner);
        // The old value may be megabytes: it is freed without the lock.
        drop(replaced);
    }

    /// Takes the newest value, unless it was taken already, and the number of values that were never taken.
    pub fn take(&self) -> Option<(T, u64)> {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let newest = inner.newest.take()?;
        Some((newest, inner.dropped))
    }
}

/// Wakes a thread that waits.
#[derive(Debug, Clone)]
pub struct Bell(Sender<()>);

impl Bell {
    /// The bell, and its receiver.
    pub fn new() -> (Self, Receiver<()>) {
        let (bell, rung) = bounded(1);
        (Self(bell), rung)
    }

    /// Rings; whether the receiver still exists. Two rings before it is heard count as one.
    pub fn ring(&self) -> bool {
        !matches!(self.0.try_send(()), Err(TrySendError::Disconnected(())))
    }
}

/// A [`LatestSlot`] for a thread that waits for the next value, and wants to know whether the sender is alive.
#[derive(Debug)]
pub(crate) struct Tap<T> {
    slot: LatestSlot<T>,
    bell: Bell,
    /// Bits of the time \[s\] at which the sender last had an answer from its source; NaN before.
    heard_s: AtomicU64,
}

impl<T> Tap<T> {
    /// The tap, and the bell that rings when there is something in it.
    pub fn new() -> (Self, Receiver<()>) {
        let (bell, rung) = Bell::new();
        (Self { slot: LatestSlot::default(), bell, heard_s: AtomicU64::new(f64::NAN.to_bits()) }, rung)
    }

    /// Puts a value and rings.
    pub fn put(&self, value: T) {
        self.slot.put(value);
        self.bell.ring();
    }

    /// See [`LatestSlot::take`].
    pub fn take(&self) -> Option<(T, u64)> {
        self.slot.take()
    }

    /// Notes that the source answered, whether there was a value or not.
    pub fn heard(&self, now_s: f64) {
        self.heard_s.store(now_s.to_bits(), Ordering::Relaxed);
    }

    /// When it last did.
    pub fn heard_s(&self) -> Option<f64> {
        Some(f64::from_bits(self.heard_s.load(Ordering::Relaxed))).filter(|heard_s| !heard_s.is_nan())
    }
}

/// The sending end of a queue of requests to a thread.
#[derive(Debug)]
pub struct Requests<T>(Option<Sender<T>>);

impl<T> Requests<T> {
    /// At most this many may wait; the thread takes them from the second.
    pub fn with_limit(limit: usize) -> (Self, Receiver<T>) {
        let (sender, requests) = bounded(limit);
        (Self(Some(sender)), requests)
    }

    /// Asks for something.
    ///
    /// # Errors
    /// [`Busy`] when too many wait, or the receiver is gone.
    pub(crate) fn ask(&self, request: T) -> Result<(), Busy> {
        self.0.as_ref().map_or(Err(Busy), |sender| sender.try_send(request).map_err(|_refused| Busy))
    }

    /// Whether nothing can be requested any more.
    pub(crate) fn is_closed(&self) -> bool {
        self.0.is_none()
    }

    /// Nothing more is requested from here: a thread that has done what waits can end.
    pub(crate) fn close(&mut self) {
        self.0 = None;
    }
}

impl<T> Default for Requests<T> {
    /// Closed.
    fn default() -> Self {
        Self(None)
    }
}

impl<T> Clone for Requests<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

/// Counts requests and up to which one they are done. A request made while an earlier one is being done is not lost.
#[derive(Debug, Default)]
pub(crate) struct Counter {
    asked: AtomicU64,
    done: AtomicU64,
}

impl Counter {
    /// Adds a request; returns its number.
    pub fn ask(&self) -> u64 {
        self.asked.fetch_add(1, Ordering::AcqRel) + 1
    }

    /// How many requests were made.
    pub fn asked(&self) -> u64 {
        self.asked.load(Ordering::Acquire)
    }

    /// All up to this number are done.
    pub fn finish(&self, number: u64) {
        self.done.fetch_max(number, Ordering::AcqRel);
    }

    /// The newest number that is not done.
    pub fn open(&self) -> Option<u64> {
        let asked = self.asked();
        (asked > self.done.load(Ordering::Acquire)).then_some(asked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_value_wins_and_the_others_are_counted() {
        let slot = LatestSlot::default();
        assert_eq!(slot.take(), None);
        for value in 1..=4 {
            slot.put(value);
        }
        assert_eq!(slot.take(), Some((4, 3)));
        assert_eq!(slot.take(), None, "a value is taken once");
        slot.put(5);
        assert_eq!(slot.take(), Some((5, 3)), "what was taken was not dropped");
    }

    #[test]
    fn the_bell_rings_once_for_values_that_came_together() {
        let (tap, bell) = Tap::new();
        tap.put(1);
        tap.put(2);
        assert_eq!((bell.try_recv(), bell.try_recv().is_err()), (Ok(()), true));
        assert_eq!(tap.take(), Some((2, 1)));
        assert_eq!(tap.heard_s(), None);
        tap.heard(4.5);
        assert_eq!(tap.heard_s(), Some(4.5));
    }

    #[test]
    fn whoever_asks_is_refused_where_too_many_wait_or_nobody_listens() {
        let (mut requests, taken) = Requests::with_limit(1);
        assert_eq!((requests.ask(1), requests.ask(2)), (Ok(()), Err(Busy)));
        assert_eq!(taken.try_recv(), Ok(1));
        requests.close();
        assert!(requests.is_closed() && taken.recv().is_err(), "the thread ends");
        assert_eq!(requests.ask(3), Err(Busy));
    }

    #[test]
    fn what_is_asked_for_while_it_is_done_stays_open() {
        let counter = Counter::default();
        assert_eq!(counter.open(), None);
        let first = counter.ask();
        assert_eq!(counter.open(), Some(first));
        let second = counter.ask();
        counter.finish(first);
        assert_eq!(counter.open(), Some(second));
        counter.finish(second);
        counter.finish(first);
        assert_eq!((counter.open(), counter.asked()), (None, 2));
    }
}
