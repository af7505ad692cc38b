//! What lasts: entries in their order; a newer one may make an older one obsolete.

use std::collections::VecDeque;
use std::mem::discriminant;
use std::path::PathBuf;

use handeye_workbench::recording::Entry;

/// Calibrations that are kept. Each may hold residuals of a thousand images.
const MAX_SOLVED: usize = 64;

/// Messages that are kept.
const MAX_MESSAGE: usize = 1000;

/// States of the robot that are kept as its trail.
const MAX_TRAIL: usize = 2048;

/// Simulated time between two states of the trail, at first \[s\].
const TRAIL_STEP_S: f64 = 0.2;

/// A recording: what its streams have in common.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recording {
    /// By which viewers recognize streams that belong together.
    pub id: String,
    /// For display.
    pub name: String,
    /// The folder of the session, once there is one.
    pub folder: Option<PathBuf>,
}

/// Something to write.
#[derive(Debug, Clone)]
pub enum Item {
    /// From here on it is a different recording.
    Begin(Recording),
    /// Its name changes to this.
    Name(String),
    Entry(Entry),
}

/// Whether an entry is only of interest while it is new.
pub fn is_live(entry: &Entry) -> bool {
    matches!(entry, Entry::Robot { .. } | Entry::Image { .. } | Entry::Detection(_) | Entry::Tracked(_))
}

/// Entries that last. The list stays short in any case: a newer document, selection or step replaces the older one, and
/// so does a newer detection in the same capture.
#[derive(Debug, Clone, Default)]
pub struct Lasting {
    items: VecDeque<Item>,
}

impl Lasting {
    /// Adds what comes after everything else.
    pub fn push(&mut self, item: Item) {
        self.items.push_back(item);
    }

    /// Adds an entry.
    pub fn put(&mut self, entry: Entry) {
        // What belongs to an earlier recording is not touched.
        let begin = self.items.iter().rposition(|item| matches!(item, Item::Begin(_))).map_or(0, |at| at + 1);
        if let Entry::Document { document, .. } = &entry {
            let gone = |item: &Item| match item {
                Item::Entry(Entry::Observed { id, .. }) => document.capture(*id).is_none(),
                _ => false,
            };
            let mut at = 0;
            self.items.retain(|item| {
                at += 1;
                at <= begin || !gone(item)
            });
        }
        let mut present = self.items.iter_mut().skip(begin);
        if let Some(older) = present.find(|item| matches!(item, Item::Entry(older) if replaces(&entry, older))) {
            *older = Item::Entry(entry);
            return;
        }
        let limit = match &entry {
            Entry::Solved(_) => MAX_SOLVED,
            Entry::Message { .. } => MAX_MESSAGE,
            _ => usize::MAX,
        };
        self.make_room(&entry, limit);
        self.items.push_back(Item::Entry(entry));
    }

    /// Drops the oldest of a kind if the limit is reached.
    fn make_room(&mut self, entry: &Entry, limit: usize) {
        let alike = |item: &Item| matches!(item, Item::Entry(other) if discriminant(other) == discriminant(entry));
        if limit < usize::MAX
            && self.items.iter().filter(|item| alike(item)).count() >= limit
            && let Some(oldest) = self.items.iter().position(alike)
        {
            self.items.remove(oldest);
        }
    }

    /// The oldest.
    pub fn pop(&mut self) -> Option<Item> {
        self.items.pop_front()
    }

    /// In their order.
    pub fn iter(&self) -> impl Iterator<Item = &Item> {
        self.items.iter()
    }

    /// Keeps what applies to every recording: the cell, and what the window shows.
    pub fn begin_another(&mut self) {
        self.items.retain(|item| matches!(item, Item::Entry(Entry::Cell(_) | Entry::KeepOut { .. } | Entry::Step(_))));
    }
}

/// Whether an entry makes an older one obsolete.
fn replaces(entry: &Entry, older: &Entry) -> bool {
    match (entry, older) {
        (Entry::Observed { id, .. }, Entry::Observed { id: other, .. }) => id == other,
        (Entry::Cell(_), Entry::Cell(_))
        | (Entry::Document { .. }, Entry::Document { .. })
        | (Entry::KeepOut { .. }, Entry::KeepOut { .. })
        | (Entry::Planned(_), Entry::Planned(_))
        | (Entry::Selected(_), Entry::Selected(_))
        | (Entry::Step(_), Entry::Step(_)) => true,
        _ => false,
    }
}

/// Where the robot has been, coarser the longer it takes.
#[derive(Debug, Clone)]
pub struct Trail {
    states: Vec<Entry>,
    last_s: f64,
    step_s: f64,
}

impl Default for Trail {
    fn default() -> Self {
        Self { states: Vec::new(), last_s: f64::NEG_INFINITY, step_s: TRAIL_STEP_S }
    }
}

impl Trail {
    /// Takes in a state of the robot, if it is not too close to the one before.
    pub fn put(&mut self, entry: &Entry) {
        let Entry::Robot { sim_time_s, .. } = entry else { return };
        // Simulated time that jumps back belongs to another run.
        if (self.last_s..self.last_s + self.step_s).contains(sim_time_s) {
            return;
        }
        if self.states.len() == MAX_TRAIL {
            let mut even = false;
            self.states.retain(|_| {
                even = !even;
                even
            });
            self.step_s *= 2.0;
        }
        self.last_s = *sim_time_s;
        self.states.push(entry.clone());
    }

    /// Oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Entry> {
        self.states.iter()
    }
}

#[cfg(test)]
#[path = "lasting_tests.rs"]
mod tests;
