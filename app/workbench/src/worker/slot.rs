//! A place for the newest value of something.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crossbeam_channel::{Receiver, Sender, bounded};

/// Holds the newest value only. A value that nobody took before the next one came is dropped and counted: a slow
/// window shows fewer images, never old ones, and the one who puts never waits.
#[derive(Debug)]
pub struct LatestSlot<T> {
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
    /// Puts a value in the place of the one before.
    pub fn put(&self, value: T) {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let replaced = inner.newest.replace(value);
        inner.dropped += u64::from(replaced.is_some());
        drop(inner);
        // The old value may be megabytes: it is freed without the lock.
        drop(replaced);
    }

    /// Takes the newest value, unless it was taken already, and the number of values that nobody ever took.
    pub fn take(&self) -> Option<(T, u64)> {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let newest = inner.newest.take()?;
        Some((newest, inner.dropped))
    }
}

/// A [`LatestSlot`] for a thread that waits for the next value, and wants to know whether the one who puts is there.
#[derive(Debug)]
pub struct Tap<T> {
    slot: LatestSlot<T>,
    bell: Sender<()>,
    /// Bits of the time \[s\] at which the one who puts last had an answer from its source; not a number before.
    heard_s: AtomicU64,
}

impl<T> Tap<T> {
    /// The tap, and the bell that rings when there is something in it.
    pub fn new() -> (Self, Receiver<()>) {
        let (bell, rung) = bounded(1);
        (Self { slot: LatestSlot::default(), bell, heard_s: AtomicU64::new(f64::NAN.to_bits()) }, rung)
    }

    /// Puts a value and rings.
    pub fn put(&self, value: T) {
        self.slot.put(value);
        // A bell that has rung and was not heard yet rings as well as two.
        let _rings_already = self.bell.try_send(()).is_err();
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
}
