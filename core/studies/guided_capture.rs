//! Guided capture against other ways to choose poses, and whether it is honest when it stops.
//!
//! ```text
//! cargo run --release -p handeye_core --example guided_capture -- choice 200
//! cargo run --release -p handeye_core --example guided_capture -- stop 1000
//! cargo run --release -p handeye_core --example guided_capture -- speed 20
//! cargo run --release -p handeye_core --example guided_capture -- hand 100
//! cargo run --release -p handeye_core --example guided_capture -- straight 6
//! ```
//!
//! `choice`: the expected error of the tip over the box about the board, by the true model and the poses that were taken, in
//! sessions that begin with one view of the board. Farthest rotation and random views know from the beginning where camera
//! and board are; guided capture does not. The optimum is the best set of so many views out of the same thousand, by
//! exchange. `stop`: what is true when guided capture ends by itself; a word behind the number picks rows. `speed`: how long the choice of a pose takes, on one
//! thread, with a thousand candidates and six poses ahead. `hand`: a robot that a person moves. `straight`: the first poses
//! where small turns determine no lens.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a study prints, and stops at what cannot be")]

use std::env;
use std::time::Instant;

use handeye_core::estimate::handeye::Mode;
use handeye_core::estimate::handeye::joint::{ExpectedView, Noise, ViewModel};
use handeye_core::geometry::arm::JointValues;
use handeye_core::geometry::frames::{Base, Pose, Tip};
use handeye_core::nalgebra::{Matrix6, UnitQuaternion, Vector3};
use handeye_core::plan::guided::by_hand::{HandGuide, HandNext};
use handeye_core::plan::guided::candidates::ViewRange;
use handeye_core::plan::guided::design::{Design, weight_about};
use handeye_core::plan::guided::{Ending, Guide, GuidedOptions, Step};
use handeye_core::progress::CancelToken;
use handeye_core::testing::guided_cell::{CellArm, CellSetup, GuidedCell, GuidedRun, Untold};
use handeye_core::testing::hand;
use handeye_core::testing::sessions::{BOARD, REALISTIC};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

/// Numbers of views that are compared.
const COUNTS: [usize; 6] = [6, 8, 10, 12, 14, 17];
/// What a capture takes after the arm has arrived, seconds.
const DWELL_S: f64 = 1.5;
/// Views at random that all ways choose from.
const CANDIDATES: usize = 1000;

fn main() {
    let mut args = env::args().skip(1);
    let what = args.next().unwrap_or_else(|| "choice".to_owned());
    let sessions: u64 = args.next().map_or(200, |n| n.parse().expect("a number of sessions"));
    match what.as_str() {
        "choice" => choice(sessions),
        "stop" => stop(sessions, &args.next().unwrap_or_default()),
        "speed" => speed(sessions),
        "hand" => by_hand(sessions),
        "straight" => straight(sessions),
        other => println!("{other:?} is none of choice, stop, speed, hand, straight"),
    }
}

