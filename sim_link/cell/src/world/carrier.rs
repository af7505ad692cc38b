//! An object that moves by itself, along a course.

use nalgebra::Isometry3;

use super::tree::Tree;
use crate::world::handle::Handle;
use handeye_motion::{Course, braked};

/// Time in which a motion that is replaced comes to rest, seconds.
const BRAKING_S: f64 = 0.6;

/// Motions that go on at once: the newest, and those before it that have not come to rest yet. More come only from a
/// client that asks for another one in nearly every pass; the oldest then stop dead.
const MAX_LEGS: usize = 16;

/// Moves an object in every pass: along one course, or on from one to another without a jump.
///
/// A course that is replaced is braked along its own way while the new one begins, and the object does both. Whoever
/// puts the object elsewhere meanwhile moves the whole motion there.
#[derive(Debug, Clone)]
pub struct Carrier {
    object: Handle,
    /// The course at the start of every simulation.
    first: Course,
    legs: Vec<Leg>,
    placed: Option<Placed>,
}

/// A course and how far it has got.
#[derive(Debug, Clone)]
struct Leg {
    course: Course,
    /// Passes since it began.
    passes: u64,
    /// Passes after which it began to brake.
    braking_from: Option<u64>,
}

/// The last placement by the carrier.
#[derive(Debug, Clone)]
struct Placed {
    /// The object's local pose without the courses.
    anchor: Isometry3<f64>,
    /// The object's local pose.
    local: Isometry3<f64>,
}

impl Leg {
    fn new(course: Course) -> Self {
        Self { course, passes: 0, braking_from: None }
    }

    fn offset(&self, time_step_s: f64) -> Isometry3<f64> {
        let seconds = |passes: u64| passes as f64 * time_step_s;
        self.course.offset(match self.braking_from {
            None => seconds(self.passes),
            Some(from) if self.course.is_jumping() => seconds(from),
            Some(from) => seconds(from) + BRAKING_S * braked(seconds(self.passes - from) / BRAKING_S),
        })
    }

    fn is_at_rest(&self, time_step_s: f64) -> bool {
        self.braking_from
            .is_some_and(|from| self.course.is_jumping() || (self.passes - from) as f64 * time_step_s >= BRAKING_S)
    }
}

impl Carrier {
    /// For an object that begins every simulation with this course.
    pub fn new(object: Handle, first: Course) -> Self {
        let mut carrier = Self { object, first, legs: Vec::new(), placed: None };
        carrier.reset();
        carrier
    }

    /// Goes over to another course, which begins where the object is.
    pub fn follow(&mut self, course: Course) {
        // A course that has not begun has moved nothing.
        self.legs.retain(|leg| leg.passes > 0);
        for leg in &mut self.legs {
            leg.braking_from.get_or_insert(leg.passes);
        }
        if !course.is_still() {
            self.legs.push(Leg::new(course));
        }
    }

    /// Moves the object on by one pass.
    pub(super) fn advance(&mut self, tree: &mut Tree, time_step_s: f64) {
        // An object that was removed goes nowhere.
        let Ok(object) = tree.get_mut(self.object) else { return };
        if self.legs.is_empty() {
            return;
        }
        let mut anchor = match &self.placed {
            Some(placed) if placed.local == object.local => placed.anchor,
            _ => object.local * self.offset(time_step_s).inverse(),
        };
        for leg in &mut self.legs {
            leg.passes += 1;
        }
        while let Some(leg) = self.legs.first()
            && (leg.is_at_rest(time_step_s) || self.legs.len() > MAX_LEGS)
        {
            anchor *= leg.offset(time_step_s);
            self.legs.remove(0);
        }
        anchor.rotation.renormalize();
        object.local = anchor * self.offset(time_step_s);
        self.placed = Some(Placed { anchor, local: object.local });
    }

    /// The simulation has ended; the object is where it was before.
    pub(super) fn reset(&mut self) {
        self.legs.clear();
        self.placed = None;
        let first = self.first.clone();
        self.follow(first);
    }

    fn offset(&self, time_step_s: f64) -> Isometry3<f64> {
        self.legs.iter().fold(Isometry3::identity(), |so_far, leg| so_far * leg.offset(time_step_s))
    }
}

#[cfg(test)]
#[path = "carrier_tests.rs"]
mod tests;
