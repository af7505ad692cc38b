//! The life of a worker: connect, work, and when the connection breaks, connect again, until it is requested to end.

use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError};
use handeye_coppeliasim::CancelToken;

use super::reconnect::Reconnect;
use super::{Clock, Waker};
use crate::command::Event;
use crate::connect::state::Link;
use crate::messages::state::Severity;
use crate::text::Text;
use crate::{connect, messages};
use handeye_link::{Cell, Connected, PortError};

/// A request to a worker.
#[derive(Debug)]
pub enum Request<Task> {
    /// Try to connect now.
    Reconnect,
    /// A request for what the worker does.
    Do(Task),
}

/// Where a worker reports to.
#[derive(Clone)]
pub struct Outlet {
    /// Changes of state, in order. A window that does not look (it may be hidden, or busy with a frame) makes the worker
    /// wait here once the channel is full. That of the control worker is never full: a stop never waits for the window. The
    /// channel closes when the application ends.
    pub events: Sender<Event>,
    /// Wakes the window.
    pub waker: Waker,
    /// The application's clock.
    pub clock: Clock,
}

impl Outlet {
    /// Reports an event.
    pub(crate) fn report(&self, event: impl Into<Event>) {
        let event = event.into();
        if self.events.send(event).is_err() {
            tracing::debug!("the window has gone");
        }
        (self.waker)();
    }

    /// Notifies the user.
    pub(crate) fn notice(&self, severity: Severity, text: Text) {
        self.report(messages::Event::Notice { severity, text });
    }

    /// The present time \[s\].
    pub(crate) fn now_s(&self) -> f64 {
        (self.clock)()
    }
}

/// What differs between the workers.
pub trait Duty: Send {
    /// The connection that it works with.
    type Port;
    /// What can be requested of it.
    type Task: Send;
    /// Which connection it is.
    const LINK: Link;

    /// Makes the connection.
    ///
    /// # Errors
    /// [`PortError`].
    fn connect(&mut self, connector: &dyn Cell, shutdown: &CancelToken) -> Result<Connected<Self::Port>, PortError>;

    /// One round of the regular work; returns how long to rest before the next.
    ///
    /// # Errors
    /// Whatever comes back ends the connection.
    fn turn(&mut self, port: &mut Self::Port, outlet: &Outlet) -> Result<Duration, PortError>;

    /// Carries out a request; `None` for the port while there is no connection.
    ///
    /// # Errors
    /// Whatever comes back ends the connection; a refusal by the cell is shown to the user as a notice.
    fn perform(&mut self, port: Option<&mut Self::Port>, task: Self::Task, outlet: &Outlet) -> Result<(), PortError>;
}

/// A worker with everything that it needs.
pub struct LinkLoop<'a, D: Duty> {
    /// What it does.
    pub duty: D,
    pub connector: &'a dyn Cell,
    /// Its requests; closed when the application ends.
    pub requests: Receiver<Request<D::Task>>,
    /// Where it reports to.
    pub outlet: Outlet,
    /// Raised when the application ends, so that calls under way return.
    pub shutdown: CancelToken,
}

/// The application ends.
struct Ended;

impl<D: Duty> LinkLoop<'_, D> {
    /// Works until the application ends.
    pub fn run(mut self, mut reconnect: Reconnect) {
        while !self.shutdown.is_cancelled() {
            self.report(reconnect.trying());
            let state = match self.duty.connect(self.connector, &self.shutdown) {
                Ok(Connected { mut port, address, server }) => {
                    self.report(reconnect.connected(address, server));
                    match self.serve(&mut port) {
                        Ok(Ended) => return,
                        Err(error) => reconnect.lost(&error, self.outlet.now_s()),
                    }
                }
                Err(error) => reconnect.failed(&error, self.outlet.now_s()),
            };
            if self.shutdown.is_cancelled() {
                return;
            }
            self.report(state);
            if let Err(Ended) = self.pause(reconnect.pause()) {
                return;
            }
        }
    }

    fn report(&self, state: crate::connect::state::LinkState) {
        tracing::debug!(link = ?D::LINK, ?state, "link");
        self.outlet.report(connect::Event::Link { link: D::LINK, state });
    }

    /// Works over one connection until it breaks.
    fn serve(&mut self, port: &mut D::Port) -> Result<Ended, PortError> {
        loop {
            let rest = self.duty.turn(port, &self.outlet)?;
            let mut request = self.requests.recv_timeout(rest);
            loop {
                match request {
                    Ok(Request::Do(task)) => self.duty.perform(Some(&mut *port), task, &self.outlet)?,
                    Ok(Request::Reconnect) | Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return Ok(Ended),
                }
                request = match self.requests.try_recv() {
                    Ok(next) => Ok(next),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => Err(RecvTimeoutError::Disconnected),
                };
            }
        }
    }

    /// Waits for the next try, or for the user to ask for it.
    fn pause(&mut self, pause: Option<Duration>) -> Result<(), Ended> {
        let deadline = pause.map(|pause| std::time::Instant::now() + pause);
        loop {
            let request = match deadline {
                Some(deadline) => self.requests.recv_deadline(deadline),
                None => self.requests.recv().map_err(|_closed| RecvTimeoutError::Disconnected),
            };
            match request {
                Ok(Request::Reconnect) | Err(RecvTimeoutError::Timeout) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(Ended),
                Ok(Request::Do(task)) => {
                    if let Err(error) = self.duty.perform(None, task, &self.outlet) {
                        tracing::debug!(?error, "a task without a connection");
                    }
                }
            }
        }
    }
}
