//! The command line. Other programs call it: names, options and exit codes are a contract.
//!
//! Results go to standard output, progress and messages to standard error. Exit code 0: done, 1: failed, 2: wrong usage
//! or unreadable input.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

mod arm_arg;
mod auto;
mod box_arg;
mod calibrate;
mod cell;
mod cell_choice;
mod correct;
mod doctor;
pub(crate) mod driver;
mod export;
mod failure;
mod gate;
#[cfg(test)]
mod help_tests;
mod import;
mod late;
#[cfg(test)]
mod offered_tests;
mod open_cell;
mod out;
mod output;
mod plan;
mod record;
mod rerun_arg;
mod robot_args;
mod sample;
mod shared;
mod shell;
mod solve;
pub(crate) mod target;
mod towards_board;
mod track;

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

use handeye_record::{Relay, WebViewer};
use handeye_serve::ServeArgs;
use handeye_ui::GuiArgs;

pub use failure::Failure;
use handeye_workbench::arguments::ObjectArgs;
use rerun_arg::RerunArg;

/// The minimum to know.
const EXAMPLES: &str = "Examples, the first of which opens the window:
  handeye
  handeye sample --out my_robot_images
  handeye calibrate my_robot_images --json result.json
  handeye auto --help";

/// Calibrates a robot's camera: live in a window, or from the command line.
#[derive(Debug, Parser)]
#[command(name = "handeye", version, max_term_width = 100, after_help = EXAMPLES)]
struct Cli {
    /// Print results and errors only.
    #[arg(long, short, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

/// What is recorded while it runs.
#[derive(Debug, Default, clap::Args)]
struct Recorded<T: clap::Args> {
    #[command(flatten)]
    window: T,
    #[command(flatten)]
    rerun: RerunArg,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Open the workbench (the default).
    #[command(after_help = "Examples:\n  handeye gui --scene panda\n  handeye gui --connect tcp://192.168.0.7:23000")]
    Gui(Recorded<GuiArgs>),
    /// Show the workbench in a browser, here or on another machine, until Ctrl-C (docs/reference/browser.md).
    #[command(after_help = "Examples:\n  handeye serve\n  handeye serve --bind 0.0.0.0 --port 8600")]
    Serve(Recorded<ServeArgs>),
    /// Serve the built-in cell over the ZeroMQ remote API until Ctrl-C.
    #[command(after_help = "Examples:\n  handeye cell --port 0 --scene realistic --seed 7")]
    Cell(cell::CellArgs),
    /// Drive the robot through poses, capture, solve, and write a session with its exports.
    #[command(after_help = auto::EXAMPLES)]
    Auto(Box<auto::AutoArgs>),
    /// Solve a session or a dataset folder, or several of one camera together.
    #[command(after_help = calibrate::EXAMPLES)]
    Calibrate(calibrate::CalibrateArgs),
    /// Write the recorded sample that comes with the program as a dataset folder, to try the other commands on.
    #[command(after_help = sample::EXAMPLES)]
    Sample(sample::SampleArgs),
    /// Report what is wrong with a session or dataset folder, and what to do about it.
    #[command(
        after_help = "Examples:\n  handeye sample --out my_robot_images\n  handeye doctor my_robot_images --json diagnosis.json"
    )]
    Doctor(doctor::DoctorArgs),
    /// List the poses that would lower the expected error of a session or dataset folder most.
    #[command(
        after_help = "Examples:\n  handeye sample --out my_robot_images\n  handeye plan my_robot_images --count 5 --json plan.json"
    )]
    Plan(plan::PlanArgs),
    /// Track the board live with a calibration, and let the arm follow it.
    #[command(after_help = track::EXAMPLES)]
    Track(track::TrackArgs),
    /// Test a driver, or run one: a program between the workbench and any robot or camera (docs/drivers.md).
    #[command(after_help = driver::EXAMPLES)]
    Driver(driver::DriverArgs),
    /// Convert a recording into a dataset folder: images with a table or one file per pose, or files of other tools.
    #[command(after_help = import::after_help(), next_line_help = true)]
    Import(import::ImportArgs),
    /// Write calibration files from a solved session or a result JSON.
    #[command(after_help = export::EXAMPLES)]
    Export(export::ExportArgs),
    /// Correct commands by the errors of the arm that a calibration found, so that the tip arrives where it should.
    #[command(after_help = correct::EXAMPLES)]
    Correct(correct::CorrectArgs),
    /// Print a target as a PDF at exact physical scale, with rulers to check the print.
    #[command(after_help = target::EXAMPLES)]
    Target(target::TargetArgs),
    /// Print the completions of these commands for a shell, to be kept where it looks for them, such as
    /// ~/.local/share/bash-completion/completions/handeye.
    #[command(after_help = shell::EXAMPLES)]
    Completions(shell::CompletionsArgs),
    /// Write these help texts as manual pages.
    #[command(hide = true, after_help = "Examples:\n  handeye man --out man1")]
    Man(shell::ManArgs),
}

/// Runs the program with the arguments of the process.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse_from(rerun_arg::joined(std::env::args_os())) {
        Ok(cli) => cli,
        Err(error) => {
            // `--help` and `--version` are answers, not errors; clap prints each to its proper stream.
            if !error.use_stderr() {
                let printed = error.print().and_then(|()| std::io::stdout().flush());
                return ended(out::finished(printed, "standard output"));
            }
            // An error contains what was typed, or what a pattern of the shell expanded to.
            let words = error.render().to_string();
            if out::shown(&words) == words {
                let _written = error.print().is_ok();
            } else {
                out::note(words.trim_end());
            }
            return ExitCode::from(2);
        }
    };
    start_logging(cli.quiet);
    let result = match cli.command.unwrap_or_else(|| Command::Gui(Recorded::default())) {
        Command::Gui(Recorded { window, rerun }) => rerun_arg::of_window(&rerun, WebViewer::Here)
            .and_then(|begin| handeye_ui::run(window, begin).map_err(Failure::failed)),
        Command::Serve(Recorded { window: args, rerun }) => {
            let is_local = args.bind.is_loopback();
            let announce = |url: &str| {
                if !is_local {
                    // Even when quiet: the user must be warned of it.
                    out::note(
                        "warning: everybody on the network who has the address with its key can move the arm and see \
                         its images, and nothing is encrypted; --bind 127.0.0.1 serves this machine alone",
                    );
                }
                // Standard output may be closed: it is served all the same.
                let _told = out::line(format_args!("the workbench is at {url}")).is_ok();
            };
            let relay = Arc::<Relay>::default();
            rerun_arg::of_window(&rerun, WebViewer::Relayed(Arc::clone(&relay)))
                .and_then(|begin| handeye_serve::run(args, begin, relay.routes(), announce).map_err(Failure::failed))
        }
        Command::Cell(args) => cell::run(&args),
        Command::Auto(args) => auto::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Sample(args) => sample::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Track(args) => track::run(&args),
        Command::Driver(args) => driver::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Correct(args) => correct::run(&args),
        Command::Target(args) => target::run(&args),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
    };
    ended(result)
}

fn ended(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            out::note(format_args!("error: {failure}"));
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Messages of level INFO and above to standard error, errors only with `--quiet`; `RUST_LOG` overrides. The libraries of
/// Rerun (`re_…`) warn about things that users cannot change.
fn start_logging(quiet: bool) {
    let default = if quiet { "error" } else { "warn,handeye=info,re_=error" };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    let is_coloured = std::io::stderr().is_terminal();
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(move || out::Log { is_coloured })
        .with_ansi(is_coloured)
        .with_target(false)
        .without_time()
        .compact()
        .init();
}
