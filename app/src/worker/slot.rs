//! A place for the newest value of something.

use std::sync::{Mutex, PoisonError};

/// Holds the newest value only. A value that nobody took before the next one came is dropped and counted: a slow
/// window shows fewer pictures, never old ones, and the one who puts never waits.
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
}
