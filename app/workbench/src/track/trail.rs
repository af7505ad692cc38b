//! Where the tip went.

use std::collections::VecDeque;

/// Points that are kept: at the speed of jogging half a minute, at rest for ever.
pub const MAX_TRAIL_POINTS: usize = 600;

/// Points closer than this to the last one are the same place [m]: a few of them make a point on a screen.
const LEAST_STEP_M: f64 = 2e-3;

/// The newest part of the path of the tip.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trail {
    points_m: VecDeque<[f64; 3]>,
}

impl Trail {
    /// The tip is at a point of the base now \[m\]. Keeps it where the tip has moved; values that are not finite are
    /// ignored.
    pub(crate) fn add(&mut self, point_m: [f64; 3]) {
        let is_same = |last: &[f64; 3]| {
            let square: f64 = last.iter().zip(point_m).map(|(last, now)| (last - now).powi(2)).sum();
            square < LEAST_STEP_M * LEAST_STEP_M
        };
        if !point_m.iter().all(|value| value.is_finite()) || self.points_m.back().is_some_and(is_same) {
            return;
        }
        while self.points_m.len() >= MAX_TRAIL_POINTS {
            self.points_m.pop_front();
        }
        self.points_m.push_back(point_m);
    }

    /// The points in the base \[m\], oldest first.
    pub fn points_m(&self) -> impl DoubleEndedIterator<Item = [f64; 3]> + ExactSizeIterator + '_ {
        self.points_m.iter().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tip_that_rests_adds_no_points_and_one_that_moves_adds_its_newest_path() {
        let mut trail = Trail::default();
        for _ in 0..50 {
            trail.add([0.1, 0.2, 0.3]);
        }
        trail.add([0.1, 0.2, 0.3 + 0.5 * LEAST_STEP_M]);
        assert_eq!(trail.points_m().collect::<Vec<_>>(), [[0.1, 0.2, 0.3]]);
        trail.add([f64::NAN, 0.0, 0.0]);
        assert_eq!(trail.points_m().len(), 1);
        for n in 0..2 * MAX_TRAIL_POINTS {
            trail.add([0.01 * n as f64, 0.0, 0.0]);
        }
        assert_eq!(trail.points_m().len(), MAX_TRAIL_POINTS);
        let last = 0.01 * (2 * MAX_TRAIL_POINTS - 1) as f64;
        assert_eq!(trail.points_m().next_back(), Some([last, 0.0, 0.0]));
    }
}
