//! What a writing thread has yet to write. A sender waits only if nothing may be dropped.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::lasting::{Item, Lasting};
use handeye_workbench::recording::Entry;

/// A writer that is later than this has dropped entries because it was slow, and not because they were not wanted.
const SLOW: Duration = Duration::from_millis(500);

/// A writer that takes nothing for this long hangs, and is no longer waited for.
const STUCK: Duration = Duration::from_secs(10);

/// How much of one kind of live entries is written.
#[derive(Debug, Clone, Copy)]
pub struct Rate {
    /// Entries that may wait; a newer one replaces the oldest.
    pub capacity: usize,
    /// Minimum time between two that are written.
    pub period: Duration,
}

impl Rate {
    /// The newest one, once per period.
    pub const fn newest_every(period: Duration) -> Self {
        Self { capacity: 1, period }
    }

    /// All of them, as long as at most this many wait.
    pub const fn all(capacity: usize) -> Self {
        Self { capacity, period: Duration::ZERO }
    }
}

/// How much of every kind of live entries is written.
#[derive(Debug, Clone, Copy)]
pub struct Rates {
    /// States of the robot.
    pub robot: Rate,
    /// Live images.
    pub image: Rate,
    /// The board in live images.
    pub detection: Rate,
    /// The board as it is tracked.
    pub tracked: Rate,
    /// Whether senders wait for the writer, so that everything is written, in its order.
    pub waits: bool,
}

/// The next work of the writing thread.
#[derive(Debug)]
pub enum Next {
    /// Something that lasts.
    Lasting(Item),
    /// Something live.
    Live(Entry),
    /// Nothing within the requested time.
    Idle,
    /// Nothing, ever again.
    End,
}

#[derive(Debug)]
pub struct Queue {
    state: Mutex<State>,
    bell: Condvar,
    /// Notified when the writer has taken something, for senders that wait.
    taken: Condvar,
    waits: bool,
}

#[derive(Debug)]
struct State {
    lasting: Lasting,
    lanes: [Lane; 4],
    arrivals: u64,
    left_out: u64,
    ended: bool,
}

/// Live entries of one kind.
#[derive(Debug)]
struct Lane {
    rate: Rate,
    waiting: VecDeque<(u64, Entry)>,
    due: Instant,
}

impl Queue {
    /// With nothing to do yet.
    pub fn new(rates: &Rates) -> Self {
        let now = Instant::now();
        let Rates { robot, image, detection, tracked, waits } = *rates;
        let lanes = [robot, image, detection, tracked].map(|rate| Lane { rate, waiting: VecDeque::new(), due: now });
        let state = State { lasting: Lasting::default(), lanes, arrivals: 0, left_out: 0, ended: false };
        Self { state: Mutex::new(state), bell: Condvar::new(), taken: Condvar::new(), waits }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an entry.
    pub fn put(&self, entry: Entry) {
        let mut state = self.state();
        if self.waits {
            let is_full = |state: &mut State| !state.is_empty() && !state.ended;
            let waited = self.taken.wait_timeout_while(state, STUCK, is_full);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let left_out = match lane_of(&entry) {
            None => {
                state.lasting.put(entry);
                None
            }
            Some(lane) => state.put_live(lane, entry),
        };
        drop(state);
        self.bell.notify_one();
        // An image is megabytes: it is freed without holding the lock.
        drop(left_out);
    }

    /// Adds what comes after everything else that lasts.
    pub fn push(&self, item: Item) {
        self.state().lasting.push(item);
        self.bell.notify_one();
    }

    /// Live entries so far that were dropped because the writer was late.
    pub fn left_out(&self) -> u64 {
        self.state().left_out
    }

    /// Number of waiting entries.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        let state = self.state();
        state.lasting.iter().count() + state.lanes.iter().map(|lane| lane.waiting.len()).sum::<usize>()
    }

    /// Nothing more comes. What is there is still written.
    pub fn end(&self) {
        self.state().ended = true;
        self.bell.notify_all();
        self.taken.notify_all();
    }

    /// Waits for the next work, for at most this long.
    pub fn next(&self, patience: Duration) -> Next {
        let end = Instant::now() + patience;
        let mut state = self.state();
        loop {
            if let Some(item) = state.lasting.pop() {
                self.taken.notify_all();
                return Next::Lasting(item);
            }
            let now = Instant::now();
            if let Some(entry) = state.pop_live(now) {
                self.taken.notify_all();
                return Next::Live(entry);
            }
            if state.ended {
                return Next::End;
            }
            let until = state.next_due().map_or(end, |due| due.min(end));
            if now >= end {
                return Next::Idle;
            }
            let wait = until.saturating_duration_since(now);
            state = self.bell.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl State {
    fn is_empty(&self) -> bool {
        self.lasting.iter().next().is_none() && self.lanes.iter().all(|lane| lane.waiting.is_empty())
    }

    /// Returns what was dropped to make room.
    fn put_live(&mut self, lane: usize, entry: Entry) -> Option<(u64, Entry)> {
        self.arrivals += 1;
        let Lane { rate, waiting, due } = &mut self.lanes[lane];
        let left_out = if waiting.len() >= rate.capacity { waiting.pop_front() } else { None };
        if left_out.is_some() && due.elapsed() > SLOW {
            self.left_out += 1;
        }
        waiting.push_back((self.arrivals, entry));
        left_out
    }

    /// The oldest live entry whose time has come. At the end there is no reason to hold anything back.
    fn pop_live(&mut self, now: Instant) -> Option<Entry> {
        let ended = self.ended;
        let due = self.lanes.iter_mut().filter(|lane| ended || lane.due <= now);
        let lane = due.filter(|lane| !lane.waiting.is_empty()).min_by_key(|lane| lane.arrival())?;
        lane.due = now + lane.rate.period;
        lane.waiting.pop_front().map(|(_, entry)| entry)
    }

    fn next_due(&self) -> Option<Instant> {
        self.lanes.iter().filter(|lane| !lane.waiting.is_empty()).map(|lane| lane.due).min()
    }
}

impl Lane {
    fn arrival(&self) -> u64 {
        self.waiting.front().map_or(u64::MAX, |(arrival, _)| *arrival)
    }
}

fn lane_of(entry: &Entry) -> Option<usize> {
    match entry {
        Entry::Robot { .. } => Some(0),
        Entry::Image { .. } => Some(1),
        Entry::Detection(_) => Some(2),
        Entry::Tracked(_) => Some(3),
        _ => None,
    }
}

#[cfg(test)]
#[path = "queue_tests.rs"]
mod tests;
