//! Colour to grey.

use image::{GrayImage, Luma, RgbImage};

/// Weights of ITU-R BT.601 in units of 2⁻¹⁵ for red, green and blue, the integers of OpenCV's `cvtColor`.
const WEIGHTS: [u32; 3] = [9798, 19235, 3735];

/// Grey image with the luma weights of ITU-R BT.601 (0.299 R + 0.587 G + 0.114 B), rounded as OpenCV 4's
/// `cvtColor(RGB2GRAY)` does, so that both give the same bytes.
pub fn gray_from_rgb(image: &RgbImage) -> GrayImage {
    let (width, height) = image.dimensions();
    GrayImage::from_fn(width, height, |x, y| {
        let sum: u32 = image.get_pixel(x, y).0.iter().zip(WEIGHTS).map(|(&c, w)| u32::from(c) * w).sum();
        // The weights add up to 2¹⁵, so 255 maps to 255 and the shift always fits a byte.
        Luma([((sum + (1 << 14)) >> 15) as u8])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::{Mat, Vec3b};
    use opencv::prelude::*;

    #[test]
    fn grey_bytes_equal_those_of_cvt_color() {
        let image = RgbImage::from_fn(64, 64, |x, y| {
            image::Rgb([(x * 4 + y) as u8, (y * 4 + 3 * x) as u8, (x * y + 17 * y) as u8])
        });
        let pixels: Vec<Vec3b> = image.pixels().map(|p| Vec3b::from(p.0)).collect();
        let source = Mat::new_rows_cols_with_data(64, 64, &pixels).expect("fits");
        let mut reference = Mat::default();
        opencv::imgproc::cvt_color_def(&source, &mut reference, opencv::imgproc::COLOR_RGB2GRAY).expect("converts");
        assert_eq!(gray_from_rgb(&image).as_raw().as_slice(), reference.data_bytes().expect("continuous"));
    }
}
