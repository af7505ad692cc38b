//! Detection and intrinsics on recorded images with published or reference results.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use handeye_detect::{DetectOptions, detect_with};
use handeye_estimate::intrinsics::{Options, SeenView, solve};
use handeye_geometry::camera::Distortion;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::data_folder;
use image::GrayImage;
use nalgebra::Vector2;
use rayon::prelude::*;

fn load(path: &Path) -> GrayImage {
    image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_luma8()
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
    corners: Option<Corners>,
    millis: f64,
}

/// Detects in all images.
fn detect_all(paths: &[PathBuf], target: &TargetSpec, options: &DetectOptions) -> Vec<Found> {
    let detect_one = |path: &PathBuf| {
        let image = load(path);
        let start = Instant::now();
        let corners = detect_with(&image, target, options).expect("searches");
        let name = path.file_name().expect("a file").to_string_lossy().into_owned();
        Found { name, corners, millis: start.elapsed().as_secs_f64() * 1e3 }
    };
    paths.par_iter().map(detect_one).collect()
}

/// Corners of a reference detector: view name to pixels in its order.
fn reference_corners(path: &Path, detector: &str) -> BTreeMap<String, Vec<Vector2<f64>>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut all: BTreeMap<String, Vec<Vector2<f64>>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        if fields[0] == detector {
            let number = |i: usize| fields[i].parse::<f64>().expect("a number");
            all.entry(fields[2].to_owned()).or_default().push(Vector2::new(number(4), number(5)));
        }
    }
    all
}

/// RMS per axis of the distance to the reference, whichever end the reference starts at, without the common shift, and
/// that shift.
fn difference(corners: &[Corner], reference: &[Vector2<f64>]) -> (f64, Vector2<f64>) {
    let n = reference.len() as f64;
    let of = |at: &dyn Fn(usize) -> Vector2<f64>| {
        let offsets: Vec<Vector2<f64>> = corners.iter().enumerate().map(|(i, c)| c.px - at(i)).collect();
        let shift = offsets.iter().sum::<Vector2<f64>>() / n;
        let sum: f64 = offsets.iter().map(|o| (o - shift).norm_squared()).sum();
        ((sum / (2.0 * n)).sqrt(), shift)
    };
    let (same, turned) = (of(&|i| reference[i]), of(&|i| reference[reference.len() - 1 - i]));
    if same.0 < turned.0 { same } else { turned }
}

/// Requirements for a data set. RMS: the residual of `calibrateCamera` with the better of OpenCV's two detectors, or
/// less where ours is clearly better. Focal length: the truth of rendered sets, the published or OpenCV's figure of
/// others.
struct Expected {
    folder: &'static str,
    images: &'static str,
    prefix: &'static str,
    target: TargetSpec,
    size: (u32, u32),
    count: usize,
    rms_px: f64,
    focal_px: f64,
    /// Allowed distance of the focal length.
    focal_tolerance_px: f64,
}

fn check(expected: &Expected) {
    let Some(data) = data_folder() else { return };
    let folder = data.join(expected.folder);
    let mut paths = images(&folder.join(expected.images));
    paths.retain(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(expected.prefix)));
    let found = detect_all(&paths, &expected.target, &DetectOptions::thorough());
    let missed: Vec<&str> = found.iter().filter(|f| f.corners.is_none()).map(|f| f.name.as_str()).collect();
    assert_eq!((found.len(), missed), (expected.count, vec![]), "{}", expected.folder);

    let views: Vec<_> = found.iter().filter_map(|f| f.corners.as_deref()).map(SeenView::unweighted).collect();
    let options = Options::new(Distortion::BrownConrady([0.0; 5]));
    let result = solve(&views, &expected.target, expected.size, &options, &CancelToken::default())
        .unwrap_or_else(|e| panic!("{}: {e}", expected.folder));
    let (rms_px, [fx_sigma_px, ..]) = (result.total_rms_px(), result.stated.pinhole_sigma_px);
    let camera = result.intrinsics;
    println!(
        "{}{}: {} views, rms {:.4} px, fx {:.2} ± {:.2}, fy {:.2}, cx {:.2}, cy {:.2}",
        expected.folder,
        expected.prefix,
        views.len(),
        rms_px,
        camera.fx,
        fx_sigma_px,
        camera.fy,
        camera.cx,
        camera.cy
    );
    assert!(rms_px <= expected.rms_px, "{}: {rms_px}", expected.folder);
    let off = (camera.fx - expected.focal_px).abs();
    assert!(off < expected.focal_tolerance_px, "{}: fx {}", expected.folder, camera.fx);
    for (rms_px, found) in result.rms_px.iter().zip(&found) {
        assert!(*rms_px < 4.0 * expected.rms_px, "{}: {rms_px} px", found.name);
    }
    compare_with_reference(&folder, &found);
}

/// Either reference detector has an error of 0.03 to 0.2 px per axis on these images; a corner one square off would
/// show as tens of pixels.
fn compare_with_reference(folder: &Path, found: &[Found]) {
    let path = folder.join("corners.csv");
    if !path.is_file() {
        return;
    }
    for detector in ["sb_accuracy", "classic_subpix"] {
        let reference = reference_corners(&path, detector);
        let mut compared = 0;
        let mut sum = 0.0;
        for view in found {
            let (Some(corners), Some(reference)) = (&view.corners, reference.get(&view.name)) else { continue };
            let (rms, shift) = difference(corners, reference);
            assert!(rms < 0.3, "{} against {detector}: {rms} px", view.name);
            assert!(shift.norm() < 0.6, "{} against {detector}: shifted by {shift} px", view.name);
            sum += rms * rms;
            compared += 1;
        }
        if !reference.is_empty() {
            assert!(compared > 0, "no view of {} is in {}", folder.display(), path.display());
            println!("   {detector}: {compared} views, {:.4} px per axis", f64::sqrt(sum / f64::from(compared)));
        }
    }
}

