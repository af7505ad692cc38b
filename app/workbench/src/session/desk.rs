//! The threads that need no cell: archive, solver, observer, choice of views and files. They live as long as the application, whatever
//! it is connected to.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crossbeam_channel::{Receiver, Sender, bounded};

use super::archive::{Archive, ArchiveTask};
use crate::by_hand::worker::{HandJob, choose};
use crate::capture::Measured;
use crate::command::Event;
use crate::import::worker::{ImportJob, perform};
use crate::solve::observer::{self, ObserveJob};
use crate::solve::worker::SolveJob;
use crate::solve::worker::solve;
use crate::worker::channels::Requests;
use crate::worker::files::{self, FileTask};
use crate::worker::link::Outlet;
use crate::worker::newest::NewestWins;
use crate::worker::shared::{Busy, Clock, JOIN_DEADLINE, MAX_EVENTS, MAX_REQUESTS, POLL, Waker};
use crate::worker::started::Started;

/// Captures that may wait for the disk. The vision thread blocks when there are more, and so does the next capture.
const MAX_CAPTURES: usize = 4;

/// The application's end of these threads.
pub struct SessionThreads {
    archive: Requests<ArchiveTask>,
    captures: Sender<Measured>,
    files: Requests<FileTask>,
    observer: NewestWins<ObserveJob>,
    solver: NewestWins<SolveJob>,
    chooser: NewestWins<HandJob>,
    importer: NewestWins<ImportJob>,
    events: Receiver<Event>,
    sessions: PathBuf,
    threads: Vec<Started>,
}

impl SessionThreads {
    /// Starts the threads. New sessions go under `sessions`.
    ///
    /// # Errors
    /// When the system cannot start more threads.
    pub(crate) fn start(sessions: PathBuf, clock: &Clock, waker: &Waker) -> io::Result<Self> {
        let (event_sender, events) = bounded(MAX_EVENTS);
        let outlet = || Outlet { events: event_sender.clone(), waker: Arc::clone(waker), clock: Arc::clone(clock) };
        let (archive, archive_tasks) = Requests::with_limit(MAX_REQUESTS);
        let (captures, measured) = bounded(MAX_CAPTURES);
        let keeper = Archive::new(sessions.clone(), outlet());
        let archiving = Started::spawn("archive", move || keeper.run(&archive_tasks, &measured))?;
        let (files, file_tasks) = Requests::<FileTask>::with_limit(MAX_REQUESTS);
        let out = outlet();
        let filing = Started::spawn("files", move || {
            for task in &file_tasks {
                files::perform(task, &out);
            }
        })?;
        let out = outlet();
        let (observer, observing) =
            NewestWins::start("observer", move |job, cancel| observer::observe(&job, cancel, &out))?;
        let out = outlet();
        let (solver, solving) = NewestWins::start("solver", move |job, cancel| solve(&job, cancel, &out))?;
        let out = outlet();
        let (chooser, choosing) = NewestWins::start("views", move |job, cancel| choose(&job, cancel, &out))?;
        let out = outlet();
        let (importer, importing) = NewestWins::start("importer", move |job, cancel| perform(&job, cancel, &out))?;
        Ok(Self {
            archive,
            captures,
            files,
            observer,
            solver,
            chooser,
            importer,
            events,
            sessions,
            threads: vec![archiving, filing, observing, solving, choosing, importing],
        })
    }

    /// Hands over what was reported since the last time. Never waits.
    pub(crate) fn drain(&self, mut absorb: impl FnMut(Event)) {
        for event in self.events.try_iter().take(MAX_EVENTS) {
            absorb(event);
        }
    }

    /// Where captures are handed in.
    pub(crate) fn captures(&self) -> Sender<Measured> {
        self.captures.clone()
    }

    /// Where new sessions go.
    pub(crate) fn sessions(&self) -> &Path {
        &self.sessions
    }

    /// Asks the archive for something.
    ///
    /// # Errors
    /// [`Busy`] when the disk does not keep up.
    pub(crate) fn archive(&self, task: ArchiveTask) -> Result<(), Busy> {
        self.archive.ask(task)
    }

    /// Asks for reading or writing.
    ///
    /// # Errors
    /// [`Busy`] when the disk does not keep up.
    pub(crate) fn files(&self, task: FileTask) -> Result<(), Busy> {
        self.files.ask(task)
    }

    /// Has captures searched, these alone.
    pub(crate) fn observe(&mut self, job: ObserveJob) {
        self.observer.submit(job);
    }

    /// Has a set solved, this one alone.
    pub(crate) fn solve(&mut self, job: SolveJob) {
        self.solver.submit(job);
    }

    /// Has the next view chosen for a robot that is moved by hand.
    pub(crate) fn choose_view(&mut self, job: HandJob) {
        self.chooser.submit(job);
    }

    /// Looks at a recording.
    pub(crate) fn import(&mut self, job: ImportJob) {
        self.importer.submit(job);
    }

    /// Cancels the import.
    pub(crate) fn cancel_import(&self) {
        self.importer.cancel();
    }

    pub(crate) fn cancel_solve(&self) {
        self.solver.cancel();
    }

    /// Cancels what only computes.
    pub(crate) fn cancel_all(&self) {
        self.observer.cancel();
        self.solver.cancel();
        self.chooser.cancel();
        self.importer.cancel();
    }

    /// Ends the threads, and waits for them no longer than until `end`. What was handed to the archive is still written;
    /// everything else is cancelled. Called again it does nothing.
    pub(crate) fn end(&mut self, end: Instant) {
        // All parts by their names: one that is missing here would be waited for in vain.
        let Self { archive, captures: _, files, observer, solver, chooser, importer, events, sessions: _, threads } =
            self;
        observer.end();
        solver.end();
        chooser.end();
        importer.end();
        archive.close();
        files.close();
        for thread in threads.drain(..) {
            // A thread whose reports are not taken would wait for ever.
            while thread.is_running() && Instant::now() < end {
                let _dropped = events.recv_timeout(POLL).is_ok();
            }
            thread.join_until(end);
        }
    }
}

impl Drop for SessionThreads {
    fn drop(&mut self) {
        self.end(Instant::now() + JOIN_DEADLINE);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn threads_that_have_nothing_to_do_end_when_they_are_asked_to() {
        // Far more than they take on a busy machine: one that is not asked to end waits for all of it.
        const LONG: Duration = Duration::from_mins(2);
        let folder = tempfile::tempdir().expect("a folder");
        let clock: Clock = Arc::new(|| 0.0);
        let waker: Waker = Arc::new(|| {});
        let mut desk = SessionThreads::start(folder.path().to_path_buf(), &clock, &waker).expect("threads");
        let asked = Instant::now();
        desk.end(asked + LONG);
        assert!(asked.elapsed() < LONG / 2, "{:?}", asked.elapsed());
        assert!(desk.threads.is_empty());
    }
}
