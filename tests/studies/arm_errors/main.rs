//! What the errors of an arm do to a touched point, and what is left of them once the command is corrected.
//!
//!     cargo run --release -p handeye_studies --example arm_errors -- CSV|ARM [VIEWS] [lens] [guided] [unknown|poses] [exact] [joints] [bent|square|lens-off|late] [accuracy=PX] [sessions=40] [KIND…]
//!
//! With a CSV of factory calibrations (its columns: `arm, model, link, x_m, y_m, z_m, roll_rad, pitch_rad, yaw_rad`) an arm moves
//! according to it, and its controller believes the numbers of the data sheet: one session per arm and set-up. With `joints` the
//! joints yield under 2 kg and have gears as well; with `exact` the arms are as in their data sheets. With the name of an arm
//! (`ur5e`, `panda`, `xarm6`, `four`) errors of each kind are drawn, one arm per session; with `bent`, `square`, `lens-off` or `late`
//! something else is wrong as well. With `poses` no joints are known, only the accuracy of the robot: its error over 300 views,
//! with base and tip where that is least. `accuracy` is the stated accuracy of the given lens, which is otherwise taken as exact.
//!
//! Corners have 0.1 px of noise, the arm repeats to 0.02 mm and 0.005°. A tool of 120 mm, whose tip was found by the same arm about
//! one point, is sent to points that the camera saw; the distance between the two is printed, RMS over 40 points per session. Next
//! to it are the error of a point in space from the hand-eye transform alone, and its stated error; what no view can distinguish
//! from the transform (the arm's first joint, the zero of its last) is not an error of it. No part of the truth of a touch comes
//! from the estimator: chains, joints, lens and noise are written out here or in `handeye_simulate`. What belongs to the gauge in
//! space follows the convention of the estimator, with its own errors of an arm.

mod cell;
mod chain;
mod guided;
mod real;
mod session;

use std::path::Path;
use std::process::ExitCode;

use handeye_estimate::handeye::Mode;
use handeye_geometry::statistics::median;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use cell::{Cell, Wrong};
use chain::model;
use real::{Kind, Real};
use session::{Asked, ByAccuracy, Touched, Unknown, by_accuracy, session, unknown};

/// What ends the study.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

const SET_UPS: [(&str, Mode); 2] = [("camera on the arm", Mode::EyeInHand), ("camera beside the arm", Mode::EyeToHand)];

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let given = |word: &str| arguments.iter().any(|argument| argument == word);
    let what = arguments.first().ok_or("which CSV of arms, or which arm?")?;
    let views: usize = arguments.get(1).map_or(Ok(20), |text| text.parse())?;
    let accuracy_px = arguments.iter().find_map(|argument| argument.strip_prefix("accuracy=")).map(str::parse);
    let accuracy_px = accuracy_px.transpose()?;
    let asked = Asked { views, free_lens: given("lens"), accuracy_px, guided: given("guided"), of_links: true };
    let wrong = Wrong::ALL.into_iter().find(|(name, _)| given(name)).map(|(_, wrong)| wrong).unwrap_or_default();
    let said = wrong != Wrong::Nothing || asked.accuracy_px.is_some();
    let is_file = Path::new(what).extension().is_some_and(|ending| ending == "csv");
    if said && (is_file || asked.guided || given("unknown")) {
        return Err("what else is wrong is for drawn arms with random views and a known chain".into());
    }
    if is_file {
        return of_file(what, asked, ["exact", "joints", "poses"].map(given));
    }
    let sessions = arguments.iter().find_map(|argument| argument.strip_prefix("sessions="));
    let sessions: u64 = sessions.map_or(Ok(40), str::parse)?;
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| given(kind.name())).collect();
    let kinds = if kinds.is_empty() { Kind::ALL.to_vec() } else { kinds };
    if given("unknown") {
        of_unknown((what, wrong), asked, sessions, &kinds);
    } else if given("poses") {
        of_poses((what, wrong), asked, sessions, &kinds);
    } else {
        of_drawn((what, wrong), asked, sessions, &kinds);
    }
    Ok(())
}

/// A cell with an arm whose errors are drawn.
fn drawn((name, wrong): (&str, Wrong), kind: Kind, mode: Mode, seed: u64) -> Result<Cell, Failure> {
    let model = model(name)?;
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let real = Real::draw(kind, &model, rng);
    Ok(Cell::new(name, model, real, kind.repeats(), mode).with(wrong, rng))
}

