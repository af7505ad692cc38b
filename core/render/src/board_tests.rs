use super::*;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The part of the footprint that is dark by counting points, without any of the code under test.
fn counted(columns: i64, rows: i64, f: &Footprint, per_side: u32) -> f64 {
    let step = |i: u32| (f64::from(i) + 0.5) / f64::from(per_side) - 0.5;
    let mut dark = 0u32;
    for i in 0..per_side {
        for j in 0..per_side {
            let at = |k: usize| (f.centre[k] + step(i) * f.by_u[k] + step(j) * f.by_v[k]).floor() as i64;
            let (s, r) = (at(0), at(1));
            dark += u32::from((-1..columns).contains(&s) && (-1..rows).contains(&r) && (s + r) % 2 == 0);
        }
    }
    f64::from(dark) / f64::from(per_side * per_side)
}

#[test]
fn the_integral_agrees_with_counting_points_at_every_scale() {
    const PER_SIDE: u32 = 300;
    let pattern = Pattern::new(10, 7);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut worst = 0.0f64;
    for trial in 0..600 {
        // From 20 pixels per square to 5 squares per pixel.
        let size = [0.05, 0.2, 1.0, 5.0][trial % 4];
        let mut about = |scale: f64| random.random_range(-scale..scale);
        let f = Footprint {
            centre: [4.5 + about(7.0), 3.0 + about(5.5)],
            by_u: [about(size), about(size)],
            by_v: [about(size), about(size)],
        };
        worst = worst.max((pattern.dark_fraction(&f) - counted(10, 7, &f, PER_SIDE)).abs());
    }
    // A line through n × n points leaves about 1/n of them in doubt, each by half; several lines add up.
    assert!(worst < 3.0 / f64::from(PER_SIDE), "{worst}");
}

#[test]
fn one_line_across_a_pixel_gives_the_same_by_both_formulas() {
    let pattern = Pattern::new(10, 7);
    for offset in [-0.04, -0.011, 0.0, 0.02, 0.049] {
        for (by_u, by_v) in [([0.06, 0.01], [-0.02, 0.05]), ([0.06, 0.0], [0.0, 0.06]), ([-0.03, 0.04], [0.04, 0.03])] {
            for centre in [[3.0 + offset, 2.5], [3.5, 2.0 + offset], [-1.0 + offset, 0.5], [9.5, 7.0 + offset]] {
                let f = Footprint { centre, by_u, by_v };
                let (fast, general) = (pattern.dark_fraction(&f), pattern.integral(&f));
                assert!((fast - general).abs() < 1e-12, "{f:?}: {fast} {general}");
            }
        }
    }
}

#[test]
fn the_first_square_is_dark_and_its_neighbours_are_not() {
    let pattern = Pattern::new(10, 7);
    let at =
        |s: f64, r: f64| pattern.dark_fraction(&Footprint { centre: [s, r], by_u: [0.01, 0.0], by_v: [0.0, 0.01] });
    assert_eq!(at(0.5, 0.5), 1.0);
    assert_eq!(at(1.5, 0.5), 0.0);
    assert_eq!(at(0.5, 1.5), 0.0);
    assert_eq!(at(-0.5, -0.5), 1.0);
    assert_eq!(at(-0.5, 0.5), 0.0);
    assert_eq!(at(9.5, 6.5), 0.0, "the last square of a 10 × 7 board is white, the first dark: its ends differ");
    assert_eq!(at(-1.5, 0.5), 0.0, "white margin");
    assert_eq!(at(9.5, 7.5), 0.0, "white margin");
}

#[test]
fn an_edge_through_the_centre_of_a_pixel_halves_it() {
    let pattern = Pattern::new(10, 7);
    for angle in [0.0f64, 0.1, 0.7, 1.3] {
        let (sin, cos) = angle.sin_cos();
        let f = Footprint { centre: [4.0, 2.5], by_u: [0.05 * cos, 0.05 * sin], by_v: [-0.05 * sin, 0.05 * cos] };
        assert!((pattern.dark_fraction(&f) - 0.5).abs() < 1e-12);
    }
}

#[test]
fn a_pixel_larger_than_the_board_sees_its_mean() {
    let pattern = Pattern::new(10, 7);
    // 88 squares, 44 of them dark, in a pixel of 40 × 30 squares.
    let f = Footprint { centre: [4.0, 3.0], by_u: [40.0, 0.0], by_v: [0.0, 30.0] };
    assert!((pattern.dark_fraction(&f) - 44.0 / 1200.0).abs() < 1e-12);
}

#[test]
fn a_sheet_seen_edge_on_gives_a_finite_value() {
    let pattern = Pattern::new(10, 7);
    for by in [0.0, 1e-300, 1e300, f64::INFINITY, f64::NAN] {
        let f = Footprint { centre: [4.3, 2.2], by_u: [by, by], by_v: [by, by] };
        assert!((0.0..=1.0).contains(&pattern.dark_fraction(&f)), "{by}");
    }
}
