//! Values at instants, and between them.

use std::collections::VecDeque;

use nalgebra::Isometry3;

/// Values that are kept: a second of the fastest stream that there is.
const MOST: usize = 512;

/// What a quantity was of late.
#[derive(Debug)]
pub(super) struct Samples<T> {
    values: VecDeque<(f64, T)>,
}

impl<T> Default for Samples<T> {
    fn default() -> Self {
        Self { values: VecDeque::new() }
    }
}

impl<T> Samples<T> {
    /// Takes a value. One that is older than the newest begins anew: a clock was set back, as a replay does.
    pub fn push(&mut self, at_s: f64, value: T) {
        match self.last_s() {
            Some(last) if at_s == last => {
                self.values.pop_back();
            }
            Some(last) if at_s < last => self.values.clear(),
            _ => {}
        }
        if self.values.len() == MOST {
            self.values.pop_front();
        }
        self.values.push_back((at_s, value));
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.values.clear();
    }

    /// When the newest was.
    pub fn last_s(&self) -> Option<f64> {
        self.values.back().map(|(at, _)| *at)
    }

    /// The newest.
    pub fn last(&self) -> Option<&T> {
        self.values.back().map(|(_, value)| value)
    }

    /// At an instant that lies among them.
    pub fn at(&self, at_s: f64, between: impl Fn(&T, &T, f64) -> T) -> Option<T> {
        let after = self.values.partition_point(|(at, _)| *at < at_s);
        let (right_s, right) = self.values.get(after)?;
        let Some((left_s, left)) = after.checked_sub(1).and_then(|before| self.values.get(before)) else {
            return (*right_s == at_s).then(|| between(right, right, 0.0));
        };
        Some(between(left, right, (at_s - left_s) / (right_s - left_s)))
    }
}

/// On the straight line, turning evenly about one axis.
pub(super) fn between(left: &Isometry3<f64>, right: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    let turn = left.rotation.rotation_to(&right.rotation);
    let translation = left.translation.vector.lerp(&right.translation.vector, share);
    Isometry3::from_parts(translation.into(), turn.powf(share) * left.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_interpolated_among_the_samples_and_nowhere_else() {
        let mut samples = Samples::default();
        let line = |a: &f64, b: &f64, share: f64| a + (b - a) * share;
        assert_eq!(samples.at(1.0, line), None);
        samples.push(1.0, 10.0);
        samples.push(3.0, 30.0);
        assert_eq!(samples.at(0.9, line), None);
        assert_eq!(samples.at(1.0, line), Some(10.0));
        assert_eq!(samples.at(2.5, line), Some(25.0));
        assert_eq!(samples.at(3.0, line), Some(30.0));
        assert_eq!(samples.at(3.1, line), None);
        samples.push(0.5, 5.0);
        assert_eq!(samples.at(1.0, line), None, "the clock went back");
        for i in 0..10_000 {
            samples.push(f64::from(i), 0.0);
        }
        assert_eq!(samples.values.len(), MOST);
    }
}
