use super::*;
use handeye_geometry::targets::{AprilGrid, AprilTag, Charuco, Dictionary, Grid, IdOrder, Layout};

fn charuco() -> TargetSpec {
    let dictionary = "5x5_100".parse().expect("known");
    TargetSpec::Charuco(Charuco { columns: 6, rows: 8, square_m: 0.022, marker_m: 0.016, dictionary, layout: None })
}

fn kalibr() -> AprilGrid {
    AprilGrid {
        columns: 4,
        rows: 5,
        tag_m: 0.03,
        spacing_m: 0.009,
        first_id: 0,
        family: Dictionary::APRILTAG_36H11,
        border_bits: None,
        ids: IdOrder::BottomUp,
    }
}

fn all() -> Vec<TargetSpec> {
    vec![
        TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 }),
        TargetSpec::Circles(Grid { columns: 7, rows: 5, square_m: 0.02 }),
        TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 11, square_m: 0.018 }),
        charuco(),
        TargetSpec::AprilGrid(kalibr()),
        TargetSpec::AprilTag(AprilTag { tag_m: 0.1, id: 7, family: Dictionary::APRILTAG_36H11, border_bits: None }),
    ]
}

/// Contents of a PDF without compression: the operators of its page, and its box.
struct Read {
    media_box: [f64; 4],
    matrix: [f64; 6],
    /// Rectangles of the path in millimetres: x, y, width, height.
    rectangles: Vec<[f64; 4]>,
    /// Points of curves that lie on them.
    on_curves: Vec<[f64; 2]>,
    texts: Vec<String>,
}

fn read(pdf: &[u8]) -> Read {
    let text = String::from_utf8_lossy(pdf).into_owned();
    let numbers = |part: &str| part.split_whitespace().filter_map(|w| w.parse().ok()).collect::<Vec<f64>>();
    let after = text.split_once("/MediaBox [").expect("a box").1;
    let media_box = numbers(after.split_once(']').expect("closed").0).try_into().expect("four");
    let stream = after.split_once("stream\n").expect("a stream").1.split_once("endstream").expect("closed").0;
    let mut out = Read { media_box, matrix: [0.0; 6], rectangles: vec![], on_curves: vec![], texts: vec![] };
    for line in stream.lines() {
        let values = numbers(line);
        assert!(!line.contains("e-"), "an exponent in {line:?}");
        match line.rsplit(' ').next().expect("an operator") {
            "cm" => out.matrix = values.try_into().expect("six"),
            "re" => out.rectangles.push(values.try_into().expect("four")),
            "m" => out.on_curves.push(values.try_into().expect("two")),
            "c" => out.on_curves.push([values[4], values[5]]),
            "Tj" => out.texts.push(line.trim_end_matches(" Tj").to_owned()),
            _ => {}
        }
    }
    out
}

/// A tenth of a micrometre by rounding, twice, and the digits of single precision at half a metre.
const EXACT_MM: f64 = 3e-4;

#[test]
fn every_shape_is_on_the_page_in_exact_millimetres() {
    for target in all() {
        let sheet = Sheet::new(&target, Page::A4).expect("fits");
        let page = read(&pdf(&sheet));
        // A point is 1/72 inch.
        let points = sheet.size_mm.map(|mm| mm / 25.4 * 72.0);
        assert!((page.media_box[2] - points[0]).abs() < 1e-3 && (page.media_box[3] - points[1]).abs() < 1e-3);
        assert_eq!(page.media_box[..2], [0.0, 0.0]);
        let [a, b, c, d, e, f] = page.matrix;
        assert!((a * 25.4 / 72.0 - 1.0).abs() < 1e-6 && (d * 25.4 / 72.0 + 1.0).abs() < 1e-6, "{a} {d}");
        assert_eq!([b, c, e], [0.0; 3]);
        assert!((f - points[1]).abs() < 1e-3);
        let mut rectangles = page.rectangles.iter();
        let mut curves = page.on_curves.chunks(5);
        for shape in &sheet.drawing.shapes {
            let (low, high) = shape.bounds();
            let [x, y] = sheet.origin_mm;
            let want = [x + low.x * 1e3, y + low.y * 1e3, (high.x - low.x) * 1e3, (high.y - low.y) * 1e3];
            let got = match shape {
                Shape::Rectangle { .. } => *rectangles.next().expect("a rectangle"),
                Shape::Dot { .. } => {
                    let points = curves.next().expect("a circle");
                    let range = |axis: usize| {
                        let values = points.iter().map(|p| p[axis]);
                        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
                    };
                    let ((left, right), (top, bottom)) = (range(0), range(1));
                    [left, top, right - left, bottom - top]
                }
            };
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < EXACT_MM), "{target}: {got:?} for {want:?}");
        }
    }
}