/// Arms that the program does not know.
fn of_unknown(what @ (name, wrong): (&str, Wrong), asked: Asked, count: u64, kinds: &[Kind]) {
    for (set_up, mode) in SET_UPS {
        println!(
            "\n{name}, {wrong:?}, chain not known, {set_up}, {} views\n\n| kind | sessions | from that of many views mm | from the true one mm | stated mm | within | within of the true one |\n| --- | --- | --- | --- | --- | --- | --- |",
            asked.views
        );
        for kind in kinds {
            let one = |seed: u64| {
                let cell = drawn(what, *kind, mode, seed)?;
                unknown(&cell, Asked { of_links: kind.is_of_links(), ..asked }, 1000 + seed)
            };
            let sessions: Vec<Result<Unknown, Failure>> = (0..count).into_par_iter().map(one).collect();
            let sessions: Vec<Unknown> = sessions.into_iter().filter_map(Result::ok).collect();
            let middle = |of: &dyn Fn(&Unknown) -> f64| median(sessions.iter().map(of)).unwrap_or(f64::NAN);
            println!(
                "| {} | {} | {:.3} | {:.3} | {:.3} | {} | {} |",
                kind.name(),
                sessions.len(),
                middle(&|s| s.from_reported),
                middle(&|s| s.from_truth),
                middle(&|s| s.stated),
                sessions.iter().filter(|s| s.from_reported <= s.stated).count(),
                sessions.iter().filter(|s| s.from_truth <= s.stated).count(),
            );
        }
    }
}

/// Robots of which the program only knows the accuracy.
fn of_poses(what @ (name, _): (&str, Wrong), asked: Asked, count: u64, kinds: &[Kind]) {
    for (set_up, mode) in SET_UPS {
        for kind in kinds {
            let one = |seed: u64| by_accuracy(&drawn(what, *kind, mode, seed)?, asked, 1000 + seed);
            let sessions: Vec<ByAccuracy> = (0..count).into_par_iter().filter_map(|seed| one(seed).ok()).collect();
            row_by_accuracy(&format!("{name}, {set_up}, {}", kind.name()), &sessions);
        }
    }
}

/// Medians over sessions.
fn row_by_accuracy(name: &str, sessions: &[ByAccuracy]) {
    let middle = |of: &dyn Fn(&ByAccuracy) -> f64| median(sessions.iter().map(of)).unwrap_or(f64::NAN);
    let within = sessions.iter().map(|s| s.within).sum::<f64>() / sessions.len().max(1) as f64;
    println!(
        "| {name} | {} | {:.3} mm, {:.4}° ({:.1} rad/m) | {:.3} | {:.3} | {:.1} % |",
        sessions.len(),
        middle(&|s| s.accuracy[0]),
        middle(&|s| s.accuracy[1]),
        middle(&|s| s.accuracy[1].to_radians() / s.accuracy[0] * 1e3),
        middle(&|s| s.touch_mm),
        middle(&|s| s.stated_mm),
        100.0 * within,
    );
}

/// Arms of a file, one line each.
fn of_file(path: &str, asked: Asked, [exact, joints, poses]: [bool; 3]) -> Result<(), Failure> {
    let csv = std::fs::read_to_string(path)?;
    for (name, mode) in SET_UPS {
        let cell = |arm: usize, kind: &str, truth: chain::Chain| -> Result<Cell, Failure> {
            let model = model(kind)?;
            let real = Real::of_links(if exact { model.believed.clone() } else { truth });
            let rng = &mut ChaCha8Rng::seed_from_u64(arm as u64);
            let real = if joints { real.with_joints(&model, rng) } else { real };
            Ok(Cell::new(kind, model, real, Kind::Links.repeats(), mode))
        };
        if poses {
            let sessions = chain::read(&csv)?.into_par_iter().filter_map(|(arm, (kind, truth))| {
                by_accuracy(&cell(arm, &kind, truth).ok()?, asked, 100 + arm as u64).ok()
            });
            row_by_accuracy(name, &sessions.collect::<Vec<_>>());
            continue;
        }
        let one = |arm: usize, kind: &str, truth: chain::Chain| {
            let cell = cell(arm, kind, truth)?;
            session(&cell, Asked { of_links: !joints, ..asked }, 100 + arm as u64)
        };
        let sessions: Vec<_> = chain::read(&csv)?
            .into_par_iter()
            .map(|(arm, (kind, truth))| (format!("{arm} {kind}"), one(arm, &kind, truth)))
            .collect();
        println!(
            "\n{name}, {} views\n\n| arm | as it is mm | corrected mm | stated 95 % | within | in space mm | stated 95 % |\n| --- | --- | --- | --- | --- | --- | --- |",
            asked.views
        );
        for (arm, touched) in &sessions {
            match touched {
                Ok(Touched { as_it_is_mm, corrected_mm, within, stated_mm, space_mm, space_stated_mm, .. }) => {
                    println!(
                        "| {arm} | {as_it_is_mm:.3} | {corrected_mm:.3} | {:.2}, {:.2} | {:.0} %, {:.0} % | {space_mm:.3} | {space_stated_mm:.3} |",
                        stated_mm[0],
                        stated_mm[1],
                        within[0] * 100.0,
                        within[1] * 100.0
                    );
                }
                Err(error) => println!("| {arm} | {error} | |"),
            }
        }
        println!("\n{HEADER}");
        row("all", &sessions.into_iter().filter_map(|(_, touched)| touched.ok()).collect::<Vec<_>>());
    }
    Ok(())
}

