//! How much of the live entries is written, and where to.

use std::time::Duration;

use super::queue::{Rate, Rates};

/// How much of the live entries is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// What can be perceived, and less in a file: for a window that is open all day.
    Live,
    /// Everything: for a command that ends.
    Everything,
}

impl Pace {
    /// How much of them goes to a file.
    pub(super) fn for_file(self) -> Rates {
        let every = |millis| Rate::newest_every(Duration::from_millis(millis));
        match self {
            Self::Live => Rates {
                robot: every(200),
                image: every(1000),
                detection: every(1000),
                tracked: every(50),
                waits: false,
            },
            Self::Everything => Rates { waits: true, ..Self::everything() },
        }
    }

    /// How much of them goes to a viewer.
    pub(super) fn for_viewer(self) -> Rates {
        let every = |millis| Rate::newest_every(Duration::from_millis(millis));
        match self {
            Self::Live => {
                Rates { robot: every(50), image: every(100), detection: every(100), tracked: every(33), waits: false }
            }
            Self::Everything => Self::everything(),
        }
    }

    /// Images are megabytes, so that few may wait.
    fn everything() -> Rates {
        let (small, images) = (Rate::all(4096), Rate::all(8));
        Rates { robot: small, image: images, detection: Rate::all(64), tracked: small, waits: false }
    }
}
