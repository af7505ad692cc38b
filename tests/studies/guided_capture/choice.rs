//! How good poses are that are chosen with different strategies.

use handeye_plan::testing::guided_cell::{CellSetup, GuidedCell};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::bench::{Bench, NAMES, Way, Ways};
use super::scenes::{self, CellFaults};
use super::{COUNTS, SETUPS};

/// Times at which the error is compared, seconds.
const TIMES_S: [f64; 6] = [15.0, 20.0, 30.0, 40.0, 50.0, 60.0];

/// With places of the study's own.
pub fn choice(sessions: u64) {
    println!("errors in mm, mean (90th percentile) of {sessions} sessions; lens known, 0.1 px, 0.1 mm, 0.02°");
    for (arm, mode) in SETUPS {
        let cell = |seed| GuidedCell::new(CellSetup::new(arm, mode, seed));
        compare(&format!("{arm:?}, {mode:?}"), sessions, cell);
    }
}

/// In the scenes of the cell, with a lens that is estimated.
pub fn in_scenes(sessions: u64, only: &str) {
    println!("errors in mm, mean (90th percentile) of {sessions} sessions; lens estimated");
    for faults in CellFaults::ALL {
        for (arm, mode) in SETUPS {
            let name = format!("{faults:?}, {arm:?}, {mode:?}");
            if name.contains(only) {
                compare(&name, sessions, |seed| scenes::cell(faults, arm, mode, seed));
            }
        }
    }
}

fn compare(name: &str, sessions: u64, cell: impl Fn(u64) -> GuidedCell + Sync) {
    println!("\n{name}");
    let of_session = |seed| Bench::new(cell(seed), seed).ways();
    let all: Vec<Ways> = (0..sessions).into_par_iter().map(of_session).collect();
    by_views(&all);
    true_errors(&all);
    by_time(&all);
    with_all(&all);
    against_random(&all);
}

/// The true errors of the answers, if there are answers.
fn true_errors(all: &[Ways]) {
    println!("true error");
    for (k, name) in NAMES.into_iter().enumerate() {
        let at = |place: usize| {
            let known: Vec<f64> = all.iter().filter_map(|ways| Some(ways.of[k].truth_m[place]? * 1e3)).collect();
            let some = if known.len() < all.len() && !known.is_empty() {
                format!(" of {}", known.len())
            } else {
                String::new()
            };
            format!("{}{some}", spread(known))
        };
        println!("{name:22}{}", [0, 1, 2, 3, 4, 5].map(at).concat());
    }
}

fn by_views(all: &[Ways]) {
    println!("{:22}{}", "views", COUNTS.map(|n| format!("{n:>16}")).concat());
    let row = |name: &str, of: &dyn Fn(&Ways, usize) -> Option<f64>| {
        // For all sessions or for none: those with this many views differ from those with fewer.
        let at = |place: usize| all.iter().map(|ways| of(ways, place)).collect::<Option<Vec<f64>>>();
        println!("{name:22}{}", [0, 1, 2, 3, 4, 5].map(|place| spread(at(place).unwrap_or_default())).concat());
    };
    for (k, name) in NAMES.into_iter().enumerate() {
        row(name, &|ways, place| Some(ways.of[k].after.get(COUNTS[place] - 1)?.0 * 1e3));
    }
    row("optimum", &|ways, place| Some(ways.optimum[place] * 1e3));
    row("optimum after 3 turns", &|ways, place| Some(ways.optimum_after[place] * 1e3));
    row("guided / optimum", &|ways, place| Some(ways.of[0].after.get(COUNTS[place] - 1)?.0 / ways.optimum[place]));
    row("guided / that after 3", &|ways, place| {
        Some(ways.of[0].after.get(COUNTS[place] - 1)?.0 / ways.optimum_after[place])
    });
}

/// The error at a given time, if there is any answer by then.
fn by_time(all: &[Ways]) {
    println!("{:22}{}", "seconds", TIMES_S.map(|s| format!("{s:>16}")).concat());
    for (k, name) in NAMES.into_iter().enumerate().take(3) {
        let at = |time_s: f64| {
            let last = |ways: &Ways| Some(ways.of[k].after.iter().take_while(|a| a.1 <= time_s).last()?.0 * 1e3);
            spread(all.iter().map(last).collect::<Option<Vec<f64>>>().unwrap_or_default())
        };
        println!("{name:22}{}", TIMES_S.map(at).concat());
    }
}

/// The result of lists of poses that were prepared beforehand, with all of their usable poses.
fn with_all(all: &[Ways]) {
    for (k, name) in NAMES.into_iter().enumerate().skip(3) {
        let last = || all.iter().filter_map(|ways| ways.of[k].after.last().map(|last| (last, ways)));
        let views = all.iter().map(|ways| ways.of[k].after.len() as f64).collect();
        let errors = last().map(|(last, _)| last.0 * 1e3).collect();
        let times = last().map(|(last, _)| last.1).collect();
        println!(
            "{name}, all of its poses: views {}, error {}, seconds {}",
            spread(views),
            spread(errors),
            spread(times)
        );
        let needed = |of: fn(&Way, f64) -> Option<f64>| {
            spread(last().filter_map(|(last, ways)| of(&ways.of[0], last.0)).collect())
        };
        println!("{:22}guided has that after views {}, seconds {}", "", needed(views_to), needed(time_to));
    }
}

/// How many views, and how long, until the error of random views is reached.
fn against_random(all: &[Ways]) {
    let needed = |of: fn(&Way, f64) -> Option<f64>| {
        let at = |ways: &Ways| {
            let (error_m, _) = *ways.of[2].after.get(16)?;
            Some(of(&ways.of[0], error_m)? / of(&ways.of[2], error_m)?)
        };
        spread(all.iter().filter_map(at).collect())
    };
    println!("to the error of 17 random views: views {} of theirs, time {}", needed(views_to), needed(time_to));
}

fn views_to(way: &Way, error_m: f64) -> Option<f64> {
    way.after.iter().position(|a| a.0 <= error_m).map(|k| k as f64 + 1.0)
}

fn time_to(way: &Way, error_m: f64) -> Option<f64> {
    way.after.iter().find(|a| a.0 <= error_m).map(|a| a.1)
}

fn spread(mut of: Vec<f64>) -> String {
    if of.is_empty() {
        return format!("{:>16}", "-");
    }
    of.sort_by(f64::total_cmp);
    let mean = of.iter().sum::<f64>() / of.len() as f64;
    format!("{mean:>8.3} ({:5.3})", of[(of.len() * 9 / 10).min(of.len() - 1)])
}
