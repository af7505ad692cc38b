//! Monte-Carlo study of small targets that are far away and little tilted, which have two poses in a view.
//!
//!     cargo run --release -p handeye_studies --example two_poses -- SESSIONS
//!
//! Prints Markdown: the table of `docs/studies/mathematics.md`. A session has 15 views of 4×3 corners, 15 mm apart, through
//! 640×480 pixels with f = 581 px, 0.2 px of noise per axis, rolled by up to 60°, with a robot whose repeatability is 0.1
//! mm and 0.02°. Targets are 0.5 m to the stated distance away and tilted by up to the stated angle.

use std::process::ExitCode;

use handeye_estimate::diagnose::calibrate;
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::Noise;
use handeye_estimate::{Method, ViewStatus};
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, SMALL_TARGET, SmallTarget, camera, small_target_trial};
use rayon::prelude::*;

const VIEWS: usize = 15;
const CASES: [SmallTarget; 4] = [
    SmallTarget { farthest_m: 0.8, tilt_deg: 15.0 },
    SmallTarget { farthest_m: 1.2, tilt_deg: 15.0 },
    SmallTarget { farthest_m: 1.2, tilt_deg: 10.0 },
    SmallTarget { farthest_m: 1.2, tilt_deg: 5.0 },
];
const METHODS: [&str; 2] = ["park_martin", "shah"];

/// The result of one session.
#[derive(Default)]
struct Session {
    wrong_poses: usize,
    /// Views reported as outliers; none is an outlier.
    outliers: usize,
    /// For the closed forms and for the joint estimate, millimetres; infinite if there is none.
    error_mm: [f64; METHODS.len() + 1],
    /// Squared error of the joint estimate in units of its stated covariance, over its six numbers.
    ratio: f64,
}

fn session(case: SmallTarget, mode: Mode, seed: u64) -> Session {
    let noise = Noise { corner_px: 0.2, ..REALISTIC };
    let trial = small_target_trial(mode, VIEWS, &noise, case, seed);
    let solve = |i: usize| planar_pose::solve(&trial.views[i].corners, &SMALL_TARGET, &camera()).ok();
    let wrong = |i: &usize| {
        let truth = trial.true_camera_from_target[*i].rotation();
        solve(*i).is_some_and(|pose| {
            let off = |s: &planar_pose::Solution| s.camera_from_target.rotation().angle_to(&truth);
            pose.alternative.is_some_and(|other| off(&other) < off(&pose.best))
        })
    };
    let observations = trial.observations(false);
    let mut out = Session {
        wrong_poses: (0..VIEWS).filter(wrong).count(),
        error_mm: [f64::INFINITY; METHODS.len() + 1],
        ratio: f64::INFINITY,
        ..Session::default()
    };
    let Ok(found) = calibrate(&observations, Method::Joint, &CancelToken::default()) else { return out };
    let off_mm = |pose| trial.mount_from_camera.distance_to(&pose).0 * 1e3;
    for (error, name) in out.error_mm.iter_mut().zip(METHODS) {
        let solved = found.methods.iter().find(|m| m.name == name).and_then(|m| m.outcome.clone().ok());
        *error = solved.map_or(f64::INFINITY, |solution| off_mm(solution.mount_from_camera));
    }
    if let Some(hand_eye) = found.hand_eye {
        out.error_mm[METHODS.len()] = off_mm(hand_eye.mount_from_camera());
        let e =
            handeye_geometry::se3::log((trial.mount_from_camera.inverse() * hand_eye.mount_from_camera()).isometry());
        let inverse = found.hand_eye_covariance().and_then(|c| c.try_inverse());
        out.ratio = inverse.map_or(f64::INFINITY, |inverse| e.dot(&(inverse * e)) / 6.0);
    }
    out.outliers = found.views.iter().filter(|view| view.status == ViewStatus::Outlier).count();
    out
}

fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

fn main() -> ExitCode {
    let Some(count) = std::env::args().nth(1).and_then(|n| n.parse::<u64>().ok()).filter(|n| *n > 0) else {
        eprintln!("usage: two_poses SESSIONS");
        return ExitCode::from(2);
    };
    println!(
        "| set-up | to | tilt | views whose best pose is the wrong one | sessions with views called outliers | such views | \
         Park & Martin mm, 50 % / 95 % | Shah mm | joint mm | joint, squared error over stated |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for case in CASES {
        for (mode, name) in [(Mode::EyeInHand, "eye in hand"), (Mode::EyeToHand, "eye to hand")] {
            let sessions: Vec<Session> = (0..count).into_par_iter().map(|seed| session(case, mode, seed)).collect();
            let percent = |n: usize, of: usize| 100.0 * n as f64 / of as f64;
            let views = sessions.len() * VIEWS;
            let error = |k: usize| {
                let at = |part| quantile(sessions.iter().map(|s| s.error_mm[k]), part);
                format!("{:.1} / {:.1}", at(0.5), at(0.95))
            };
            println!(
                "| {name} | {} m | {}° | {:.1} % | {:.1} % | {:.2} % | {} | {} | {} | {:.2} |",
                case.farthest_m,
                case.tilt_deg,
                percent(sessions.iter().map(|s| s.wrong_poses).sum(), views),
                percent(sessions.iter().filter(|s| s.outliers > 0).count(), sessions.len()),
                percent(sessions.iter().map(|s| s.outliers).sum(), views),
                error(0),
                error(1),
                error(2),
                quantile(sessions.iter().map(|s| s.ratio), 0.5),
            );
        }
    }
    ExitCode::SUCCESS
}
