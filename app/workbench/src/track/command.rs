//! Commands and events of tracking and following the board.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::text::Text;
use crate::track::state::{BoardMotion, FollowRequest, FollowStatus, Tracked};

/// What the user wants of tracking and following the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Track the board in every image, or stop tracking.
    SetTracking(bool),
    /// Make the arm follow the board; `None` brings it to rest.
    SetFollow(Option<FollowRequest>),
    /// Correct tip poses and commands for the errors of the arm, or use them as they are reported.
    SetCorrected(bool),
    /// Make the simulated cell move its board.
    MoveBoard(BoardMotion),
    /// Hide the board of the simulated cell, or show it again.
    HideBoard(bool),
}

/// What has happened to tracking and following the board.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The board in the newest image that was tracked.
    #[serde(skip)]
    Tracked(Arc<Tracked>),
    /// The board is no longer tracked.
    Failed {
        /// Why, and what to do.
        why: Text,
    },
    /// The arm follows the board, or has stopped.
    #[serde(skip)]
    Follow(FollowStatus),
}
