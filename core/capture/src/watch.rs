//! Whether the robot is at rest and the image has stopped changing.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::Shot;
use super::cells::Cells;
use handeye_geometry::frames::{Base, Pose, Tip};

/// Fastest joint [rad/s] that counts as at rest: an arm of 1 m reach then moves by 0.05 mm in a pass of 50 ms, less than
/// a tenth of a pixel at 0.4 m. The same as where motions wait for the arm.
pub const STILL_RATE_RAD_S: f64 = 1e-3;

/// Reach of an arm [m], for the tip of a robot that reports no joints.
const REACH_M: f64 = 1.0;

/// Over longer intervals \[s\] a joint may not travel further than in this one: what moved and stopped between two
/// images has moved.
const LONGEST_INTERVAL_S: f64 = 0.05;

/// Images closer in simulated time \[s\] than this are one: what settles slowly looks still from one to the next.
const SHORTEST_INTERVAL_S: f64 = 0.03;

/// Images that must agree: three intervals. One interval may be the turning point of an oscillation, and an image
/// may be from the pass before the joints were read.
const IMAGES: usize = 4;

/// Differences between images at rest vary by this part as noise is not quite the same in all of them.
const UNEVEN_NOISE: f64 = 0.1;

/// Standard deviation of the absolute value of a normal number as a part of its mean: √(π/2 − 1).
const SPREAD_OF_ABSOLUTE: f64 = 0.756;

/// Standard deviations of the mean difference that chance is given.
const CHANCE: f64 = 5.0;

/// Difference \[grey levels\] that counts as zero: one level in half a percent of the cells, which is how an image
/// rounds that moves by a hundredth of a pixel.
const NO_DIFFERENCE: f64 = 0.005;

/// State after an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rest {
    /// Too few images to decide, and nothing moved in those.
    Unknown,
    /// The robot has not come to rest, and how fast it moves.
    RobotMoves(RobotRate),
    /// The robot is at rest, the image is not yet.
    ImageChanges,
    /// Nothing moves.
    Still {
        /// Mean absolute difference of two images at rest [grey levels]: their noise.
        noise: f64,
    },
}

/// Speed of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum RobotRate {
    /// The fastest joint [rad/s].
    Joint(f64),
    /// The tip, where joints are not reported.
    Tip {
        /// Its speed [m/s].
        m_s: f64,
        /// Its rate of turn [rad/s].
        rad_s: f64,
    },
}

/// Watches the last few images.
///
/// # Robot
/// It is at rest when from image to image no joint turns faster than [`STILL_RATE_RAD_S`]; of a robot that does not report
/// its joints, when the tip does not turn faster than that nor move faster than it would at the end of an arm of 1 m.
///
/// # Image
/// Differences (mean absolute, of cells of about 1/80 of the width, apart from brightness) are taken between all pairs
/// of the last four images. Images of a scene at rest differ by their noise, and every pair by the same amount,
/// whatever the noise is like. What moves differs more the further apart two images are, and what jumps differs across
/// the jump only. So the image is at rest when the largest of the six differences is not larger than the smallest by
/// more than chance allows. No level of noise has to be known.
///
/// A motion of the whole image by a tenth of a pixel between the first and the last of the four is seen at 2 grey
/// levels of noise. Light that flickers all over the image does not count as a change; light that flickers in stripes
/// is one.
#[derive(Debug, Clone, Default)]
pub struct Watch {
    seen: VecDeque<Sample>,
    rest: Option<Rest>,
}

#[derive(Debug, Clone)]
struct Sample {
    sim_time_s: f64,
    robot: Configuration,
    cells: Cells,
}

impl Watch {
    /// Takes in an image. One that is not later than the last by enough changes nothing; one that is earlier begins
    /// again, as the simulation has.
    pub(crate) fn see(&mut self, shot: &Shot<'_>) -> Rest {
        if !shot.sim_time_s.is_finite() {
            return self.rest.unwrap_or(Rest::Unknown);
        }
        let seen = Sample { sim_time_s: shot.sim_time_s, robot: Configuration::of(shot), cells: Cells::of(shot.grey) };
        if let Some(last) = self.seen.back() {
            let interval_s = seen.sim_time_s - last.sim_time_s;
            if interval_s < 0.0 || !seen.cells.fits(&last.cells) {
                self.seen.clear();
            } else if interval_s < SHORTEST_INTERVAL_S {
                return self.rest.unwrap_or(Rest::Unknown);
            }
        }
        let rest = self.judge(&seen);
        if matches!(rest, Rest::RobotMoves(_)) {
            self.seen.clear();
        }
        if self.seen.len() == IMAGES {
            self.seen.pop_front();
        }
        self.seen.push_back(seen);
        self.rest = Some(rest);
        rest
    }

