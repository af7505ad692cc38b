//! Monte-Carlo study of a camera without a robot: whether the stated uncertainty of the lens holds, and whether boards
//! are called bent when they are.
//!
//!     cargo run --release -p handeye_studies --example camera_alone -- TRIALS [flat]
//!
//! Prints Markdown: the tables of `docs/studies/mathematics.md`. Every cell runs this many sessions through `calibrate`:
//! 640×480, f = 581 px, five distortion coefficients, 10×7 corners of 30 mm, 0.5 to 0.8 m away, tilted by 11° to 40°, 0.1 px
//! per axis; `little tilt` is 3° to 17°. With `flat` only flat boards, for the rate of false alarms.

use std::process::ExitCode;

use handeye_estimate::Method;
use handeye_estimate::diagnose::findings::{FindingCode, FindingOptions, findings};
use handeye_estimate::diagnose::{Calibration, calibrate};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::bent::BoardShape;
use handeye_simulate::{BoardViews, SharedErrors};
use rayon::prelude::*;

const COEFFICIENTS: [f64; 5] = [-0.21, 0.12, 0.001, -0.002, -0.02];
const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.03 };
/// Number of standard deviations that contain 95 % of a Gaussian's errors.
const HELD: f64 = 1.96;

/// Corner errors by name: the share of the variance common to neighbours, and over how many squares.
const ERRORS: [(&str, Option<SharedErrors>); 3] = [
    ("independent", None),
    ("half shared, 2 squares", Some(SharedErrors { part: 0.5, reach: 2.0 })),
    ("all shared, 3 squares", Some(SharedErrors { part: 1.0, reach: 3.0 })),
];
const BENDS_MM: [[f64; 2]; 5] = [[0.0, 0.0], [0.1, -0.05], [0.2, -0.1], [0.5, -0.3], [2.0, -1.0]];
const TILTS: [(&str, (f64, f64)); 2] = [("", (0.2, 0.7)), (" little tilt", (0.05, 0.3))];

fn camera() -> Intrinsics {
    let distortion = Distortion::BrownConrady(COEFFICIENTS);
    Intrinsics { distortion, fy: 575.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(640, 480, 581.0) }
}

/// What the sessions of a cell showed.
#[derive(Default, Clone, Copy)]
struct Tally {
    sessions: usize,
    failed: usize,
    bent: usize,
    held: [usize; 4],
    squared: [f64; 4],
    stated: [f64; 4],
    warps_held: usize,
}

impl Tally {
    fn of(calibration: &Calibration, shown: bool, warp_m: [f64; 2]) -> Self {
        let mut tally = Self { sessions: 1, bent: usize::from(shown), ..Self::default() };
        let Some((found, sigma)) = calibration.camera.and_then(|c| Some((c.intrinsics, c.sigma_px?))) else {
            return Self { failed: 1, ..tally };
        };
        let truth = camera();
        let errors = [found.fx - truth.fx, found.fy - truth.fy, found.cx - truth.cx, found.cy - truth.cy];
        for i in 0..4 {
            tally.held[i] = usize::from(errors[i].abs() <= HELD * sigma[i]);
            tally.squared[i] = errors[i].powi(2);
            tally.stated[i] = sigma[i];
        }
        if let Some(shape) = calibration.camera_fit.and_then(|fit| fit.shape) {
            let sigma_m = shape.warp_sigma_m.unwrap_or_default();
            let holds = |i: usize| (shape.shape.warp_m[i] - warp_m[i]).abs() <= HELD * sigma_m[i];
            tally.warps_held = (0..2).filter(|i| holds(*i)).count();
        }
        tally
    }

    fn and(self, other: Self) -> Self {
        let both = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|i| a[i] + b[i]);
        Self {
            sessions: self.sessions + other.sessions,
            failed: self.failed + other.failed,
            bent: self.bent + other.bent,
            held: std::array::from_fn(|i| self.held[i] + other.held[i]),
            squared: both(self.squared, other.squared),
            stated: both(self.stated, other.stated),
            warps_held: self.warps_held + other.warps_held,
        }
    }
}

fn cell(views: BoardViews, count: usize, trials: u64) -> Tally {
    let session = |seed: u64| {
        let observations = views.observations(count, seed);
        let Ok(calibration) = calibrate(&observations, Method::Joint, &CancelToken::default()) else {
            return Tally { sessions: 1, failed: 1, ..Tally::default() };
        };
        let found = findings(&observations, Some(&calibration), &FindingOptions::default());
        let shown = found.iter().any(|finding| finding.code == FindingCode::BoardBent);
        Tally::of(&calibration, shown, views.shape.warp_m)
    };
    (0..trials).into_par_iter().map(session).reduce(Tally::default, Tally::and)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(trials) = arguments.first().and_then(|word| word.parse().ok()) else {
        eprintln!("usage: camera_alone TRIALS [flat]");
        return ExitCode::from(2);
    };
    let only_flat = arguments.get(1).is_some_and(|word| word == "flat");
    println!(
        "| views | corner errors | bend mm | called bent % | fx, fy, cx, cy held % | RMS error of fx px | stated px | bend held % |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (tilted, tilt) in TILTS {
        for count in [4, 6, 10, 20, 40] {
            for (errors, shared) in ERRORS {
                for bend_mm in BENDS_MM.into_iter().filter(|bend| !only_flat || *bend == [0.0; 2]) {
                    let shape = BoardShape { warp_m: bend_mm.map(|mm| mm * 1e-3), scale: 1.0 };
                    let views = BoardViews { shape, tilt, shared, ..BoardViews::new(camera(), GRID, 0.1) };
                    let tally = cell(views, count, trials);
                    let solved = (tally.sessions - tally.failed).max(1) as f64;
                    let held: Vec<String> =
                        tally.held.iter().map(|held| format!("{:.1}", 100.0 * *held as f64 / solved)).collect();
                    let warps = match tally.bent {
                        0 => "–".to_owned(),
                        bent => format!("{:.1}", 50.0 * tally.warps_held as f64 / bent as f64),
                    };
                    println!(
                        "| {count}{tilted} | {errors} | {}, {} | {:.2} | {} | {:.3} | {:.3} | {warps} |",
                        bend_mm[0],
                        bend_mm[1],
                        100.0 * tally.bent as f64 / solved,
                        held.join(", "),
                        (tally.squared[0] / solved).sqrt(),
                        tally.stated[0] / solved,
                    );
                }
            }
        }
    }
    ExitCode::SUCCESS
}
