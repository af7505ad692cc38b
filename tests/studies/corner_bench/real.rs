//! Boards found in the reference sets, and the repeatability of a detector on a robot that returns to one pose.

use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::Corner;
use image::GrayImage;
use nalgebra::Vector2;

use crate::{Detector, detectors, load, timed};

/// Folder, columns and rows.
pub const SETS: [(&str, usize, usize); 8] = [
    ("visp_franka_eye_in_hand", 9, 6),
    ("rwhe_kuka_1_eye_in_hand/images", 28, 17),
    ("rwhe_cs_synthetic_3/images", 9, 6),
    ("caliban_no_curv/images", 14, 9),
    ("opencv_stereo_9x6", 9, 6),
    ("alim_repeatability_intrinsics/cam1_intrinsics", 9, 7),
    ("alim_repeatability_intrinsics/repeatability", 9, 7),
    // No board of this size is in these: the time of a search without a result.
    ("rct_circles_eye_in_hand/images", 9, 6),
];

pub fn all() {
    let Some(data) = handeye_geometry::testing::data_folder() else { return };
    for (folder, columns, rows) in SETS {
        println!("{folder}");
        let images: Vec<GrayImage> = load(&data.join(folder));
        for detector in detectors() {
            one(detector, &images, &Grid { columns, rows, square_m: 1.0 }, folder.ends_with("/repeatability"));
        }
    }
}

fn one(detector: &Detector, images: &[GrayImage], grid: &Grid, repeats: bool) {
    let (mut times, mut views) = (Vec::new(), Vec::new());
    for image in images {
        let (corners, ms) = timed(detector, image, grid);
        times.push(ms / (f64::from(image.width()) * f64::from(image.height()) / 1e6));
        views.extend(corners);
    }
    println!(
        "  {:37} found {}/{}, {:.2} ms/MP",
        detector.name,
        views.len(),
        images.len(),
        median_high(times).unwrap_or(f64::NAN)
    );
    if repeats && views.len() > 1 {
        println!("  {:37} repeats to {:.4} px per axis", "", repeatability(&views));
    }
}

/// Standard deviation per axis of the corners over the views, without the common shift of each view.
fn repeatability(views: &[Vec<Corner>]) -> f64 {
    let (count, corners) = (views.len() as f64, views[0].len());
    let mean: Vec<Vector2<f64>> =
        (0..corners).map(|i| views.iter().map(|v| v[i].px).sum::<Vector2<f64>>() / count).collect();
    let mut sum = 0.0;
    for view in views {
        let off: Vec<Vector2<f64>> = view.iter().zip(&mean).map(|(c, m)| c.px - m).collect();
        let shift = off.iter().sum::<Vector2<f64>>() / corners as f64;
        sum += off.iter().map(|o| (o - shift).norm_squared()).sum::<f64>();
    }
    (sum / (2.0 * (count - 1.0) * (corners as f64 - 1.0))).sqrt()
}
