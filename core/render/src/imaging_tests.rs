use super::*;

const SIDE: u32 = 200;

fn flat(value: f32) -> Vec<f32> {
    vec![value; (3 * SIDE * SIDE) as usize]
}

fn mean_and_deviation(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

#[test]
fn noise_has_the_stated_deviation_and_no_offset() {
    let imaging = Imaging { noise_grey: 5.0, ..Imaging::default() };
    let image = develop(flat(0.5), SIDE, SIDE, &imaging, 3);
    let (mean, deviation) = mean_and_deviation(image.iter().map(|&b| f64::from(b)));
    // 120 000 values: standard error 0.014 of the mean, 0.010 of the deviation; rounding adds 1/12 of variance.
    assert!((mean - 127.5).abs() < 0.06, "{mean}");
    assert!((deviation - (25.0f64 + 1.0 / 12.0).sqrt()).abs() < 0.04, "{deviation}");
}

#[test]
fn noise_of_channels_and_neighbours_and_seeds_is_independent() {
    let imaging = Imaging { noise_grey: 8.0, ..Imaging::default() };
    let image = |seed| develop(flat(0.5), SIDE, SIDE, &imaging, seed).into_raw();
    let (one, other) = (image(1), image(2));
    let correlation = |a: &[u8], b: &[u8]| {
        let products = a.iter().zip(b).map(|(&a, &b)| (f64::from(a) - 127.5) * (f64::from(b) - 127.5) / 64.0);
        mean_and_deviation(products).0
    };
    // Standard error 0.003.
    for shift in [1, 2, 3, 600] {
        let value = correlation(&one[..one.len() - shift], &one[shift..]);
        assert!(value.abs() < 0.015, "{shift}: {value}");
    }
    assert!(correlation(&one, &other).abs() < 0.015);
    assert_eq!(one, image(1));
}

#[test]
fn blur_has_the_stated_width_and_keeps_the_sum() {
    for sigma in [0.2, 0.5, 0.7, 1.5, 4.0] {
        let weights = kernel(sigma);
        let both_sides = |power: i32| -> f64 {
            weights.iter().enumerate().skip(1).map(|(n, &w)| 2.0 * (n as f64).powi(power) * f64::from(w)).sum()
        };
        assert!((f64::from(weights[0]) + both_sides(0) - 1.0).abs() < 1e-6);
        let width = both_sides(2).sqrt();
        assert!((width - sigma).abs() < 0.02 * sigma + 0.002, "{sigma}: {width}");
    }
}

#[test]
fn blur_spreads_a_bright_pixel_evenly_to_all_sides_and_over_no_channel() {
    let (mut dot, middle) = (flat(0.0), (3 * (SIDE * 100 + 100)) as usize);
    dot[middle] = 1.0;
    let blurred = blur(&dot, SIDE as usize, 1.2);
    let row = 3 * SIDE as usize;
    for step in [1, 2, 3] {
        assert!(blurred[middle + 3 * step] > 0.0);
        for (a, b) in [(3 * step, row * step), (3 * step, 0), (row * step, 0)] {
            assert_eq!(blurred[middle + a], blurred[middle - a]);
            assert!(a == b || b == 0 || (blurred[middle + a] - blurred[middle + b]).abs() < 1e-7);
        }
    }
    assert_eq!(blurred.iter().skip(1).step_by(3).sum::<f32>(), 0.0);
    assert!((blurred.iter().sum::<f32>() - 1.0).abs() < 1e-5);
}

#[test]
fn a_flat_image_stays_flat_up_to_the_border() {
    let imaging = Imaging { blur_px: 2.0, ..Imaging::default() };
    assert!(develop(flat(0.6), SIDE, SIDE, &imaging, 0).iter().all(|&b| b == 153));
}

#[test]
fn grey_levels_round_to_the_nearest_and_do_not_wrap() {
    for (value, level) in [(-3.0, 0), (0.49, 0), (0.51, 1), (127.4, 127), (254.6, 255), (900.0, 255)] {
        assert_eq!(grey(value), level);
    }
}

#[test]
fn depth_noise_grows_with_the_square_of_distance_and_spares_the_far_plane() {
    let imaging = Imaging { depth_noise_m: 0.001, depth_noise_per_m2: 0.002, ..Imaging::default() };
    for (depth, sigma) in [(0.5, 0.0015), (2.0, 0.009)] {
        let mut depths = vec![depth as f32; 50_000];
        disturb(&mut depths, 0.01, 3.5, &imaging, 9);
        let (mean, deviation) = mean_and_deviation(depths.iter().map(|&d| f64::from(d)));
        assert!((mean - depth).abs() < 0.03 * sigma && (deviation - sigma).abs() < 0.02 * sigma, "{mean} {deviation}");
    }
    let mut depths = vec![3.5; 100];
    disturb(&mut depths, 0.01, 3.5, &imaging, 9);
    assert!(depths.iter().all(|&d| d == 3.5));
}

#[test]
fn values_that_are_not_positive_switch_an_effect_off() {
    for off in [0.0, -1.0, f64::NAN] {
        let imaging = Imaging {
            blur_px: off,
            noise_grey: off,
            depth_noise_m: off,
            depth_noise_per_m2: off,
            ..Imaging::default()
        };
        assert!(develop(flat(0.2), SIDE, SIDE, &imaging, 0).iter().all(|&b| b == 51));
        let mut depths = vec![1.0; 10];
        disturb(&mut depths, 0.01, 3.5, &imaging, 0);
        assert_eq!(depths, vec![1.0; 10]);
    }
}
