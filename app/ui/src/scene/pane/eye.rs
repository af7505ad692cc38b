//! The eye of the 3D pane: where it is, how points are projected onto the screen, and how it is moved.

use std::f64::consts::FRAC_PI_2;

use egui::{Pos2, Rect, Vec2};
use nalgebra::{Point3, Vector3};

use handeye_workbench::model::SceneView;
use handeye_workbench::scene::OPENING_RAD;

/// Near clipping distance of the eye \[m\].
const NEAR_M: f64 = 0.02;
/// Limits of the distance of the eye from the centre \[m\].
const DISTANCES_M: [f64; 2] = [0.08, 12.0];
/// The centre is at most this far from the base \[m\], so that the cell can be found again.
const FARTHEST_CENTRE_M: f64 = 5.0;
/// Turn per point of a drag [rad]: half a turn across a pane of usual size.
const RAD_PER_POINT: f64 = 0.008;

/// The eye over a room on the screen. Coordinates are the base's, in metres; the eye's own axes are x to the right,
/// y up and depth forward.
#[derive(Debug, Clone, Copy)]
pub struct Eye {
    at: Point3<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
    forward: Vector3<f64>,
    middle: Pos2,
    /// Points on the screen per metre at a depth of one metre.
    focal: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScreenPoint {
    /// Where.
    pub at: Pos2,
    /// How far in front of the eye \[m\].
    pub depth_m: f64,
}

impl Eye {
    /// The eye of a view that fills a room.
    pub fn new(view: &SceneView, room: Rect) -> Self {
        let (az_sin, az_cos) = view.azimuth_rad.sin_cos();
        let (el_sin, el_cos) = view.elevation_rad.sin_cos();
        let from_centre = Vector3::new(el_cos * az_cos, el_cos * az_sin, el_sin);
        // The horizon stays level, also for an eye that looks straight down.
        let right = Vector3::new(-az_sin, az_cos, 0.0);
        let side = f64::from(room.width().min(room.height()).max(1.0));
        Self {
            at: Point3::from(view.centre_m) + from_centre * view.distance_m,
            right,
            up: from_centre.cross(&right),
            forward: -from_centre,
            middle: room.center(),
            focal: side / 2.0 / (OPENING_RAD / 2.0).tan(),
        }
    }

    /// Where the eye is.
    pub fn at(&self) -> Point3<f64> {
        self.at
    }

    /// The axes of the eye in base axes: to the right, up, and forward.
    pub fn axes(&self) -> [Vector3<f64>; 3] {
        [self.right, self.up, self.forward]
    }

    fn depth_m(&self, point: &Point3<f64>) -> f64 {
        (point - self.at).dot(&self.forward)
    }

    /// A point that is known to be in front of the eye.
    fn seen(&self, point: &Point3<f64>) -> ScreenPoint {
        let from_eye = point - self.at;
        let depth_m = from_eye.dot(&self.forward);
        let scale = self.focal / depth_m;
        let (x, y) = (from_eye.dot(&self.right) * scale, from_eye.dot(&self.up) * scale);
        ScreenPoint { at: self.middle + Vec2::new(x as f32, -y as f32), depth_m }
    }

    /// A point on the screen; `None` behind the eye.
    pub fn point(&self, point: &Point3<f64>) -> Option<ScreenPoint> {
        (self.depth_m(point) >= NEAR_M).then(|| self.seen(point))
    }

    /// The part of a straight line that is in front of the eye.
    pub fn segment(&self, ends: [Point3<f64>; 2]) -> Option<[ScreenPoint; 2]> {
        let [from, to] = ends;
        let depths = [self.depth_m(&from), self.depth_m(&to)];
        let [from, to] = match depths.map(|depth_m| depth_m >= NEAR_M) {
            [true, true] => [from, to],
            [false, false] => return None,
            [true, false] => [from, crossing([from, to], depths)],
            [false, true] => [crossing([from, to], depths), to],
        };
        Some([self.seen(&from), self.seen(&to)])
    }

    /// The part of a convex polygon that is in front of the eye; fewer than three corners when there is none.
    pub fn polygon(&self, corners: &[Point3<f64>]) -> Vec<ScreenPoint> {
        let mut seen = Vec::with_capacity(corners.len() + 1);
        for (index, &corner) in corners.iter().enumerate() {
            let next = corners[(index + 1) % corners.len()];
            let depths = [self.depth_m(&corner), self.depth_m(&next)];
            let [is_front, next_is_front] = depths.map(|depth_m| depth_m >= NEAR_M);
            if is_front {
                seen.push(self.seen(&corner));
            }
            if is_front != next_is_front {
                seen.push(self.seen(&crossing([corner, next], depths)));
            }
        }
        seen
    }

