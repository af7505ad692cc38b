//! How often something comes.

use std::collections::VecDeque;

/// Number of arrivals over which the rate is measured.
const ARRIVALS: usize = 20;

/// A gap this long \[s\] restarts the measurement.
const GAP_S: f64 = 2.0;

/// Arrivals per second, from the times at which they came.
#[derive(Debug, Default)]
pub struct RateMeter {
    arrivals_s: VecDeque<f64>,
}

impl RateMeter {
    /// One has come.
    pub fn arrived(&mut self, at_s: f64) {
        if self.arrivals_s.back().is_some_and(|last_s| at_s - last_s > GAP_S) {
            self.arrivals_s.clear();
        }
        if self.arrivals_s.len() == ARRIVALS {
            self.arrivals_s.pop_front();
        }
        self.arrivals_s.push_back(at_s);
    }

    /// 0 before the second one.
    pub fn rate_hz(&self) -> f64 {
        match (self.arrivals_s.front(), self.arrivals_s.back()) {
            (Some(first_s), Some(last_s)) if last_s > first_s => {
                (self.arrivals_s.len() - 1) as f64 / (last_s - first_s)
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_present_stream() {
        let mut rate = RateMeter::default();
        rate.arrived(0.0);
        assert_eq!(rate.rate_hz(), 0.0);
        for i in 0..50 {
            rate.arrived(100.0 + f64::from(i) * 0.04);
        }
        assert!((rate.rate_hz() - 25.0).abs() < 1e-9, "{}", rate.rate_hz());
    }
}
