//! The first views, from one view of the board, for a camera or a board that is moved by hand: tilted and turned as a person
//! sees it in the image, because the place of the camera on the robot is not known yet.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::deviation::swing_and_twist;
use crate::guided::candidates::ViewRange;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;

/// Turns about the axes of the image to the right and down and about the line of sight \[deg\], against a view straight
/// from the front. Any two in addition to the first view determine an answer.
const TURNS_DEG: [[f64; 3]; 6] = [
    [25.0, 0.0, 0.0],
    [0.0, 25.0, 0.0],
    [-25.0, 0.0, 50.0],
    [0.0, -25.0, -50.0],
    [20.0, 20.0, 90.0],
    [-20.0, 20.0, -90.0],
];
/// Turns and distances that are tried for a view that does not have the whole board in the image.
const TRIES: [(f64, f64); 4] = [(1.0, 1.0), (1.0, 1.25), (0.6, 1.25), (0.4, 1.45)];

/// View `index`, with the board in the middle of the image, about as far away as in the first view; `None` where the whole
/// board does not fit into the image.
pub fn view(
    intrinsics: &Intrinsics,
    target: &TargetSpec,
    first: &Pose<Camera, Target>,
    index: usize,
) -> Option<Pose<Camera, Target>> {
    let centre = target.centre();
    let distance_m = (first.isometry() * centre).coords.norm();
    let range = ViewRange::about([distance_m].into_iter())?;
    let (_, rolled_rad) = swing_and_twist(&first.rotation());
    let turn = TURNS_DEG[index % TURNS_DEG.len()].map(f64::to_radians);
    TRIES.iter().find_map(|(part, farther)| {
        let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(turn[0], turn[1], 0.0) * *part);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rolled_rad + turn[2] * part);
        let place = Translation3::new(0.0, 0.0, distance_m * farther);
        let pose = Isometry3::from_parts(place, tilt * roll) * Translation3::from(-centre.coords);
        let pose = Pose::from_isometry(pose);
        range.shows(intrinsics, target, &pose).then_some(pose)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_geometry::testing::BOARD;
    use handeye_simulate::session::camera;

    #[test]
    fn the_first_views_have_the_whole_board_and_differ_by_more_than_a_hand_errs() {
        let seen = Isometry3::from_parts(
            Translation3::new(0.02, -0.03, 0.4),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.15, 0.7)),
        ) * Translation3::from(-BOARD.centre().coords);
        let first = Pose::from_isometry(seen);
        let views: Vec<_> = (0..6).map(|index| view(&camera(), &BOARD, &first, index).expect("it fits")).collect();
        let all: Vec<_> = std::iter::once(&first).chain(&views).collect();
        for (index, a) in all.iter().enumerate() {
            for b in &all[..index] {
                assert!(a.rotation().angle_to(&b.rotation()) > 16_f64.to_radians(), "two views are nearly the same");
            }
        }
        // A board that fills the image is tilted less, or seen from farther away.
        let near = at_distance(0.17);
        if let Some(pose) = view(&camera(), &BOARD, &near, 0) {
            assert!((pose.isometry() * BOARD.centre()).z > 0.17);
        }
    }

    fn at_distance(distance_m: f64) -> Pose<Camera, Target> {
        Pose::from_isometry(Isometry3::translation(0.0, 0.0, distance_m) * Translation3::from(-BOARD.centre().coords))
    }
}