    /// The point of the ground, the plane z = 0, behind a point on the screen; `None` above the horizon.
    pub fn on_ground(&self, at: Pos2) -> Option<Point3<f64>> {
        let offset = at - self.middle;
        let sight = self.forward * self.focal + self.right * f64::from(offset.x) - self.up * f64::from(offset.y);
        let along = -self.at.z / sight.z;
        (along.is_finite() && along > 0.0).then(|| self.at + sight * along)
    }

    /// Whether a face with this normal is seen from its front.
    pub fn faces(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        (self.at - point).dot(normal) > 0.0
    }
}

/// Where a line crosses the near plane of the eye.
fn crossing([from, to]: [Point3<f64>; 2], [near, far]: [f64; 2]) -> Point3<f64> {
    from + (to - from) * ((NEAR_M - near) / (far - near))
}

/// Axis-aligned views of the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// From above: x of the base to the right, y up.
    Top,
    /// Against y of the base: x to the right, z up.
    Front,
    /// Against x of the base, from its tip: y to the right, z up.
    Right,
}

impl Side {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Top, Self::Front, Self::Right];

    /// The view from there, of the same point and from the same distance.
    #[must_use]
    pub fn view(self, now: SceneView) -> SceneView {
        let (azimuth_rad, elevation_rad) = match self {
            Self::Top => (-FRAC_PI_2, FRAC_PI_2),
            Self::Front => (-FRAC_PI_2, 0.0),
            Self::Right => (0.0, 0.0),
        };
        SceneView { azimuth_rad, elevation_rad, ..now }
    }
}

/// The view after a drag that turns the cell under the pointer.
#[must_use]
pub fn orbited(now: SceneView, drag: Vec2) -> SceneView {
    let azimuth_rad = (now.azimuth_rad - f64::from(drag.x) * RAD_PER_POINT).rem_euclid(std::f64::consts::TAU);
    let elevation_rad = (now.elevation_rad + f64::from(drag.y) * RAD_PER_POINT).clamp(-FRAC_PI_2, FRAC_PI_2);
    SceneView { azimuth_rad, elevation_rad, ..now }
}

/// The view after a drag that shifts the cell with the pointer: what is in the middle of the pane follows it exactly.
#[must_use]
pub fn panned(now: SceneView, drag: Vec2, room: Rect) -> SceneView {
    let eye = Eye::new(&now, room);
    let metres = now.distance_m / eye.focal;
    let shift = eye.right * (-f64::from(drag.x) * metres) + eye.up * (f64::from(drag.y) * metres);
    let centre = Vector3::from(now.centre_m) + shift;
    let centre_m = [centre.x, centre.y, centre.z].map(|value| value.clamp(-FARTHEST_CENTRE_M, FARTHEST_CENTRE_M));
    SceneView { centre_m, ..now }
}

