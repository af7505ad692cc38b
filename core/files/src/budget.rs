//! Limits on time and unpacked data for reading foreign files.
//!
//! Nothing here reads a clock: the caller provides it, and a test provides one that it sets.

use std::cell::Cell;
use std::time::Duration;

use handeye_geometry::progress::CancelToken;

/// Limits for reading one recording, unless the user allows more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Time on the caller's clock.
    pub time: Duration,
    /// Bytes that come out of compressed files and are kept in memory or in temporary files.
    pub unpacked_bytes: u64,
}

impl Limits {
    /// With another time.
    #[must_use]
    pub fn with_time(self, time: Duration) -> Self {
        Self { time, ..self }
    }
}

impl Default for Limits {
    /// 20 s, after which a person wonders whether anything happens; 4 GiB, more than a thousand images of 1280×800 px as they
    /// are, and less than most disks of temporary files have.
    fn default() -> Self {
        Self { time: Duration::from_secs(20), unpacked_bytes: 1 << 32 }
    }
}

/// Why the reading was ended before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
pub enum Spent {
    /// A person has cancelled it.
    #[error("cancelled")]
    Cancelled,
    /// It took longer than it may.
    #[error("reading took longer than {seconds} s and was stopped", seconds = .0.as_secs_f64())]
    Time(Duration),
    /// More came out of compressed files than may.
    #[error("its compressed files unpack to more than {size:.1} GiB and reading was stopped", size = *.0 as f64 / f64::from(1 << 30))]
    Unpacked(u64),
}

/// The limits of one piece of work, and the used part of them. Once it is spent it stays so, so that work may end early in
/// any place and its caller can determine why.
pub struct Budget<'a> {
    cancel: &'a CancelToken,
    /// Time since the work began.
    elapsed: &'a dyn Fn() -> Duration,
    limits: Limits,
    unpacked_bytes: Cell<u64>,
    spent: Cell<Option<Spent>>,
}

impl<'a> Budget<'a> {
    /// `elapsed` gives the time since the work began, and is called often.
    pub fn new(limits: Limits, elapsed: &'a dyn Fn() -> Duration, cancel: &'a CancelToken) -> Self {
        Self { cancel, elapsed, limits, unpacked_bytes: Cell::new(0), spent: Cell::new(None) }
    }

    /// Whether work may go on; called at least every few milliseconds in our own loops.
    ///
    /// # Errors
    /// [`Spent`], the first reason there was.
    pub fn check(&self) -> Result<(), Spent> {
        if self.spent.get().is_none() {
            self.spent.set(if self.cancel.is_cancelled() {
                Some(Spent::Cancelled)
            } else if (self.elapsed)() > self.limits.time {
                Some(Spent::Time(self.limits.time))
            } else {
                None
            });
        }
        self.spent.get().map_or(Ok(()), Err)
    }

    /// Whether work has to end.
    pub fn is_spent(&self) -> bool {
        self.check().is_err()
    }

    /// Takes account of bytes that came out of a compressed file and are kept.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn unpack(&self, bytes: u64) -> Result<(), Spent> {
        let all = self.unpacked_bytes.get().saturating_add(bytes);
        self.unpacked_bytes.set(all);
        if all > self.limits.unpacked_bytes && self.spent.get().is_none() {
            self.spent.set(Some(Spent::Unpacked(self.limits.unpacked_bytes)));
        }
        self.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_reason_to_end_stays_the_reason() {
        let clock = Cell::new(Duration::ZERO);
        let elapsed = || clock.get();
        let cancel = CancelToken::default();
        let limits = Limits { time: Duration::from_secs(3), unpacked_bytes: 100 };
        let budget = Budget::new(limits, &elapsed, &cancel);
        assert_eq!(budget.check(), Ok(()));
        assert_eq!(budget.unpack(100), Ok(()));
        clock.set(Duration::from_secs(4));
        assert_eq!(budget.check(), Err(Spent::Time(limits.time)));
        cancel.cancel();
        assert_eq!(budget.unpack(1), Err(Spent::Time(limits.time)));
        let other = Budget::new(limits, &elapsed, &cancel);
        assert_eq!(other.check(), Err(Spent::Cancelled));
        let cancel = CancelToken::default();
        clock.set(Duration::ZERO);
        let other = Budget::new(limits, &elapsed, &cancel);
        assert_eq!(other.unpack(101), Err(Spent::Unpacked(100)));
        assert_eq!(other.check(), Err(Spent::Unpacked(100)));
    }
}
