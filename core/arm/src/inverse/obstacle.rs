//! What prevents an arm of Universal Robots from reaching a pose.

/// What prevents reaching a goal.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum Obstacle {
    /// The goal is past the stretched arm.
    #[error(
        "its wrist would be {needed_m:.4} m from the shoulder and the arm reaches {reach_m:.4} m: bring it at least {excess:.1} \
         mm closer to the robot",
        excess = (needed_m - reach_m) * 1e3
    )]
    TooFar {
        /// Distance from shoulder to the wrist that the goal requires.
        needed_m: f64,
        /// The longest possible distance.
        reach_m: f64,
    },
    /// The wrist would be inside the folded arm.
    #[error(
        "its wrist would be {needed_m:.4} m from the shoulder and the folded arm cannot come closer than {least_m:.4} m: move \
         it at least {excess:.1} mm away from the shoulder",
        excess = (least_m - needed_m) * 1e3
    )]
    TooNear {
        /// Distance from shoulder to the wrist that the goal requires.
        needed_m: f64,
        /// The shortest possible distance.
        least_m: f64,
    },
    /// The wrist would be inside the column of the robot.
    #[error(
        "its wrist would be {distance_m:.4} m from the vertical axis and cannot come closer than {least_m:.4} m: move it at \
         least {excess:.1} mm away from the robot's column",
        excess = (least_m - distance_m) * 1e3
    )]
    InColumn {
        /// Distance of the wrist from the vertical axis.
        distance_m: f64,
        /// The shortest possible distance.
        least_m: f64,
    },
}

impl Obstacle {
    /// Distance of the goal beyond the limit, metres.
    fn excess_m(&self) -> f64 {
        match *self {
            Self::TooFar { needed_m, reach_m } => needed_m - reach_m,
            Self::TooNear { needed_m, least_m } => least_m - needed_m,
            Self::InColumn { distance_m, least_m } => least_m - distance_m,
        }
    }

    /// The one of the two that a smaller displacement of the goal removes.
    pub(super) fn or_easier(self, other: Self) -> Self {
        if other.excess_m() < self.excess_m() { other } else { self }
    }
}
