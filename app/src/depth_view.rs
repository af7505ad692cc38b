//! Depth as colours: which depths the colour map covers, and the map.
//!
//! Runs on the camera worker. The window uses [`colour`] alone, for the colour bar.

use std::sync::OnceLock;

use handeye_core::image::{Rgb, RgbImage};
use handeye_sim_link::client::convert::DepthFrame;

/// Where nothing reflects.
pub const NO_RETURN: [u8; 3] = [40, 42, 48];

/// Colours in the table: more than a screen can tell apart.
const LEVELS: usize = 256;

/// Every so manyth pixel is enough to find the range.
const RANGE_STRIDE: usize = 7;

/// Share of the depths at each end that the range may leave out: single wild pixels must not set it.
const RANGE_TAIL: f64 = 0.01;

/// The range ends at multiples of this [m], so that it does not flicker.
const RANGE_STEP_M: f32 = 0.05;

/// The shortest range [m]: a flat wall is not stretched over the whole map.
const SHORTEST_RANGE_M: f32 = 0.10;

/// Polynomials of the Turbo colour map in red, green and blue, lowest power first.
/// Source: A. Mikhailov, "Turbo, an improved rainbow colormap for visualization", 2019, fifth-order approximation.
const TURBO: [[f32; 6]; 3] = [
    [0.135_721_38, 4.615_392_6, -42.660_322, 132.131_09, -152.942_4, 59.286_38],
    [0.091_402_61, 2.194_188_4, 4.842_966_6, -14.185_033, 4.277_298_6, 2.829_566],
    [0.106_673_3, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25],
];

/// The colour of a depth within a range: red is near, blue is far.
pub fn colour(depth_m: f32, range_m: [f32; 2]) -> [u8; 3] {
    let [near, far] = range_m;
    let part = ((depth_m - near) / (far - near).max(f32::EPSILON)).clamp(0.0, 1.0);
    let level = ((1.0 - part) * (LEVELS - 1) as f32).round() as usize;
    table().get(level).copied().unwrap_or(NO_RETURN)
}

/// A picture of depths. What is not finite, not positive, or at `limit_m` and beyond has the colour [`NO_RETURN`].
pub fn picture(depth: &DepthFrame, range_m: [f32; 2], limit_m: f32) -> RgbImage {
    RgbImage::from_fn(depth.width, depth.height, |column, row| {
        let seen = depth.at(column, row).filter(|&depth_m| is_return(depth_m, limit_m));
        Rgb(seen.map_or(NO_RETURN, |depth_m| colour(depth_m, range_m)))
    })
}

/// The depths [m] that a picture has, rounded outwards. `previous` is kept while it still fits, because a colour map
/// that changes with every frame cannot be read. `None` when there is nothing to see and there was no range.
pub fn range_of(depth: &DepthFrame, limit_m: f32, previous: Option<[f32; 2]>) -> Option<[f32; 2]> {
    let mut seen: Vec<f32> =
        depth.metres.iter().step_by(RANGE_STRIDE).copied().filter(|&depth_m| is_return(depth_m, limit_m)).collect();
    if seen.is_empty() {
        return previous;
    }
    let tail = (seen.len() as f64 * RANGE_TAIL) as usize;
    let last = seen.len() - 1;
    let near = *seen.select_nth_unstable_by(tail, f32::total_cmp).1;
    let far = *seen.select_nth_unstable_by(last - tail, f32::total_cmp).1;
    let range = rounded(near, far);
    Some(previous.filter(|&previous| still_fits(previous, range)).unwrap_or(range))
}

/// Whether something reflects at this depth.
fn is_return(depth_m: f32, limit_m: f32) -> bool {
    depth_m > 0.0 && depth_m < limit_m
}

fn rounded(near: f32, far: f32) -> [f32; 2] {
    let near = (near / RANGE_STEP_M).floor() * RANGE_STEP_M;
    let far = (far / RANGE_STEP_M).ceil() * RANGE_STEP_M;
    [near, far.max(near + SHORTEST_RANGE_M)]
}

