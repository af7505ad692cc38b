//! Signals that ask the window to end: it closes as if the user had closed it.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use handeye_workbench::worker::{StopLine, Waker};

/// This long after a signal the program ends in any case: service managers wait for a few seconds and then kill it.
const LIMIT: Duration = Duration::from_millis(1900);

/// Whether the system has requested the end (SIGINT, SIGTERM, SIGHUP).
#[derive(Default)]
pub struct Signals {
    asked: OnceLock<()>,
    heeds: OnceLock<(Arc<StopLine>, Waker)>,
}

impl Signals {
    /// Starts to listen, on a thread of its own.
    pub fn listen() -> Arc<Self> {
        let signals = Arc::new(Self::default());
        let heard = Arc::clone(&signals);
        if let Err(error) = ctrlc::set_handler(move || heard.asked()) {
            tracing::warn!(%error, "a signal will end the program at once");
        }
        signals
    }

    /// The first signal counts; others find the thread already waiting.
    fn asked(&self) {
        self.hear();
        std::thread::sleep(LIMIT);
        tracing::error!("the window did not close in time; what was captured is on the disk");
        std::process::exit(1);
    }

    /// The arm is braked here: the window may be busy with a frame.
    fn hear(&self) {
        let _first = self.asked.set(()).is_ok();
        if let Some((stop, waker)) = self.heeds.get() {
            stop.press_if_moving();
            waker();
        }
    }

    /// What a signal stops, and the window that it wakes.
    pub fn lead_to(&self, stop: Arc<StopLine>, waker: Waker) {
        let _first = self.heeds.set((stop, waker)).is_ok();
    }

    /// Whether there was one.
    pub fn is_asked(&self) -> bool {
        self.asked.get().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::model::{MotionGoal, MotionId, MotionRequest};
    use handeye_workbench::motion::desk::{MotionQueue, MotionTask, Work};
    use handeye_workbench::motion::stop_line::Ends;

    #[test]
    fn a_signal_ends_what_moves_whatever_the_window_does() {
        let (stop, waker): (Arc<StopLine>, Waker) = (Arc::default(), Arc::new(|| {}));
        let desk = Arc::new(MotionQueue::new(Arc::clone(stop.grip()), Arc::clone(&waker)));
        stop.lead_to(Ends { desk: Arc::clone(&desk), wake_control: Box::new(|| {}), clock: Arc::new(|| 0.0) });
        let signals = Signals::default();
        signals.lead_to(Arc::clone(&stop), waker);
        desk.connected();
        let goal = MotionGoal::Joints([0.0; 6].into());
        desk.ask(MotionTask::Move(MotionRequest { id: MotionId(1), goal, speed: 1.0, correction: None }), &stop);
        let Work::Motion(_, cancel) = desk.take(0.0) else { panic!("no motion") };
        signals.hear();
        assert!(signals.is_asked() && cancel.is_cancelled() && stop.is_barred());
    }
}
