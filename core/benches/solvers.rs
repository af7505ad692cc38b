//! Speed of the solvers on simulated corners: `cargo bench -p handeye_core --bench solvers`.
//!
//! [`docs/benchmarks.md`](../../docs/benchmarks.md) has the comparison with other programs, which `tests/bench/solvers.py`
//! makes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use handeye_core::estimate::handeye::Mode;
use handeye_core::estimate::intrinsics::{Options, SeenView, solve};
use handeye_core::estimate::{CameraKnowledge, Method, Observations, ObservedView, calibrate};
use handeye_core::geometry::camera::{Distortion, Intrinsics};
use handeye_core::geometry::frames::Pose;
use handeye_core::progress::CancelToken;
use handeye_core::targets::observation::Corner;
use handeye_core::targets::{Grid, TargetSpec};
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.015 };
const SIZE: (u32, u32) = (640, 480);
const CORNER_NOISE_PX: f64 = 0.1;
const ROBOT_NOISE: (f64, f64) = (1e-4, 3.5e-4);
const LENSES: [Distortion; 4] = [
    Distortion::None,
    Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
    Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
    Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
];

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics { distortion, fy: 579.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(SIZE.0, SIZE.1, 581.0) }
}

/// An arm with a camera in its hand before a board, tilted up to 40° and rolled up to 60°.
fn views(camera: &Intrinsics, count: usize) -> Vec<ObservedView> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let noise = |rng: &mut ChaCha8Rng, sigma: f64| {
        let normal = Normal::new(0.0, sigma).expect("a deviation");
        Vector3::from_fn(|_, _| normal.sample(rng))
    };
    let tip_from_camera = Isometry3::new(Vector3::new(0.03, -0.05, 0.04), Vector3::new(0.02, -0.01, 1.55));
    let base_from_target = Isometry3::new(Vector3::new(0.5, 0.1, 0.02), Vector3::new(0.0, 3.1, 0.1));
    (0..count)
        .map(|i| {
            let azimuth = i as f64 * 2.4;
            let axis = Unit::new_normalize(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0));
            let tilt = Rotation3::from_axis_angle(&axis, rng.random_range(0.1..0.7));
            let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), rng.random_range(-1.0..1.0));
            let at = Vector3::new(rng.random_range(-0.1..0.1), rng.random_range(-0.08..0.08), 1.0)
                * rng.random_range(0.3..0.5);
            let camera_from_target =
                Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&(roll * tilt)))
                    * Translation3::new(-0.0675, -0.045, 0.0);
            let error = Isometry3::new(noise(&mut rng, ROBOT_NOISE.0), noise(&mut rng, ROBOT_NOISE.1));
            let base_from_tip = base_from_target * camera_from_target.inverse() * tip_from_camera.inverse() * error;
            let corners = (0..GRID.len())
                .map(|index| {
                    let px = camera.project(&(camera_from_target * GRID.point(index))).expect("in front");
                    Corner::new(index, px + noise(&mut rng, CORNER_NOISE_PX).xy())
                })
                .collect();
            ObservedView::new(format!("{i:05}"), Some(Pose::from_isometry(base_from_tip)), Some(corners))
        })
        .collect()
}

fn projection(c: &mut Criterion) {
    let mut group = c.benchmark_group("project_with_jacobians");
    let points: Vec<Point3<f64>> =
        (0..70).map(|i| Point3::new(f64::from(i % 10) * 0.02 - 0.1, f64::from(i / 10) * 0.02 - 0.06, 0.4)).collect();
    group.throughput(Throughput::Elements(points.len() as u64));
    for lens in LENSES {
        let camera = camera(lens);
        group.bench_function(lens.name(), |b| {
            b.iter(|| {
                points.iter().fold(Vector2::zeros(), |sum, point| {
                    let projection = black_box(&camera).project_with_jacobians(black_box(point)).expect("in front");
                    sum + projection.px + projection.px_by_parameters.column(0)
                })
            });
        });
    }
}

fn intrinsics(c: &mut Criterion) {
    let mut group = c.benchmark_group("intrinsics");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let target = TargetSpec::Chessboard(GRID);
    for lens in LENSES {
        for count in [10, 100, 1_000, 10_000] {
            if count > 100 && lens.name() != "brown_conrady" {
                continue;
            }
            let views = views(&camera(lens), count);
            let seen: Vec<SeenView<'_>> =
                views.iter().filter_map(|v| v.corners.as_deref()).map(SeenView::unweighted).collect();
            group.throughput(Throughput::Elements(count as u64));
            group.bench_with_input(BenchmarkId::new(lens.name(), count), &seen, |b, seen| {
                let cancel = CancelToken::default();
                b.iter(|| solve(black_box(seen), &target, SIZE, &Options::new(lens), &cancel).expect("solves"));
            });
        }
    }
}

/// Everything that `handeye calibrate` does after the corners are found: intrinsics, closed forms, joint estimate with
/// covariance and influence of every view, held-out fits and the prediction of the error.
fn whole(c: &mut Criterion) {
    let mut group = c.benchmark_group("calibrate");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let truth = camera(LENSES[1]);
    for (name, knowledge) in [
        ("known_camera", CameraKnowledge::Fixed(truth)),
        ("unknown_camera", CameraKnowledge::Estimate { model: LENSES[1], start: None }),
    ] {
        for count in [10, 100, 1_000] {
            let observations = Observations {
                mode: Some(Mode::EyeInHand),
                target: TargetSpec::Chessboard(GRID),
                image_size: SIZE,
                camera: knowledge,
                views: views(&truth, count),
            };
            group.throughput(Throughput::Elements(count as u64));
            group.bench_with_input(BenchmarkId::new(name, count), &observations, |b, observations| {
                let cancel = CancelToken::default();
                b.iter(|| calibrate(black_box(observations), Method::Joint, &cancel).expect("solves"));
            });
        }
    }
}

criterion_group!(benches, projection, intrinsics, whole);
criterion_main!(benches);
