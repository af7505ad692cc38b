//! The surroundings of an arm: one model for planning, jogging and following.

mod file;

pub use file::{EntryFault, EntryName, KeepBelow, KeepInVolume, KeepOutBox, KeepOutFile, SurroundingsError};

use nalgebra::{Isometry3, Point3, Vector3};

/// Obstacles around an arm, the volume in which it has to stay and its limits of speed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surroundings {
    /// Obstacles, which must not be touched.
    pub obstacles: Vec<Obstacle>,
    /// The volume in which tip and camera have to stay; unlimited without one.
    pub volume: Option<WorkVolume>,
    /// Limits of speed, below those of the arm.
    pub limits: SpeedLimits,
}

/// A box that must not be touched.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// Its name in messages.
    pub name: String,
    /// Pose of its centre in the base, which is the world of a simulation.
    pub world_from_centre: Isometry3<f64>,
    /// Lengths of its edges, metres; zero for a sheet without thickness.
    pub size_m: [f64; 3],
}

/// A box along the axes of the base that tip and camera stay in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorkVolume {
    /// The corner with the smallest coordinates, metres.
    pub min_m: Point3<f64>,
    /// The corner with the largest coordinates, metres.
    pub max_m: Point3<f64>,
}

/// Limits of speed; `None` for those that only the arm limits.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpeedLimits {
    /// Largest speed of the tip, m/s.
    pub tip_m_s: Option<f64>,
    /// Largest speed of every revolute joint, rad/s.
    pub joint_rad_s: Option<f64>,
}

impl Surroundings {
    /// Surroundings of boxes only.
    pub fn of(obstacles: Vec<Obstacle>) -> Self {
        Self { obstacles, ..Self::default() }
    }

    /// Both together: all boxes, the intersection of the volumes, the lower of the limits.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.obstacles.extend(other.obstacles);
        self.volume = match (self.volume, other.volume) {
            (Some(a), Some(b)) => Some(WorkVolume { min_m: a.min_m.sup(&b.min_m), max_m: a.max_m.inf(&b.max_m) }),
            (a, b) => a.or(b),
        };
        self.limits = SpeedLimits {
            tip_m_s: lower(self.limits.tip_m_s, other.limits.tip_m_s),
            joint_rad_s: lower(self.limits.joint_rad_s, other.limits.joint_rad_s),
        };
        self
    }
}

fn lower(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

impl Obstacle {
    /// A box with this name; its pose is that of its centre in the base, its edges are metres.
    pub fn new(name: impl Into<String>, world_from_centre: Isometry3<f64>, size_m: [f64; 3]) -> Self {
        Self { name: name.into(), world_from_centre, size_m }
    }

    /// Its corners in the base, metres: the one at the smallest coordinates of the box first, then x fastest and z slowest.
    pub fn corners(&self) -> [Point3<f64>; 8] {
        std::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 1 { 0.5 } else { -0.5 } * self.size_m[axis];
            self.world_from_centre * Point3::new(side(0), side(1), side(2))
        })
    }

    /// Distance of a point of the base from its surface, metres; below zero inside.
    pub fn distance_to(&self, in_world: &Point3<f64>) -> f64 {
        let in_box = self.world_from_centre.inverse_transform_point(in_world);
        let beyond = in_box.coords.abs() - Vector3::from(self.size_m) * 0.5;
        beyond.map(|v| v.max(0.0)).norm() + beyond.max().min(0.0)
    }
}

impl WorkVolume {
    /// How far inside a point of the base is, metres; below zero outside.
    pub(crate) fn depth_m(&self, in_world: &Point3<f64>) -> f64 {
        (in_world - self.min_m).inf(&(self.max_m - in_world)).min()
    }
}

impl SpeedLimits {
    /// The speed of a revolute joint \[rad/s\], clamped to the limit.
    pub fn joint(&self, rad_s: f64) -> f64 {
        self.joint_rad_s.map_or(rad_s, |limit| limit.min(rad_s))
    }

    /// The speed of the tip \[m/s\], clamped to the limit.
    pub fn tip(&self, m_s: f64) -> f64 {
        self.tip_m_s.map_or(m_s, |limit| limit.min(m_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_from_a_box_grows_outside_and_falls_below_zero_inside() {
        let turned = Isometry3::new(Vector3::new(1.0, 0.0, 0.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
        let long = Obstacle::new("beam", turned, [2.0, 0.2, 0.2]);
        let distance = |x: f64, y: f64, z: f64| long.distance_to(&Point3::new(x, y, z));
        // Turned by 90°, its long edge runs along y.
        assert!((distance(1.0, 1.5, 0.0) - 0.5).abs() < 1e-12);
        assert!((distance(1.0, 0.9, 0.0) + 0.1).abs() < 1e-12);
        assert!((distance(1.4, 1.0, 0.5) - 0.5).abs() < 1e-12, "3 and 4 are 5");
    }

    #[test]
    fn two_surroundings_together_are_as_strict_as_the_stricter() {
        let volume = |min: f64, max: f64| WorkVolume { min_m: [min; 3].into(), max_m: [max; 3].into() };
        let limits = |tip_m_s, joint_rad_s| SpeedLimits { tip_m_s, joint_rad_s };
        let one = |name: &str| Obstacle::new(name, Isometry3::identity(), [0.1; 3]);
        let a = Surroundings {
            obstacles: vec![one("a")],
            volume: Some(volume(-1.0, 1.0)),
            limits: limits(Some(0.2), None),
        };
        let b = Surroundings {
            obstacles: vec![one("b")],
            volume: Some(volume(0.0, 2.0)),
            limits: limits(Some(0.3), Some(1.0)),
        };
        let both = a.and(b);
        assert_eq!(both.obstacles.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        assert_eq!(both.volume, Some(volume(0.0, 1.0)));
        assert_eq!(both.limits, limits(Some(0.2), Some(1.0)));
        assert!(both.volume.is_some_and(|v| v.depth_m(&Point3::new(0.5, 0.5, -0.1)) < 0.0));
    }
}
