//! Which depths the colours of a live depth image cover. Runs on the camera worker.

use handeye_geometry::depth::{DepthImage, DepthSample};

/// Every Nth pixel is enough to find the range. A prime, so that it does not fall into step with the columns.
const RANGE_STRIDE: usize = 7;

/// Share of the depths at each end that the range may leave out: single outlier pixels must not set it.
const RANGE_TAIL: f64 = 0.01;

/// The range ends at multiples of this \[m\], so that it does not flicker.
const RANGE_STEP_M: f32 = 0.05;

/// Share of its length by which the range is longer at each end: the ends of the colour map are dark, and what is
/// nearest is what people look for.
const RANGE_MARGIN: f32 = 0.08;

/// The shortest range [m]: a flat wall is not stretched over the whole map.
const SHORTEST_RANGE_M: f32 = 0.10;

/// A range that covers the image may be this many times as long as needed before it is made shorter.
const LARGEST_EXCESS: f32 = 1.5;

/// The depths \[m\] that an image has, rounded outwards. `previous` is kept while it still fits, because a colour map
/// that changes with every frame cannot be read. `None` when there is nothing to see and there was no range.
pub fn range_of(depth: &DepthImage, far_plane_m: f32, previous: Option<[f32; 2]>) -> Option<[f32; 2]> {
    let mut seen: Vec<f32> = samples(depth, far_plane_m).collect();
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

fn samples(depth: &DepthImage, far_plane_m: f32) -> impl Iterator<Item = f32> + '_ {
    let pixels = depth.width as usize * depth.height as usize;
    (0..pixels).step_by(RANGE_STRIDE).filter_map(move |index| {
        let (column, row) = (index as u32 % depth.width, index as u32 / depth.width);
        match depth.sample(column, row, far_plane_m) {
            DepthSample::Metres(depth_m) => Some(depth_m),
            DepthSample::Far | DepthSample::Invalid => None,
        }
    })
}

fn rounded(near: f32, far: f32) -> [f32; 2] {
    let margin = RANGE_MARGIN * (far - near);
    let near = ((near - margin) / RANGE_STEP_M).floor().max(0.0) * RANGE_STEP_M;
    let far = ((far + margin) / RANGE_STEP_M).ceil() * RANGE_STEP_M;
    [near, far.max(near + SHORTEST_RANGE_M)]
}

fn still_fits(previous: [f32; 2], range: [f32; 2]) -> bool {
    let covers = previous[0] <= range[0] && previous[1] >= range[1];
    covers && (previous[1] - previous[0]) < LARGEST_EXCESS * (range[1] - range[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(metres: Vec<f32>) -> DepthImage {
        DepthImage { width: metres.len() as u32, height: 1, metres }
    }

    fn ramp(from: f32, to: f32) -> DepthImage {
        image((0..700).map(|i| from + (to - from) * i as f32 / 700.0).collect())
    }

    #[test]
    fn the_range_ignores_pixels_without_surface_and_single_wild_ones() {
        let mut metres: Vec<f32> = (0..7000).map(|i| 0.41 + 0.3 * i as f32 / 7000.0).collect();
        for (index, value) in [0.02, 3.5, f32::NAN, -1.0, f32::INFINITY].into_iter().enumerate() {
            metres[index * RANGE_STRIDE] = value;
        }
        let [near, far] = range_of(&image(metres), 3.5, None).expect("a range");
        assert!((near - 0.35).abs() < 1e-4 && (far - 0.75).abs() < 1e-4, "{near} {far}");
    }

    #[test]
    fn the_range_stays_while_it_fits_and_changes_when_it_does_not() {
        let first = range_of(&ramp(0.40, 0.80), 3.5, None).expect("a range");
        assert_eq!(range_of(&ramp(0.44, 0.76), 3.5, Some(first)), Some(first), "a small change is no reason");
        assert_ne!(range_of(&ramp(0.40, 1.60), 3.5, Some(first)), Some(first), "it does not cover the far end");
        assert_ne!(range_of(&ramp(0.50, 0.60), 3.5, Some(first)), Some(first), "it is far too long");
        assert_eq!(range_of(&ramp(3.5, 4.0), 3.5, Some(first)), Some(first), "nothing to see");
    }

    #[test]
    fn a_flat_wall_is_not_stretched_over_the_whole_map() {
        let [near, far] = range_of(&image(vec![0.62; 700]), 3.5, None).expect("a range");
        assert!(far - near >= SHORTEST_RANGE_M - 1e-6);
    }

    #[test]
    fn an_empty_image_has_no_range() {
        assert_eq!(range_of(&image(Vec::new()), 3.5, None), None);
    }
}
