//! What was found of the sessions that share a lens.

use crate::stated_uncertainty::Alternative;

/// Part of the focal length from which a difference is that of another focus, zoom or camera: that from which intrinsics
/// that were given count as wrong, too.
const ANOTHER: f64 = 3e-3;

/// What a calibration knows of the sessions that it shares its lens with.
#[derive(Debug, Clone)]
pub struct SharedLens {
    /// Number of sessions, including its own.
    pub sessions: usize,
    /// Views in the fits of all of them.
    pub views: usize,
    /// Probability that sessions of one lens differ as much as these; of the worst, for the number of sessions.
    pub p_value: f64,
    /// Sessions whose lens differs by more than chance explains; empty where all agree.
    pub odd: Vec<OddSession>,
    /// The hand-eye transform with the lens of its own session alone.
    pub with_own_lens: Alternative,
}

impl SharedLens {
    /// Whether there is more than one lens, see [`OddSession::is_another_lens`].
    pub(crate) fn has_others(&self) -> bool {
        self.odd.iter().any(OddSession::is_another_lens)
    }
}

/// A session whose lens differs from that of the others by more than chance explains.
#[derive(Debug, Clone, PartialEq)]
pub struct OddSession {
    /// Name of the session.
    pub name: String,
    /// Its own focal length fx, pixels.
    pub focal_px: f64,
    /// The focal length of the others, pixels.
    pub others_focal_px: f64,
    /// Standard deviation of the difference, pixels.
    pub sigma_px: f64,
    /// Distance of its principal point from that of the others, pixels.
    pub centre_apart_px: f64,
}

impl OddSession {
    /// Whether it is another lens, and not the same one that the model does not follow: that shifts focal length and
    /// principal point by parts in a thousand of the focal length, by other parts where the views cover others of the image.
    pub fn is_another_lens(&self) -> bool {
        let apart = (self.focal_px - self.others_focal_px).abs().max(self.centre_apart_px);
        apart > ANOTHER * self.others_focal_px
    }
}
