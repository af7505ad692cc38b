//! Our calibration of the camera compared with OpenCV's `calibrateCamera` and `fisheye::calibrate` on the same corners.
//!
//! OpenCV takes corners and points in single precision; here both are such numbers, so that the two have the same
//! optimum to the last digits. The unit of length is 1/32 of the real one for the same reason.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector2};
use opencv::calib3d;
use opencv::core::{Point2f, Point3f, Size, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER, Vec3d, Vector};

use super::bridge::to_points2f;
use super::bridge_for_tests::{camera_matrix, coefficients, isometries, numbers, to_points3f};
use handeye_estimate::intrinsics::{Found, Options, SeenView, solve};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::data_folder;
use handeye_simulate::BoardViews;

const SQUARE_M: f64 = 1.0 / 32.0;

struct Set {
    grid: Grid,
    size: (u32, u32),
    views: Vec<Vec<Corner>>,
}

impl Set {
    fn single(index: usize, px: Vector2<f64>) -> Corner {
        Corner::new(index, px.map(|v| f64::from(v as f32)))
    }

    /// 15 views of 70 corners with 0.1 px of noise.
    fn simulated(camera: &Intrinsics, seed: u64) -> Self {
        let grid = Grid { columns: 10, rows: 7, square_m: SQUARE_M };
        let views = BoardViews::new(*camera, grid, 0.1)
            .corners(15, seed)
            .into_iter()
            .map(|view| view.into_iter().map(|corner| Self::single(corner.index, corner.px)).collect())
            .collect();
        Self { grid, size: (camera.width, camera.height), views }
    }

    /// The corners of a recorded set.
    fn recorded(folder: &Path, (columns, rows): (usize, usize), size: (u32, u32)) -> Self {
        let text = std::fs::read_to_string(folder.join("corners.csv")).expect("corners.csv");
        let mut views: BTreeMap<String, Vec<Corner>> = BTreeMap::new();
        for line in text.lines().skip(1).filter(|line| line.starts_with("sb_accuracy,")) {
            let cells: Vec<&str> = line.split(',').collect();
            let px = Vector2::new(cells[4].parse().expect("u"), cells[5].parse().expect("v"));
            views.entry(cells[2].to_owned()).or_default().push(Self::single(cells[3].parse().expect("corner"), px));
        }
        Self { grid: Grid { columns, rows, square_m: SQUARE_M }, size, views: views.into_values().collect() }
    }

    fn ours(&self, model: Distortion) -> Found {
        let target = TargetSpec::Chessboard(self.grid);
        let views: Vec<SeenView<'_>> = self.views.iter().map(|view| SeenView::unweighted(view)).collect();
        solve(&views, &target, self.size, &Options::new(model), &CancelToken::default())
            .unwrap_or_else(|e| panic!("{model:?}: {e}"))
    }

    /// OpenCV's optimum and its cost by our own projection.
    fn of_opencv(&self, model: Distortion) -> (Intrinsics, f64) {
        let points: Vec<Point3<f64>> = (0..self.grid.len()).map(|i| self.grid.point(i)).collect();
        let objects: Vector<Vector<Point3f>> = self
            .views
            .iter()
            .map(|view| to_points3f(&view.iter().map(|c| points[c.index]).collect::<Vec<_>>()))
            .collect();
        let images: Vector<Vector<Point2f>> =
            self.views.iter().map(|view| to_points2f(&view.iter().map(|c| c.px).collect::<Vec<_>>())).collect();
        let size = Size::new(self.size.0 as i32, self.size.1 as i32);
        // Its criterion is the relative change of the parameters.
        let criteria = TermCriteria { typ: TermCriteria_EPS + TermCriteria_MAX_ITER, max_count: 100, epsilon: 1e-15 };
        let start = Intrinsics { distortion: model, ..Intrinsics::pinhole(self.size.0, self.size.1, 1.0) };
        let mut matrix = camera_matrix(&start).expect("K");
        let mut distortion = coefficients(&start);
        if distortion.is_empty() {
            distortion = Vector::from_slice(&[0.0; 5]);
        }
        let (mut rotations, mut translations) = (Vector::<Vec3d>::new(), Vector::<Vec3d>::new());
        let no_distortion =
            calib3d::CALIB_FIX_K1 + calib3d::CALIB_FIX_K2 + calib3d::CALIB_FIX_K3 + calib3d::CALIB_ZERO_TANGENT_DIST;
        let (matrix, distortion, rotations, translations) =
            (&mut matrix, &mut distortion, &mut rotations, &mut translations);
        if let Distortion::Fisheye(_) = model {
            let flags = calib3d::Fisheye_CALIB_RECOMPUTE_EXTRINSIC + calib3d::Fisheye_CALIB_FIX_SKEW;
            calib3d::calibrate(&objects, &images, size, matrix, distortion, rotations, translations, flags, criteria)
        } else {
            let flags = match model {
                Distortion::None => no_distortion,
                Distortion::Rational(_) => calib3d::CALIB_RATIONAL_MODEL,
                _ => 0,
            };
            calib3d::calibrate_camera(
                &objects,
                &images,
                size,
                matrix,
                distortion,
                rotations,
                translations,
                flags,
                criteria,
            )
        }
        .expect("OpenCV calibrates");
        let k = numbers(matrix).expect("K");
        let coefficients: Vec<f64> = distortion.iter().collect();
        let camera = Intrinsics {
            fx: k[0],
            fy: k[4],
            cx: k[2],
            cy: k[5],
            distortion: model.with_coefficients(&coefficients),
            ..start
        };
        let cost = self.views.iter().zip(isometries(rotations, translations)).map(|(view, pose)| {
            let squared = |c: &Corner| squared_px(&camera, &pose, &points[c.index], c);
            view.iter().map(squared).sum::<f64>()
        });
        (camera, cost.sum())
    }