#[test]
fn both_rulers_are_100_mm_long_with_a_tick_at_every_millimetre() {
    let sheet = Sheet::new(&charuco(), Page::A4).expect("fits");
    let page = read(&pdf(&sheet));
    let ruler = &page.rectangles[sheet.drawing.shapes.len()..];
    assert_eq!(ruler.len(), 2 * 102);
    for (axis, ticks) in ruler.chunks(102).enumerate() {
        let start = sheet.rulers_mm[axis][axis];
        assert!((ticks[0][2 + axis] - 100.0).abs() < EXACT_MM, "the line: {:?}", ticks[0]);
        for (millimetre, tick) in ticks[1..].iter().enumerate() {
            let middle = tick[axis] + tick[2 + axis] / 2.0;
            assert!((middle - start - millimetre as f64).abs() < EXACT_MM, "tick {millimetre}: {tick:?}");
        }
    }
    let text = page.texts.join("\n");
    for word in ["charuco", "6x8", "22 mm", "16 mm", "5x5_100", "100 %", "100 mm"] {
        assert!(text.contains(word), "{word:?} is missing in {text}");
    }
}

#[test]
fn nothing_overlaps_and_nothing_leaves_the_page() {
    for target in all() {
        for page in [Page::A4, Page::A3, Page::Letter, Page::Fit] {
            let sheet = Sheet::new(&target, page).expect("fits");
            let (low, high) = sheet.drawing.bounds();
            let place = |p: nalgebra::Vector2<f64>, axis: usize| sheet.origin_mm[axis] + p[axis] * 1e3;
            let quiet = (sheet.drawing.quiet_m * 1e3).max(5.0);
            // The strip of a ruler is 9 mm.
            assert!(place(low, 0) - quiet >= sheet.rulers_mm[1][0] + 9.0 - 1e-9, "{target} on {page}");
            assert!(place(high, 1) + quiet <= sheet.rulers_mm[0][1] + 1e-9, "{target} on {page}");
            assert!(place(low, 1) >= 10.0 - 1e-9 && place(high, 0) <= sheet.size_mm[0] - 10.0 + 1e-9);
            for shape in sheet.ruler_shapes() {
                let (low, high) = shape.bounds();
                assert!(low.min() >= 9.8 && high.x <= sheet.size_mm[0] && high.y <= sheet.size_mm[1] - 10.0);
            }
        }
    }
}

#[test]
fn a_page_that_is_too_small_says_what_is_needed() {
    let large = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.03 });
    let refused = Sheet::new(&large, Page::A4).expect_err("330 mm");
    assert!(matches!(refused, PrintError::DoesNotFit { has_mm: [297.0, 210.0], .. }), "{refused}");
    let fit = Sheet::new(&large, Page::Fit).expect("fits");
    assert!(fit.size_mm[0] >= 330.0);
    let huge = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 1.0 });
    assert!(matches!(Sheet::new(&huge, Page::Fit), Err(PrintError::TooLarge { .. })));
    let none = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: f64::NAN });
    assert!(matches!(Sheet::new(&none, Page::Fit), Err(PrintError::BadTarget { .. })));
}

#[test]
fn tags_stand_upright_as_the_apriltag_project_draws_them() {
    // The first code of 36h11, most significant bit at the top left; a set bit is white.
    const FIRST: u64 = 0xd_5d62_8584;
    let tag = AprilTag { tag_m: 0.08, id: 0, family: Dictionary::APRILTAG_36H11, border_bits: None };
    let drawing = Drawing::of(&TargetSpec::AprilTag(tag)).expect("drawn");
    for bit in 0..36usize {
        let (row, column) = (bit / 6, bit % 6);
        let white = FIRST >> (35 - bit) & 1 == 1;
        // Cells of 10 mm, the code within a border of one.
        let middle = nalgebra::Vector2::new(column as f64 + 1.5, row as f64 + 1.5) * 0.01;
        assert_eq!(drawing.shapes.iter().any(|s| s.contains(&middle)), !white, "row {row}, column {column}");
    }
}

#[test]
fn the_first_square_of_a_chessboard_is_dark_and_kalibrs_squares_touch_the_tags() {
    let dark = |target: &TargetSpec, x: f64, y: f64| {
        let p = nalgebra::Vector2::new(x, y);
        Drawing::of(target).expect("drawn").shapes.iter().any(|s| s.contains(&p))
    };
    let board = TargetSpec::Chessboard(Grid { columns: 4, rows: 3, square_m: 0.01 });
    assert!(dark(&board, 0.005, 0.005) && dark(&board, -0.005, -0.005) && !dark(&board, 0.015, 0.005));
    let grid = TargetSpec::AprilGrid(kalibr());
    assert!(dark(&grid, -0.001, -0.001) && !dark(&grid, -0.001, 0.001) && dark(&grid, 0.001, 0.001));
    let plain = TargetSpec::AprilGrid(AprilGrid { border_bits: Some(1), ..kalibr() });
    assert!(!dark(&plain, -0.001, -0.001));
}

#[test]
fn the_layouts_of_charuco_boards_differ_by_the_colour_of_the_first_square() {
    let board = |rows, layout| {
        let TargetSpec::Charuco(board) = charuco() else { unreachable!("a ChArUco board") };
        let target = TargetSpec::Charuco(Charuco { rows, layout: Some(layout), ..board });
        Drawing::of(&target).expect("drawn")
    };
    assert_eq!(board(8, Layout::New), board(8, Layout::Legacy));
    assert_ne!(board(7, Layout::New), board(7, Layout::Legacy));
}
