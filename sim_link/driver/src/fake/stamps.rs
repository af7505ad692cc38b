//! Stamps of simulated instants on a steady clock.

use std::collections::VecDeque;
use std::time::Instant;

/// How long an observation counts \[s\]: simulated time falls behind permanently when the machine is busy.
const MEMORY_S: f64 = 1.0;

/// The clock of a fake driver, and how simulated time runs relative to it.
#[derive(Debug)]
pub struct Stamps {
    began: Instant,
    ahead_s: f64,
    /// When simulated time was seen, and by how much the clock was ahead of it.
    seen: VecDeque<(f64, f64)>,
    newest_s: f64,
}

impl Stamps {
    /// A clock that begins at `ahead_s`.
    pub fn new(ahead_s: f64) -> Self {
        Self { began: Instant::now(), ahead_s, seen: VecDeque::new(), newest_s: f64::NEG_INFINITY }
    }

    /// The clock \[s\].
    pub fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64() + self.ahead_s
    }

    /// Takes in that this simulated time is over.
    pub fn see(&mut self, sim_time_s: f64) {
        let now_s = self.now_s();
        self.seen.retain(|(at_s, _)| now_s - at_s <= MEMORY_S);
        self.seen.push_back((now_s, now_s - sim_time_s));
    }

    /// The stamp of a simulated instant. It was seen late by as much as the look took, so the earliest sight counts.
    pub fn stamp(&self, sim_time_s: f64) -> f64 {
        let late_s = self.seen.iter().map(|(_, late_s)| *late_s).fold(f64::INFINITY, f64::min);
        if late_s.is_finite() { (sim_time_s + late_s).min(self.now_s()) } else { self.now_s() }
    }

    /// The stamp of the newest state, never before the one before it.
    pub fn next(&mut self, sim_time_s: f64) -> f64 {
        self.newest_s = self.stamp(sim_time_s).max(self.newest_s);
        self.newest_s
    }
}
