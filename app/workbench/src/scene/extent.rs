//! How much room arm, cameras, boards and captures take, for viewers that show all of them.

use handeye_cell::render::Shape;
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Point3, Vector3};

use super::view::{AZIMUTH_RAD, ELEVATION_RAD, OPENING_RAD};
use super::{Known, PosedArm, frustum_end, outline};

/// Room around the ball, as a part of its radius: the arm moves.
const ROOM: f64 = 0.15;
/// Length of the frustum of the camera, as it is drawn \[m\].
const FRUSTUM_M: f64 = 0.2;
/// A ball about a single point has this radius \[m\].
const LEAST_M: f64 = 0.15;

/// A ball in the base frame that contains all of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Its centre.
    pub centre: Point3<f64>,
    /// Its radius \[m\].
    pub radius_m: f64,
}

impl Extent {
    /// About arm, camera and boards, and about the captures that were taken with these poses of the tip; `None` where there is
    /// nothing.
    pub fn of<'a>(
        known: &Known,
        arm: Option<&PosedArm>,
        captures: impl Iterator<Item = &'a Pose<Base, Tip>>,
    ) -> Option<Self> {
        let mut points: Vec<Point3<f64>> = arm.map(arm_points).unwrap_or_default();
        points.extend(known.base_from_tip.map(|tip| Point3::from(tip.translation())));
        for tip in captures {
            points.push(Point3::from(tip.translation()));
            points.extend(known.base_from_camera(tip).map(|camera| Point3::from(camera.translation())));
        }
        if let Some(camera) = known.camera()
            && let Some(pose) = camera.place.in_base(known.base_from_tip.as_ref())
        {
            points.push(Point3::from(pose.translation()));
            let end = camera.shape.map(|intrinsics| frustum_end(&intrinsics, FRUSTUM_M));
            points.extend(end.into_iter().flatten().map(|corner| pose.isometry() * corner));
        }
        for board in known.boards() {
            if let (Some(pose), Some(target)) = (board.place.in_base(known.base_from_tip.as_ref()), board.shape) {
                points.extend(outline(&target, 0.0).map(|corner| pose.isometry() * corner));
            }
        }
        Self::about(&points)
    }

    fn about(points: &[Point3<f64>]) -> Option<Self> {
        let finite = || points.iter().filter(|point| point.coords.iter().all(|value| value.is_finite()));
        let first = finite().next()?;
        let (mut least, mut most) = (first.coords, first.coords);
        for point in finite() {
            (least, most) = (least.inf(&point.coords), most.sup(&point.coords));
        }
        let centre = Point3::from((least + most) / 2.0);
        let farthest = finite().map(|point| (point - centre).norm()).fold(LEAST_M, f64::max);
        Some(Self { centre, radius_m: farthest })
    }

    /// From how far an eye of [`OPENING_RAD`] sees all of it, with room around it \[m\].
    pub fn distance_m(&self) -> f64 {
        self.radius_m * (1.0 + ROOM) / (OPENING_RAD / 2.0).sin()
    }

    /// Where this eye is.
    pub fn eye(&self) -> Point3<f64> {
        let ((az_sin, az_cos), (el_sin, el_cos)) = (AZIMUTH_RAD.sin_cos(), ELEVATION_RAD.sin_cos());
        self.centre + Vector3::new(el_cos * az_cos, el_cos * az_sin, el_sin) * self.distance_m()
    }

    /// Whether a view of this one is a view of another: all of it is in sight, and not much smaller than it could be.
    pub fn suits(&self, other: &Self) -> bool {
        let reach = (other.centre - self.centre).norm() + other.radius_m;
        reach <= self.radius_m * (1.0 + ROOM) && other.radius_m >= 0.5 * self.radius_m
    }
}

/// The ends of the axes of its bodies.
fn arm_points(arm: &PosedArm) -> Vec<Point3<f64>> {
    let ends = |shape: &Shape| match *shape {
        Shape::Capsule { a, b, .. } => [a, b],
        Shape::Cylinder { half_height, .. } => [-half_height, half_height].map(|z| Point3::new(0.0, 0.0, z)),
        Shape::Sphere { .. } | Shape::Box { .. } | Shape::Plane => [Point3::origin(); 2],
    };
    let placed = arm.bodies.iter().filter_map(|(link, solid)| Some((arm.links.get(*link)?, solid)));
    placed
        .flat_map(|(moved, solid)| {
            ends(&solid.shape).map(|end| arm.base_from_arm * moved * solid.world_from_shape * end)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(points: &[[f64; 3]]) -> Option<Extent> {
        Extent::about(&points.iter().map(|&point| Point3::from(point)).collect::<Vec<_>>())
    }

    #[test]
    fn all_points_are_in_the_ball_and_what_is_nowhere_does_not_count() {
        let ball = extent(&[[0.0, 0.0, 0.0], [2.0, 0.0, 1.0], [f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0]]);
        let ball = ball.expect("there are points");
        assert_eq!(ball.centre, Point3::new(1.0, 0.0, 0.5));
        assert!((ball.radius_m - 1.25_f64.sqrt()).abs() < 1e-12);
        assert_eq!(extent(&[[f64::NAN; 3]]), None);
        assert!(extent(&[[0.3, 0.0, 0.0]]).expect("a point").radius_m > 0.0, "an eye stands off a point");
    }

    #[test]
    fn a_view_is_kept_while_everything_is_in_it_and_large_enough() {
        let ball = |x: f64, radius_m: f64| Extent { centre: Point3::new(x, 0.0, 0.0), radius_m };
        assert!(ball(0.0, 1.0).suits(&ball(0.1, 1.0)) && ball(0.0, 1.0).suits(&ball(0.0, 0.6)));
        assert!(!ball(0.0, 1.0).suits(&ball(0.5, 1.0)), "it is out of the picture");
        assert!(!ball(0.0, 1.0).suits(&ball(0.0, 0.3)), "it is a speck");
        let centre = ball(0.0, 1.0);
        assert!(((centre.eye() - centre.centre).norm() - centre.distance_m()).abs() < 1e-12);
    }
}
