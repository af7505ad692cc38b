//! `handeye track`: tracks the board live, and makes the arm follow it.

mod calibration;
mod document;
mod live;

use std::path::PathBuf;

use clap::Args;
use handeye_coppeliasim::cell::{BoardMotion, BoardPath};
use handeye_server::CellConfig;
use handeye_track::{MotionModel, Setup};

use super::output::Output;
use crate::cell_choice::CellChoice;
use crate::open_cell::OpenCell;
use crate::rerun_arg;
use crate::{Failure, RerunArg, out, solve};
use handeye_record::{Pace, RerunChoice};
use handeye_workbench::arguments::heading;
use handeye_workbench::model::{FollowRequest, Tracked};
use handeye_workbench::worker::TrackedBy;
use live::{Job, Summary, Taken, Task};

/// At the end of its help.
pub const EXAMPLES: &str = "Examples:
  handeye auto --out session
  handeye track --calibration session/result.json --frames 100

Until Ctrl-C:
  handeye track --calibration session/result.json --follow";

/// Options of `handeye track`.
#[derive(Debug, Args)]
pub struct TrackArgs {
    #[command(flatten)]
    cell: CellChoice,
    /// The calibration: a result JSON, or a session that is solved.
    #[arg(long, value_name = "FILE", help_heading = heading::TRACKING)]
    calibration: PathBuf,
    /// Let the arm keep the view of the board that it has at the beginning.
    #[arg(long, help_heading = heading::FOLLOWING)]
    follow: bool,
    /// With --follow: where the arm has no room to go along with the board, move it to the nearest place where it has, as
    /// soon as the board is seen, and keep the view from there.
    #[arg(long, requires = "follow", conflicts_with = "corner", help_heading = heading::FOLLOWING)]
    make_room: bool,
    /// With --follow: bring the tip to this corner of the board instead, counted from 0.
    #[arg(long, value_name = "INDEX", requires = "follow", help_heading = heading::FOLLOWING)]
    corner: Option<usize>,
    /// Move the tip once to this corner of the board, counted from 0, with the orientation that it has; then end.
    #[arg(long, value_name = "INDEX", conflicts_with = "follow", help_heading = heading::FOLLOWING)]
    reach: Option<usize>,
    /// With --corner and --reach: how far the tip stays off the board, millimetres.
    #[arg(long, value_name = "MM", default_value_t = 100.0, help_heading = heading::FOLLOWING)]
    stand_off: f64,
    /// With --follow and --reach: take tip poses as the robot reports them, although the calibration knows the errors of its arm.
    /// Without it they are corrected, and so is what the arm is sent, where that brings the tip nearer.
    #[arg(long, help_heading = heading::FOLLOWING)]
    as_reported: bool,
    /// End after this many images; without it, at Ctrl-C.
    #[arg(long, value_name = "N", help_heading = heading::TRACKING)]
    frames: Option<u64>,
    /// Write every pose and a summary as JSON to this file; `-` for standard output instead of the summary.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
    /// The chessboard, if the calibration does not contain it: inner corners along x and y, and the square.
    #[arg(long, value_name = "COLUMNSxROWSxMM", help_heading = heading::TRACKING)]
    target: Option<String>,
    /// How the built-in cell moves its board: still, circle, figure_eight, random_walk or step; a circle if neither this nor the
    /// scene states it.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["connect", "driver"], help_heading = heading::BOARD)]
    board_path: Option<BoardPath>,
    /// How fast, metres per second; from the scene if not given.
    #[arg(long, value_name = "SPEED", conflicts_with_all = ["connect", "driver"], help_heading = heading::BOARD)]
    board_speed: Option<f64>,
    #[command(flatten)]
    rerun: RerunArg,
}

