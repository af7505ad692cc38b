//! Grey values must be OpenCV's own.

use handeye_images::gray_from_rgb;
use image::RgbImage;
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
