//! Monte-Carlo study of the joint estimator and of all closed forms against the Cramér–Rao bound.
//!
//!     cargo run --release -p handeye_studies --example monte_carlo -- --trials 1500
//!
//! The whole grid takes hours; every option narrows it, and what is printed is Markdown:
//!
//!     --trials N          trials a cell (100)
//!     --poses 10,20,40    numbers of views
//!     --px 0.03,0.1,0.3   corner noise, pixels per axis
//!     --robot 0,1,2       robot: exact; 0.1 mm and 0.02°; 0.5 mm and 0.1°; 3: as 1 with errors that are affine in the place,
//!                         2 mm and 0.2° at its RMS distance from the mean (the bound is that of robot 1 then)
//!     --modes hand,to     eye in hand, eye to hand
//!     --lens known,free   intrinsics known; nine of them unknown
//!     --corrupted         a tenth of the views is grossly wrong; implies --product
//!     --product           noise levels estimated by the whole path of `calibrate`, not by the estimator alone
//!     --threads N         (1); no number depends on it
//!     --seed N            (1)
//!
//! The result tables and what they mean are in `docs/studies/accuracy.md`.

mod answer;
mod bound;
mod level_scatter;
mod scene;
mod tables;
mod tally;

use std::time::Instant;

use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::Noise;
use rayon::prelude::*;

use scene::Cell;
use tally::Summary;

/// The robots of the grid: noise per axis in metres and degrees, then errors that depend on the place, in the same
/// units.
const ROBOTS: [[f64; 4]; 4] = [[0.0; 4], [1e-4, 0.02, 0.0, 0.0], [5e-4, 0.1, 0.0, 0.0], [1e-4, 0.02, 2e-3, 0.2]];

struct Arguments {
    cells: Vec<Cell>,
    trials: usize,
    threads: usize,
    seed: u64,
    product: bool,
}

fn list<T: std::str::FromStr>(name: &str, words: &str) -> Result<Vec<T>, String> {
    words.split(',').map(|w| w.parse().map_err(|_not_a_number| format!("{name}: {w:?} is not a number"))).collect()
}

fn arguments(mut words: impl Iterator<Item = String>) -> Result<Arguments, String> {
    let (mut poses, mut px, mut robots) = (vec![10, 20, 40], vec![0.03, 0.1, 0.3], vec![0, 1, 2]);
    let (mut modes, mut lenses) = (vec![Mode::EyeInHand, Mode::EyeToHand], vec![false, true]);
    let (mut trials, mut threads, mut seed) = (100, 1, 1);
    let (mut corrupted, mut product) = (false, false);
    while let Some(name) = words.next() {
        let mut value = || words.next().ok_or_else(|| format!("{name} needs a value"));
        let first = |numbers: Vec<u64>| numbers.first().copied().unwrap_or_default();
        match name.as_str() {
            "--trials" => trials = first(list(&name, &value()?)?) as usize,
            "--threads" => threads = first(list(&name, &value()?)?).max(1) as usize,
            "--seed" => seed = first(list(&name, &value()?)?),
            "--poses" => poses = list(&name, &value()?)?,
            "--px" => px = list(&name, &value()?)?,
            "--robot" => robots = list(&name, &value()?)?,
            "--modes" => {
                modes = value()?
                    .split(',')
                    .map(|w| match w {
                        "hand" => Ok(Mode::EyeInHand),
                        "to" => Ok(Mode::EyeToHand),
                        _ => Err(format!("--modes: {w:?} is neither hand nor to")),
                    })
                    .collect::<Result<_, _>>()?;
            }
            "--lens" => {
                lenses = value()?
                    .split(',')
                    .map(|w| match w {
                        "known" => Ok(false),
                        "free" => Ok(true),
                        _ => Err(format!("--lens: {w:?} is neither known nor free")),
                    })
                    .collect::<Result<_, _>>()?;
            }
            "--corrupted" => (corrupted, product) = (true, true),
            "--product" => product = true,
            _ => return Err(format!("{name}: no such option; the head of main.rs lists them")),
        }
    }
    let mut cells = Vec::new();
    for &mode in &modes {
        for &free_intrinsics in &lenses {
            for &poses in &poses {
                for &robot in &robots {
                    let [robot_m, robot_deg, field_m, field_deg] =
                        *ROBOTS.get(robot).ok_or_else(|| format!("--robot: there is no robot {robot}"))?;
                    for &corner_px in &px {
                        let (robot_rad, field_rad) = (robot_deg.to_radians(), field_deg.to_radians());
                        let noise = Noise { corner_px, robot_m, robot_rad, field_m, field_rad, ..Noise::EXACT };
                        cells.push(Cell { mode, poses, noise, free_intrinsics, corrupted });
                    }
                }
            }
        }
    }
    Ok(Arguments { cells, trials, threads, seed, product })
}

/// A seed that differs between cells, so that their results are independent of each other (FNV-1a of their parameters).
fn cell_seed(cell: &Cell, seed: u64) -> u64 {
    let text = format!("{seed} {cell:?}");
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn run_cell(cell: Cell, arguments: &Arguments) -> Summary {
    let began = Instant::now();
    let seed = cell_seed(&cell, arguments.seed);
    let trial = |number: usize| tally::run(&cell, seed, number as u64, arguments.product);
    let results: Vec<_> = (0..arguments.trials).into_par_iter().map(trial).collect();
    Summary::of(cell, &results, began.elapsed().as_secs_f64() * arguments.threads as f64)
}

fn main() -> Result<(), String> {
    let arguments = arguments(std::env::args().skip(1))?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads);
    pool.build_global().map_err(|error| error.to_string())?;
    let began = Instant::now();
    let mut summaries = Vec::new();
    for (done, cell) in arguments.cells.iter().enumerate() {
        summaries.push(run_cell(*cell, &arguments));
        eprintln!("{} of {} cells after {:.0} s", done + 1, arguments.cells.len(), began.elapsed().as_secs_f64());
    }
    for table in [tables::errors, tables::coverage, tables::levels, tables::pooled] {
        println!("{}", table(&summaries));
    }
    let failures = tables::failures(&summaries);
    if !failures.is_empty() {
        println!("{failures}");
    }
    Ok(())
}