#[test]
fn every_board_of_the_kuka_set_is_found_and_fits_as_well_as_with_opencvs_slow_detector() {
    check(&Expected {
        folder: "rwhe_kuka_1_eye_in_hand",
        images: "images",
        prefix: "",
        target: chessboard(28, 17, 0.02),
        size: (1928, 1208),
        count: 30,
        rms_px: 0.077,
        focal_px: 2057.96,
        focal_tolerance_px: 1.0,
    });
}

#[test]
fn every_board_of_the_rendered_close_set_is_found_and_gives_the_true_focal_length() {
    check(&Expected {
        folder: "caliban_no_curv",
        images: "images",
        prefix: "",
        target: chessboard(14, 9, 0.0121),
        size: (1920, 1080),
        count: 20,
        rms_px: 0.040,
        focal_px: 1400.0,
        focal_tolerance_px: 0.5,
    });
}

#[test]
fn every_board_of_the_rendered_distant_set_is_found_and_gives_the_true_focal_length() {
    check(&Expected {
        folder: "rwhe_cs_synthetic_3",
        images: "images",
        prefix: "",
        target: chessboard(9, 6, 0.2),
        size: (1920, 1080),
        count: 30,
        rms_px: 0.020,
        focal_px: 1080.0,
        focal_tolerance_px: 0.3,
    });
}

#[test]
fn every_board_of_the_franka_set_is_found_and_fits_better_than_with_opencv() {
    check(&Expected {
        folder: "visp_franka_eye_in_hand",
        images: "",
        prefix: "",
        target: chessboard(9, 6, 0.0236),
        size: (640, 480),
        count: 8,
        rms_px: 0.245,
        focal_px: 602.43,
        focal_tolerance_px: 2.0,
    });
}

#[test]
fn every_board_of_the_stereo_set_is_found_and_fits_better_than_with_opencv() {
    // Reference for the focal length: a calibration by mrcal with a model of the board's bend.
    for (prefix, rms_px, focal_px) in [("left", 0.17, 533.16), ("right", 0.17, 537.45)] {
        check(&Expected {
            folder: "opencv_stereo_9x6",
            images: "",
            prefix,
            target: chessboard(9, 6, 0.025),
            size: (640, 480),
            count: 13,
            rms_px,
            focal_px,
            focal_tolerance_px: 1.5,
        });
    }
}

#[test]
fn every_grid_of_dots_is_found_and_gives_the_published_camera() {
    check(&Expected {
        folder: "rct_circles_eye_in_hand",
        images: "images",
        prefix: "",
        target: dots(),
        size: (640, 480),
        count: 15,
        rms_px: 0.186,
        focal_px: 542.32,
        focal_tolerance_px: 1.0,
    });
}

fn dots() -> TargetSpec {
    TargetSpec::Circles(Grid { columns: 10, rows: 10, square_m: 0.0254 })
}

#[test]
fn grids_of_dots_begin_at_the_larger_dot_in_every_view() {
    let Some(data) = data_folder() else { return };
    let folder = data.join("rct_circles_eye_in_hand");
    let text = std::fs::read_to_string(folder.join("points.csv")).expect("points.csv");
    let mut reference: BTreeMap<String, Vec<Vector2<f64>>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |i: usize| fields[i].parse::<f64>().expect("a number");
        reference.entry(fields[1].to_owned()).or_default().push(Vector2::new(number(5), number(6)));
    }
    for found in detect_all(&images(&folder.join("images")), &dots(), &DetectOptions::live()) {
        let corners = found.corners.unwrap_or_else(|| panic!("{} missed by the live search", found.name));
        for corner in &corners {
            let (column, row) = (corner.index % 10, corner.index / 10);
            // The reference has the larger dot at the end of its y axis: a quarter turn from ours.
            let theirs = reference[&found.name][(9 - column) * 10 + row];
            let distance = (corner.px - theirs).norm();
            assert!(distance < 1.0, "{} dot {}: {distance} px", found.name, corner.index);
        }
    }
}

#[test]
fn a_live_search_finds_all_boards_too() {
    let Some(data) = data_folder() else { return };
    for (folder, target) in [
        ("opencv_stereo_9x6", chessboard(9, 6, 0.025)),
        ("caliban_no_curv/images", chessboard(14, 9, 0.0121)),
        ("rwhe_kuka_1_eye_in_hand/images", chessboard(28, 17, 0.02)),
        ("alim_repeatability_intrinsics/cam1_intrinsics", chessboard(9, 7, 0.02)),
        ("alim_repeatability_intrinsics/repeatability", chessboard(9, 7, 0.02)),
        ("visp_franka_eye_in_hand", chessboard(9, 6, 0.0236)),
        ("rwhe_cs_synthetic_3/images", chessboard(9, 6, 0.2)),
    ] {
        let found = detect_all(&images(&data.join(folder)), &target, &DetectOptions::live());
        let mut millis: Vec<f64> = found.iter().map(|f| f.millis).collect();
        millis.sort_by(f64::total_cmp);
        println!(
            "{folder}: live search {:.1} ms, at most {:.1} ms",
            millis[millis.len() / 2],
            millis[millis.len() - 1]
        );
        let missed: Vec<&str> = found.iter().filter(|f| f.corners.is_none()).map(|f| f.name.as_str()).collect();
        assert_eq!((found.is_empty(), missed), (false, vec![]), "{folder}");
    }
}
