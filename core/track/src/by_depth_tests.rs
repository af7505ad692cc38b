use nalgebra::Vector3;

use super::*;
use crate::moving_board::{self, FAR_M, Watch, board_at, error};
use handeye_geometry::frames::Target;
use handeye_geometry::targets::observation::Corners;
use handeye_geometry::testing::GRID;

fn board() -> Pose<Base, Target> {
    board_at(Vector3::zeros(), Vector3::new(0.3, -0.2, 0.1))
}

/// Exact corners, and depths that `change` has made something of.
fn measured(change: impl Fn(u32, u32, &mut f32)) -> Option<ByDepth> {
    let watch = Watch::new();
    let in_camera = watch.camera_from_target(&board());
    let mut depth = watch.stage.depth(&in_camera, 1);
    for (i, metres) in depth.metres.iter_mut().enumerate() {
        change(i as u32 % depth.width, i as u32 / depth.width, metres);
    }
    let corners: Corners = (0..GRID.len())
        .map(|index| {
            Corner::new(index, watch.stage.camera.project(&(in_camera * GRID.point(index))).expect("in front"))
        })
        .collect();
    let seen = BoardDetection {
        corners,
        camera_from_target: Pose::from_isometry(in_camera),
        base_from_target: board(),
        covariance: nalgebra::Matrix6::identity(),
        rms_px: 0.0,
    };
    let grey = image::GrayImage::new(640, 480);
    let base_from_tip = moving_board::base_from_tip();
    let image = Image { time_s: 0.0, grey: &grey, depth: Some(&depth), far_plane_m: FAR_M, base_from_tip };
    by_depth(&image, &depth, &seen, &moving_board::calibrated(), &TargetSpec::Chessboard(GRID))
}

#[test]
fn exact_depths_give_the_exact_board() {
    let found = measured(|_, _, _| ()).expect("depths");
    let (shift, turn) = error(&found.base_from_target, &board());
    // The lens bends the plane between four pixels by some micrometres.
    assert!(shift < 1e-5 && turn < 1e-4, "{shift} m {turn} rad");
    assert_eq!(found.corners, 70);
    let first = found.first_corner_in_base.expect("a depth");
    assert!((first.coords - board().translation()).norm() < 1e-5, "{first}");
}

#[test]
fn holes_far_planes_and_things_in_front_are_left_out() {
    let found = measured(|u, v, metres| {
        if u > 400 {
            *metres = FAR_M;
        } else if v < 200 {
            *metres = f32::NAN;
        } else if u < 260 {
            *metres -= 0.05;
        } else if (u + v) % 3 == 0 {
            *metres = 0.0;
        }
    });
    let found = found.expect("depths");
    let (shift, turn) = error(&found.base_from_target, &board());
    assert!(shift < 2e-3 && turn < 0.03, "{shift} m {turn} rad");
    assert!((MIN_POINTS..50).contains(&found.corners), "{}", found.corners);
    assert_eq!(found.first_corner_in_base, None);
}

#[test]
fn an_offset_of_all_depths_shifts_the_board_and_loses_none_of_it() {
    let found = measured(|_, _, metres| *metres += 0.02).expect("depths");
    let (shift, _) = error(&found.base_from_target, &board());
    assert!((shift - 0.02).abs() < 3e-3 && found.corners == 70, "{shift} m, {} corners", found.corners);
}

#[test]
fn without_depths_there_is_no_board() {
    assert_eq!(measured(|_, _, metres| *metres = FAR_M), None);
    assert_eq!(measured(|_, _, metres| *metres = f32::INFINITY), None);
    assert_eq!(measured(|_, _, metres| *metres = -1.0), None);
}
