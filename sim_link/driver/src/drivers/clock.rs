//! What another computer's clock shows now, from the stamps of what it sends.

use std::collections::VecDeque;

/// How long a message counts: as long as two clocks that drift apart by 1 part in 10 000 stay within 3 ms.
const WINDOW_S: f64 = 30.0;
/// One value is kept for so long.
const BUCKET_S: f64 = 1.0;
/// How fast what is shown follows what is known, seconds a second: half of what the workbench takes for the drift of two
/// clocks. Faster, it would take it for a clock that was set.
const SLEW: f64 = 5e-5;
/// What is farther off is shown at once: the clock was set, or the first messages were very late.
const STEP_S: f64 = 0.05;

/// The clock that a device stamps with, as messages tell it. A message arrives some time after it was stamped, so the one
/// that was the fastest of late is nearest to the truth.
#[derive(Debug, Default)]
pub(super) struct DeviceClock {
    /// Begin of the bucket and the least of `arrival − stamp` in it, oldest first.
    buckets: VecDeque<(f64, f64)>,
    /// When it was last asked, and by how much the own clock was shown to lead.
    shown: Option<(f64, f64)>,
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
    pub fn at(&mut self, own_s: f64) -> f64 {
        let Some(known) = self.buckets.iter().map(|(_, least)| *least).reduce(f64::min) else { return own_s };
        let lead = match self.shown {
            Some((last_s, shown)) if (known - shown).abs() < STEP_S => {
                let most = SLEW * (own_s - last_s).max(0.0);
                shown + (known - shown).clamp(-most, most)
            }
            _ => known,
        };
        self.shown = Some((own_s, lead));
        own_s - lead
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
        // After a break of a minute, messages of a clock that was set by 5 s are all that is known.
        clock.heard(100.0, 1105.0);
        assert!((clock.at(101.0) - 1106.0).abs() < 1e-9);
        assert!(clock.buckets.len() <= 31);
    }

    #[test]
    fn a_faster_message_does_not_make_the_time_jump() {
        let mut clock = DeviceClock::default();
        clock.heard(0.010, 0.0);
        let before = clock.at(1.0);
        clock.heard(1.001, 1.0);
        let after = clock.at(2.0);
        assert!((after - before - 1.0).abs() < 1e-4, "{before} {after}");
        // It is there in the end.
        assert!((clock.at(1000.0) - 999.999).abs() < 1e-9);
    }
}
