//! What the handlers of features work on.

use crate::app::Connect;
use crate::model::{JobId, Model, MotionId};
use crate::solve::question::Question;
use crate::worker::{Clock, SessionThreads, Waker, Workers};

/// The model and those that work for it. A handler takes of it what it needs, so that its signature says what it can change
/// and whom it can ask; it takes all of it where it has other features go on.
pub(crate) struct Context {
    pub(crate) model: Model,
    /// The threads that talk to the cell; others take their place when another cell is chosen.
    pub(crate) workers: Workers,
    pub(crate) desk: SessionThreads,
    pub(crate) numbers: Numbers,
}

/// What a connection is begun with.
pub(crate) struct Connector {
    pub(crate) connect: Connect,
    pub(crate) clock: Clock,
    /// Has the window drawn again.
    pub(crate) waker: Waker,
}

/// What was asked for last, by which late answers are told apart.
#[derive(Debug, Default)]
pub(crate) struct Numbers {
    pub(crate) capture: u64,
    pub(crate) job: JobId,
    pub(crate) motion: MotionId,
    /// The motion that follows the board.
    pub(crate) follow: Option<MotionId>,
    /// The request for poses to verify at that is not answered yet.
    pub(crate) plan: Option<MotionId>,
    /// The request for a view for a person to bring about.
    pub(crate) view: u64,
    /// The request about a recording.
    pub(crate) import: u64,
    /// The question that the solver was asked.
    pub(crate) asked: Option<Question>,
}
