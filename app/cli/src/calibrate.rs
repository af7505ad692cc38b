//! `handeye calibrate`: solves a session or a dataset folder, or several of one camera together.

use std::path::PathBuf;

use clap::Args;
use handeye_estimate::{Method, Options};

use super::gate::{self, Gate};
use super::output::Output;
use crate::rerun_arg;
use crate::robot_args::RobotArgs;
use crate::solve::Wanted;
use crate::{Failure, RerunArg, shared, solve};
use handeye_record::{Pace, RerunChoice};
use handeye_workbench::arguments::heading;
use handeye_workbench::model::Goal;

/// At the end of its help.
pub const EXAMPLES: &str = "Examples:
  handeye sample --out my_robot_images
  handeye calibrate my_robot_images --json result.json
  handeye auto --scene realistic --out realistic
  handeye calibrate my_robot_images realistic --share-intrinsics --out results";

/// Options of `handeye calibrate`.
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// Session or dataset folder: images, a pose table and dataset.toml. With `--share-intrinsics` two or more.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Calibrate sessions of one camera together: one lens for all of them, links and noise levels of each. There is a
    /// result for every folder, and `--json` writes an array of them.
    #[arg(long, help_heading = heading::ESTIMATE)]
    share_intrinsics: bool,
    /// Write the result as JSON to this file; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
    /// Method: the joint estimate, or one closed form.
    #[arg(long, value_name = "NAME", default_value = "joint", value_parser = Method::names(), help_heading = heading::ESTIMATE)]
    method: String,
    /// Write the result and its exports into this folder; of several sessions into a folder each in it, by their names.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    out: Option<PathBuf>,
    /// Keep views and corners that do not fit the others; without it they are left out as outliers and named.
    #[arg(long, help_heading = heading::ESTIMATE)]
    keep_outliers: bool,
    /// Estimate the true size of the target, from the robot's translations.
    #[arg(long, help_heading = heading::ESTIMATE)]
    free_scale: bool,
    /// End with exit code 1 unless a number of the result is below a limit, such as `tip_error_95_mm<0.5`. A finding that
    /// is a problem ends with it too, whatever the numbers.
    #[arg(long, value_name = "NAME<LIMIT", help_heading = heading::OUTPUT)]
    gate: Vec<Gate>,
    #[command(flatten)]
    robot: RobotArgs,
    #[command(flatten)]
    rerun: RerunArg,
}

impl CalibrateArgs {
    fn options(&self) -> Options {
        Options { keep_outliers: self.keep_outliers, free_scale: self.free_scale }
    }
}

pub fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let method = Method::by_name(&args.method)
        .ok_or_else(|| Failure::unusable(anyhow::anyhow!("no method {:?}", args.method)))?;
    let path = match args.paths.as_slice() {
        [path] if !args.share_intrinsics => path,
        paths => return several(args, paths, method),
    };
    let cancel = solve::cancel_on_ctrl_c();
    let recorder = rerun_arg::start(&args.rerun, RerunChoice::Off, Pace::Everything, false)?;
    let wanted = Wanted { method, options: args.options(), goal_m: Goal::default().0, robot: args.robot };
    let solution = solve::folder(path, wanted, None, &cancel)?;
    let result = solution.result();
    if let Some(folder) = &args.out {
        solve::write_exports(folder, result)?;
    }
    solution.publish(args.json.as_ref())?;
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)?;
    passed(&gate::failures(&args.gate, result))
}

/// Sessions of one camera.
fn several(args: &CalibrateArgs, paths: &[PathBuf], method: Method) -> Result<(), Failure> {
    let unusable = |message: &str| Err(Failure::unusable(anyhow::anyhow!("{message}")));
    if !args.share_intrinsics {
        return unusable(
            "several folders: `--share-intrinsics` calibrates sessions of one camera together; without it give one folder",
        );
    }
    if paths.len() < 2 {
        return unusable(
            "`--share-intrinsics` takes the folders of two or more sessions; one is calibrated without it",
        );
    }
    if method != Method::Joint {
        return unusable(
            "`--share-intrinsics` is for the joint estimate: closed forms estimate no lens, leave `--method` out",
        );
    }
    if args.robot.is_given() {
        return unusable(
            "`--tool` and `--robot-accuracy` are of one session: leave them out, and write tool_m and accuracy_mm into [robot] of each \
             data set",
        );
    }
    if args.rerun.choice(RerunChoice::Off) != RerunChoice::Off {
        return unusable("`--rerun` shows one session: leave it out, or calibrate the sessions one by one");
    }
    let cancel = solve::cancel_on_ctrl_c();
    let solutions = shared::folders(paths, args.options(), &cancel)?;
    if let Some(folder) = &args.out {
        shared::write_exports(folder, &solutions)?;
    }
    shared::publish(&solutions, args.json.as_ref())?;
    let failures: Vec<String> = solutions
        .iter()
        .flat_map(|solution| {
            let failures = gate::failures(&args.gate, solution.result());
            failures.into_iter().map(|failure| format!("{}: {failure}", solution.folder().display()))
        })
        .collect();
    passed(&failures)
}

fn passed(failures: &[String]) -> Result<(), Failure> {
    if failures.is_empty() { Ok(()) } else { Err(Failure::failed(anyhow::anyhow!("{}", failures.join("; ")))) }
}
