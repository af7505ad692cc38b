use nalgebra::{Isometry3, Vector3};

use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::{Noise, estimate};
use crate::test_sessions::Estimated as _;
use crate::uncertainty::quality;
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

/// An error of the robot that neighbouring poses share: a field in base axes that is linear in the position.
fn bend(t: &mut Session, per_metre: f64) {
    let mean = t.views.iter().map(|v| v.base_from_tip.translation()).sum::<Vector3<f64>>() / t.views.len() as f64;
    for view in &mut t.views {
        let off = view.base_from_tip.translation() - mean;
        let error = Vector3::new(off.y + off.z, -off.x, 0.7 * off.x - 0.5 * off.y) * per_metre;
        view.base_from_tip =
            Pose::from_isometry(Isometry3::translation(error.x, error.y, error.z) * view.base_from_tip.isometry());
    }
}

fn solve(t: &Session, free: bool) -> (JointSolution, Overdispersion) {
    let problem = t.problem(free, None);
    let solution = estimate(&problem, &t.start(), &CancelToken::default()).expect("solves");
    let widening = check(&problem, &solution, ShownEffects::default(), &CancelToken::default()).expect("checks");
    (solution, widening)
}

/// Share of trials widened, mean factor, and lines about the evidence and how often the truth was covered.
fn study(trials: u64, views: usize, free: bool, per_metre: f64, noise: &Noise) -> (f64, f64, Vec<String>) {
    let (mut widened, mut factor) = (0.0, 0.0);
    let (mut covered, mut covered_formal, mut tip) = (0, 0, 0);
    let mut by = std::collections::BTreeMap::<String, (usize, f64)>::new();
    for k in 0..trials {
        let mut t =
            trial(if k % 2 == 0 { Mode::EyeInHand } else { Mode::EyeToHand }, views, noise, camera(), 50_000 + k);
        bend(&mut t, per_metre);
        let (solution, widening) = solve(&t, free);
        widened += f64::from(u8::from(widening.by.is_some())) / trials as f64;
        factor += widening.factor / trials as f64;
        let e = t.hand_eye_error(&solution);
        let squared = |solution: &JointSolution| {
            e.dot(&(solution.hand_eye_covariance().try_inverse().expect("regular") * e)) / 6.0
        };
        let law = solution.small_sample;
        let quantile = f95(6, law.degrees_of_freedom.min(1e6)) / law.scale;
        let mut stated = solution.clone();
        stated.widen(&widening);
        covered += usize::from(squared(&stated) < quantile);
        covered_formal += usize::from(squared(&solution) < quantile);
        let off = e.fixed_rows::<3>(0) + e.fixed_rows::<3>(3).cross(&solution.reference_point.coords);
        tip += usize::from(off.norm() < quality::tip_error_95_m(&stated));
        for c in &widening.checks {
            let entry = by.entry(format!("{:?}", c.by)).or_default();
            entry.0 += usize::from(c.is_significant());
            entry.1 += c.ratio / trials as f64;
        }
    }
    let mut lines: Vec<String> = by
        .into_iter()
        .map(|(name, (n, ratio))| {
            format!("{name}: {:.1} % significant, mean ratio {ratio:.2}", n as f64 / trials as f64 * 100.0)
        })
        .collect();
    lines.push(format!(
        "region covers {:.1} %, tip {:.1} %, region as stated {:.1} %",
        covered as f64 / trials as f64 * 100.0,
        tip as f64 / trials as f64 * 100.0,
        covered_formal as f64 / trials as f64 * 100.0
    ));
    (widened, factor, lines)
}

/// 95 % quantile of Fisher's distribution.
fn f95(a: usize, b: f64) -> f64 {
    use statrs::distribution::ContinuousCDF as _;
    statrs::distribution::FisherSnedecor::new(a as f64, b).expect("positive").inverse_cdf(0.95)
}

#[test]
fn healthy_sessions_are_left_alone() {
    // At most three in a hundred are widened by chance; of forty then more than five in one case in five hundred.
    let (widened, factor, lines) = study(40, 10, false, 0.0, &REALISTIC);
    println!("widened {widened:.3}, mean factor {factor:.3}; {lines:?}");
    assert!(widened <= 5.0 / 40.0, "{widened}");
}

#[test]
fn errors_that_neighbouring_poses_share_widen_the_uncertainty() {
    // A robot with a systematic error of 4 mm per metre, where its own noise is a tenth of a millimetre.
    let mut t = trial(Mode::EyeInHand, 24, &REALISTIC, camera(), 77);
    bend(&mut t, 0.004);
    let (solution, widening) = solve(&t, false);
    println!("{widening:?}");
    assert_eq!(widening.by, Some(Evidence::Neighbours));
    assert!(widening.factor > 1.2, "{}", widening.factor);
    let covariance = solution.hand_eye_covariance();
    let at = |c| quality::tip_error_95_at(&c, solution.small_sample, &solution.reference_point);
    assert!((at(covariance * widening.factor) / at(covariance) - widening.factor.sqrt()).abs() < 1e-6);
}

#[test]
fn the_check_is_the_same_every_time_and_says_nothing_of_few_views() {
    let t = trial(Mode::EyeToHand, 9, &REALISTIC, camera(), 5);
    assert_eq!(solve(&t, false).1, solve(&t, false).1);
    let t = trial(Mode::EyeToHand, 5, &REALISTIC, camera(), 5);
    assert_eq!(solve(&t, false).1, Overdispersion { factor: 1.0, by: None, lens: 1.0, checks: Vec::new() });
}

/// `HANDEYE_TRIALS` makes a study of it, of minutes, with that many sessions of each kind.
#[test]
fn study_of_healthy_and_bent_sessions() {
    let trials = std::env::var("HANDEYE_TRIALS").ok().and_then(|t| t.parse().ok()).unwrap_or(8);
    let noisy = Noise { corner_px: 0.1, robot_m: 5e-4, robot_rad: 0.1f64.to_radians(), ..Noise::EXACT };
    let cells = |per_metre: f64, cells: &[(usize, bool, &Noise)]| {
        let mut widened = 0.0;
        for &(views, free, noise) in cells {
            let (share, factor, lines) = study(trials, views, free, per_metre, noise);
            println!(
                "{views} views, robot {} mm, camera {}, bent by {per_metre} m/m: widened {:.1} %, mean factor {factor:.3}",
                noise.robot_m * 1e3,
                if free { "free" } else { "known" },
                share * 100.0
            );
            for line in lines {
                println!("    {line}");
            }
            widened += share / cells.len() as f64;
        }
        widened
    };
    let healthy = cells(
        0.0,
        &[
            (10, false, &REALISTIC),
            (20, false, &REALISTIC),
            (40, false, &REALISTIC),
            (10, false, &noisy),
            (20, false, &noisy),
            (20, true, &REALISTIC),
            (20, true, &noisy),
        ],
    );
    // Three checks at one in a hundred: at most 3 % of healthy sessions; four standard deviations are allowed for.
    let sessions = 7.0 * trials as f64;
    assert!(healthy <= 0.03 + 4.0 * (0.03 * 0.97 / sessions).sqrt(), "{healthy} of {sessions} healthy sessions");
    // Forty times the robot's own noise over a metre is found in most sessions; a tenth of that noise's share is not.
    let bent = cells(0.004, &[(20, false, &REALISTIC)]);
    cells(0.004, &[(20, false, &noisy)]);
    assert!(bent > 0.5, "{bent} of bent sessions");
}
