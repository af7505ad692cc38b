//! Our poses of a flat target compared with OpenCV's: both starts by `SOLVEPNP_IPPE`, refined by `solvePnPRefineLM`
//! through the same lens, which the fisheye model lacks.
//!
//! OpenCV's refinement gives up in the valleys between two minima that nearly merge, and on the way out of a start that
//! leads to no second minimum: a tenth of its second poses are not minima. So its poses are compared as they are, where
//! only their error counts, and after our own descent to the minimum below them, where the poses count.

use nalgebra::{Isometry3, Point3, Vector2};
use opencv::calib3d::{SolvePnPMethod, solve_pnp_generic, solve_pnp_refine_lm};
use opencv::core::{Mat, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER, Vector, no_array};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::bridge_for_tests::{camera_matrix, coefficients, isometry, numbers, to_points2d, to_points3d};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::planar_pose::refine::refine;
use handeye_geometry::planar_pose::{PlanarPose, Solution, solve};
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::looking_at;
use handeye_geometry::view_equations::{ViewInput, Whitener};

const LENSES: [Distortion; 5] = [
    Distortion::None,
    Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
    Distortion::BrownConrady([0.08, -0.05, -0.0005, 0.0004, 0.01]),
    Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
    Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
];
const GRIDS: [(usize, usize); 4] = [(2, 2), (5, 4), (10, 7), (3, 8)];
/// Errors of two descents into one minimum differ by rounding and by where each stops: parts of the error, and what
/// rounding leaves of exact corners \[px\].
const SAME_ERROR: (f64, f64) = (1e-9, 1e-9);
/// Minima closer than this angle \[rad\] are one, as for [`solve`].
const SAME_RAD: f64 = 1e-4;
/// Steps that reach every minimum.
const STEPS: usize = 5000;

/// A view of a grid and what is seen of it.
struct Case {
    lens: Intrinsics,
    target: TargetSpec,
    corners: Vec<Corner>,
    tilt_deg: f64,
    noise_px: f64,
    size_over_distance: f64,
}

impl Case {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let distortion = LENSES[rng.random_range(0..LENSES.len())];
        let lens = Intrinsics { distortion, fy: 575.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(640, 480, 581.0) };
        let (columns, rows) = GRIDS[rng.random_range(0..GRIDS.len())];
        let size_m = 0.2;
        let grid = Grid { columns, rows, square_m: size_m / (columns.max(rows) - 1) as f64 };
        let distance_m = 0.4 * 10f64.powf(rng.random_range(0.0..1.0));
        let tilt_deg: f64 = rng.random_range(0.0..75.0);
        let angles = [tilt_deg.to_radians(), rng.random_range(0.0..6.3), rng.random_range(-3.1..3.1)];
        let offset = Vector2::new(rng.random_range(-80.0..80.0), rng.random_range(-60.0..60.0));
        let truth = looking_at(&grid, &lens, distance_m, angles, offset);
        let noise_px = [0.0, 0.02, 0.1, 0.3, 1.0][rng.random_range(0..5)];
        let mut noise = || -> f64 { noise_px * rng.sample::<f64, _>(StandardNormal) };
        let corners = (0..grid.len())
            .map(|index| {
                let px = lens.project(&(truth * grid.point(index))).expect("in front");
                Corner::new(index, px + Vector2::new(noise(), noise()))
            })
            .collect();
        let size_over_distance = size_m / distance_m;
        Self { lens, target: TargetSpec::Chessboard(grid), corners, tilt_deg, noise_px, size_over_distance }
    }

    fn rms_px(&self, pose: &Isometry3<f64>) -> f64 {
        let squared = |corner: &Corner| {
            let point = pose * self.target.point(corner.index);
            self.lens.project(&point).map_or(f64::INFINITY, |px| (px - corner.px).norm_squared())
        };
        (self.corners.iter().map(squared).sum::<f64>() / self.corners.len() as f64).sqrt()
    }

    /// OpenCV's poses, the better one first.
    fn of_opencv(&self) -> Vec<Isometry3<f64>> {
        let points: Vec<Point3<f64>> = self.corners.iter().map(|c| self.target.point(c.index)).collect();
        let pixels: Vec<Vector2<f64>> = self.corners.iter().map(|c| c.px).collect();
        let rays = pixels.iter().map(|px| self.lens.unproject(px).expect("inside")).map(|ray| ray.xy() / ray.z);
        let rays: Vec<Vector2<f64>> = rays.collect();
        let (points, pixels, rays) = (to_points3d(&points), to_points2d(&pixels), to_points2d(&rays));
        let unit = camera_matrix(&Intrinsics { cx: 0.0, cy: 0.0, ..Intrinsics::pinhole(2, 2, 1.0) }).expect("K");
        let (mut rotations, mut translations) = (Vector::<Mat>::new(), Vector::<Mat>::new());
        let method = SolvePnPMethod::SOLVEPNP_IPPE;
        let (none, mut errors) = (no_array(), no_array());
        let (r, t) = (&mut rotations, &mut translations);
        solve_pnp_generic(&points, &rays, &unit, &none, r, t, false, method, &none, &none, &mut errors)
            .expect("OpenCV solves");
        let poses = rotations.iter().zip(translations.iter()).map(|(mut rotation, mut translation)| {
            if !matches!(self.lens.distortion, Distortion::Fisheye(_)) {
                let typ = TermCriteria_EPS + TermCriteria_MAX_ITER;
                let criteria = TermCriteria { typ, max_count: 200, epsilon: 1e-15 };
                let (k, d) = (camera_matrix(&self.lens).expect("K"), coefficients(&self.lens));
                solve_pnp_refine_lm(&points, &pixels, &k, &d, &mut rotation, &mut translation, criteria)
                    .expect("OpenCV refines");
            }
            pose_of(&rotation, &translation)
        });
        let mut poses: Vec<_> = poses.collect();
        poses.sort_by(|a, b| self.rms_px(a).total_cmp(&self.rms_px(b)));
        poses
    }

    /// The minima below some poses, the lowest first, each once.
    fn minima(&self, starts: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
        let board = BoardPoints::new(&self.target.points());
        let (shape, corners) = (&BoardShape::FLAT, &self.corners);
        let seen = ViewInput {
            intrinsics: &self.lens,
            board: &board,
            shape,
            corners,
            whitener: &Whitener::Alike,
            depths: None,
        };
        let mut minima: Vec<_> = starts.iter().filter_map(|start| refine(&seen, start, STEPS)).collect();
        minima.sort_by(|a, b| a.squared_px.total_cmp(&b.squared_px));
        minima.dedup_by(|b, a| a.pose.rotation.angle_to(&b.pose.rotation) < SAME_RAD);
        minima.into_iter().map(|minimum| minimum.pose).collect()
    }
}

