//! A calibration with guidance by hand.

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_plan::guided::by_hand::{HandGuide, HandNext, Judged, Wanted};
use handeye_plan::guided::{Ending, GuidedOptions};

/// Where it is.
#[derive(Debug, Clone, PartialEq)]
pub struct ByHand {
    /// What chooses the views.
    pub guide: HandGuide,
    pub waits: HandWaits,
    /// The view that is wanted.
    pub wanted: Option<Box<Wanted>>,
    /// How the view in the newest image compares with it; `None` while the board is not seen.
    pub judged: Option<Judged>,
    /// Since when \[s\], and where, the robot is at rest in a view that is good enough.
    pub rests: Option<(f64, Pose<Base, Tip>)>,
    /// Where a capture was refused: it is not tried there again.
    pub refused_at: Option<Pose<Base, Tip>>,
    /// How the choice ended; what follows checks the answer.
    pub ending: Option<Ending>,
    /// Captures so far that check it.
    pub checked: usize,
    /// Views that were requested to check it.
    pub tried: usize,
    /// When it began \[s\].
    pub began_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HandWaits {
    /// For the answer from all captures.
    Answer,
    /// For the choice of a view.
    Choice,
    /// For the user to bring the view about.
    View,
    Capture,
}

impl ByHand {
    /// At the beginning.
    pub fn new(options: GuidedOptions, waits: HandWaits, began_s: f64) -> Self {
        Self {
            guide: HandGuide::new(options),
            waits,
            wanted: None,
            judged: None,
            rests: None,
            refused_at: None,
            ending: None,
            checked: 0,
            tried: 0,
            began_s,
        }
    }
}

/// What was chosen.
#[derive(Debug, Clone)]
pub struct HandChoice {
    /// What chose, with what it proposed.
    pub guide: HandGuide,
    /// What comes next; `None` where the board of the first view has no pose, or no verification view is found.
    pub next: Option<HandNext>,
}
