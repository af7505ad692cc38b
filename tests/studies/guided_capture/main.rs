//! Guided capture against other ways to choose poses, and whether it is honest when it stops.
//!
//! ```text
//! cargo run --release -p handeye_studies --example guided_capture -- choice 200
//! cargo run --release -p handeye_studies --example guided_capture -- scenes 200
//! cargo run --release -p handeye_studies --example guided_capture -- stop 1000
//! cargo run --release -p handeye_studies --example guided_capture -- speed 20
//! cargo run --release -p handeye_studies --example guided_capture -- hand 100
//! cargo run --release -p handeye_studies --example guided_capture -- straight 6
//! ```
//!
//! `choice`: the expected error of the tip over the box about the board, with the true model and the poses that were taken,
//! in sessions that begin with one view of the board. Farthest rotation and random views know from the beginning where camera
//! and board are; guided capture does not. The optimum is the best set of this many views out of the same thousand, by
//! exchange, once of all and once of those that begin with the first three views of guided capture. And the true error of the
//! answers. `scenes`: the same in the scenes of the cell, each arm in the reference and in the realistic one, with the camera
//! where the scene has it, and with camera and board swapped. `stop`: what is true when guided capture ends by itself. A word
//! after the number selects rows of both. `speed`: how long the choice of a pose takes, on one thread, with a thousand
//! candidates and six poses ahead. `hand`: a robot that is moved by hand. `straight`: the first poses where small rotations
//! determine no lens.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a study prints, and stops at what cannot be")]

mod bench;
mod choice;
mod scenes;
mod stop;

use std::env;
use std::time::Instant;

use handeye_estimate::handeye::Mode;
use handeye_geometry::progress::CancelToken;
use handeye_plan::guided::by_hand::{HandGuide, HandNext};
use handeye_plan::guided::{Ending, Guide, GuidedOptions};
use handeye_plan::testing::guided_cell::{CellArm, CellSetup, GuidedCell};
use handeye_plan::testing::hand;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

/// Numbers of views that are compared.
const COUNTS: [usize; 6] = [6, 8, 10, 12, 14, 17];

fn main() {
    let mut args = env::args().skip(1);
    let what = args.next().unwrap_or_else(|| "choice".to_owned());
    let sessions: u64 = args.next().map_or(200, |n| n.parse().expect("a number of sessions"));
    match what.as_str() {
        "choice" => choice::choice(sessions),
        "scenes" => choice::in_scenes(sessions, &args.next().unwrap_or_default()),
        "stop" => stop::stop(sessions, &args.next().unwrap_or_default()),
        "speed" => speed(sessions),
        "hand" => by_hand(sessions),
        "straight" => straight(sessions),
        other => println!("{other:?} is none of choice, scenes, stop, speed, hand, straight"),
    }
}

/// A trembling hand that is guided to ten views: how long each view takes, and the result.
fn by_hand(sessions: u64) {
    println!(
        "| camera | seconds a view, median, 90 % | refused | given up | error stated, mean, mm | true below stated |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for (mode, name) in [(Mode::EyeInHand, "on the arm"), (Mode::EyeToHand, "beside it")] {
        let (mut took_s, mut refused, mut skipped) = (Vec::new(), 0, 0);
        let (mut stated_mm, mut below, mut solved) = (0.0, 0, 0);
        for seed in 0..sessions {
            let setup = CellSetup::new(CellArm::Ur5e, mode, seed);
            let mut cell = GuidedCell::new(setup);
            let run = hand::session(&mut cell, GuidedOptions { goal_m: 1e-9, ..GuidedOptions::default() }, 10, seed);
            took_s.extend(run.took_s);
            refused += run.refused;
            skipped += run.skipped;
            let errors = run.calibration.as_ref().and_then(|it| Some((it.tip_error_95_m()?, cell.true_error_m(it)?)));
            if let Some((stated_m, true_m)) = errors {
                solved += 1;
                stated_mm += stated_m * 1e3;
                below += u32::from(true_m <= stated_m);
            }
        }
        took_s.sort_by(f64::total_cmp);
        let quantile = |part: f64| took_s.get((took_s.len() as f64 * part) as usize).copied().unwrap_or(f64::NAN);
        let count = f64::from(solved);
        println!(
            "| {name} | {:.1}, {:.1} | {refused} | {skipped} | {:.3} | {:.0} % of {solved} |",
            quantile(0.5),
            quantile(0.9),
            stated_mm / count,
            1e2 * f64::from(below) / count
        );
    }
}