/// It covers the new range and is not much longer than it.
fn still_fits(previous: [f32; 2], range: [f32; 2]) -> bool {
    let covers = previous[0] <= range[0] && previous[1] >= range[1];
    covers && (previous[1] - previous[0]) < 1.5 * (range[1] - range[0])
}

fn table() -> &'static [[u8; 3]; LEVELS] {
    static TABLE: OnceLock<[[u8; 3]; LEVELS]> = OnceLock::new();
    TABLE.get_or_init(|| {
        std::array::from_fn(|level| {
            let x = level as f32 / (LEVELS - 1) as f32;
            TURBO.map(|powers| {
                let value = powers.iter().rev().fold(0.0, |sum, factor| sum * x + factor);
                (value.clamp(0.0, 1.0) * 255.0).round() as u8
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(metres: Vec<f32>) -> DepthFrame {
        DepthFrame { width: metres.len() as u32, height: 1, metres }
    }

    #[test]
    fn near_is_red_and_far_is_blue() {
        let range = [0.2, 3.5];
        let [red, _, blue] = colour(0.25, range);
        assert!(red > blue, "near: {red} {blue}");
        let [red, _, blue] = colour(3.4, range);
        assert!(blue > red, "far: {red} {blue}");
    }

    #[test]
    fn turbo_agrees_with_its_published_table() {
        // Middle and three quarters of the published 256 entries; the polynomial is good to a few levels.
        for (depth_m, published) in [(1.0 - 128.0 / 255.0, [164, 252, 60]), (1.0 - 192.0 / 255.0, [251, 126, 33])] {
            let got = colour(depth_m, [0.0, 1.0]);
            for (got, published) in got.iter().zip(published) {
                assert!((i32::from(*got) - published).abs() <= 12, "{got} against {published}");
            }
        }
    }

    #[test]
    fn what_reflects_nothing_has_no_depth_colour() {
        let picture = picture(&frame(vec![0.5, f32::NAN, 0.0, -1.0, 3.5, f32::INFINITY]), [0.2, 1.0], 3.5);
        let is_gray: Vec<bool> = picture.pixels().map(|pixel| pixel.0 == NO_RETURN).collect();
        assert_eq!(is_gray, [false, true, true, true, true, true]);
    }

    #[test]
    fn the_range_ignores_pixels_without_return_and_single_wild_ones() {
        let mut metres: Vec<f32> = (0..7000).map(|i| 0.41 + 0.3 * i as f32 / 7000.0).collect();
        metres[0] = 0.02;
        metres[7] = 3.5;
        let [near, far] = range_of(&frame(metres), 3.5, None).expect("a range");
        assert!((near - 0.40).abs() < 1e-4 && (far - 0.75).abs() < 1e-4, "{near} {far}");
    }

    #[test]
    fn the_range_stays_while_it_fits_and_changes_when_it_does_not() {
        let flat = |from: f32, to: f32| frame((0..700).map(|i| from + (to - from) * i as f32 / 700.0).collect());
        let first = range_of(&flat(0.40, 0.80), 3.5, None).expect("a range");
        assert_eq!(range_of(&flat(0.44, 0.76), 3.5, Some(first)), Some(first), "a small change is no reason");
        assert_ne!(range_of(&flat(0.40, 1.60), 3.5, Some(first)), Some(first), "it does not cover the far end");
        assert_ne!(range_of(&flat(0.50, 0.60), 3.5, Some(first)), Some(first), "it is far too long");
        assert_eq!(range_of(&flat(3.5, 4.0), 3.5, Some(first)), Some(first), "nothing to see");
    }

    #[test]
    fn a_flat_wall_is_not_stretched_over_the_whole_map() {
        let [near, far] = range_of(&frame(vec![0.62; 700]), 3.5, None).expect("a range");
        assert!(far - near >= SHORTEST_RANGE_M - 1e-6);
    }
}
