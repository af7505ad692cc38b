//! Images that are late.

use std::time::Instant;

use handeye_capture::NO_IMAGES_S;
use handeye_coppeliasim::LinkError;

/// Images that cannot be had whole: on a machine under load the simulation moves on while one is read. Said once, and waited
/// for as long as a capture waits.
#[derive(Debug, Default)]
pub struct Late {
    since: Option<Instant>,
}

impl Late {
    /// The frame, or nothing where the next one may be whole.
    ///
    /// # Errors
    /// That of the images, once none has been whole for [`NO_IMAGES_S`].
    pub fn grabbed<T>(&mut self, grabbed: Result<T, LinkError>, now: Instant) -> Result<Option<T>, LinkError> {
        match grabbed {
            Err(error @ LinkError::MixedInstants { .. }) => {
                if self.since.is_none() {
                    tracing::warn!("an image is late, and the next one is waited for: {error}");
                }
                let since = *self.since.get_or_insert(now);
                if now.saturating_duration_since(since).as_secs_f64() > NO_IMAGES_S { Err(error) } else { Ok(None) }
            }
            Err(error) => Err(error),
            Ok(frame) => {
                self.since = None;
                Ok(Some(frame))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn one_late_image_is_waited_for_and_images_that_stay_away_end_the_tracking_with_the_reason() {
        let late = || Err::<u8, _>(LinkError::MixedInstants { attempts: 10 });
        let begun = Instant::now();
        let after = |s: f64| begun + Duration::from_secs_f64(s);
        let mut images = Late::default();
        assert_eq!(images.grabbed(late(), after(0.0)), Ok(None));
        assert_eq!(images.grabbed(Ok(7), after(0.5)), Ok(Some(7)));
        assert_eq!(images.grabbed(late(), after(NO_IMAGES_S + 1.0)), Ok(None), "another one, not the same");
        assert_eq!(images.grabbed(late(), after(2.0 * NO_IMAGES_S + 0.5)), Ok(None));
        assert!(matches!(images.grabbed(late(), after(2.0 * NO_IMAGES_S + 1.5)), Err(LinkError::MixedInstants { .. })));
        let gone = LinkError::OwnCellEnded { call: "sim.getObjectPose".to_owned() };
        assert_eq!(images.grabbed(Err::<u8, _>(gone.clone()), after(0.0)), Err(gone), "that is no matter of waiting");
    }
}