/// The view from nearer by a factor, or from farther if it is below 1.
#[must_use]
pub fn zoomed(now: SceneView, factor: f64) -> SceneView {
    let [nearest, farthest] = DISTANCES_M;
    SceneView { distance_m: (now.distance_m / factor).clamp(nearest, farthest), ..now }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room() -> Rect {
        Rect::from_min_size(Pos2::new(100.0, 50.0), Vec2::new(600.0, 400.0))
    }

    fn view() -> SceneView {
        SceneView { centre_m: [0.1, -0.2, 0.3], azimuth_rad: 0.7, elevation_rad: 0.4, distance_m: 2.0 }
    }

    fn close(a: Pos2, b: Pos2) -> bool {
        (a - b).length() < 1e-3
    }

    #[test]
    fn the_middle_of_the_view_is_in_the_middle_of_the_room_and_what_is_twice_as_far_is_half_as_large() {
        let eye = Eye::new(&view(), room());
        let centre = Point3::from(view().centre_m);
        let seen = eye.point(&centre).expect("in front");
        assert!(close(seen.at, room().center()), "{seen:?}");
        assert!((seen.depth_m - 2.0).abs() < 1e-12);
        let [right, _, forward] = eye.axes();
        let offset = |at: Point3<f64>| eye.point(&at).expect("in front").at.x - room().center().x;
        let (near, far) = (offset(centre + right * 0.1), offset(centre + forward * 2.0 + right * 0.1));
        assert!(near > 0.0 && (near - 2.0 * far).abs() < 1e-3, "{near} {far}");
    }

    #[test]
    fn the_straight_views_have_the_axes_of_the_base_where_they_say() {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        for (side, to_the_right, upwards) in [(Side::Top, x, y), (Side::Front, x, z), (Side::Right, y, z)] {
            let [right, up, forward] = Eye::new(&side.view(view()), room()).axes();
            assert!((right - to_the_right).norm() < 1e-12, "{side:?}");
            assert!((up - upwards).norm() < 1e-12, "{side:?}");
            assert!((forward - upwards.cross(&to_the_right)).norm() < 1e-12, "{side:?}");
        }
    }

    #[test]
    fn the_horizon_is_level_and_z_is_up_from_everywhere() {
        for step in 0..40 {
            let from = SceneView {
                azimuth_rad: 0.31 * f64::from(step),
                elevation_rad: -1.4 + 0.07 * f64::from(step),
                ..view()
            };
            let [right, up, forward] = Eye::new(&from, room()).axes();
            assert!(right.z.abs() < 1e-12 && up.z > 0.0);
            assert!((right.cross(&up) + forward).norm() < 1e-12, "right, up and backwards are right-handed");
        }
    }

    #[test]
    fn a_line_through_the_eye_is_cut_and_one_behind_it_is_not_drawn() {
        let eye = Eye::new(&view(), room());
        let [right, up, forward] = eye.axes();
        let (front, back) = (eye.at() + forward * 1.0 + up * 0.1, eye.at() - forward * 1.0 + right * 0.1);
        let [first, second] = eye.segment([front, back]).expect("half of it");
        assert!((first.depth_m - 1.0).abs() < 1e-12 && (second.depth_m - NEAR_M).abs() < 1e-12, "{first:?} {second:?}");
        let [third, fourth] = eye.segment([back, front]).expect("half of it");
        assert!(close(third.at, second.at) && close(fourth.at, first.at));
        assert_eq!(eye.segment([back, back - forward]), None);
        assert_eq!(eye.point(&back), None);
    }

    #[test]
    fn a_polygon_through_the_eye_loses_the_part_behind() {
        let eye = Eye::new(&view(), room());
        let [right, up, forward] = eye.axes();
        let corner = |x: f64, depth_m: f64| eye.at() + right * x + forward * depth_m - up * 0.1;
        let floor = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let seen = eye.polygon(&floor);
        assert_eq!(seen.len(), 4);
        assert!(seen.iter().all(|seen| seen.depth_m > NEAR_M - 1e-12 && seen.at.is_finite()));
        let triangle = eye.polygon(&floor[1..]);
        assert_eq!(triangle.len(), 4, "a corner that is cut off leaves two: {triangle:?}");
        assert!(eye.polygon(&floor[..2]).len() < 3);
        assert!(eye.polygon(&[]).is_empty());
    }

    #[test]
    fn dragging_shifts_the_middle_by_as_much_as_the_pointer_went() {
        let drag = Vec2::new(40.0, -25.0);
        let after = panned(view(), drag, room());
        let seen = Eye::new(&after, room()).point(&Point3::from(view().centre_m)).expect("in front");
        assert!(close(seen.at, room().center() + drag), "{seen:?}");
        let far = panned(view(), Vec2::new(1e9, 0.0), room());
        assert!(far.centre_m.iter().all(|value| value.abs() <= FARTHEST_CENTRE_M));
    }

    #[test]
    fn dragging_to_the_right_turns_what_is_in_front_to_the_right_and_never_over_the_top() {
        let front = |eye: &Eye| Point3::from(view().centre_m) - eye.axes()[2] * 0.3;
        let before = Eye::new(&view(), room());
        let nearest = front(&before);
        let after = Eye::new(&orbited(view(), Vec2::new(10.0, 0.0)), room());
        let seen = after.point(&nearest).expect("in front");
        assert!(seen.at.x > room().center().x + 1.0, "{seen:?}");
        let after = Eye::new(&orbited(view(), Vec2::new(0.0, 10.0)), room());
        let seen = after.point(&nearest).expect("in front");
        assert!(seen.at.y > room().center().y + 1.0, "{seen:?}");
        assert!((orbited(view(), Vec2::new(0.0, 1e4)).elevation_rad - FRAC_PI_2).abs() < 1e-12);
        let drawn = orbited(view(), Vec2::new(f32::MAX, 0.0));
        assert!((0.0..=std::f64::consts::TAU).contains(&drawn.azimuth_rad));
    }

    #[test]
    fn zooming_changes_the_distance_within_its_ends() {
        assert!((zoomed(view(), 2.0).distance_m - 1.0).abs() < 1e-12);
        assert!((zoomed(view(), 1e9).distance_m - DISTANCES_M[0]).abs() < 1e-12);
        assert!((zoomed(view(), 1e-9).distance_m - DISTANCES_M[1]).abs() < 1e-12);
    }
}
