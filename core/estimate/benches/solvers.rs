//! Speed of the solvers on simulated corners: `cargo bench -p handeye_estimate --bench solvers`.
//!
//! `docs/studies/benchmarks.md` has the comparison with other programs, which `tests/bench/solvers.py`
//! makes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use handeye_estimate::diagnose::calibrate;
use handeye_estimate::handeye::Mode;
use handeye_estimate::intrinsics::{Options, SeenView, solve};
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::testing::BOARD;
use handeye_simulate::session::{REALISTIC, trial};
use nalgebra::{Point3, Vector2};

const SIZE: (u32, u32) = (640, 480);
const LENSES: [Distortion; 4] = [
    Distortion::None,
    Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
    Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
    Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
];

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics { distortion, fy: 579.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(SIZE.0, SIZE.1, 581.0) }
}

fn views(camera: &Intrinsics, count: usize) -> Vec<ObservedView> {
    trial(Mode::EyeInHand, count, &REALISTIC, *camera, 5).observations(false).views
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
    let target = BOARD;
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
                target: BOARD,
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
