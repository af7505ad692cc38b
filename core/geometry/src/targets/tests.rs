use nalgebra::Vector2;

use super::*;

fn charuco(columns: usize, rows: usize) -> Charuco {
    let dictionary = "4x4_100".parse().expect("known");
    Charuco { columns, rows, square_m: 0.03, marker_m: 0.022, dictionary, layout: None }
}

fn kalibr(columns: usize, rows: usize) -> AprilGrid {
    AprilGrid {
        columns,
        rows,
        tag_m: 0.08,
        spacing_m: 0.024,
        first_id: 0,
        family: Dictionary::APRILTAG_36H11,
        border_bits: None,
        ids: IdOrder::BottomUp,
    }
}

#[test]
fn points_run_row_by_row() {
    let target = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });
    let points = target.points();
    assert_eq!(points.len(), 70);
    assert_eq!(points[0], Point3::origin());
    assert_eq!(points[1], Point3::new(0.015, 0.0, 0.0));
    assert_eq!(points[10], Point3::new(0.0, 0.015, 0.0));
    assert!((target.centre() - Point3::new(0.0675, 0.045, 0.0)).norm() < 1e-12);
}

#[test]
fn only_boards_of_odd_sum_have_two_different_ends() {
    let board = |columns, rows| TargetSpec::Chessboard(Grid { columns, rows, square_m: 0.01 });
    assert!(!board(10, 7).is_symmetric());
    assert!(!board(9, 6).is_symmetric());
    assert!(board(9, 7).is_symmetric());
    assert!(board(8, 8).is_symmetric());
}

#[test]
fn odd_rows_of_asymmetric_dots_are_shifted_by_half_their_distance() {
    let target = TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 11, square_m: 0.02 });
    let points = target.points();
    assert_eq!(points[1], Point3::new(0.04, 0.0, 0.0));
    assert_eq!(points[4], Point3::new(0.02, 0.02, 0.0));
    assert_eq!(points[8], Point3::new(0.0, 0.04, 0.0));
    assert!((target.centre() - Point3::new(0.07, 0.1, 0.0)).norm() < 1e-12);
    assert!(!target.is_symmetric());
}

#[test]
fn half_a_turn_maps_asymmetric_dots_on_themselves_only_for_even_rows() {
    for rows in 3..9 {
        let target = TargetSpec::AsymmetricCircles(Grid { columns: 4, rows, square_m: 1.0 });
        let points = target.points();
        let centre = target.centre();
        let turned = points.iter().map(|p| centre + (centre - p));
        let same = turned.into_iter().all(|t| points.iter().any(|p| (p - t).norm() < 1e-9));
        assert_eq!(same, target.is_symmetric(), "{rows} rows");
    }
}

#[test]
fn layouts_differ_only_for_even_rows_of_squares() {
    for rows in 2..6 {
        let board = charuco(4, rows);
        let [new, legacy] = Layout::BOTH.map(|layout| board.marker_squares(layout));
        assert_eq!(new == legacy, board.layouts_are_alike(), "{rows} rows of corners");
        assert_eq!(
            new.len()
                + (0..=rows).map(|r| (0..=4).filter(|&c| board.is_dark(Layout::New, c, r)).count()).sum::<usize>(),
            5 * (rows + 1)
        );
        // The new layout has a dark square at the top left, the legacy one at the bottom left.
        assert!(board.is_dark(Layout::New, 0, 0));
        assert!(board.is_dark(Layout::Legacy, 0, rows));
    }
}

#[test]
fn the_marker_of_a_square_is_in_its_middle() {
    let corners = charuco(4, 3).marker_corners((0, 0));
    assert!((corners[0] - Vector2::new(-0.026, -0.026)).norm() < 1e-12);
    assert!((corners[2] - Vector2::new(-0.004, -0.004)).norm() < 1e-12);
}

#[test]
fn corners_of_tags_are_numbered_from_the_top_left_and_tags_as_kalibr_has_them() {
    let board = kalibr(6, 5);
    assert_eq!(TargetSpec::AprilGrid(board).len(), 120);
    // Kalibr's tag 0 is at the bottom left.
    assert_eq!(board.place_of(0), Some((0, 4)));
    assert_eq!(board.place_of(29), Some((5, 0)));
    assert_eq!(board.place_of(30), None);
    assert_eq!(AprilGrid { ids: IdOrder::TopDown, ..board }.place_of(7), Some((1, 1)));
    for row in 0..5 {
        for column in 0..6 {
            assert_eq!(board.place_of(board.id_at(column, row)), Some((column, row)));
        }
    }
    assert_eq!(board.corner_indices((1, 1)), [26, 27, 39, 38]);
    let corners = board.tag_corners((1, 1));
    assert!((corners[0] - Vector2::new(0.104, 0.104)).norm() < 1e-12);
    assert!((corners[2] - Vector2::new(0.184, 0.184)).norm() < 1e-12);
}

#[test]
fn targets_that_cannot_be_are_named_by_key() {
    let key = |target: TargetSpec| target.check().expect_err("refused").key;
    assert_eq!(key(TargetSpec::Circles(Grid { columns: 2, rows: 5, square_m: 0.1 })), "columns");
    assert_eq!(key(TargetSpec::Charuco(Charuco { marker_m: 0.03, ..charuco(4, 4) })), "marker_m");
    assert_eq!(key(TargetSpec::Charuco(charuco(20, 20))), "dictionary");
    assert_eq!(key(TargetSpec::AprilGrid(AprilGrid { first_id: 580, ..kalibr(3, 3) })), "first_id");
    assert_eq!(key(TargetSpec::AprilGrid(AprilGrid { first_id: usize::MAX, ..kalibr(3, 3) })), "first_id");
    assert_eq!(key(TargetSpec::AprilGrid(AprilGrid { border_bits: Some(0), ..kalibr(3, 3) })), "border_bits");
    let tag = AprilTag { tag_m: 0.05, id: 587, family: Dictionary::APRILTAG_36H11, border_bits: None };
    assert_eq!(key(TargetSpec::AprilTag(tag)), "id");
    assert!(TargetSpec::AprilTag(AprilTag { id: 586, ..tag }).check().is_ok());
}

#[test]
fn families_have_the_names_that_others_give_them() {
    for name in ["apriltag_36h11", "36h11", "tag36h11", "t36h11", "DICT_APRILTAG_36h11"] {
        assert_eq!(name.parse(), Ok(Dictionary::APRILTAG_36H11), "{name}");
    }
    assert_eq!("DICT_5X5_100".parse::<Dictionary>().map(Dictionary::name), Ok("5x5_100"));
    assert!("8x8_50".parse::<Dictionary>().is_err());
    assert!(Dictionary::all().all(|d| d.name().parse() == Ok(d)));
}

#[test]
fn targets_survive_a_file() {
    let all = [
        TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 }),
        TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 11, square_m: 0.02 }),
        TargetSpec::Charuco(charuco(4, 3)),
        TargetSpec::Charuco(Charuco { layout: Some(Layout::Legacy), ..charuco(4, 3) }),
        TargetSpec::AprilGrid(kalibr(6, 6)),
        TargetSpec::AprilTag(AprilTag { tag_m: 0.05, id: 3, family: Dictionary::APRILTAG_36H11, border_bits: None }),
    ];
    for target in all {
        let text = serde_json::to_string(&target).expect("writes");
        assert!(text.starts_with(&format!("{{\"kind\":\"{}\"", target.kind())), "{text}");
        assert_eq!(serde_json::from_str::<TargetSpec>(&text).expect("reads"), target);
    }
}
