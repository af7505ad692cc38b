//! How the clock of a driver relates to that of the workbench.
//!
//! A pong stamped `s` on the driver's clock, whose ping left at `t0` and which arrived at `t1` on ours, shows that `ours −
//! driver's` lies in `[t0 − s, t1 − s]`: whatever the way there and back took, the stamp was made in between. The intervals
//! of many pongs, widened by what two clocks may drift apart since, are intersected. The middle of their intersection is
//! the offset and half its width a strict bound of its error; the pong that was fastest decides, as in the usual filter by
//! least round trip.

use std::collections::VecDeque;
use std::time::Instant;

/// How fast two clocks may drift apart: crystals of computers are within 50 parts in a million each.
const DRIFT: f64 = 1e-4;
/// How long a pong is used \[s\]: after it the drift makes it worse than any new one.
const MEMORY_S: f64 = 30.0;
/// Most pongs that are kept.
const MOST: usize = 256;

/// The clock of the workbench: seconds since it was started. Copies are the same clock.
#[derive(Debug, Clone, Copy)]
pub struct Timebase(Instant);

impl Timebase {
    /// A clock that starts now.
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since its start.
    pub fn now_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

impl Default for Timebase {
    fn default() -> Self {
        Self::start()
    }
}

/// Offset to add to a timestamp of the driver to get the time of the workbench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// The offset \[s\].
    pub offset_s: f64,
    /// The true one is within ± this \[s\].
    pub uncertainty_s: f64,
    /// How many times the driver's clock has jumped.
    pub jumps: u32,
}

#[derive(Debug, Clone, Copy)]
struct Pong {
    /// When it arrived \[s\].
    arrived: f64,
    /// Least and greatest offset that it allows \[s\].
    least: f64,
    greatest: f64,
}

/// Estimates the offset from pongs.
#[derive(Debug, Clone, Default)]
pub struct ClockOffset {
    pongs: VecDeque<Pong>,
    jumps: u32,
}

impl ClockOffset {
    /// A pong: when its ping left and when it arrived on our clock, and the driver's stamp, all in seconds. A pong that
    /// contradicts those before shows that a clock was set: those are discarded.
    pub(crate) fn add(&mut self, left_s: f64, arrived_s: f64, stamp_s: f64) {
        let pong = Pong { arrived: arrived_s, least: left_s - stamp_s, greatest: arrived_s - stamp_s };
        if let Some((low_s, high_s)) = self.interval(arrived_s)
            && (pong.least > high_s || pong.greatest < low_s)
        {
            self.pongs.clear();
            self.jumps += 1;
        }
        self.pongs.retain(|old| arrived_s - old.arrived <= MEMORY_S);
        if self.pongs.len() >= MOST {
            self.pongs.pop_front();
        }
        self.pongs.push_back(pong);
    }

    /// The offset at a time of our clock; `None` before the first pong.
    pub(crate) fn at(&self, now_s: f64) -> Option<Offset> {
        let (low_s, high_s) = self.interval(now_s)?;
        let uncertainty_s = 0.5 * (high_s - low_s).max(0.0);
        Some(Offset { offset_s: 0.5 * (low_s + high_s), uncertainty_s, jumps: self.jumps })
    }

    fn interval(&self, now_s: f64) -> Option<(f64, f64)> {
        let wider = |pong: &Pong| DRIFT * (now_s - pong.arrived).abs();
        let low_s = self.pongs.iter().map(|pong| pong.least - wider(pong)).reduce(f64::max)?;
        let high_s = self.pongs.iter().map(|pong| pong.greatest + wider(pong)).reduce(f64::min)?;
        Some((low_s, high_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pongs of a clock that is behind by `offset_s` and drifts, with ways there and back of other lengths each time.
    fn pongs(count: usize, offset_s: f64, drift: f64) -> ClockOffset {
        let mut clock = ClockOffset::default();
        for i in 0..count {
            let left_s = 0.2 * i as f64;
            let there_s = 1e-4 + 4e-3 * ((i * 7919) % 97) as f64 / 97.0;
            let back_s = 1e-4 + 9e-3 * ((i * 104_729) % 89) as f64 / 89.0;
            let stamped_s = left_s + there_s;
            clock.add(left_s, stamped_s + back_s, stamped_s * (1.0 - drift) - offset_s);
        }
        clock
    }

    #[test]
    fn the_offset_is_within_its_bound_whatever_way_was_slow_and_however_the_clocks_drift() {
        for drift in [-9e-5, 0.0, 9e-5] {
            let offset = pongs(100, 1234.5, drift).at(20.0).expect("pongs came");
            let off_s = (offset.offset_s - (1234.5 + drift * 20.0)).abs();
            assert!(off_s <= offset.uncertainty_s, "off by {off_s}, bound {}", offset.uncertainty_s);
            assert!(offset.uncertainty_s < 2e-3, "{}", offset.uncertainty_s);
        }
    }

    #[test]
    fn a_clock_that_is_set_is_noticed_at_the_next_pong() {
        let mut clock = pongs(100, 10.0, 0.0);
        clock.add(20.0, 20.001, 20.0005 - 15.0);
        let offset = clock.at(20.001).expect("pongs came");
        assert!((offset.offset_s - 15.0).abs() <= offset.uncertainty_s && offset.uncertainty_s < 1e-3, "{offset:?}");
        assert_eq!(offset.jumps, 1);
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut clock = ClockOffset::default();
        for i in 0..10_000 {
            let now_s = 1e-3 * f64::from(i);
            clock.add(now_s, now_s + 1e-4, now_s);
        }
        assert!(clock.pongs.len() <= MOST);
    }
}
