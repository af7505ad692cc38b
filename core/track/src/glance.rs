//! Whether a whole chessboard can be in an image at all, before a search that takes tens of times as long.
//!
//! On a ring around a chessboard's corner light and dark change four times, so that opposite samples are alike and
//! samples a quarter turn apart are not. Reference: Bennett & Lasenby 2014, "ChESS — Quick and robust detection of
//! chess-board features".

use image::GrayImage;

/// Radii of the rings [px]: for usual squares, and for small ones.
const RADII: [f64; 2] = [5.0, 3.0];
/// Looked at are every other row and column: a corner's response is wider than that.
const STRIDE: usize = 2;
/// Least response, and how much more per grey level of noise. A corner with a difference of `c` grey levels has some
/// `6 c`; noise of σ alone has −9 σ ± 6 σ.
const LEAST: (f64, f64) = (30.0, 10.0);
/// Mean of the summed differences of eight opposite pairs in noise of one grey level.
const OPPOSITE_PER_NOISE: f64 = 9.0;
/// Part of the board's corners that must be there: a search needs all, a ring misses some at steep angles.
const PART: f64 = 0.75;

/// `false` when the image has clearly fewer corners than a board with `corners`.
pub(super) fn may_show(image: &GrayImage, corners: usize) -> bool {
    let need = (PART * corners as f64).ceil() as usize;
    RADII.into_iter().any(|radius| Ring::new(image, radius).is_some_and(|ring| ring.count() >= need))
}

struct Ring<'a> {
    pixels: &'a [u8],
    width: usize,
    height: usize,
    margin: usize,
    /// The sixteen samples, relative to the middle.
    samples: [isize; 16],
}

impl<'a> Ring<'a> {
    fn new(image: &'a GrayImage, radius: f64) -> Option<Self> {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let margin = radius.ceil() as usize + 1;
        let samples = std::array::from_fn(|i| {
            let (sin, cos) = (i as f64 * std::f64::consts::TAU / 16.0).sin_cos();
            (radius * sin).round() as isize * width as isize + (radius * cos).round() as isize
        });
        let pixels = image.as_raw().get(..width * height)?;
        (width > 2 * margin && height > 2 * margin).then_some(Self { pixels, width, height, margin, samples })
    }

    /// Response, and what of it is noise.
    fn response(&self, at: usize) -> (i32, i32) {
        let level = |offset: isize| i32::from(self.pixels[at.wrapping_add_signed(offset)]);
        let ring: [i32; 16] = std::array::from_fn(|i| level(self.samples[i]));
        let mut alike = 0;
        let mut opposite = 0;
        let mut sum = 0;
        for i in 0..4 {
            let (a, b, c, d) = (ring[i], ring[i + 4], ring[i + 8], ring[i + 12]);
            alike += (a + c - b - d).abs();
            opposite += (a - c).abs() + (b - d).abs();
            sum += a + b + c + d;
        }
        let row = self.width as isize;
        let middle = level(0) + level(1) + level(-1) + level(row) + level(-row);
        (alike - opposite - (sum - 16 * middle / 5).abs(), opposite)
    }

    fn count(&self) -> usize {
        let columns = (self.width - 2 * self.margin).div_ceil(STRIDE);
        let rows = (self.height - 2 * self.margin).div_ceil(STRIDE);
        let mut responses = Vec::with_capacity(columns * rows);
        let mut opposites = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let at = (self.margin + row * STRIDE) * self.width + self.margin + column * STRIDE;
                let (response, opposite) = self.response(at);
                responses.push(response);
                opposites.push(opposite);
            }
        }
        let middle = opposites.len() / 2;
        let noise = f64::from(*opposites.select_nth_unstable(middle).1) / OPPOSITE_PER_NOISE;
        let least = (LEAST.0 + LEAST.1 * noise) as i32;
        let mut count = 0;
        for row in 1..rows.saturating_sub(1) {
            for column in 1..columns.saturating_sub(1) {
                let i = row * columns + column;
                let here = responses[i];
                let around = [i - columns - 1, i - columns, i - columns + 1, i - 1];
                let after = [i + 1, i + columns - 1, i + columns, i + columns + 1];
                // The first of equal neighbours counts.
                if here >= least
                    && around.iter().all(|j| responses[*j] < here)
                    && after.iter().all(|j| responses[*j] <= here)
                {
                    count += 1;
                }
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::moving_board::{Stage, Watch, board_at};
    use handeye_geometry::testing::GRID;

    #[test]
    fn an_image_without_board_shows_none_and_one_with_a_board_may() {
        let mut stage = Stage::new();
        let watch = Watch::new();
        for noise in [0.0, 2.0, 5.0, 10.0] {
            stage.noise = noise;
            assert!(!may_show(&stage.image(None, 1), GRID.len()), "noise {noise}");
            for (distance, blur) in [(-0.2, 2.0), (0.0, 0.3), (0.0, 1.5), (0.4, 0.7)] {
                stage.blur_px = blur;
                let board = board_at(Vector3::new(0.0, 0.0, distance), Vector3::new(0.5, 0.2, 0.4));
                let image = stage.image(Some(&watch.camera_from_target(&board)), 2);
                assert!(may_show(&image, GRID.len()), "noise {noise}, {distance} m further, blur {blur} px");
            }
        }
    }

    #[test]
    fn an_image_smaller_than_the_ring_shows_none() {
        assert!(!may_show(&GrayImage::new(5, 5), 9));
        assert!(!may_show(&GrayImage::new(0, 0), 9));
    }
}
