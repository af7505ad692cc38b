//! How the board moves by itself.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Fastest path in rad/s that a board goes along: the quotient of speed and size. Beyond this a pass would skip a good
/// part of the path.
const MAX_RATE_RAD_S: f64 = 20.0;

/// The shape of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BoardPath {
    /// It is at rest.
    #[default]
    Still,
    /// A circle in its plane, anticlockwise when looking at the print.
    Circle,
    /// A figure of eight in its plane, lying on its side.
    FigureEight,
    /// A smooth random walk in all six degrees of freedom that stays near where it began.
    RandomWalk,
    /// Every two seconds it jumps to another of five places around where it began.
    Step,
}

impl BoardPath {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Still, Self::Circle, Self::FigureEight, Self::RandomWalk, Self::Step];

    /// Its name in scene files and over the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Still => "still",
            Self::Circle => "circle",
            Self::FigureEight => "figure_eight",
            Self::RandomWalk => "random_walk",
            Self::Step => "step",
        }
    }
}

impl fmt::Display for BoardPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no path has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error("there is no path {0:?} for the board; it is one of still, circle, figure_eight, random_walk, step")]
pub struct UnknownPath(pub String);

impl FromStr for BoardPath {
    type Err = UnknownPath;

    fn from_str(text: &str) -> Result<Self, UnknownPath> {
        Self::ALL.into_iter().find(|path| path.name() == text).ok_or_else(|| UnknownPath(text.to_owned()))
    }
}

/// How the board moves: along a path around where it is when the motion begins.
///
/// Every path but [`BoardPath::Step`] begins from rest and without a jump in velocity. The same path, numbers and seed
/// give the same motion in simulated time, however fast that runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoardMotionSpec {
    /// The shape of the path.
    pub path: BoardPath,
    /// Mean speed of the board's centre along the path, m/s. [`BoardPath::Step`] does not have one.
    pub speed_m_s: f64,
    /// Extent of the path: radius of the circle and of the places to jump to, half the width of the figure of eight,
    /// largest displacement along either side of the sheet of the random walk; metres.
    pub size_m: f64,
    /// Largest angle by which the board is turned on its way, degrees; the axes are drawn from the seed. 0 for none.
    pub tilt_deg: f64,
}

impl Default for BoardMotionSpec {
    fn default() -> Self {
        Self { path: BoardPath::Still, speed_m_s: 0.1, size_m: 0.04, tilt_deg: 3.0 }
    }
}

impl BoardMotionSpec {
    /// Checks its numbers.
    ///
    /// # Errors
    /// The first number that is out of its range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let Self { path, speed_m_s, size_m, tilt_deg } = *self;
        for (name, value, low, high) in
            [("speed_m_s", speed_m_s, 0.001, 1.0), ("size_m", size_m, 0.001, 0.5), ("tilt_deg", tilt_deg, 0.0, 30.0)]
        {
            if !(value >= low && value <= high) {
                return Err(OutOfRange { name, value, need: format!("a number from {low} to {high}") });
            }
        }
        let has_speed = !matches!(path, BoardPath::Still | BoardPath::Step);
        if has_speed && speed_m_s > MAX_RATE_RAD_S * size_m {
            let need = format!("at most {MAX_RATE_RAD_S}/s times size_m, which is {size_m}");
            return Err(OutOfRange { name: "speed_m_s", value: speed_m_s, need });
        }
        Ok(())
    }
}

/// A number of a motion that no board can follow.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} is {value}, it must be {need}")]
pub struct OutOfRange {
    /// The field.
    pub name: &'static str,
    /// The number that was given.
    pub value: f64,
    /// The valid range.
    pub need: String,
}
