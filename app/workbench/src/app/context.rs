//! What the handlers of features work on.

use std::collections::VecDeque;
use std::sync::Arc;

use handeye_coppeliasim::cell::CellPaths;
use handeye_link::{Cell, CellSource};

use crate::command::Event;
use crate::model::Model;
use crate::motion::state::MotionId;
use crate::session::desk::SessionThreads;
use crate::solve::question::Question;
use crate::solve::state::JobId;
use crate::worker::shared::{Clock, Waker};
use crate::worker::threads::Workers;

/// Makes what connects to a cell.
pub type Connect = Arc<dyn Fn(&CellSource, &CellPaths) -> Arc<dyn Cell> + Send + Sync>;

/// The model and what works for it. A handler takes only the parts that it needs, so that its signature shows what it can
/// change and whom it can ask; it takes all of it where it lets other features continue.
pub(crate) struct Context {
    pub(crate) model: Model,
    /// The threads that talk to the cell; they are replaced when another cell is chosen.
    pub(crate) workers: Workers,
    pub(crate) desk: SessionThreads,
    pub(crate) numbers: Numbers,
    /// Events that handlers report themselves; they are taken in next.
    pub(crate) reported: VecDeque<Event>,
}

impl Context {
    /// Has an event taken in as soon as the present command or event is done.
    pub(crate) fn report(&mut self, event: impl Into<Event>) {
        self.reported.push_back(event.into());
    }
}

/// What a connection is started with.
pub(crate) struct Connector {
    pub(crate) connect: Connect,
    pub(crate) clock: Clock,
    /// Has the window drawn again.
    pub(crate) waker: Waker,
}

/// Numbers of the newest requests, used to recognize late answers.
#[derive(Debug, Default)]
pub(crate) struct Numbers {
    pub(crate) capture: u64,
    pub(crate) job: JobId,
    pub(crate) motion: MotionId,
    /// The motion that follows the board.
    pub(crate) follow: Option<MotionId>,
    /// The request for verification poses that is not answered yet.
    pub(crate) plan: Option<MotionId>,
    /// The request for a view that the user should bring about.
    pub(crate) view: u64,
    /// The request about a recording.
    pub(crate) import: u64,
    /// The question that the solver was asked.
    pub(crate) asked: Option<Question>,
}
