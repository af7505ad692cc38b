//! The first few poses, from one view of the board, when the place of the camera is unknown: turns of the tip about its
//! own axes, small enough that the board stays in the image and the arm hardly moves.
//!
//! A turn of the tip by an angle turns what is fixed to it by the same angle. It shifts the image by about the focal length
//! times that angle and by the lever between tip and camera (or board), which is assumed to be no longer than the distance
//! of the board. Turns about two axes are what a first estimate needs.

use nalgebra::{Unit, UnitQuaternion, Vector2, Vector3};

use handeye_geometry::frames::{Base, Pose, Tip};

/// Largest turn: more than ten times the errors of corners and robot, and a camera a hand's breadth from the tip moves
/// by less than 3 cm.
const LARGEST_RAD: f64 = 14.0 * std::f64::consts::PI / 180.0;
/// Smallest turn that is worth a capture.
const LEAST_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Part of the room in the image that a turn may use: the lever may use as much again.
const PART: f64 = 0.45;
/// Factor by which the turns grow when it begins again.
const LARGER: f64 = 1.4;
/// Axes of the tip in the order in which it is turned about them.
const TURNS: [[f64; 3]; 8] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [0.6, 0.6, 0.529],
    [-0.6, -0.6, -0.529],
];

/// Largest turn of the tip for which the present corners stay in the image, radians, for a focal length in pixels.
pub(crate) fn free_turn_rad(
    corners_px: impl Iterator<Item = Vector2<f64>>,
    image_size: (u32, u32),
    focal_px: f64,
) -> f64 {
    let (width, height) = (f64::from(image_size.0), f64::from(image_size.1));
    let room_px = corners_px
        .map(|px| px.x.min(px.y).min(width - 1.0 - px.x).min(height - 1.0 - px.y))
        .fold(f64::INFINITY, f64::min);
    (PART * room_px.max(0.0) / focal_px).clamp(LEAST_RAD, LARGEST_RAD)
}

/// Pose `index` of the fan about a tip pose, and its turn \[rad\], with turns of `turn_rad` at first. After the last one it
/// begins again with larger turns, because the board was seen from all; with turns half as large for each two of `failed` poses
/// that did not show it.
pub fn pose(about: &Pose<Base, Tip>, index: usize, turn_rad: f64, failed: usize) -> (Pose<Base, Tip>, f64) {
    let axis = Unit::new_normalize(Vector3::from(TURNS[index % TURNS.len()]));
    let scale = LARGER.powi((index / TURNS.len()) as i32) * 0.5_f64.powi((failed / 2) as i32);
    let turn_rad = (turn_rad * scale).min(LARGEST_RAD);
    let mut turned = *about.isometry();
    turned.rotation *= UnitQuaternion::from_axis_angle(&axis, turn_rad);
    (Pose::from_isometry(turned), turn_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_that_nearly_fills_the_image_is_turned_less_than_a_small_one_in_its_middle() {
        let around = |half: f64| {
            [[-1.0, -1.0], [1.0, 1.0]].into_iter().map(move |[x, y]| Vector2::new(320.0 + half * x, 240.0 + half * y))
        };
        let turn = |half| free_turn_rad(around(half), (640, 480), 600.0);
        assert!(turn(200.0) < 0.5 * turn(100.0));
        assert!(turn(239.0) >= LEAST_RAD && turn(10.0) <= LARGEST_RAD);
        // It uses less than half of the room.
        assert!(turn(200.0) * 600.0 < 0.5 * 40.0);
    }

    #[test]
    fn the_tip_stays_where_it_is_and_turns_about_two_axes_first() {
        let about: Pose<Base, Tip> =
            Pose::from_isometry(handeye_geometry::se3::exp(&nalgebra::Vector6::new(0.3, 0.1, 0.5, 0.2, 1.0, 0.4)));
        let turn = |index, failed| {
            let (pose, stated_rad) = pose(&about, index, 0.1, failed);
            assert!((about.rotation().angle_to(&pose.rotation()) - stated_rad).abs() < 1e-12);
            assert!((pose.translation() - about.translation()).norm() < 1e-12);
            (about.rotation().inverse() * pose.rotation()).scaled_axis()
        };
        assert!(turn(0, 0).normalize().dot(&turn(1, 0).normalize()).abs() < 0.1);
        assert!((turn(0, 0).norm() - 0.1).abs() < 1e-12 && (turn(6, 1).norm() - 0.1).abs() < 1e-12);
        assert!((turn(8, 0).norm() - 0.14).abs() < 1e-12 && (turn(8, 4).norm() - 0.035).abs() < 1e-12);
        assert!((turn(24, 0).norm() - LARGEST_RAD).abs() < 1e-12, "never a large move");
    }
}