/// Arms with errors of each kind, a line a kind.
fn of_drawn(what @ (name, wrong): (&str, Wrong), asked: Asked, count: u64, kinds: &[Kind]) {
    for (set_up, mode) in SET_UPS {
        println!(
            "\n{name}, {wrong:?}, {set_up}, {} views, lens {}\n\n{HEADER}",
            asked.views,
            match asked.accuracy_px {
                Some(px) => format!("known to {px} px"),
                None => if asked.free_lens { "estimated" } else { "known" }.to_owned(),
            }
        );
        for kind in kinds {
            let one = |seed: u64| {
                let cell = drawn(what, *kind, mode, seed)?;
                session(&cell, Asked { of_links: kind.is_of_links(), ..asked }, 1000 + seed)
            };
            let sessions: Vec<Result<Touched, Failure>> = (0..count).into_par_iter().map(one).collect();
            let failed = sessions.iter().find_map(|session| session.as_ref().err()).map(ToString::to_string);
            let sessions: Vec<Touched> = sessions.into_iter().filter_map(Result::ok).collect();
            row(kind.name(), &sessions);
            if let Some(failed) = failed {
                println!("({} of {count} failed, the first: {failed})", count as usize - sessions.len());
            }
        }
    }
}

const HEADER: &str = "| kind | sessions | Park mm | as it is mm | corrected mm | worse | stated 95 % mm | touches within | sessions within, corrected | in space mm | stated | within |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |";

/// Medians over sessions; RMS in brackets. Those that corrected commands made worse, and those whose corrected touches were within
/// the stated error 95 times of a hundred.
fn row(name: &str, sessions: &[Touched]) {
    let count = sessions.len().max(1) as f64;
    let middle = |of: &dyn Fn(&Touched) -> f64| median(sessions.iter().map(of)).unwrap_or(f64::NAN);
    let rms = |of: &dyn Fn(&Touched) -> f64| (sessions.iter().map(|s| of(s).powi(2)).sum::<f64>() / count).sqrt();
    let part = |of: &dyn Fn(&Touched) -> f64| sessions.iter().map(of).sum::<f64>() / count * 100.0;
    let with_space: Vec<&Touched> = sessions.iter().filter(|session| session.space_mm.is_finite()).collect();
    let space = |of: &dyn Fn(&Touched) -> f64| median(with_space.iter().map(|s| of(s))).unwrap_or(f64::NAN);
    println!(
        "| {name} | {} | {:.3} | {:.3} ({:.3}) | {:.3} ({:.3}) | {} | {:.2}, {:.2} | {:.1} %, {:.1} % | {:.0} % | {:.3} | {:.3} | {} of {} |",
        sessions.len(),
        middle(&|s| s.park_mm),
        middle(&|s| s.as_it_is_mm),
        rms(&|s| s.as_it_is_mm),
        middle(&|s| s.corrected_mm),
        rms(&|s| s.corrected_mm),
        sessions.iter().filter(|s| s.corrected_mm > s.as_it_is_mm).count(),
        middle(&|s| s.stated_mm[0]),
        middle(&|s| s.stated_mm[1]),
        part(&|s| s.within[0]),
        part(&|s| s.within[1]),
        part(&|s| f64::from(s.within[1] >= 0.95)),
        space(&|s| s.space_mm),
        space(&|s| s.space_stated_mm),
        with_space.iter().filter(|s| s.space_mm <= s.space_stated_mm).count(),
        with_space.len(),
    );
}
