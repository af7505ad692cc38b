//! What may be wanted of guiding a person who moves the arm, and what is reported.

use serde::{Deserialize, Serialize};

use crate::by_hand::state::HandChoice;

/// What the user wants of guiding a person who moves the arm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Say how the board is to look in the image, and capture when it does, until the goal is reached: for an arm that a
    /// person moves.
    Guide,
    /// Leave out the view that is wanted, and ask for another one.
    SkipView,
    /// No more views.
    StopGuiding,
}

/// What has happened to guiding a person who moves the arm.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The next view for an arm that a person moves was chosen, or cannot be.
    #[serde(skip)]
    ViewChosen {
        /// The number of the request.
        number: u64,
        /// What was chosen.
        choice: Box<HandChoice>,
    },
}