/// Whether the goal is reached from a board straight on and near the edge of the image, with an unknown lens.
fn straight(sessions: u64) {
    println!("| focal length, px of 640 | camera | reached | moves that lost the board |");
    println!("| --- | --- | --- | --- |");
    for focal_px in [350.0, 581.0, 1100.0] {
        for (mode, name) in [(Mode::EyeInHand, "on the arm"), (Mode::EyeToHand, "beside it")] {
            let all = CellArm::ALL.into_iter().flat_map(|arm| (0..sessions).map(move |seed| (arm, seed)));
            let runs: Vec<(bool, usize)> = all
                .collect::<Vec<_>>()
                .into_par_iter()
                .map(|(arm, seed)| {
                    let setup =
                        CellSetup { free_lens: true, straight: Some(focal_px), ..CellSetup::new(arm, mode, 21 + seed) };
                    let run = GuidedCell::new(setup).run(GuidedOptions { goal_m: 1.5e-3, ..GuidedOptions::default() });
                    (matches!(run.ending, Ending::GoalReached { .. }), run.failed)
                })
                .collect();
            let reached = runs.iter().filter(|run| run.0).count();
            let lost: usize = runs.iter().map(|run| run.1).sum();
            println!("| {focal_px} | {name} | {reached} of {} | {lost} |", runs.len());
        }
    }
}

const SETUPS: [(CellArm, Mode); 6] = [
    (CellArm::Ur5e, Mode::EyeInHand),
    (CellArm::Ur5e, Mode::EyeToHand),
    (CellArm::Panda, Mode::EyeInHand),
    (CellArm::Panda, Mode::EyeToHand),
    (CellArm::Xarm6, Mode::EyeInHand),
    (CellArm::Xarm6, Mode::EyeToHand),
];

fn speed(sessions: u64) {
    println!("median time to choose the eleventh pose, ms, {sessions} sessions");
    for (arm, mode) in SETUPS {
        for free_lens in [false, true] {
            let mut times: Vec<f64> = (0..sessions)
                .map(|seed| {
                    let mut cell = GuidedCell::new(CellSetup { free_lens, ..CellSetup::new(arm, mode, seed) });
                    let _ended = cell.run(GuidedOptions { goal_m: 0.0, most_views: 10, ..GuidedOptions::default() });
                    let calibration = cell.calibrate();
                    let known = cell.known(calibration.as_ref(), 0.0);
                    let mut guide = Guide::new(GuidedOptions { goal_m: 0.0, ..GuidedOptions::default() });
                    let began = Instant::now();
                    let _next = guide.next(&known, &CancelToken::default());
                    began.elapsed().as_secs_f64() * 1e3
                })
                .collect();
            times.sort_by(f64::total_cmp);
            if !free_lens {
                looks(arm, mode, sessions);
            }
            let lens = if free_lens { "lens estimated" } else { "lens known" };
            println!("{arm:?}, {mode:?}, {lens}: {:.0}", times[times.len() / 2]);
        }
    }
}

/// The time to compare a view with the wanted one.
fn looks(arm: CellArm, mode: Mode, sessions: u64) {
    let mut times: Vec<f64> = Vec::new();
    for seed in 0..sessions {
        let mut cell = GuidedCell::new(CellSetup::new(arm, mode, seed));
        let _ended = cell.run(GuidedOptions { goal_m: 0.0, most_views: 10, ..GuidedOptions::default() });
        let calibration = cell.calibrate();
        let truth = cell.truth();
        let tip = cell.base_from_tip();
        let seen = truth.camera_from_target(&tip.into());
        let known = cell.known(calibration.as_ref(), 0.0);
        let mut guide = HandGuide::new(GuidedOptions { goal_m: 0.0, ..GuidedOptions::default() });
        let next = guide.next(&known, &seen, truth.intrinsics(), &CancelToken::default());
        let (HandNext::Take(wanted), Some(corners)) = (next, hand::corners(truth.intrinsics(), &seen)) else {
            continue;
        };
        let began = Instant::now();
        let _judged = wanted.judge(&corners, &tip);
        times.push(began.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    if let (Some(median), Some(longest)) = (times.get(times.len() / 2), times.last()) {
        println!("{arm:?}, {mode:?}, a look at a view by hand: {median:.2}, longest {longest:.2}");
    }
}
