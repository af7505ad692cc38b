//! All kinds of targets, rendered from the drawing that is printed.

use image::{GrayImage, imageops};
use nalgebra::Vector2;

use super::{VisionError, charuco_layout, detect};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{AprilGrid, AprilTag, Charuco, Dictionary, Grid, IdOrder, Layout, TargetSpec};
use handeye_geometry::testing::looking_at_point;
use handeye_simulate::Scene;

/// Largest error of a corner. With noise of one grey level and this blur the fits have 0.005 to 0.014 px RMS, so that
/// three to four deviations of the worst are within.
const EXACT_PX: f64 = 0.05;
/// The same for the RMS over a view, of as few as four corners.
const RMS_PX: f64 = 0.02;

fn camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 581.0)
}

fn charuco(columns: usize, rows: usize, layout: Option<Layout>) -> Charuco {
    let dictionary = "4x4_50".parse().expect("known");
    Charuco { columns, rows, square_m: 0.03, marker_m: 0.022, dictionary, layout }
}

fn kalibr(columns: usize, rows: usize) -> AprilGrid {
    AprilGrid {
        columns,
        rows,
        tag_m: 0.03,
        spacing_m: 0.009,
        first_id: 0,
        family: Dictionary::APRILTAG_36H11,
        border_bits: None,
        ids: IdOrder::BottomUp,
    }
}

/// The target's middle is `distance_m` in front of the camera and imaged `offset_px` from the middle of the image; the
/// target is turned by `roll`, then tilted about an axis at `azimuth` in the image.
fn photo_of(
    target: TargetSpec,
    camera: Intrinsics,
    distance_m: f64,
    [tilt, azimuth, roll]: [f64; 3],
    offset_px: Vector2<f64>,
) -> Scene {
    // A tilt after a roll is a tilt about an axis that was rolled back before it.
    let angles = [tilt, azimuth - roll, roll];
    Scene::drawn(target, camera, looking_at_point(&target.centre(), &camera, distance_m, angles, offset_px))
}

/// Tilt, azimuth and roll: straight, tilted either way, turned by any angle.
const POSES: [[f64; 3]; 4] = [[0.0, 0.0, 0.1], [0.6, 0.4, -0.7], [0.5, 2.3, 1.9], [0.7, 4.0, 3.1]];

fn found(image: &GrayImage, target: &TargetSpec) -> Corners {
    let corners = detect(image, target).expect("searches").unwrap_or_else(|| panic!("{target}: not found"));
    assert!(corners.windows(2).all(|pair| pair[0].index < pair[1].index), "{target}: not ascending");
    corners
}

/// Every corner is where it is in truth; returns how many there are.
fn right(corners: &[Corner], photo: &Scene, what: &str) -> usize {
    let truth = photo.truth();
    let mut sum = 0.0;
    for corner in corners {
        let off = (corner.px - truth[corner.index]).norm();
        assert!(off < EXACT_PX, "{what}: corner {} is {off:.3} px off", corner.index);
        sum += off * off;
    }
    let rms = (sum / corners.len() as f64).sqrt();
    println!("{what}: {} corners, {rms:.4} px RMS", corners.len());
    assert!(rms < RMS_PX, "{what}: {rms} px RMS");
    corners.len()
}

fn whole(target: TargetSpec, distance_m: f64, camera: Intrinsics) {
    for (seed, angles) in POSES.into_iter().enumerate() {
        let photo = photo_of(target, camera, distance_m, angles, Vector2::new(8.0, -5.0));
        let corners = found(&photo.render(seed as u64), &target);
        let count = right(&corners, &photo, &format!("{target} at {angles:?}"));
        assert_eq!(count, target.len(), "{target} at {angles:?}");
    }
}

#[test]
fn all_corners_of_a_charuco_board_are_found_where_they_are() {
    whole(TargetSpec::Charuco(charuco(6, 4, None)), 0.42, camera());
}

#[test]
fn all_corners_of_kalibrs_board_are_found_where_they_are() {
    whole(TargetSpec::AprilGrid(kalibr(4, 3)), 0.33, camera());
}

