//! Speed of the solvers on simulated corners: `cargo bench -p handeye_estimate --bench solvers`.
//!
//! `docs/studies/benchmarks.md` has the comparison with other programs, which `tests/bench/solvers.py`
//! makes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use handeye_arm::ArmKind;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{calibrate, calibrate_with};
use handeye_estimate::handeye::Mode;
use handeye_estimate::intrinsics::{Options, SeenView, solve};
use handeye_estimate::placement::{ArmOfViews, JointView, place};
use handeye_estimate::reach_error::USUAL_TOOL_M;
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView, Options as SolveOptions};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::testing::BOARD;
use handeye_simulate::session::{REALISTIC, Setup, session, trial};
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

/// The same with an arm whose joints are known: its errors, what a tool arrives within, and a corrected command.
fn with_arm(c: &mut Criterion) {
    let mut group = c.benchmark_group("calibrate_with_arm");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    let near = [0.0, -1.2, 1.6, -1.9, -1.5, 0.0];
    for (name, free_lens) in [("known_camera", false), ("unknown_camera", true)] {
        for count in [10, 100, 1_000] {
            let setup = Setup { joints: true, noise: REALISTIC, ..Setup::new(Mode::EyeInHand, count, 5) };
            let session = session(&setup);
            let observations = session.observations(free_lens);
            let arm = ArmKind::Ur5.arm();
            let inverse = |pose| arm.inverse(&pose, &near).expect("within reach");
            let joints_rad: Vec<Vec<f64>> = session.views.iter().map(|view| inverse(view.base_from_tip)).collect();
            let views: Vec<JointView<'_>> = session
                .views
                .iter()
                .zip(&joints_rad)
                .map(|(view, joints_rad)| JointView { base_from_tip: view.base_from_tip, joints_rad })
                .collect();
            let placement = place(&arm, &views).expect("an arm");
            let tool_m = [0.0, 0.0, USUAL_TOOL_M];
            let of_views = ArmOfViews { placement, tool_m, joints_rad: joints_rad.into_iter().map(Some).collect() };
            let wanted = FindingOptions::default().with_arm(Some(&of_views));
            let cancel = CancelToken::default();
            let solve = |observations: &Observations| {
                calibrate_with(observations, Method::Joint, SolveOptions::default(), &wanted, &cancel).expect("solves")
            };
            group.throughput(Throughput::Elements(count as u64));
            group.bench_with_input(BenchmarkId::new(name, count), &observations, |b, observations| {
                b.iter(|| solve(black_box(observations)));
            });
            if (count, free_lens) == (10, false) {
                let calibration = solve(&observations);
                let errors = calibration.joint.as_ref().and_then(|joint| joint.arm.as_ref()).expect("known joints");
                let corrected = CorrectedArm::new(of_views.placement.arm.clone(), errors).expect("its own");
                let wanted = session.views[3].base_from_tip;
                group.bench_function("command", |b| {
                    b.iter(|| corrected.command(black_box(&wanted), &near).expect("within reach"));
                });
            }
        }
    }
}

criterion_group!(benches, projection, intrinsics, whole, with_arm);
criterion_main!(benches);
