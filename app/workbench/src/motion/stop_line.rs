//! The path of a stop to the arm, from every thread.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::desk::MotionQueue;
use super::grip::Grip;
use crate::worker::channels::Counter;
use crate::worker::shared::Clock;

/// Stops the arm from any thread. Nothing in here waits: a stop is a count that the control worker looks at before anything
/// else, and it takes precedence until the arm has been stopped, over every connection and every cell.
///
/// A stop that does not come from the thread that draws takes precedence over what that thread still does: what the user
/// requested before it, and a sequence that continues by itself. Until that thread has handled the stop, nothing that
/// moves begins.
#[derive(Default)]
pub struct StopLine {
    stops: Counter,
    /// Those pressed by threads other than the one that draws, done when that one has handled them.
    outside: Counter,
    ends: Mutex<Option<Ends>>,
    grip: Arc<Grip>,
}

/// What a stop reaches in the current cell.
pub struct Ends {
    /// The motions that wait.
    pub desk: Arc<MotionQueue>,
    /// Wakes the thread that controls the simulation, without waiting for it.
    pub wake_control: Box<dyn Fn() + Send + Sync>,
    /// The time of the window.
    pub clock: Clock,
}

impl StopLine {
    /// What the user holds down at a page.
    pub fn grip(&self) -> &Arc<Grip> {
        &self.grip
    }

    /// Asks for a stop. What this program moves ends at once, and nothing is left that could begin afterwards.
    pub(crate) fn press(&self) {
        self.stops.ask();
        if let Some(ends) = self.ends().as_ref() {
            ends.desk.cancel((ends.clock)());
            (ends.wake_control)();
        }
    }

    /// The same from a thread that does not draw; returns the number that [`Self::note`] takes.
    pub fn press_outside(&self) -> u64 {
        let number = self.outside.ask();
        self.press();
        number
    }

    /// The same when this program moves the arm; it does not stop motions of others.
    pub fn press_if_moving(&self) {
        let is_moving = self.ends().as_ref().is_some_and(|ends| ends.desk.is_busy((ends.clock)()));
        if is_moving {
            self.press_outside();
        }
    }

    /// How many stops were pressed outside of the thread that draws.
    pub(crate) fn outside(&self) -> u64 {
        self.outside.asked()
    }

    /// The thread that draws has handled this many of them: what it requests from now on was requested after them.
    pub(crate) fn note(&self, number: u64) {
        self.outside.finish(number);
    }

    /// Whether a stop is requested and not done.
    pub fn is_pressed(&self) -> bool {
        self.wanted().is_some()
    }

    /// Whether nothing that moves may begin now.
    pub fn is_barred(&self) -> bool {
        self.is_pressed() || self.outside.open().is_some()
    }

    /// The number of the newest stop that is not done.
    pub(crate) fn wanted(&self) -> Option<u64> {
        self.stops.open()
    }

    /// Stops up to this one are done. One that was pressed meanwhile is not.
    pub(crate) fn finish(&self, number: u64) {
        self.stops.finish(number);
    }

    /// From now on a stop reaches these ends.
    pub fn lead_to(&self, ends: Ends) {
        *self.ends() = Some(ends);
    }

    /// A stop does not reach these any more, unless they were already replaced.
    pub(crate) fn lead_away_from(&self, desk: &Arc<MotionQueue>) {
        self.ends().take_if(|ends| Arc::ptr_eq(&ends.desk, desk));
    }

    fn ends(&self) -> MutexGuard<'_, Option<Ends>> {
        self.ends.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_bars_the_arm_until_it_is_done_and_the_window_has_taken_note() {
        let line = StopLine::default();
        assert!(!line.is_barred());
        let number = line.press_outside();
        line.finish(line.wanted().expect("it is asked for"));
        assert!(!line.is_pressed() && line.is_barred(), "the window may still do what was asked for before");
        line.note(number);
        assert!(!line.is_barred());
        let (first, second) = (line.press_outside(), line.press_outside());
        line.finish(2);
        line.note(first);
        assert!(line.is_pressed() && line.is_barred());
        line.finish(3);
        assert!(line.is_barred(), "one is left to take note of");
        line.note(second);
        assert!(!line.is_barred());
    }

    #[test]
    fn a_stop_of_the_thread_that_draws_needs_no_note() {
        let line = StopLine::default();
        line.press();
        assert!(line.is_barred());
        line.finish(1);
        assert!(!line.is_barred());
    }
}
