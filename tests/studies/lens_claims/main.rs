//! What is reported about a lens with a robot, on sessions drawn by code that shares nothing with the estimator.
//!
//! `cargo run --release -p handeye_studies --example lens_claims -- given [SESSIONS] [ROBOT]`: how often a given lens with a wrong
//! centre is found, how often a right one is reported, and whether the stated error covers the true one. `… -- halves [SESSIONS]
//! [KIND]`: the stated error of lens and hand-eye transform if the lens is estimated from half a session, and what it was without
//! counting that views disagree about the lens.

#[expect(dead_code, reason = "the test draws more than is printed here")]
mod scene;

use handeye_estimate::diagnose::doctor::Diagnosis;
use handeye_estimate::diagnose::findings::FindingCode;
use handeye_estimate::diagnose::{Calibration, calibrate};
use handeye_estimate::handeye::Mode;
use handeye_estimate::uncertainty::{overdispersion, quality};
use handeye_estimate::{JointFit, Method, Observations};
use handeye_geometry::progress::CancelToken;
use nalgebra::{DMatrix, Matrix6};
use scene::Scene;

/// Index of the lens among the unknowns of a covariance.
const LENS_AT: usize = 12;

const MODES: [Mode; 2] = [Mode::EyeInHand, Mode::EyeToHand];

/// As made by the command line.
fn examined(observations: &Observations) -> Option<(Calibration, Diagnosis)> {
    let cancel = CancelToken::default();
    let calibration = calibrate(observations, Method::Joint, &cancel).ok()?;
    let diagnosis = calibration.diagnosis().clone();
    Some((calibration, diagnosis))
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let what = arguments.next().unwrap_or_default();
    let sessions = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(50);
    match what.as_str() {
        "halves" => halves(sessions, &arguments.next().unwrap_or_default()),
        _ => given(sessions, &arguments.next().unwrap_or_default()),
    }
}

/// Robots of the study by name: noise in metres and radians, waves in metres.
const ROBOTS: [(&str, (f64, f64), f64); 3] = [
    ("exact", (0.0, 0.0), 0.0),
    ("0.1 mm, 0.02°", (1e-4, 3.5e-4), 0.0),
    ("0.03 mm, 0.005°, waves of 0.5 mm, 0.1°", (3e-5, 8.7e-5), 5e-4),
];

fn given(sessions: u64, only: &str) {
    println!(
        "| eye | robot | views | corners px, own + shared | off px | found % | \"half a pixel\" % | others named % | true mm | \
         stated mm | covered % |"
    );
    for mode in MODES {
        for (robot, noise, waves_m) in ROBOTS.into_iter().filter(|(name, ..)| name.contains(only)) {
            for views in [12, 24] {
                for (corner_px, shared_px) in [(0.0, 0.0), (0.03, 0.0), (0.1, 0.0), (0.1, 0.05), (0.3, 0.0)] {
                    let scene = Scene { corner_px, shared_px, robot: noise, waves_m, ..Scene::new(mode, views) };
                    for off in [0.0, 0.25, 0.5, 1.0] {
                        given_row(&scene, robot, off, sessions);
                    }
                }
            }
        }
    }
}

