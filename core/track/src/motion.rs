//! How a board may move, by default.

use super::{MotionModel, TrackError};

impl Default for MotionModel {
    /// A board in a hand or on a conveyor. White noise in the acceleration of density `q` changes the velocity by `q √t`
    /// within a time `t`.
    ///
    /// - 0.3 m/s²/√Hz: 1 m/s² that lasts a tenth of a second, which is how a hand starts, stops and turns; some m/s² for
    ///   a few images still pass the gate at 20 images a second or more. At 30 images a second the board is then
    ///   expected within 1.5 mm (1σ), a tenth of a usual square.
    /// - 1.5 rad/s²/√Hz: 5 rad/s² that last a tenth of a second, the same for a turn.
    /// - 0.5 s: the place expected is then uncertain by 6 cm (1σ), half of a usual board.
    fn default() -> Self {
        Self { acceleration: 0.3, angular_acceleration: 1.5, coast_s: 0.5 }
    }
}

impl MotionModel {
    pub(super) fn check(&self) -> Result<(), TrackError> {
        let numbers = [
            ("noise of the acceleration", self.acceleration),
            ("noise of the angular acceleration", self.angular_acceleration),
            ("time to coast", self.coast_s),
        ];
        for (name, value) in numbers {
            if !(value.is_finite() && value > 0.0) {
                return Err(TrackError::BadMotion { name, value });
            }
        }
        Ok(())
    }
}
