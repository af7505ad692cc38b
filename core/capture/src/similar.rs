//! Whether there is a capture from almost the same pose.

use handeye_geometry::frames::{Base, Pose, Tip};

/// The capture that is too close.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similar {
    /// Its number.
    pub id: u32,
    /// Distance \[m\].
    pub distance_m: f64,
    /// Rotation \[rad\].
    pub angle_rad: f64,
}

/// Of the captures closer than *both* limits, the closest relative to them. A capture nearby that looks from another
/// angle adds information, and so does one with the same orientation from elsewhere; a limit of zero refuses nothing.
pub fn nearest_similar(
    base_from_tip: &Pose<Base, Tip>,
    others: &[(u32, Pose<Base, Tip>)],
    least_distance_m: f64,
    least_angle_rad: f64,
) -> Option<Similar> {
    let share = |similar: &Similar| similar.distance_m / least_distance_m + similar.angle_rad / least_angle_rad;
    others
        .iter()
        .map(|(id, other)| {
            let (distance_m, angle_rad) = base_from_tip.distance_to(other);
            Similar { id: *id, distance_m, angle_rad }
        })
        .filter(|similar| similar.distance_m < least_distance_m && similar.angle_rad < least_angle_rad)
        .min_by(|a, b| share(a).total_cmp(&share(b)))
}
