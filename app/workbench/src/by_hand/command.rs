//! Commands and events of guiding a user who moves the arm by hand.

use serde::{Deserialize, Serialize};

use crate::by_hand::state::HandChoice;

/// What the user wants when guided while moving the arm by hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// Show how the board should look in the image, and capture when it does, until the goal is reached: for an arm that
    /// is moved by hand.
    Guide,
    /// Skip the wanted view, and ask for another one.
    SkipView,
    /// No more views.
    StopGuiding,
}

/// What has happened while guiding a user who moves the arm by hand.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// The next view for an arm that is moved by hand was chosen, or cannot be.
    #[serde(skip)]
    ViewChosen {
        /// The number of the request.
        number: u64,
        /// What was chosen.
        choice: Box<HandChoice>,
    },
}
