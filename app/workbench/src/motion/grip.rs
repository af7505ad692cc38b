//! What the user holds down at a page of a browser, as known to the thread that listens to the page: the dead man's
//! switch of a held jog, which must not wait for a frame.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What is held down moves nothing any more when the page was silent for this long. Pages report it every 50 ms, so
/// three reports can be missed.
pub const SILENCE: Duration = Duration::from_millis(200);

/// Whether what the window takes for held is held. The window draws past input; in between it may have been released.
#[derive(Debug, Default)]
pub struct Grip {
    inner: Mutex<Inner>,
}

/// How often what is held was released.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Times {
    /// In total.
    pub let_go: u64,
    /// Because of too long a silence.
    pub silent: u64,
}

#[derive(Debug, Default)]
struct Inner {
    /// When the driving page last reported; `None` without pages, where the window itself receives the input.
    heard: Option<Instant>,
    times: Times,
    /// How often something had been released when the window last looked.
    known: u64,
    /// The silence was too long, and that is counted.
    is_silent: bool,
}

impl Grip {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The driving page has reported.
    pub fn hear(&self, now: Instant) {
        let mut inner = self.inner();
        inner.count_silence(now);
        inner.heard = Some(now);
        inner.is_silent = false;
    }

    /// Something was released.
    pub fn let_go(&self) {
        self.inner().times.let_go += 1;
    }

    /// How often something was released so far.
    pub fn times(&self, now: Instant) -> Times {
        let mut inner = self.inner();
        inner.count_silence(now);
        inner.times
    }

    /// Whether the driving page was silent for too long.
    pub fn is_silent(&self, now: Instant) -> bool {
        let mut inner = self.inner();
        inner.count_silence(now);
        inner.is_silent
    }

    /// What the window does from now on takes this many releases into account.
    pub fn know(&self, times: Times) {
        let mut inner = self.inner();
        inner.known = inner.known.max(times.let_go);
    }

    /// Whether what the window takes for held is held.
    pub(crate) fn is_firm(&self, now: Instant) -> bool {
        let mut inner = self.inner();
        inner.count_silence(now);
        !inner.is_silent && inner.known == inner.times.let_go
    }
}

impl Inner {
    /// Too long a silence counts as a release, even if the page reports again before anybody looks.
    fn count_silence(&mut self, now: Instant) {
        if !self.is_silent && self.heard.is_some_and(|heard| now.saturating_duration_since(heard) > SILENCE) {
            self.is_silent = true;
            self.times.let_go += 1;
            self.times.silent += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn without_pages_the_window_knows_what_is_held() {
        assert!(Grip::default().is_firm(Instant::now()));
    }

    #[test]
    fn what_was_let_go_is_not_held_until_the_window_knows() {
        let (grip, now) = (Grip::default(), Instant::now());
        grip.hear(now);
        assert!(grip.is_firm(now));
        grip.let_go();
        assert!(!grip.is_firm(now));
        let times = grip.times(now);
        grip.let_go();
        grip.know(times);
        assert!(!grip.is_firm(now), "the window knows of the first alone");
        grip.know(grip.times(now));
        assert!(grip.is_firm(now));
    }

    #[test]
    fn a_page_that_is_heard_again_has_let_go_all_the_same() {
        let (grip, began) = (Grip::default(), Instant::now());
        grip.hear(began);
        grip.hear(began + SILENCE);
        assert!(grip.is_firm(began + 2 * SILENCE), "nothing was missed");
        let back = began + 2 * SILENCE + MS;
        assert!(!grip.is_firm(back) && grip.is_silent(back));
        grip.hear(back);
        assert!(!grip.is_silent(back) && !grip.is_firm(back));
        // Nobody looked while it was silent.
        assert_eq!(grip.times(back), Times { let_go: 1, silent: 1 });
        grip.know(grip.times(back));
        assert!(grip.is_firm(back));
        grip.hear(back + SILENCE + MS);
        assert!(!grip.is_firm(back + SILENCE + MS));
    }
}
