//! A thread for long computations where only the newest matters.

use std::io;
use std::sync::Arc;

use handeye_coppeliasim::CancelToken;

use super::channels::{Bell, LatestSlot};
use super::started::Started;

/// Runs one job at a time. A submitted job replaces the waiting one and cancels the running one, so that the answer to
/// the newest question comes as soon as possible.
pub struct NewestWins<Job> {
    jobs: Arc<LatestSlot<(Job, CancelToken)>>,
    wake: Option<Bell>,
    running: CancelToken,
}

impl<Job: Send + 'static> NewestWins<Job> {
    /// Starts the thread; `work` is called for one job after the other.
    ///
    /// # Errors
    /// When the system cannot start more threads.
    pub fn start(name: &str, mut work: impl FnMut(Job, &CancelToken) + Send + 'static) -> io::Result<(Self, Started)> {
        let jobs: Arc<LatestSlot<(Job, CancelToken)>> = Arc::default();
        let (wake, woken) = Bell::new();
        let waiting = Arc::clone(&jobs);
        let started = Started::spawn(name, move || {
            while woken.recv().is_ok() {
                if let Some(((job, cancel), _replaced)) = waiting.take()
                    && !cancel.is_cancelled()
                {
                    work(job, &cancel);
                }
            }
        })?;
        Ok((Self { jobs, wake: Some(wake), running: CancelToken::default() }, started))
    }

    /// Hands in a job.
    pub fn submit(&mut self, job: Job) {
        self.cancel();
        self.running = CancelToken::default();
        self.jobs.put((job, self.running.clone()));
        if self.wake.as_ref().is_some_and(|wake| !wake.ring()) {
            tracing::error!("a worker has ended before the application");
        }
    }

    /// Cancels the running and the waiting job.
    pub fn cancel(&self) {
        self.running.cancel();
    }

    /// Cancels, and makes the thread end.
    pub fn end(&mut self) {
        self.cancel();
        self.wake = None;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use crossbeam_channel::bounded;

    use super::*;

    const SOON: Duration = Duration::from_secs(20);

    #[test]
    fn the_newest_job_cancels_the_running_one_and_replaces_the_waiting_ones() {
        let (began, beginnings) = bounded(16);
        let (ended, endings) = bounded(16);
        let (release, released) = bounded::<()>(1);
        let (mut worker, started) = NewestWins::start("test", move |job: u32, cancel: &CancelToken| {
            began.send(job).expect("the test listens");
            if job == 0 {
                // Not before the last one waits, or a fast thread begins those between.
                released.recv_timeout(SOON).expect("the test goes on");
            }
            ended.send((job, cancel.is_cancelled())).expect("the test listens");
        })
        .expect("a thread");
        worker.submit(0);
        assert_eq!(beginnings.recv_timeout(SOON), Ok(0));
        for job in 1..=3 {
            worker.submit(job);
        }
        release.send(()).expect("job 0 waits");
        assert_eq!(endings.recv_timeout(SOON), Ok((0, true)), "the first job was cancelled");
        assert_eq!(endings.recv_timeout(SOON).map(|(job, _)| job), Ok(3), "jobs 1 and 2 were never begun");
        worker.end();
        assert!(started.join_until(std::time::Instant::now() + SOON));
    }
}