    fn judge(&self, new: &Sample) -> Rest {
        let Some(last) = self.seen.back() else { return Rest::Unknown };
        let interval_s = new.sim_time_s - last.sim_time_s;
        let travel = new.robot.travel_from(&last.robot);
        if !travel.is_rest(interval_s) {
            return Rest::RobotMoves(travel.rate(interval_s));
        }
        let mut images: Vec<&Cells> = self.seen.iter().rev().take(IMAGES - 1).map(|seen| &seen.cells).collect();
        if images.len() + 1 < IMAGES {
            return Rest::Unknown;
        }
        images.push(&new.cells);
        let differences =
            (0..IMAGES).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| images[i].difference(images[j]));
        let (least, most) =
            differences.fold((f64::INFINITY, 0.0), |(least, most), d| (f64::min(least, d), f64::max(most, d)));
        if most <= limit(least, new.cells.count()) { Rest::Still { noise: least } } else { Rest::ImageChanges }
    }
}

/// Largest difference of images whose noise makes `noise` of difference.
fn limit(noise: f64, cells: usize) -> f64 {
    let chance = CHANCE * SPREAD_OF_ABSOLUTE / (cells.max(1) as f64).sqrt();
    noise * (1.0 + UNEVEN_NOISE + chance) + NO_DIFFERENCE
}

/// Where the robot is: by its joints, or by its tip where those are not known.
#[derive(Debug, Clone)]
struct Configuration {
    joints_rad: Vec<f64>,
    base_from_tip: Pose<Base, Tip>,
}

/// Motion of a robot.
#[derive(Debug, Clone, Copy)]
enum Travel {
    /// The joint that turned furthest \[rad\].
    Joint(f64),
    /// The tip \[m, rad\].
    Tip { m: f64, rad: f64 },
}

impl Configuration {
    fn of(shot: &Shot<'_>) -> Self {
        Self { joints_rad: shot.joints_rad.to_vec(), base_from_tip: shot.base_from_tip }
    }

    fn travel_from(&self, before: &Self) -> Travel {
        if self.joints_rad.is_empty() && before.joints_rad.is_empty() {
            let moved = before.base_from_tip.inverse() * self.base_from_tip;
            return Travel::Tip { m: moved.translation().norm(), rad: moved.rotation().angle() };
        }
        Travel::Joint(travel_rad(&before.joints_rad, &self.joints_rad))
    }
}

impl Travel {
    /// Whether a robot that moved by this in an interval is at rest; false for NaN.
    fn is_rest(self, interval_s: f64) -> bool {
        let limit = STILL_RATE_RAD_S * interval_s.min(LONGEST_INTERVAL_S);
        match self {
            Self::Joint(rad) => rad <= limit,
            Self::Tip { m, rad } => m <= limit * REACH_M && rad <= limit,
        }
    }

    fn rate(self, interval_s: f64) -> RobotRate {
        match self {
            Self::Joint(rad) => RobotRate::Joint(rad / interval_s),
            Self::Tip { m, rad } => RobotRate::Tip { m_s: m / interval_s, rad_s: rad / interval_s },
        }
    }
}

/// Largest turn of a joint \[rad\], by the shorter way round; NaN when a joint value is not finite.
fn travel_rad(from: &[f64], to: &[f64]) -> f64 {
    use std::f64::consts::{PI, TAU};
    if from.len() != to.len() {
        return f64::NAN;
    }
    let turn = |(a, b): (&f64, &f64)| ((b - a + PI).rem_euclid(TAU) - PI).abs();
    from.iter().zip(to).map(turn).fold(0.0, |most, turn| if turn > most || turn.is_nan() { turn } else { most })
}

/// Reference for the images of an average: robot and image as they were when everything was at rest.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    robot: Configuration,
    cells: Cells,
    noise: f64,
}

impl Reference {
    /// From the image after which [`Watch`] found everything at rest, with the noise it found.
    pub fn new(shot: &Shot<'_>, noise: f64) -> Self {
        Self { robot: Configuration::of(shot), cells: Cells::of(shot.grey), noise }
    }

    /// The difference of a later image from it. The robot may have moved by as much as in one interval at rest, however
    /// long ago it was.
    pub fn compare(&self, shot: &Shot<'_>, interval_s: f64) -> Rest {
        let travel = Configuration::of(shot).travel_from(&self.robot);
        if !travel.is_rest(LONGEST_INTERVAL_S) {
            return Rest::RobotMoves(travel.rate(interval_s));
        }
        let cells = Cells::of(shot.grey);
        let same = cells.fits(&self.cells) && {
            let difference = self.cells.difference(&cells);
            difference <= limit(self.noise, cells.count())
        };
        if same { Rest::Still { noise: self.noise } } else { Rest::ImageChanges }
    }
}
