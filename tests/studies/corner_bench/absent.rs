//! What it takes to find that there is no board.

use image::GrayImage;

use crate::scenes::{GRID, SCENES, painted_over};
use crate::{Detector, detectors, load, native, real, timed};

/// VGA, 2 and 8 megapixels.
const SIZES: [(u32, u32); 3] = [(640, 480), (1632, 1224), (3264, 2448)];

pub fn all(images: u64) {
    for scene in SCENES {
        for size in SIZES {
            println!("{}, {}×{}", scene.name, size.0, size.1);
            let images: Vec<GrayImage> = (0..images).map(|seed| (scene.image)(size, seed)).collect();
            for detector in detectors() {
                report(detector, &images.iter().map(|image| (image, &GRID)).collect::<Vec<_>>());
            }
        }
    }
    let Some(data) = handeye_geometry::testing::data_folder() else { return };
    for (folder, columns, rows) in real::SETS {
        let grid = handeye_geometry::targets::Grid { columns, rows, square_m: 1.0 };
        let painted: Vec<GrayImage> = load(&data.join(folder))
            .iter()
            .take(images as usize * 2)
            .filter_map(|image| Some(painted_over(image, &native(image, &grid)?, &grid)))
            .collect();
        if painted.is_empty() {
            continue;
        }
        println!("{folder}, boards painted over");
        for detector in detectors() {
            report(detector, &painted.iter().map(|image| (image, &grid)).collect::<Vec<_>>());
        }
    }
}

fn report(detector: &Detector, images: &[(&GrayImage, &handeye_geometry::targets::Grid)]) {
    let (mut times, mut found) = (Vec::new(), 0);
    for (image, grid) in images {
        let (corners, ms) = timed(detector, image, grid);
        found += usize::from(corners.is_some());
        times.push(ms / (f64::from(image.width()) * f64::from(image.height()) / 1e6));
    }
    let most = times.iter().copied().fold(0.0, f64::max);
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    println!("  {:37} found {found}/{}, {mean:.2} ms/MP, at the most {most:.2}", detector.name, images.len());
}