    /// Relative difference of the costs, positive where ours is lower, and the largest distance of a pinhole number in
    /// units of its standard deviation.
    fn compare(&self, model: Distortion) -> (f64, f64) {
        let (ours, (theirs, cost)) = (self.ours(model), self.of_opencv(model));
        let off = (0..4).map(|i| {
            let sigma = ours.sigma * ours.unit_covariance[(i, i)].sqrt();
            (ours.intrinsics.parameters()[i] - theirs.parameters()[i]).abs() / sigma
        });
        let (gain, off) = (cost / ours.cost - 1.0, off.fold(0.0, f64::max));
        println!(
            "{} {} views: cost {gain:.1e}, off {off:.1e} sigma, {} steps",
            model.name(),
            self.views.len(),
            ours.steps
        );
        (gain, off)
    }
}

fn squared_px(camera: &Intrinsics, pose: &Isometry3<f64>, point: &Point3<f64>, corner: &Corner) -> f64 {
    (camera.project(&(pose * point)).expect("in front") - corner.px).norm_squared()
}

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics { distortion, fy: 575.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(640, 480, 581.0) }
}

#[test]
fn the_optimum_is_that_of_opencv_on_simulated_corners() {
    for seed in 0..3 {
        for distortion in [
            Distortion::None,
            Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
            Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
        ] {
            let (gain, off) = Set::simulated(&camera(distortion), seed).compare(distortion);
            assert!(gain.abs() < 1e-9, "{distortion:?}: {gain:e}");
            // A cost within 1e-9 of the lowest of 2100 squares is within √2e-6 of a standard deviation or so.
            assert!(off < 1e-2, "{distortion:?}: {off} sigma");
        }
    }
}

#[test]
fn the_rational_model_fits_at_least_as_well_as_with_opencv() {
    // Its eight coefficients trade against one another along a valley, in which OpenCV stops earlier.
    let truth = Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]);
    let (gain, _) = Set::simulated(&camera(truth), 0).compare(truth);
    assert!(gain > -1e-9, "{gain:e}");
}

mod slow {
    use super::*;

    #[test]
    fn the_optimum_is_that_of_opencv_on_recorded_corners() {
        let Some(data) = data_folder() else { return };
        for (name, inner, size) in [
            ("caliban_no_curv", (14, 9), (1920, 1080)),
            ("rwhe_cs_synthetic_3", (9, 6), (1920, 1080)),
            ("rwhe_kuka_1_eye_in_hand", (28, 17), (1928, 1208)),
            ("visp_franka_eye_in_hand", (9, 6), (640, 480)),
        ] {
            let set = Set::recorded(&data.join(name), inner, size);
            let (gain, off) = set.compare(Distortion::BrownConrady([0.0; 5]));
            assert!(gain.abs() < 1e-9, "{name}: {gain:e}");
            assert!(off < 1e-2, "{name}: {off} sigma");
        }
    }
}