pub fn run(args: &TrackArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let mut scene = args.cell.scene()?;
    let calibration::Read { calibrated, corrected, target: stated_target } = calibration::read(&args.calibration)?;
    let target = match &args.target {
        Some(text) => calibration::chessboard(text)?,
        None => stated_target.ok_or_else(|| {
            Failure::unusable(anyhow::anyhow!(
                "{} does not say which board it was made with: give --target, for example --target 10x7x15",
                args.calibration.display()
            ))
        })?,
    };
    // The arm first has to look at the board.
    let motion = std::mem::take(&mut scene.board.motion);
    let path = args.board_path.unwrap_or(if motion.path == BoardPath::Still { BoardPath::Circle } else { motion.path });
    let board = BoardMotion {
        size_m: Some(motion.size_m),
        tilt_deg: Some(motion.tilt_deg),
        ..BoardMotion::along(path, args.board_speed.unwrap_or(motion.speed_m_s))
    };
    if let Some(index) = args.corner.or(args.reach).filter(|&index| index >= target.len()) {
        return Err(Failure::unusable(anyhow::anyhow!(
            "there is no corner {index}: a {target} has corners 0 to {}",
            target.len() - 1
        )));
    }
    let stand_off_m = args.stand_off * 1e-3;
    if !(stand_off_m.is_finite() && stand_off_m >= 0.0) {
        return Err(Failure::unusable(anyhow::anyhow!("{} mm is not a distance: give 0 or more", args.stand_off)));
    }
    let task = match (args.follow, args.corner, args.reach) {
        (_, _, Some(index)) => Task::Reach { index, stand_off_m },
        (true, Some(index), None) => Task::Follow(FollowRequest::Corner { index, stand_off_m }),
        (true, None, None) if args.make_room => Task::Follow(FollowRequest::KeepViewWithRoom),
        (true, None, None) => Task::Follow(FollowRequest::KeepView),
        (false, _, None) => Task::Watch,
    };
    if matches!(task, Task::Follow(_)) && (args.cell.driver.is_some() || args.cell.dry_run) {
        return Err(Failure::unusable(anyhow::anyhow!(
            "--follow moves simulated arms alone, and not in a dry run: --reach moves a robot behind a driver once"
        )));
    }
    let recorder = rerun_arg::start(&args.rerun, RerunChoice::Off, Pace::Live, false)?;
    // If it only watches, it uses the calibration for uncorrected commands.
    let corrects = !matches!(task, Task::Watch) && !args.as_reported;
    let by = |calibrated, arm| TrackedBy { setup: Setup { target, calibrated, motion: MotionModel::default() }, arm };
    let job = Job {
        recorder: &recorder,
        by: by(calibrated, None),
        corrected: corrected.filter(|_| corrects).map(|(calibrated, arm)| by(calibrated, Some(arm))),
        task,
        frames: args.frames,
        // The board of an existing cell must not be moved here, nor the arm before it follows.
        own_cell: (!args.cell.is_given()).then_some(board),
        dry_run: args.cell.dry_run,
    };
    let mut document = document::Document::begin(args.json.as_ref(), &args.calibration)?;
    let mut add = |tracked: &Tracked| {
        document.add(tracked)?;
        if document.is_closed() {
            cancel.cancel();
        }
        Ok(())
    };
    let mut summary = Summary::default();
    let own = CellConfig { seed: args.cell.seed, real_time: Some(true), ..CellConfig::new(scene) };
    let tracked = OpenCell::connect(&args.cell, own, &cancel).and_then(|mut cell| {
        let moves = !matches!(task, Task::Watch) && !args.cell.dry_run;
        if moves {
            cell.allow_motion(args.cell.allow_motion)?;
        }
        let tracked = live::run(&mut cell, &job, &cancel, &mut Taken { publish: &mut add, summary: &mut summary });
        if moves && !cell.is_simulated() {
            cell.leave(tracked.is_err() || cancel.is_cancelled(), false);
        }
        tracked
    });
    // What was tracked before an error is valid.
    document.finish(&summary, tracked.as_ref().err())?;
    let is_worth_saying = tracked.is_ok() || !summary.is_empty();
    if is_worth_saying && !args.json.as_ref().is_some_and(Output::is_standard) {
        out::print(&summary.text())?;
    }
    tracked?;
    rerun_arg::finish(recorder, &cancel)
}
