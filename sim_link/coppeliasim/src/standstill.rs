//! Distinguishes a simulation that another client holds from one that is slow.

use std::time::{Duration, Instant};

/// How long another client may hold the simulation before it is reported: longer than the slowest step of a working program,
/// and no longer than a user waits for an arm before looking for a fault.
pub(super) const LONGEST_HOLD: Duration = Duration::from_secs(3);

/// A server that is silent for longer computes a pass: it serves no client meanwhile, while one that is held serves all.
/// Half of [`LONGEST_HOLD`], because a call that waits for a pass may see the end of the previous one, and 1.5 times the
/// longest time that the built-in cell lets a client wait for a message.
const PASS: Duration = Duration::from_millis(1500);

/// A call that the server asks to wait, repeatedly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Standstill {
    /// Since when the server has answered all along.
    since: Instant,
    heard: Instant,
}

impl Standstill {
    /// For a call that begins now.
    pub(super) fn begin(now: Instant) -> Self {
        Self { since: now, heard: now }
    }

    /// The server has asked to wait again. Returns how long it has done nothing else, once that is too long.
    pub(super) fn heard(&mut self, now: Instant) -> Option<Duration> {
        if now.saturating_duration_since(self.heard) > PASS {
            self.since = now;
        }
        self.heard = now;
        let after = now.saturating_duration_since(self.since);
        (after >= LONGEST_HOLD).then_some(after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When a server that answers at intervals of `interval_s` is reported to be held.
    fn held_after_s(interval_s: f64) -> Option<f64> {
        let start = Instant::now();
        let mut standstill = Standstill::begin(start);
        let mut times = (1..200).map(|turn| f64::from(turn) * interval_s);
        times.find(|time_s| standstill.heard(start + Duration::from_secs_f64(*time_s)).is_some())
    }

    #[test]
    fn a_server_that_answers_all_along_is_held_after_3_s() {
        for (interval_s, after_s) in [(0.125, 3.0), (1.0, 3.0), (1.25, 3.75)] {
            assert_eq!(held_after_s(interval_s), Some(after_s));
        }
    }

    #[test]
    fn a_server_that_is_busy_for_long_is_slow_and_not_held() {
        for interval_s in [1.75, 4.0, 30.0] {
            assert_eq!(held_after_s(interval_s), None, "{interval_s} s");
        }
    }

    #[test]
    fn a_pass_that_took_long_does_not_count() {
        let start = Instant::now();
        let at = |time_s| start + Duration::from_secs_f64(time_s);
        let mut standstill = Standstill::begin(start);
        let heard = [2.5, 3.5, 4.5, 5.25, 5.5].map(|time_s| standstill.heard(at(time_s)));
        assert_eq!(heard, [None, None, None, None, Some(Duration::from_secs(3))]);
    }
}
