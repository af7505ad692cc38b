//! Planes through depths of images that are generated without the estimator.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use handeye_geometry::depth::DepthImage;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::{Corner, Corners, renumber};
use handeye_geometry::testing::BOARD;
use handeye_simulate::moving_board::{Stage, centre, lens};

fn board(tilt: [f64; 2], away_m: f64) -> Isometry3<f64> {
    let tilt = Vector3::new(tilt[0], tilt[1], 0.3);
    Isometry3::from_parts(Translation3::new(0.03, -0.02, away_m), UnitQuaternion::from_scaled_axis(tilt))
        * Translation3::from(-centre().coords)
}

fn corners(board: &Isometry3<f64>) -> Vec<Corner> {
    let corner =
        |(i, point): (usize, &Point3<f64>)| Corner::new(i, lens().project(&(board * point)).expect("in front"));
    BOARD.points().iter().enumerate().map(corner).collect()
}

/// Compared with the third row of the pose that the depths were generated from, through a lens with distortion.
#[test]
fn depths_at_the_corners_are_the_third_row_of_the_pose() {
    let stage = Stage::new();
    for (tilt, away_m) in [([0.0, 0.0], 0.4), ([0.6, -0.3], 0.35), ([-0.2, 0.9], 0.6)] {
        let board = board(tilt, away_m);
        let plane = DepthPlane::new(&stage.depth(&board, 1), (640, 480), &corners(&board), &BOARD).expect("a plane");
        let row = board.rotation.to_rotation_matrix().into_inner().row(2).into_owned();
        let at = board * Point3::new(plane.place_m.x, plane.place_m.y, 0.0);
        let expected = Vector3::new(at.z, row[0], row[1]);
        // Depths are 32-bit floats.
        assert!((plane.depth - expected).norm() < 2e-5, "{:?} {expected:?}", plane.depth);
        assert!(plane.scatter_m < 1e-6 && plane.fill > 0.999, "{plane:?}");
        assert!((plane.depth_at(&BOARD.centre()) - (board * BOARD.centre()).z).abs() < 2e-6);
    }
}

#[test]
fn what_covers_a_part_of_the_target_does_not_tilt_it() {
    let mut stage = Stage::new();
    stage.depth_noise_m = 3e-4;
    let board = board([0.5, 0.3], 0.4);
    let corners = corners(&board);
    let of = |depth: &DepthImage| DepthPlane::new(depth, (640, 480), &corners, &BOARD);
    let mut depth = stage.depth(&board, 2);
    let free = of(&depth).expect("a plane");
    assert!((free.scatter_m - 3e-4).abs() < 2e-5, "{}", free.scatter_m);
    let mut columns: Vec<f64> = corners.iter().map(|corner| corner.px.x).collect();
    columns.sort_by(f64::total_cmp);
    let beyond = columns[columns.len() * 2 / 3];
    let cover = |depth: &mut DepthImage, metres: f32| {
        for (i, value) in depth.metres.iter_mut().enumerate() {
            if (i % 640) as f64 > beyond {
                *value = metres;
            }
        }
    };
    cover(&mut depth, 0.2);
    let covered = of(&depth).expect("two thirds of a plane");
    // A third of the corners fewer, and at one end: known twice as badly there.
    assert!((covered.depth.yz() - free.depth.yz()).norm() < 2e-3, "{covered:?} {free:?}");
    assert!((covered.depth_at(&BOARD.centre()) - free.depth_at(&BOARD.centre())).abs() < 2e-4);
    cover(&mut depth, f32::NAN);
    let holes = of(&depth).expect("two thirds of a plane");
    assert!((holes.fill - 2.0 / 3.0).abs() < 0.05, "{}", holes.fill);
    depth.metres.fill(f32::NAN);
    assert_eq!(of(&depth), None);
    let other = stage.depth(&board, 2);
    assert_eq!(DepthPlane::new(&other, (1280, 960), &corners, &BOARD), None, "of an image of another size");
}

/// Compared with depths at the same pixels, whose corners were numbered differently from the start.
#[test]
fn a_plane_counted_from_another_corner_is_that_of_corners_counted_so() {
    let mut stage = Stage::new();
    stage.depth_noise_m = 3e-4;
    for (columns, rows, quarters) in [(9, 7, 2), (8, 8, 1), (8, 8, 2), (8, 8, 3)] {
        let target = TargetSpec::Chessboard(Grid { columns, rows, square_m: 0.015 });
        assert!(target.quarter_turns().contains(&quarters));
        let board = board([0.5, -0.3], 0.4);
        let depth = stage.depth(&board, 3);
        let points = target.points();
        let corner =
            |(i, point): (usize, &Point3<f64>)| Corner::new(i, lens().project(&(board * point)).expect("in front"));
        // Some of them, so that their mean place is not the middle.
        let mut corners: Corners = points.iter().enumerate().map(corner).skip(5).collect();
        let of = |corners: &[Corner]| DepthPlane::new(&depth, (640, 480), corners, &target);
        let mut plane = of(&corners);
        renumber(&mut corners, &mut plane, &target, quarters);
        let (found, expected) = (plane.expect("a plane"), of(&corners).expect("a plane"));
        assert!(
            (found.place_m - expected.place_m).norm() < 1e-12,
            "{columns} × {rows}, {quarters}: {found:?} {expected:?}"
        );
        assert!((found.depth - expected.depth).norm() < 1e-9, "{columns} × {rows}, {quarters}: {found:?} {expected:?}");
        assert!((found.information - expected.information).norm() < 1e-12, "{found:?} {expected:?}");
    }
}
