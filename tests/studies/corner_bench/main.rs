//! Chessboard detection on rendered boards and on the reference sets, compared with OpenCV.
//!
//! `cargo run --release -p handeye_studies --example corner_bench -- [VIEWS] [native] [PART …]`: VIEWS rendered boards per case,
//! 24 by default; with `native` without the detectors of OpenCV, which take most of the time. The parts are `rendered`, `hard`,
//! `absent` and `recorded`; all of them by default. The sets are searched for in `$HANDEYE_DATA`, then in `../shared/data`.

mod absent;
mod opencv_detectors;
mod real;
mod recall;
mod render;
mod scenes;

use std::path::{Path, PathBuf};
use std::time::Instant;

use handeye_detect::{DetectOptions, detect_with};
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use image::GrayImage;
use nalgebra::{Matrix2, Vector2};
use render::{Image, Look, view};

/// A detector by name: the corners in any order, `None` when the board is not found.
pub struct Detector {
    pub name: &'static str,
    /// Its search.
    pub find: fn(&GrayImage, &Grid) -> Option<Vec<Corner>>,
}

/// The detectors that are compared.
pub const DETECTORS: [Detector; 3] = [
    Detector { name: "native", find: native },
    Detector { name: "findChessboardCorners + cornerSubPix", find: opencv_detectors::classic },
    Detector { name: "findChessboardCornersSB", find: opencv_detectors::sectors },
];

/// The requested ones.
pub fn detectors() -> &'static [Detector] {
    if std::env::args().any(|argument| argument == "native") { &DETECTORS[..1] } else { &DETECTORS }
}

/// Our own search.
pub fn native(image: &GrayImage, grid: &Grid) -> Option<Vec<Corner>> {
    let found = detect_with(image, &TargetSpec::Chessboard(*grid), &DetectOptions::live());
    found.expect("the image can be searched").map(|corners| corners.to_vec())
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let views: u64 = words.iter().find_map(|word| word.parse().ok()).unwrap_or(24);
    let all = words.iter().all(|word| word == "native" || word.parse::<u64>().is_ok());
    let asked = |part: &str| all || words.iter().any(|word| word == part);
    if asked("rendered") {
        all_rendered(views);
    }
    if asked("hard") {
        recall::all(views);
    }
    if asked("absent") {
        absent::all(views.div_ceil(12));
    }
    if asked("recorded") {
        real::all();
    }
}

fn all_rendered(views: u64) {
    let at = Look::published;
    let mut cases: Vec<(String, Look)> =
        [(0.0, 0.0), (0.5, 0.0), (0.7, 2.0), (1.0, 2.0), (0.7, 5.0), (1.5, 2.0), (2.5, 2.0), (0.7, 10.0)]
            .into_iter()
            .map(|(blur, noise)| (format!("blur {blur} px, noise {noise}"), at(blur, noise)))
            .collect();
    let usual = at(0.7, 2.0);
    cases.extend([
        ("squares of 8 px".to_owned(), Look { square_px: 8.0, ..usual }),
        ("squares of 30 px".to_owned(), Look { square_px: 30.0, ..usual }),
        ("tilt up to 65°".to_owned(), Look { max_tilt: 1.13, ..usual }),
        ("wide lens".to_owned(), Look { focal_px: 400.0, radial: -0.1, ..usual }),
        ("light falls to a third".to_owned(), Look { fall: 1.0, ..usual }),
        ("saturated".to_owned(), Look { light: 300.0, dark: -20.0, ..usual }),
        ("contrast 20".to_owned(), Look { light: 70.0, dark: 50.0, ..usual }),
    ]);
    for (name, look) in cases {
        println!("{name}");
        let images: Vec<Image> = (0..views).map(|seed| view(&look, seed)).collect();
        for detector in detectors() {
            rendered(detector, &look, &images);
        }
    }
}

fn rendered(detector: &Detector, look: &Look, images: &[Image]) {
    let grid = look.grid();
    // The board does not have this odd size, so it is not found: as much texture, but nothing to find.
    let other = Grid { columns: look.columns + 1, ..grid };
    let (mut found, mut hit_ms, mut miss_ms) = (0, Vec::new(), Vec::new());
    let (mut errors, mut normalised): (Vec<Vector2<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
    for image in images {
        miss_ms.push(timed(detector, &image.image, &other).1);
        let (corners, ms) = timed(detector, &image.image, &grid);
        let Some(corners) = corners else { continue };
        found += 1;
        hit_ms.push(ms);
        for corner in corners {
            let nearest = image.truth.iter().map(|t| corner.px - t).min_by(|a, b| a.norm().total_cmp(&b.norm()));
            let Some(error) = nearest else { continue };
            errors.push(error);
            if let Some(inverse) = corner.covariance_px2.and_then(Matrix2::try_inverse) {
                normalised.push(error.dot(&(inverse * error)) / 2.0);
            }
        }
    }
    let mean = |all: &mut dyn Iterator<Item = f64>, count: usize| all.sum::<f64>() / count.max(1) as f64;
    let rms = (mean(&mut errors.iter().map(nalgebra::Matrix::norm_squared), errors.len()) / 2.0).sqrt();
    let worst = errors.iter().map(nalgebra::Matrix::norm).fold(0.0, f64::max);
    let unit = mean(&mut normalised.iter().copied(), normalised.len()).sqrt();
    let megapixels = f64::from(look.size.0) * f64::from(look.size.1) / 1e6;
    println!(
        "  {:37} found {found}/{}, RMS per axis {rms:.4} px, worst {worst:.3} px, normalised {unit:.2}, \
         {:.2} ms/MP found, {:.2} ms/MP not found",
        detector.name,
        images.len(),
        median_high(hit_ms).unwrap_or(f64::NAN) / megapixels,
        median_high(miss_ms).unwrap_or(f64::NAN) / megapixels
    );
}

/// The images of a folder in the order of their names.
pub fn load(folder: &Path) -> Vec<GrayImage> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "png" || e == "jpg"));
    paths.sort();
    let open = |path: &PathBuf| image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    paths.iter().map(|path| open(path).to_luma8()).collect()
}

/// A search of more than this is timed once \[ms\].
const LONG_MS: f64 = 1000.0;

/// What is found, and the shortest of three times in milliseconds: the machine may be busy.
pub fn timed(detector: &Detector, image: &GrayImage, grid: &Grid) -> (Option<Vec<Corner>>, f64) {
    let mut shortest = f64::INFINITY;
    let mut corners = None;
    for _ in 0..3 {
        let start = Instant::now();
        corners = (detector.find)(image, grid);
        shortest = shortest.min(start.elapsed().as_secs_f64() * 1e3);
        if shortest > LONG_MS {
            break;
        }
    }
    (corners, shortest)
}