fn pose_of(rotation: &Mat, translation: &Mat) -> Isometry3<f64> {
    let three = |mat: &Mat| numbers(mat).expect("numbers").try_into().expect("three");
    isometry(&three(rotation), &three(translation))
}

/// Differences between ours and OpenCV's.
#[derive(Debug, Default)]
struct Tally {
    /// Views whose better pose has the same error as OpenCV's, a lower one, a higher one.
    same: usize,
    lower: usize,
    higher: usize,
    /// Second poses of OpenCV that are not minima.
    no_minima: usize,
    /// Views with two minima, and those whose minima are not those below OpenCV's poses.
    two: usize,
    differ: usize,
    /// Largest distance of a minimum from that below OpenCV's pose: radians, and parts of the distance.
    apart: (f64, f64),
}

impl Tally {
    fn of(views: usize, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut tally = Self::default();
        for number in 0..views {
            tally.add(number, &Case::new(&mut rng));
        }
        println!("{views} views: {tally:?}");
        tally
    }

    fn add(&mut self, number: usize, case: &Case) {
        let PlanarPose { best, alternative } = solve(&case.corners, &case.target, &case.lens).expect("a pose");
        let ours: Vec<&Solution> = std::iter::once(&best).chain(&alternative).collect();
        let poses = case.of_opencv();
        let theirs = case.minima(&poses);
        let is_pinhole = !matches!(case.lens.distortion, Distortion::Fisheye(_));
        let error_px = case.rms_px(if is_pinhole { &poses[0] } else { &theirs[0] });
        match (best.rms_px - error_px) / (SAME_ERROR.0 * error_px + SAME_ERROR.1) {
            excess if excess > 1.0 => self.higher += 1,
            excess if excess < -1.0 => self.lower += 1,
            _ => self.same += 1,
        }
        let angle = |a: &Isometry3<f64>, b: &Isometry3<f64>| a.rotation.angle_to(&b.rotation);
        if is_pinhole && poses.get(1).is_some_and(|pose| theirs.iter().all(|minimum| angle(pose, minimum) > SAME_RAD)) {
            self.no_minima += 1;
        }
        self.two += usize::from(ours.len() == 2);
        let mut same = ours.len() == theirs.len();
        for (ours, theirs) in ours.iter().zip(&theirs) {
            let turn = angle(ours.camera_from_target.isometry(), theirs);
            let shift = (ours.camera_from_target.translation() - theirs.translation.vector).norm();
            same &= turn < SAME_RAD;
            if same {
                self.apart = (self.apart.0.max(turn), self.apart.1.max(shift / theirs.translation.vector.norm()));
            }
        }
        if !same {
            self.differ += 1;
            let Case { tilt_deg, noise_px, size_over_distance, .. } = case;
            println!(
                "view {number}: {} {}, tilt {tilt_deg:.1}°, noise {noise_px} px, size / distance {size_over_distance:.3}: \
                 ours {:?} px, theirs {:?} px, apart {:?} rad",
                case.lens.distortion.name(),
                case.target,
                ours.iter().map(|solution| solution.rms_px).collect::<Vec<_>>(),
                theirs.iter().map(|pose| case.rms_px(pose)).collect::<Vec<_>>(),
                ours.iter().map(|s| angle(s.camera_from_target.isometry(), &theirs[0])).collect::<Vec<_>>(),
            );
        }
    }
}

fn check(views: usize, seed: u64) {
    let tally = Tally::of(views, seed);
    assert_eq!(tally.higher, 0, "a pose of OpenCV fits better");
    // Where two minima are about to merge, their number depends on rounding.
    assert!(tally.differ * 1000 <= views, "{tally:?}");
    assert!(tally.two > views / 2, "the views do not test what they should");
}

#[test]
fn both_minima_are_those_of_opencv() {
    check(300, 1);
}

mod slow {
    #[test]
    fn both_minima_are_those_of_opencv_in_ten_thousand_views() {
        super::check(10_000, 2);
    }
}
