use image::{Rgb, RgbImage};
use nalgebra::Vector2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use super::{Average, Scatter};
use handeye_geometry::depth::DepthImage;
use handeye_geometry::targets::observation::Corner;

#[test]
fn colours_are_averaged_and_rounded_and_depths_leave_holes_out() {
    let frame = |level: u8, metres: [f32; 4]| {
        (RgbImage::from_pixel(2, 2, Rgb([level, 255, 0])), DepthImage { width: 2, height: 2, metres: metres.into() })
    };
    let nan = f32::NAN;
    // A surface that is measured twice of three times, one pixel far away twice, one never measured, one always.
    let (rgb, depth) = frame(10, [0.5, 3.5, 0.0, 1.0]);
    let mut average = Average::begin(&rgb, Some(&depth), 3.5);
    for (rgb, depth) in [frame(11, [nan, 3.5, nan, 2.0]), frame(11, [0.7, nan, 0.0, 3.0])] {
        assert!(average.add(&rgb, Some(&depth), 3.5));
    }
    let (rgb, depth) = average.finish();
    let depth = depth.expect("every image had one");
    assert_eq!(rgb.get_pixel(1, 1).0, [11, 255, 0], "10.67 is rounded up");
    assert!((depth.metres[0] - 0.6).abs() < 1e-6);
    assert_eq!(depth.metres[1], 3.5, "far, not a surface at the mean of far and nothing");
    assert_eq!(depth.metres[2], 0.0);
    assert_eq!(depth.metres[3], 2.0);
    let other = RgbImage::new(3, 2);
    assert!(!average.add(&other, Some(&depth), 3.5), "another size");
    assert!(!average.add(&rgb, None, 3.5), "no depth");
    assert_eq!(average.frames(), 3);
}

#[test]
fn the_scatter_is_that_of_one_image_whatever_the_places_of_the_corners() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let noise = Normal::new(0.0, 0.03).expect("a deviation");
    for (images, tolerance) in [(3, 0.15), (16, 0.06)] {
        let mut scatter = Scatter::default();
        for image in 0..images {
            // Every third corner is missing from every other image.
            let corners: Vec<Corner> = (0..70)
                .filter(|i| i % 3 > 0 || image % 2 == 0)
                .map(|index| {
                    let at = Vector2::new(index as f64 * 9.0, 100.0 - index as f64);
                    Corner::new(index, at + Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng)))
                })
                .collect();
            if image < 2 {
                assert_eq!(scatter.sigma_px(), None);
            }
            scatter.add(&corners);
        }
        let sigma = scatter.sigma_px().expect("three images");
        // Three standard deviations of the estimate.
        assert!((sigma / 0.03 - 1.0).abs() < tolerance, "{images} images: {sigma} px");
    }
}
