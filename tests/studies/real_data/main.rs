//! How good the estimator is on recorded data: held-out error of every method over five folds, agreement of the answers
//! of random halves, and the checks of the stated uncertainty.
//!
//! ```text
//! cargo run --release -p handeye_studies --example real_data -- folds 20
//! cargo run --release -p handeye_studies --example real_data -- halves 40
//! cargo run --release -p handeye_studies --example real_data -- checks
//! ```
//!
//! The number is that of random divisions; names of sets may follow. The data sets are searched for in `$HANDEYE_DATA`,
//! then in `../shared/data`. The results are in `docs/studies/real_data.md`.

mod blocks;
mod checks;
mod folds;
mod halves;
mod methods;
mod sets;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(data) = handeye_geometry::testing::data_folder() else { return ExitCode::SUCCESS };
    let what = arguments.first().map_or("checks", String::as_str);
    let divisions = arguments.get(1).and_then(|n| n.parse::<usize>().ok());
    let chosen = &arguments[arguments.len().min(if divisions.is_some() { 2 } else { 1 })..];
    if what == "halves" {
        halves::header();
    }
    let mut of_all = halves::Agreement::default();
    for set in sets::all(&data, chosen) {
        match what {
            "folds" => folds::run(&set, divisions.unwrap_or(20)),
            "halves" => of_all = of_all.together(halves::run(&set, divisions.unwrap_or(100))),
            "checks" => checks::run(&set),
            other => {
                println!("{other:?} is none of folds, halves, checks");
                return ExitCode::FAILURE;
            }
        }
    }
    if what == "halves" {
        of_all.print("all", "");
    }
    ExitCode::SUCCESS
}
