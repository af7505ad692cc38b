//! The detection rate for boards that are hard to see.

use image::{GrayImage, Luma};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::render::{Image, Look, view};
use crate::{Detector, detectors};

/// Changes the image of a seed.
type Change = fn(&mut Image, u64);

pub fn all(views: u64) {
    let at = Look::published;
    let usual = at(0.7, 2.0);
    let small = Look { square_px: 8.0, ..usual };
    let plain: Change = |_, _| {};
    let cases: [(&str, Look, Change); 21] = [
        ("blur 3.5 px", at(3.5, 2.0), plain),
        ("blur 5 px", at(5.0, 2.0), plain),
        ("blur 6 px", at(6.0, 2.0), plain),
        ("blur 1.5 px, squares of 8 px", Look { blur_px: 1.5, ..small }, plain),
        ("blur 2.5 px, squares of 8 px", Look { blur_px: 2.5, ..small }, plain),
        ("squares of 6 px", Look { square_px: 6.0, ..usual }, plain),
        ("squares of 5 px", Look { square_px: 5.0, ..usual }, plain),
        ("noise 20", at(0.7, 20.0), plain),
        ("noise 30", at(0.7, 30.0), plain),
        ("contrast 12", Look { light: 66.0, dark: 54.0, ..usual }, plain),
        ("contrast 20, noise 5", Look { light: 70.0, dark: 50.0, noise: 5.0, ..usual }, plain),
        ("contrast 40, blur 4 px", Look { light: 80.0, dark: 40.0, blur_px: 4.0, ..usual }, plain),
        ("light falls to a ninth", Look { fall: 1.6, ..usual }, plain),
        ("light falls to a ninth, blur 3.5 px", Look { fall: 1.6, blur_px: 3.5, ..usual }, plain),
        ("tilt up to 70°", Look { max_tilt: 1.22, ..usual }, plain),
        ("shadow", usual, shadow),
        ("glare", usual, glare),
        ("blobs on the board", usual, blobs),
        ("lines across the board", usual, line),
        ("motion of 8 px", usual, |image, _| moved(image, 8)),
        ("motion of 14 px", usual, |image, _| moved(image, 14)),
    ];
    for (name, look, change) in cases {
        println!("{name}");
        let images: Vec<Image> = (0..views)
            .map(|seed| {
                let mut image = view(&look, seed);
                change(&mut image, seed);
                image
            })
            .collect();
        for detector in detectors() {
            report(detector, &look, &images);
        }
    }
}

fn report(detector: &Detector, look: &Look, images: &[Image]) {
    let grid = look.grid();
    let (mut found, mut squares, mut normalised, mut count) = (0, 0.0, 0.0, 0.0);
    for image in images {
        let Some(corners) = (detector.find)(&image.image, &grid) else { continue };
        found += 1;
        for corner in &corners {
            let nearest = image.truth.iter().map(|t| corner.px - t).min_by(|a, b| a.norm().total_cmp(&b.norm()));
            let Some(error) = nearest else { continue };
            squares += error.norm_squared();
            count += 2.0;
            if let Some(inverse) = corner.covariance_px2.and_then(Matrix2::try_inverse) {
                normalised += error.dot(&(inverse * error));
            }
        }
    }
    println!(
        "  {:37} found {found}/{}, RMS per axis {:.4} px, normalised {:.2}",
        detector.name,
        images.len(),
        f64::sqrt(squares / count),
        f64::sqrt(normalised / count)
    );
}

/// Half of the image at a fifth of the light, with a penumbra of 30 px through the middle of the board.
fn shadow(image: &mut Image, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
    let middle = image.truth.iter().sum::<Vector2<f64>>() / image.truth.len() as f64;
    let light = |p: Vector2<f64>| 0.6 + 0.4 * ((p - middle).dot(&Vector2::new(cos, sin)) / 15.0).clamp(-1.0, 1.0);
    scaled(&mut image.image, light);
}

/// A bright spot of the size of a square, saturated in its middle.
fn glare(image: &mut Image, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let at = image.truth[rng.random_range(0..image.truth.len())];
    for (u, v, pixel) in image.image.enumerate_pixels_mut() {
        let r2 = (Vector2::new(f64::from(u), f64::from(v)) - at).norm_squared();
        let light = 300.0 * (-r2 / (2.0 * 5.0 * 5.0)).exp();
        *pixel = Luma([(f64::from(pixel.0[0]) + light).min(255.0) as u8]);
    }
}

/// Three grey blobs of half a square on the board.
fn blobs(image: &mut Image, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..3 {
        let at = image.truth[rng.random_range(0..image.truth.len())];
        let shift = Vector2::new(rng.random_range(-8.0..8.0), rng.random_range(-8.0..8.0));
        for (u, v, pixel) in image.image.enumerate_pixels_mut() {
            if (Vector2::new(f64::from(u), f64::from(v)) - at - shift).norm() < 5.0 {
                *pixel = Luma([110]);
            }
        }
    }
}

/// A grey line of 3 px, a cable, over the board.
fn line(image: &mut Image, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let at = image.truth[rng.random_range(0..image.truth.len())];
    let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
    for (u, v, pixel) in image.image.enumerate_pixels_mut() {
        if (Vector2::new(f64::from(u), f64::from(v)) - at).dot(&Vector2::new(cos, sin)).abs() < 1.5 {
            *pixel = Luma([90]);
        }
    }
}

/// The camera moved along the rows of the image while it exposed.
fn moved(image: &mut Image, px: u32) {
    let still = image.image.clone();
    for (u, v, pixel) in image.image.enumerate_pixels_mut() {
        let from = (u + px / 2).saturating_sub(px - 1);
        let range = from..=(u + px / 2).min(still.width() - 1);
        let count = range.clone().count() as u32;
        *pixel = Luma([(range.map(|u| u32::from(still.get_pixel(u, v).0[0])).sum::<u32>() / count) as u8]);
    }
}

fn scaled(image: &mut GrayImage, light: impl Fn(Vector2<f64>) -> f64) {
    for (u, v, pixel) in image.enumerate_pixels_mut() {
        let factor = light(Vector2::new(f64::from(u), f64::from(v)));
        *pixel = Luma([(f64::from(pixel.0[0]) * factor).round() as u8]);
    }
}
