//! Images that are late.

use std::time::Instant;

use handeye_capture::NO_IMAGES_S;
use handeye_link::PortError;
use handeye_wording::text;

/// Images that do not arrive, or are incomplete: on a machine under load the simulation advances while one is read. Reported
/// once, and waited for as long as a capture waits.
#[derive(Debug, Default)]
pub struct Late {
    since: Option<Instant>,
    is_reported: bool,
}

/// How long images may be late \[s\] without a report: a slow camera has intervals of this length.
const UNSAID_S: f64 = 1.0;

impl Late {
    /// No image has arrived yet.
    ///
    /// # Errors
    /// Once there has been none for [`NO_IMAGES_S`].
    pub fn waits(&mut self, now: Instant) -> Result<(), PortError> {
        let since_s = now.saturating_duration_since(*self.since.get_or_insert(now)).as_secs_f64();
        if since_s > UNSAID_S && !std::mem::replace(&mut self.is_reported, true) {
            tracing::warn!("an image is late, and the next one is waited for");
        }
        if since_s <= NO_IMAGES_S {
            return Ok(());
        }
        Err(PortError::Refused(text!(
            "No whole image has come for {seconds} s: look at the camera, or this computer has too much to do",
            seconds = NO_IMAGES_S
        )))
    }

    /// One has arrived.
    pub fn came(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn one_late_image_is_waited_for_and_images_that_stay_away_end_the_command_with_the_reason() {
        let begun = Instant::now();
        let after = |s: f64| begun + Duration::from_secs_f64(s);
        let mut images = Late::default();
        assert_eq!(images.waits(after(0.0)), Ok(()));
        images.came();
        assert_eq!(images.waits(after(NO_IMAGES_S + 1.0)), Ok(()), "another one, not the same");
        assert_eq!(images.waits(after(2.0 * NO_IMAGES_S + 0.5)), Ok(()));
        assert!(matches!(images.waits(after(2.0 * NO_IMAGES_S + 1.5)), Err(PortError::Refused(_))));
    }
}
