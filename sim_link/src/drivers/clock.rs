//! What another computer's clock shows now, from the stamps of what it sends.

use std::collections::VecDeque;

/// How long a message counts: as long as two clocks that drift apart by 1 part in 10 000 stay within 3 ms.
const WINDOW_S: f64 = 30.0;
/// One value is kept for so long.
const BUCKET_S: f64 = 1.0;

/// The clock that a device stamps with, as messages tell it. A message arrives some time after it was stamped, so the one
/// that was the fastest of late is nearest to the truth.
#[derive(Debug, Default)]
pub(super) struct DeviceClock {
    /// Begin of the bucket and the least of `arrival − stamp` in it, oldest first.
    buckets: VecDeque<(f64, f64)>,
}

impl DeviceClock {
    /// A message with this stamp arrived at this time of the own clock.
    pub fn heard(&mut self, arrival_s: f64, stamp_s: f64) {
        let lead = arrival_s - stamp_s;
        match self.buckets.back_mut() {
            Some((begin, least)) if arrival_s - *begin < BUCKET_S => *least = least.min(lead),
            _ => self.buckets.push_back((arrival_s, lead)),
        }
        while self.buckets.front().is_some_and(|(begin, _)| arrival_s - begin > WINDOW_S) {
            self.buckets.pop_front();
        }
    }

    /// What it shows at this time of the own clock: that itself as long as nothing was heard.
    pub fn at(&self, own_s: f64) -> f64 {
        let least = self.buckets.iter().map(|(_, least)| *least).reduce(f64::min);
        own_s - least.unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_message_tells_the_time_and_is_forgotten_when_the_clocks_drift() {
        let mut clock = DeviceClock::default();
        assert!((clock.at(5.0) - 5.0).abs() < 1e-12);
        for i in 0..100 {
            let own = 10.0 + 0.1 * f64::from(i);
            // The other clock is 1000 s ahead; messages take 1 ms, and every other 20 ms.
            let delay = if i % 2 == 0 { 1e-3 } else { 20e-3 };
            clock.heard(own + delay, own + 1000.0);
        }
        assert!((clock.at(20.0) - 1019.999).abs() < 1e-9);
        // After a break of a minute, slower ones are all that is known.
        clock.heard(100.02, 1100.0);
        assert!((clock.at(101.0) - 1100.98).abs() < 1e-9);
        assert!(clock.buckets.len() <= 31);
    }
}