fn given_row(scene: &Scene, robot: &str, off: f64, sessions: u64) {
    let (mut found, mut half, mut others, mut covered, mut total) = (0, 0, 0, 0, 0);
    let (mut true_m, mut stated_m) = (Vec::new(), Vec::new());
    for seed in 0..sessions {
        let session = scene.draw(seed);
        let off = if seed.is_multiple_of(2) { off } else { -off };
        let Some((calibration, diagnosis)) = examined(&session.given([off; 2])) else { continue };
        total += 1;
        let named = |code| diagnosis.findings.iter().find(|finding| finding.code == code);
        let lens = named(FindingCode::WrongIntrinsics);
        found += usize::from(lens.is_some());
        half += usize::from(lens.is_some_and(|finding| finding.to_string().contains("half a pixel")));
        let another =
            [FindingCode::BoardMoved, FindingCode::CameraMoved, FindingCode::WrongScale, FindingCode::OutlierView];
        others += usize::from(another.into_iter().any(|code| named(code).is_some()));
        if let Some((error, stated)) = session.errors_m(&calibration) {
            true_m.push(error);
            covered += usize::from(stated.is_none_or(|stated| stated >= error));
            stated_m.extend(stated);
        }
    }
    let percent = |count: usize| 100.0 * count as f64 / total.max(1) as f64;
    println!(
        "| {:?} | {robot} | {} | {} + {} | {off} | {:.0} | {:.0} | {:.0} | {:.3} | {:.3} | {:.0} |",
        scene.mode,
        scene.views,
        scene.corner_px,
        scene.shared_px,
        percent(found),
        percent(half),
        percent(others),
        median(true_m) * 1e3,
        median(stated_m) * 1e3,
        percent(covered)
    );
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn halves(sessions: u64, only: &str) {
    println!(
        "| eye | what | views a half | fx held % | fy | cx | cy | fx sigma % | disagree % | true mm | stated mm | covered % | \
         without: fx held % | stated mm | covered % | halves |"
    );
    for mode in MODES {
        for (what, change) in KINDS.iter().filter(|(what, _)| what.contains(only)) {
            for views in [8, 14] {
                halves_row(&change(Scene::new(mode, 2 * views)), what, sessions);
            }
        }
    }
}

type Kind = (&'static str, fn(Scene) -> Scene);

/// How the sessions differ from the model, or are weak.
const KINDS: [Kind; 11] = [
    ("good", |scene| scene),
    ("little tilt", |scene| Scene { tilt_deg: 12.0, ..scene }),
    ("little turn", |scene| Scene { roll_deg: 10.0, ..scene }),
    ("waves of the robot", |scene| Scene { robot: (3e-5, 8.7e-5), waves_m: 5e-4, ..scene }),
    ("waves of the robot, little tilt", |scene| Scene {
        robot: (3e-5, 8.7e-5),
        waves_m: 5e-4,
        tilt_deg: 12.0,
        ..scene
    }),
    ("waves of the robot, little turn", |scene| Scene {
        robot: (3e-5, 8.7e-5),
        waves_m: 5e-4,
        roll_deg: 10.0,
        ..scene
    }),
    ("corners err alike", |scene| Scene { shared_px: 0.1, ..scene }),
    ("corners err alike, little tilt", |scene| Scene { shared_px: 0.1, tilt_deg: 12.0, ..scene }),
    ("print off by 0.1 mm", |scene| Scene { print_m: 1e-4, ..scene }),
    ("corners err alike, print off by 0.1 mm", |scene| Scene { shared_px: 0.1, print_m: 1e-4, ..scene }),
    ("board bent by 0.1 mm, little tilt", |scene| Scene { bend_m: 1e-4, tilt_deg: 12.0, ..scene }),
];

/// What is stated about a lens and about a point where the target was seen.
#[derive(Default)]
struct Held {
    lens: [usize; 4],
    tip: usize,
    sigma: Vec<f64>,
    stated_m: Vec<f64>,
}

impl Held {
    /// With a covariance of all unknowns that begins with the hand-eye transform.
    fn add(&mut self, covariance: &DMatrix<f64>, lens_error_px: [f64; 4], joint: &JointFit, error_m: f64, focal: f64) {
        let sigma = |i: usize| covariance[(LENS_AT + i, LENS_AT + i)].sqrt();
        for (k, error) in lens_error_px.into_iter().enumerate() {
            self.lens[k] += usize::from(error.abs() < 1.96 * sigma(k));
        }
        let hand_eye: Matrix6<f64> = covariance.fixed_view::<6, 6>(0, 0).into_owned();
        let stated_m = quality::tip_error_95_at(&hand_eye, joint.small_sample, &joint.reference_point);
        self.tip += usize::from(error_m <= stated_m);
        self.sigma.push(100.0 * sigma(0) / focal);
        self.stated_m.push(stated_m);
    }
}

fn halves_row(scene: &Scene, what: &str, sessions: u64) {
    let (mut with, mut without) = (Held::default(), Held::default());
    let (mut true_m, mut widened) = (Vec::new(), 0);
    for seed in 0..sessions {
        let session = scene.draw(1000 + seed);
        for half in session.halves() {
            let Ok(calibration) = calibrate(&half, Method::Joint, &CancelToken::default()) else { continue };
            let (Some(camera), Some(joint)) = (calibration.camera, &calibration.joint) else { continue };
            let Some((error_m, _)) = session.errors_m(&calibration) else { continue };
            let lens = camera.intrinsics;
            let truth = session.lens;
            let off = [lens.fx - truth.fx, lens.fy - truth.fy, lens.cx - truth.cx, lens.cy - truth.cy];
            with.add(&joint.covariance, off, joint, error_m, lens.fx);
            let places = LENS_AT..LENS_AT + lens.parameter_count();
            let before = overdispersion::with_less_known(&joint.covariance, places, joint.widening.lens.recip());
            without.add(&before, off, joint, error_m, lens.fx);
            widened += usize::from(joint.widening.lens_is_refuted());
            true_m.push(error_m);
        }
    }
    let total = true_m.len();
    let percent = |count: usize| 100.0 * count as f64 / total.max(1) as f64;
    let [fx, fy, cx, cy] = with.lens.map(percent);
    println!(
        "| {:?} | {what} | {} | {fx:.0} | {fy:.0} | {cx:.0} | {cy:.0} | {:.3} | {:.0} | {:.3} | {:.3} | {:.1} | {:.0} | {:.3} | {:.1} | {total} |",
        scene.mode,
        scene.views / 2,
        median(with.sigma),
        percent(widened),
        median(true_m) * 1e3,
        median(with.stated_m) * 1e3,
        percent(with.tip),
        percent(without.lens[0]),
        median(without.stated_m) * 1e3,
        percent(without.tip)
    );
}