#[test]
fn a_board_of_tags_without_squares_between_them_is_found_as_well() {
    let board = AprilGrid { border_bits: Some(1), ids: IdOrder::TopDown, first_id: 20, ..kalibr(4, 3) };
    whole(TargetSpec::AprilGrid(board), 0.28, camera());
}

#[test]
fn the_corners_of_a_single_tag_are_found_where_they_are() {
    let tag = AprilTag { tag_m: 0.05, id: 11, family: Dictionary::APRILTAG_36H11, border_bits: None };
    whole(TargetSpec::AprilTag(tag), 0.3, camera());
}

#[test]
fn centres_of_dots_are_those_of_the_dots_and_not_of_their_images() {
    // The centres of the ellipses are off by up to 0.25 px at these angles.
    whole(TargetSpec::Circles(Grid { columns: 7, rows: 5, square_m: 0.03 }), 0.45, camera());
    whole(TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 7, square_m: 0.025 }), 0.45, camera());
}

#[test]
fn a_lens_that_bends_the_board_does_not_move_its_corners() {
    let bent = Intrinsics { distortion: Distortion::BrownConrady([-0.3, 0.1, 0.001, -0.001, 0.0]), ..camera() };
    for target in [TargetSpec::Charuco(charuco(6, 4, None)), TargetSpec::AprilGrid(kalibr(4, 3))] {
        let photo = photo_of(target, bent, 0.36, [0.3, 0.9, 0.2], Vector2::new(-40.0, 20.0));
        let corners = found(&photo.render(5), &target);
        assert_eq!(right(&corners, &photo, &format!("{target} through a lens")), target.len());
    }
}

/// Corners that are at least this far inside of the rest of the image must be found: their tags or markers are wholly
/// in sight.
const CLEAR_PX: f64 = 80.0;

#[test]
fn the_part_of_a_board_that_is_in_sight_is_numbered_rightly() {
    for target in [TargetSpec::Charuco(charuco(6, 4, None)), TargetSpec::AprilGrid(kalibr(4, 3))] {
        let distance = if matches!(target, TargetSpec::Charuco(_)) { 0.42 } else { 0.33 };
        for (offset, covered) in [
            (Vector2::new(190.0, 20.0), None),
            (Vector2::new(-30.0, -170.0), None),
            (Vector2::new(0.0, 0.0), Some([0, 0, 300, 200])),
            (Vector2::new(0.0, 0.0), Some([280, 100, 360, 480])),
        ] {
            let mut photo = photo_of(target, camera(), distance, [0.4, 1.0, 0.5], offset);
            photo.covered = covered;
            let corners = found(&photo.render(3), &target);
            let what = format!("{target} moved by {offset:?}, covered {covered:?}");
            let count = right(&corners, &photo, &what);
            assert!(count < target.len(), "{what}: something is out of sight");
            let clear = |p: &Vector2<f64>| {
                let inside = p.min() > CLEAR_PX && p.x < 639.0 - CLEAR_PX && p.y < 479.0 - CLEAR_PX;
                let beside = covered.is_none_or(|[left, top, right, bottom]| {
                    let [l, t, r, b] = [left, top, right, bottom].map(f64::from);
                    p.x < l - CLEAR_PX || p.x > r + CLEAR_PX || p.y < t - CLEAR_PX || p.y > b + CLEAR_PX
                });
                inside && beside
            };
            assert!(photo.truth().iter().any(clear), "{what}: something is in sight");
            for (index, _) in photo.truth().iter().enumerate().filter(|(_, p)| clear(p)) {
                assert!(corners.iter().any(|c| c.index == index), "{what}: {index} is in sight and not found");
            }
        }
    }
}

