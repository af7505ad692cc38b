//! The paths that a board moves along, as functions of time alone.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::{BoardMotionSpec, BoardPath};

/// Stream of random numbers that belongs to paths; see the streams of the scene.
const STREAM: u64 = 3;

/// Frequencies of a wave relative to the rate of the path: the band of a random walk.
const BAND: std::ops::Range<f64> = 0.6..1.4;

/// How far a random walk leaves the plane of the board, relative to its size.
const OUT_OF_PLANE: f64 = 0.5;

/// Seconds between two jumps.
const STEP_S: f64 = 2.0;
/// Places to jump to, the corners of a regular pentagon taken in the order of a pentagram.
const PLACES: u64 = 5;

/// Shortest time in which a motion grows to its full size, seconds.
const LEAST_EASE_S: f64 = 1.0;

/// Where something is relative to where it began, as a function of the time since.
///
/// But for [`BoardPath::Step`] it is the identity at time 0 and at rest there; position, velocity and acceleration are
/// continuous.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    spec: BoardMotionSpec,
    /// How fast the path's parameter grows, 1/s.
    rate: f64,
    /// Time in which the motion grows to its full size.
    ease_s: f64,
    /// Where the pentagram begins, radians.
    first_angle: f64,
    /// Along x, y and z, and about x, y and z.
    waves: [Wave; 6],
}

/// A sum of three sines that stays within ±1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave([(f64, f64); 3]);

impl Wave {
    fn draw(random: &mut ChaCha8Rng) -> Self {
        Self(std::array::from_fn(|_| (random.random_range(BAND), random.random_range(0.0..TAU))))
    }

    fn at(&self, x: f64) -> f64 {
        self.0.iter().map(|(frequency, phase)| (frequency * x + phase).sin()).sum::<f64>() / self.0.len() as f64
    }
}

impl Course {
    /// A path of valid numbers, see [`BoardMotionSpec::validate`]. What is random in it is drawn from `seed`.
    pub fn new(spec: &BoardMotionSpec, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        let waves = std::array::from_fn(|_| Wave::draw(&mut random));
        let first_angle = random.random_range(0.0..TAU);
        let mut course = Self { spec: *spec, rate: 0.0, ease_s: 0.0, first_angle, waves };
        course.rate = spec.speed_m_s / (spec.size_m * course.mean_speed());
        // Growing adds to the speed along the path; this keeps the sum near the mean speed.
        course.ease_s = LEAST_EASE_S.max(2.0 * spec.size_m / spec.speed_m_s);
        course
    }

    /// Whether it is at rest.
    pub fn is_still(&self) -> bool {
        self.spec.path == BoardPath::Still
    }

    /// Whether it jumps, so that there is no speed to brake.
    pub fn is_jumping(&self) -> bool {
        self.spec.path == BoardPath::Step
    }

    /// Where it is after some seconds, relative to where it was at 0.
    pub fn offset(&self, seconds: f64) -> Isometry3<f64> {
        let (place, turn) = match self.spec.path {
            BoardPath::Still => return Isometry3::identity(),
            BoardPath::Step => match self.jump(seconds) {
                Some(jump) => jump,
                None => return Isometry3::identity(),
            },
            BoardPath::Circle | BoardPath::FigureEight | BoardPath::RandomWalk => {
                let (x, size) = (self.rate * seconds, eased(seconds / self.ease_s));
                (self.place(x) * size, self.turn(x) * size)
            }
        };
        Isometry3::new(place * self.spec.size_m, turn * self.spec.tilt_deg.to_radians())
    }

    /// The path at its full size, for a size of one, by its parameter.
    fn place(&self, x: f64) -> Vector3<f64> {
        match self.spec.path {
            BoardPath::Still | BoardPath::Step => Vector3::zeros(),
            BoardPath::Circle => Vector3::new(x.cos(), x.sin(), 0.0),
            BoardPath::FigureEight => Vector3::new(x.sin(), 0.5 * (2.0 * x).sin(), 0.0),
            BoardPath::RandomWalk => {
                let [along_x, along_y, along_z, ..] = self.waves.map(|wave| wave.at(x));
                Vector3::new(along_x, along_y, OUT_OF_PLANE * along_z)
            }
        }
    }

    /// A rotation vector that is not longer than one.
    fn turn(&self, x: f64) -> Vector3<f64> {
        let [.., about_x, about_y, about_z] = self.waves.map(|wave| wave.at(x));
        Vector3::new(about_x, about_y, about_z) / 3_f64.sqrt()
    }

    /// Place and turn after the last jump; `None` before the first.
    fn jump(&self, seconds: f64) -> Option<(Vector3<f64>, Vector3<f64>)> {
        // Sums of time steps are not exact; a jump is not to come a pass later for that.
        let jumps = ((seconds + 1e-9) / STEP_S).floor() as u64;
        let corner = (jumps > 0).then_some(jumps % PLACES)? as f64;
        let (sin, cos) = (self.first_angle + corner * 2.0 * TAU / PLACES as f64).sin_cos();
        Some((Vector3::new(cos, sin, 0.0), self.turn(corner * TAU)))
    }

    /// Mean of the speed along the path at its full size, for a size and a rate of one.
    fn mean_speed(&self) -> f64 {
        // A hundred rounds: whole ones for what repeats itself, many for what does not.
        const ROUNDS: f64 = 100.0;
        const CHORDS: u32 = 16_000;
        let step = ROUNDS * TAU / f64::from(CHORDS);
        let mut before = self.place(0.0);
        let mut length = 0.0;
        for chord in 1..=CHORDS {
            let place = self.place(step * f64::from(chord));
            length += (place - before).norm();
            before = place;
        }
        let speed = length / (ROUNDS * TAU);
        if speed > 0.0 { speed } else { 1.0 }
    }
}

/// From 0 to 1 with velocity and acceleration zero at both ends.
fn eased(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

/// How far something gets, in units of its speed and braking time, a part `x` of the time after it began to brake:
/// the integral of 1 − [`eased`].
pub fn braked(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x - x.powi(4) * (2.5 + x * (x - 3.0))
}

#[cfg(test)]
#[path = "course_tests.rs"]
mod tests;
