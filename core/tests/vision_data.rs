//! Detection and intrinsics on recorded images with published or reference results.
#![cfg(feature = "opencv")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use handeye_core::image::GrayImage;
use handeye_core::observation::Corner;
use handeye_core::target::{Grid, TargetSpec};
use handeye_core::vision::{DetectOptions, detect_with};
use nalgebra::Vector2;

fn data_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("HANDEYE_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    if dir.is_dir() {
        return Some(dir);
    }
    println!("skipped: no data sets at {}", dir.display());
    None
}

fn load(path: &Path) -> GrayImage {
    handeye_core::image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_luma8()
}

fn chessboard(columns: usize, rows: usize, square_m: f64) -> TargetSpec {
    TargetSpec::Chessboard(Grid { columns, rows, square_m })
}

/// Names and paths of the images of a folder in the order of their names.
fn images(folder: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "png" || e == "jpg"))
        .collect();
    all.sort();
    all
}

struct Found {
    name: String,
    corners: Option<Vec<Corner>>,
    millis: f64,
}

/// Detects in all images, two at a time.
fn detect_all(paths: &[PathBuf], target: &TargetSpec, options: DetectOptions) -> Vec<Found> {
    let detect_one = |path: &PathBuf| {
        let image = load(path);
        let start = Instant::now();
        let corners = detect_with(&image, target, options).expect("searches");
        let name = path.file_name().expect("a file").to_string_lossy().into_owned();
        Found { name, corners, millis: start.elapsed().as_secs_f64() * 1e3 }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = paths
            .chunks(paths.len().div_ceil(2).max(1))
            .map(|part| scope.spawn(move || part.iter().map(detect_one).collect::<Vec<_>>()))
            .collect();
        workers.into_iter().flat_map(|w| w.join().expect("no panic")).collect()
    })
}

#[test]
fn explore() {
    let Some(data) = data_dir() else { return };
    for (folder, target) in [
        ("opencv_stereo_9x6", chessboard(9, 6, 0.025)),
        ("visp_franka_eye_in_hand", chessboard(9, 6, 0.0236)),
        ("caliban_no_curv/images", chessboard(14, 9, 0.0121)),
        ("rwhe_cs_synthetic_3/images", chessboard(9, 6, 0.2)),
        ("rwhe_kuka_1_eye_in_hand/images", chessboard(28, 17, 0.02)),
        ("alim_repeatability_intrinsics/cam1_intrinsics", chessboard(9, 7, 0.02)),
        ("alim_repeatability_intrinsics/repeatability", chessboard(9, 7, 0.02)),
    ] {
        for options in [DetectOptions::live(), DetectOptions::thorough()] {
            let paths = images(&data.join(folder));
            let found = detect_all(&paths, &target, options);
            let mut times: Vec<f64> = found.iter().map(|f| f.millis).collect();
            times.sort_by(f64::total_cmp);
            let n = found.iter().filter(|f| f.corners.is_some()).count();
            println!("{folder} {options:?} {n}/{} median {:.1} max {:.1} ms", paths.len(), times[times.len() / 2], times[times.len() - 1]);
            for f in found.iter().filter(|f| f.corners.is_none()) {
                println!("   missed {}", f.name);
            }
        }
    }
    let _ = Vector2::<f64>::zeros();
}