#[test]
fn the_two_layouts_of_a_charuco_board_are_told_apart() {
    for (columns, rows) in [(5, 3), (4, 5), (5, 4)] {
        for layout in Layout::BOTH {
            let printed = TargetSpec::Charuco(charuco(columns, rows, Some(layout)));
            let photo = photo_of(printed, camera(), 0.45, [0.4, 1.0, 0.5], Vector2::zeros());
            let image = photo.render(2);
            let unstated = charuco(columns, rows, None);
            let what = format!("{columns}×{rows}, {}", layout.name());
            assert_eq!(right(&found(&image, &TargetSpec::Charuco(unstated)), &photo, &what), columns * rows);
            let seen = charuco_layout(&image, &unstated).expect("searches");
            let other = if layout == Layout::New { Layout::Legacy } else { Layout::New };
            let wrong = detect(&image, &TargetSpec::Charuco(charuco(columns, rows, Some(other))));
            if rows % 2 == 0 {
                // Both layouts are the same board.
                assert_eq!(seen, Some(Layout::New), "{what}");
                assert_eq!(wrong.expect("searches").map(|corners| corners.len()), Some(columns * rows), "{what}");
            } else {
                assert_eq!(seen, Some(layout), "{what}");
                let refused = VisionError::OtherLayout { stated: other.name(), seen: layout.name() };
                assert_eq!(wrong, Err(refused), "{what}");
            }
        }
    }
}

#[test]
fn asymmetric_dots_of_any_number_of_rows_are_numbered_as_the_pattern_has_them() {
    for rows in [6, 7] {
        let target = TargetSpec::AsymmetricCircles(Grid { columns: 4, rows, square_m: 0.025 });
        for roll in [-1.2, 0.3, 1.2] {
            let photo = photo_of(target, camera(), 0.5, [0.4, 1.0, roll], Vector2::zeros());
            assert_eq!(right(&found(&photo.render(1), &target), &photo, &format!("{rows} rows")), target.len());
        }
    }
}

#[test]
fn a_mirrored_target_is_not_accepted() {
    let targets = [
        TargetSpec::Charuco(charuco(6, 4, None)),
        TargetSpec::AprilGrid(kalibr(4, 3)),
        TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 6, square_m: 0.025 }),
    ];
    for target in targets {
        let photo = photo_of(target, camera(), 0.45, [0.3, 1.0, 0.2], Vector2::zeros());
        let mirrored = imageops::flip_horizontal(&photo.render(1));
        assert_eq!(detect(&mirrored, &target), Ok(None), "{target}");
    }
}

#[test]
fn another_board_is_not_accepted() {
    let photo = photo_of(TargetSpec::AprilGrid(kalibr(4, 3)), camera(), 0.33, [0.3, 1.0, 0.2], Vector2::zeros());
    let tags = photo.render(1);
    // Other numbers, and the same tags in rows of another length.
    for other in [AprilGrid { first_id: 100, ..kalibr(4, 3) }, AprilGrid { ids: IdOrder::TopDown, ..kalibr(6, 6) }] {
        assert_eq!(detect(&tags, &TargetSpec::AprilGrid(other)), Ok(None), "{other:?}");
    }
    assert_eq!(detect(&tags, &TargetSpec::Charuco(charuco(6, 4, None))), Ok(None));
    let photo = photo_of(TargetSpec::Charuco(charuco(6, 4, None)), camera(), 0.42, [0.3, 1.0, 0.2], Vector2::zeros());
    let board = photo.render(1);
    assert_eq!(detect(&board, &TargetSpec::AprilGrid(kalibr(4, 3))), Ok(None));
    let foreign = Charuco { dictionary: "6x6_250".parse().expect("known"), ..charuco(6, 4, None) };
    assert_eq!(detect(&board, &TargetSpec::Charuco(foreign)), Ok(None));
}

#[test]
fn the_stated_covariance_is_about_what_the_corners_scatter() {
    for target in [TargetSpec::Charuco(charuco(6, 4, None)), TargetSpec::AprilGrid(kalibr(4, 3))] {
        let photo = photo_of(target, camera(), 0.4, [0.5, 1.0, 0.5], Vector2::zeros());
        let (mut sum, mut count) = (0.0, 0.0);
        let truth = photo.truth();
        for seed in 0..3 {
            for corner in &found(&photo.render(seed), &target) {
                let off = corner.px - truth[corner.index];
                let covariance = corner.covariance_px2.expect("stated");
                sum += (covariance.try_inverse().expect("regular") * off).dot(&off) / 2.0;
                count += 1.0;
            }
        }
        let ratio: f64 = sum / count;
        println!("{target}: squared error over stated variance {ratio:.2}");
        // Within a factor of two in size; only the weights of corners against each other matter to a solver.
        assert!((0.25..4.0).contains(&ratio), "{target}: {ratio}");
    }
}