/// A trembling hand that is led to ten views: how long a view takes it, and what comes of it.
fn by_hand(sessions: u64) {
    println!(
        "| camera | seconds a view, median, 90 % | refused | given up | error stated, mean, mm | true below stated |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for (mode, name) in [(Mode::EyeInHand, "on the arm"), (Mode::EyeToHand, "beside it")] {
        let (mut took_s, mut refused, mut skipped) = (Vec::new(), 0, 0);
        let (mut stated_mm, mut below, mut solved) = (0.0, 0, 0);
        for seed in 0..sessions {
            let setup = CellSetup {
                arm: CellArm::Ur5e,
                mode,
                noise: REALISTIC,
                free_lens: false,
                straight: None,
                untold: Untold::NOTHING,
                seed,
            };
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

/// Whether the goal is reached from a board straight on and near the edge of the image, by a lens that is not known.
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
                    let setup = CellSetup {
                        arm,
                        mode,
                        noise: REALISTIC,
                        free_lens: true,
                        straight: Some(focal_px),
                        untold: Untold::NOTHING,
                        seed: 21 + seed,
                    };
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

/// One way through a session: the error after each view and when.
struct Way {
    /// By number of views from 1 on: expected error \[m\] and time \[s\].
    after: Vec<(f64, f64)>,
}

/// A view that the arm gets to.
struct Reachable {
    joints: JointValues,
    base_from_tip: Pose<Base, Tip>,
    view: ExpectedView,
}

/// What all ways of a session share.
struct Bench {
    setup: CellSetup,
    truth: ViewModel,
    weight: Matrix6<f64>,
    pool: Vec<Reachable>,
    first: ExpectedView,
}

impl Bench {
    fn new(setup: CellSetup) -> Self {
        let cell = GuidedCell::new(setup);
        let truth = cell.truth();
        let first_tip = cell.base_from_tip();
        let centre = truth.camera_from_target(&first_tip).isometry() * BOARD.centre();
        let weight = weight_about(&centre, &BOARD);
        let all: Vec<usize> = (0..BOARD.len()).collect();
        let range = ViewRange::about([centre.coords.norm()].into_iter()).expect("it is in front of the camera");
        let mut rng = ChaCha8Rng::seed_from_u64(setup.seed);
        let mut pool = Vec::new();
        for _ in 0..CANDIDATES * 60 {
            if pool.len() == CANDIDATES {
                break;
            }
            let Some(drawn) = range.draw(&mut rng, truth.intrinsics(), &BOARD) else { continue };
            if !range.shows(truth.intrinsics(), &BOARD, &drawn, None) {
                continue;
            }
            let base_from_tip = truth.base_from_tip(&drawn);
            let Some(joints) = cell.robot.arm.reach(&base_from_tip, &cell.robot.joints) else { continue };
            if !cell.robot.arm.is_free(&joints, &cell.robot.around, cell.robot.clearance_m) {
                continue;
            }
            let Some(view) = truth.expected(&base_from_tip, &all) else { continue };
            pool.push(Reachable { joints, base_from_tip, view });
        }
        let first = truth.expected(&first_tip, &all).expect("it is in view");
        Self { setup, truth, weight, pool, first }
    }

    /// Errors along a list of views, with the times at which they were taken.
    fn along<'a>(&self, views: impl Iterator<Item = (&'a ExpectedView, f64)>) -> Way {
        let mut design = Design::new(self.truth.prior(), [], self.weight).expect("the prior is one");
        let after = views.map(|(view, time_s)| {
            design = design.with(view);
            (design.error_m(), time_s)
        });
        Way { after: after.collect() }
    }

    /// Through views of the pool, after the first one.
    fn through(&self, cell: &GuidedCell, chosen: &[usize]) -> Way {
        let mut at = cell.robot.joints;
        let mut time_s = DWELL_S;
        let mut views = vec![(&self.first, time_s)];
        for &k in chosen {
            let next = &self.pool[k];
            time_s += cell.robot.travel_s(&at, &next.joints) + DWELL_S;
            at = next.joints;
            views.push((&next.view, time_s));
        }
        self.along(views.into_iter())
    }

    fn guided(&self) -> Way {
        let mut cell = GuidedCell::new(self.setup);
        let most = *COUNTS.last().expect("some");
        // A goal that is never reached, and gains that are always worth it: the choice alone is looked at.
        let options = GuidedOptions {
            goal_m: 0.0,
            most_views: most,
            least_gain: 0.0,
            dwell_s: DWELL_S,
            seed: self.setup.seed,
            ..GuidedOptions::default()
        };
        let run = cell.run(options);
        let all: Vec<usize> = (0..BOARD.len()).collect();
        let views: Vec<ExpectedView> = cell
            .observations
            .views
            .iter()
            .map(|view| self.truth.expected(&view.base_from_tip.expect("a robot"), &all).expect("it was seen"))
            .collect();
        self.along(views.iter().zip(run.times_s.iter().copied()))
    }

    /// Each time the view whose rotation is farthest from all before it.
    fn farthest(&self, cell: &GuidedCell) -> Way {
        let mut taken = vec![cell.base_from_tip()];
        let mut chosen: Vec<usize> = Vec::new();
        let angle = |a: &Pose<Base, Tip>, b: &Pose<Base, Tip>| a.rotation().angle_to(&b.rotation());
        while taken.len() < *COUNTS.last().expect("some") {
            let nearest =
                |k: usize| taken.iter().map(|t| angle(t, &self.pool[k].base_from_tip)).fold(f64::INFINITY, f64::min);
            let Some(best) = (0..self.pool.len()).max_by(|&a, &b| nearest(a).total_cmp(&nearest(b))) else { break };
            taken.push(self.pool[best].base_from_tip);
            chosen.push(best);
        }
        self.through(cell, &chosen)
    }

    fn random(&self, cell: &GuidedCell) -> Way {
        let most = COUNTS.last().expect("some") - 1;
        self.through(cell, &(0..most.min(self.pool.len())).collect::<Vec<_>>())
    }

    /// The poses of `easy_handeye`: about the first one, turned about each axis of the tip by ±25° and ±12.5° and shifted
    /// by 0.1 m; those that show the board and that the arm gets to.
    fn easy_handeye(&self, cell: &GuidedCell) -> Way {
        let first = cell.base_from_tip();
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let turns = [25.0, 12.5].into_iter().flat_map(|deg: f64| {
            axes.into_iter().flat_map(move |axis| [deg, -deg].map(|deg| (axis * deg.to_radians(), Vector3::zeros())))
        });
        let shifts = [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.033]];
        let shifts = shifts.into_iter().map(|shift| (Vector3::zeros(), Vector3::from(shift)));
        let range = ViewRange { spacing_px: 0.0, ..ViewRange::about([0.4].into_iter()).expect("a distance") };
        let all: Vec<usize> = (0..BOARD.len()).collect();
        let (mut at, mut time_s) = (cell.robot.joints, DWELL_S);
        let mut views = vec![(self.first.clone(), time_s)];
        for (turn, shift) in turns.chain(shifts) {
            let mut pose = *first.isometry();
            pose.rotation *= UnitQuaternion::from_scaled_axis(turn);
            pose.translation.vector += shift;
            let pose: Pose<Base, Tip> = Pose::from_isometry(pose);
            let seen = range.shows(self.truth.intrinsics(), &BOARD, &self.truth.camera_from_target(&pose), None);
            let joints = cell.robot.arm.reach(&pose, &at);
            if let (true, Some(joints), Some(view)) = (seen, joints, self.truth.expected(&pose, &all)) {
                time_s += cell.robot.travel_s(&at, &joints) + DWELL_S;
                at = joints;
                views.push((view, time_s));
            }
        }
        self.along(views.iter().map(|(view, time_s)| (view, *time_s)))
    }

    /// The best set of `count` views of the pool.
    fn optimum(&self, count: usize) -> f64 {
        let none = Design::new(self.truth.prior(), [], self.weight).expect("the prior is one");
        let mut chosen: Vec<usize> = Vec::new();
        let of = |chosen: &[usize]| chosen.iter().fold(none.clone(), |design, &k| design.with(&self.pool[k].view));
        let best = |design: &Design| {
            (0..self.pool.len())
                .map(|k| (design.error_with_m(&self.pool[k].view), k))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .expect("a pool")
        };
        while chosen.len() < count {
            chosen.push(best(&of(&chosen)).1);
        }
        let mut now_m = of(&chosen).error_m();
        for _ in 0..10 {
            let before_m = now_m;
            for place in 0..count {
                let mut others = chosen.clone();
                others.remove(place);
                let (error_m, k) = best(&of(&others));
                if error_m < now_m * (1.0 - 1e-6) {
                    (chosen[place], now_m) = (k, error_m);
                }
            }
            if now_m > before_m * (1.0 - 1e-4) {
                break;
            }
        }
        now_m
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

fn choice(sessions: u64) {
    println!("expected error in mm, mean (90th percentile) of {sessions} sessions; lens known, 0.1 px, 0.1 mm, 0.02°");
    for (arm, mode) in SETUPS {
        println!("\n{arm:?}, {mode:?}");
        println!("{:22}{}", "views", COUNTS.map(|n| format!("{n:>16}")).concat());
        let all: Vec<([Way; 4], Vec<f64>)> = (0..sessions)
            .into_par_iter()
            .map(|seed| {
                let setup = CellSetup {
                    arm,
                    mode,
                    noise: REALISTIC,
                    free_lens: false,
                    straight: None,
                    untold: Untold::NOTHING,
                    seed,
                };
                let bench = Bench::new(setup);
                let cell = GuidedCell::new(setup);
                let ways = [bench.guided(), bench.farthest(&cell), bench.random(&cell), bench.easy_handeye(&cell)];
                (ways, COUNTS.map(|count| bench.optimum(count)).to_vec())
            })
            .collect();
        for (k, name) in ["guided", "farthest rotation", "random", "easy_handeye"].into_iter().enumerate() {
            let of = |count: usize| {
                all.iter().filter_map(|(ways, _)| Some(ways[k].after.get(count - 1)?.0 * 1e3)).collect::<Vec<f64>>()
            };
            println!("{name:22}{}", COUNTS.map(|count| spread(of(count))).concat());
        }
        let of = |place: usize| all.iter().map(|(_, best)| best[place] * 1e3).collect::<Vec<f64>>();
        println!("{:22}{}", "optimum", [0, 1, 2, 3, 4, 5].map(|place| spread(of(place))).concat());
        let ratios = [0, 1, 2, 3, 4, 5].map(|place| {
            let ratio =
                all.iter().filter_map(|(ways, best)| Some(ways[0].after.get(COUNTS[place] - 1)?.0 / best[place]));
            spread(ratio.collect())
        });
        println!("{:22}{}", "guided / optimum", ratios.concat());
        // How many views, and how long, until the error of random views is reached.
        let needed = |of: fn(&Way, f64) -> Option<f64>| {
            let at = |(ways, _): &([Way; 4], Vec<f64>)| {
                let (error_m, _) = *ways[2].after.get(16)?;
                Some(of(&ways[0], error_m)? / of(&ways[2], error_m)?)
            };
            spread(all.iter().filter_map(at).collect())
        };
        let views = |way: &Way, error_m: f64| way.after.iter().position(|a| a.0 <= error_m).map(|k| k as f64 + 1.0);
        let time = |way: &Way, error_m: f64| way.after.iter().find(|a| a.0 <= error_m).map(|a| a.1);
        println!("to the error of 17 random views: views {} of theirs, time {}", needed(views), needed(time));
    }
}

fn spread(mut of: Vec<f64>) -> String {
    if of.is_empty() {
        return format!("{:>16}", "-");
    }
    of.sort_by(f64::total_cmp);
    let mean = of.iter().sum::<f64>() / of.len() as f64;
    format!("{mean:>8.3} ({:5.3})", of[(of.len() * 9 / 10).min(of.len() - 1)])
}

fn speed(sessions: u64) {
    println!("median time to choose the eleventh pose, ms, {sessions} sessions");
    for (arm, mode) in SETUPS {
        for free_lens in [false, true] {
            let mut times: Vec<f64> = (0..sessions)
                .map(|seed| {
                    let mut cell = GuidedCell::new(CellSetup {
                        arm,
                        mode,
                        noise: REALISTIC,
                        free_lens,
                        straight: None,
                        untold: Untold::NOTHING,
                        seed,
                    });
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

/// What it takes to compare a view with the one that a person is asked for.
fn looks(arm: CellArm, mode: Mode, sessions: u64) {
    let mut times: Vec<f64> = Vec::new();
    for seed in 0..sessions {
        let mut cell = GuidedCell::new(CellSetup {
            arm,
            mode,
            noise: REALISTIC,
            free_lens: false,
            straight: None,
            untold: Untold::NOTHING,
            seed,
        });
        let _ended = cell.run(GuidedOptions { goal_m: 0.0, most_views: 10, ..GuidedOptions::default() });
        let calibration = cell.calibrate();
        let truth = cell.truth();
        let tip = cell.base_from_tip();
        let seen = truth.camera_from_target(&tip);
        let known = cell.known(calibration.as_ref(), 0.0);
        let mut guide = HandGuide::new(GuidedOptions { goal_m: 0.0, ..GuidedOptions::default() });
        let next = guide.next(&known, &seen, truth.intrinsics(), &CancelToken::default());
        let (HandNext::Take(wanted), Some(corners)) = (next, hand::corners(&truth, &seen)) else { continue };
        let began = Instant::now();
        let _judged = wanted.judge(&corners, &tip);
        times.push(began.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    if let (Some(median), Some(longest)) = (times.get(times.len() / 2), times.last()) {
        println!("{arm:?}, {mode:?}, a look at a view by hand: {median:.2}, longest {longest:.2}");
    }
}

fn stop(sessions: u64, only: &str) {
    println!("at the end of guided sessions, {sessions} for each row and set-up:");
    println!(
        "{:44}{:>8}{:>10}{:>10}{:>8}{:>8}{:>8}{:>9}",
        "", "reached", "< stated", "< goal", "views", "90 %", "failed", "promise"
    );
    let as_said = Untold::NOTHING;
    let field = Noise { field_m: 1.5e-3, ..REALISTIC };
    let rows: [(&str, f64, Noise, bool, Untold); 9] = [
        ("goal 0.1 mm, 0.1 px, 0.1 mm, 0.02°", 1e-4, REALISTIC, false, as_said),
        ("goal 0.2 mm", 2e-4, REALISTIC, false, as_said),
        ("goal 0.4 mm", 4e-4, REALISTIC, false, as_said),
        (
            "goal 0.6 mm, 0.3 px, 0.5 mm, 0.1°",
            6e-4,
            Noise { corner_px: 0.3, robot_m: 5e-4, robot_rad: 0.1_f64.to_radians(), ..Noise::EXACT },
            false,
            as_said,
        ),
        ("goal 0.5 mm, lens estimated", 5e-4, REALISTIC, true, as_said),
        ("goal 0.4 mm, board bent by 1 mm", 4e-4, REALISTIC, false, Untold { bend_m: [1e-3, 0.6e-3], ..as_said }),
        ("goal 0.5 mm, lens said to be 1 % longer", 5e-4, REALISTIC, false, Untold { focal: 0.99, ..as_said }),
        ("goal 1 mm, robot off by 1.5 mm by place", 1e-3, field, false, as_said),
        ("goal 2 mm, robot off by 1.5 mm by place", 2e-3, field, false, as_said),
    ];
    for (name, goal_m, noise, free_lens, untold) in rows.into_iter().filter(|row| row.0.contains(only)) {
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let runs: Vec<_> = (0..sessions)
                .into_par_iter()
                .map(|seed| {
                    let arm = CellArm::ALL[seed as usize % 3];
                    GuidedCell::new(CellSetup {
                        arm,
                        mode,
                        noise,
                        free_lens,
                        straight: None,
                        untold,
                        seed: 1000 + seed,
                    })
                    .run(GuidedOptions { goal_m, seed, ..GuidedOptions::default() })
                })
                .collect();
            // Of those whose last answer states an error.
            let last = |run: &GuidedRun| run.history.last().copied().filter(|last| last.0 == run.times_s.len());
            let ended: Vec<_> = runs.iter().filter_map(|run| last(run).map(|last| (run, last))).collect();
            let share = |of: &dyn Fn(&(usize, f64, f64)) -> bool, among: &dyn Fn(&Ending) -> bool| {
                let among: Vec<_> = ended.iter().filter(|(run, _)| among(&run.ending)).collect();
                100.0 * among.iter().filter(|(_, last)| of(last)).count() as f64 / among.len().max(1) as f64
            };
            let is_reached = |ending: &Ending| matches!(ending, Ending::GoalReached { .. });
            let reached = ended.iter().filter(|(run, _)| is_reached(&run.ending)).count() as f64 / sessions as f64;
            let mut views: Vec<usize> = ended.iter().map(|(_, last)| last.0).collect();
            views.sort_unstable();
            let mut promises: Vec<f64> =
                runs.iter().flat_map(|run| run.steps.iter().filter_map(Step::achieved_over_promised)).collect();
            promises.sort_by(f64::total_cmp);
            let failed = runs.iter().map(|run| run.failed).sum::<usize>() as f64 / sessions as f64;
            println!(
                "{:44}{:>7.1}%{:>9.1}%{:>9.1}%{:>8.1}{:>8}{:>8.2}{:>9.2}",
                format!("{name}, {mode:?}"),
                100.0 * reached,
                share(&|last| last.2 < last.1, &|_| true),
                share(&|last| last.2 < goal_m, &is_reached),
                views.iter().sum::<usize>() as f64 / views.len().max(1) as f64,
                views[views.len() * 9 / 10],
                failed,
                promises[promises.len() / 2],
            );
        }
    }
}
