//! `handeye auto`: poses, captures, result and exports from one command.

mod guided;
mod poses;
pub(crate) mod sequence;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_dataset::taught_poses::Goal;
use handeye_estimate::handeye::Mode;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_estimate::{Method, Options};
use handeye_geometry::targets::TargetSpec;
use handeye_plan::Surroundings;
use handeye_plan::guided::{CHECKS, Guide, GuidedOptions};
use handeye_result::guided_record::GUIDED_RECORD;
use handeye_server::CellConfig;
use handeye_session::guided::guided_record;
use handeye_session::{FolderLock, Session, SessionMeta, Store};

use super::output::Output;
use crate::auto::sequence::{Images, PoseSequence};
use crate::cell_choice::CellChoice;
use crate::open_cell::OpenCell;
use crate::rerun_arg;
use crate::robot_args::RobotArgs;
use crate::solve::Wanted;
use crate::towards_board::TowardsBoard;
use crate::{Failure, RerunArg, arm_arg, box_arg, out, record, solve};
use guided::GuidedSequence;
use handeye_record::{Pace, RerunChoice};
use handeye_workbench::arguments::{self, heading};
use handeye_workbench::model::{self, CaptureOptions, Simulation, Step};
use handeye_workbench::recording::{Entry, Recording as _};
use handeye_workbench::session::start;
use handeye_workbench::text::Language;
use handeye_workbench::worker::{timestamp, timestamp_rfc3339};
use poses::{GUIDED, PLANNED, Plan, REFERENCE};
use solve::Solution;

/// Options of `handeye auto`.
#[derive(Debug, Args)]
pub struct AutoArgs {
    #[command(flatten)]
    cell: CellChoice,
    /// `seed10` (the ten reference poses), a pose file, `auto` (planned views of the board), or `guided` (each pose chosen
    /// by what the captures so far leave open, until the goal is reached). `seed10` if not given, and `guided` with an option
    /// of guided capture.
    #[arg(long, value_name = "seed10|FILE|auto|guided", help_heading = heading::POSES)]
    poses: Option<String>,
    #[command(flatten)]
    guided: GuidedArgs,
    /// What the arm must not touch, in addition to what the scene has: a file of boxes, with a work volume and limits of speed if
    /// wanted (docs/reference/surroundings.md). Every motion to joint values is then checked before it begins.
    #[arg(long, value_name = "FILE", help_heading = heading::CELL)]
    keep_out: Option<PathBuf>,
    /// The chain of the arm by a built-in name or a URDF file, in place of the one that is read from the simulation. One
    /// that puts the tip elsewhere than the robot reports it is refused.
    #[arg(long, value_name = "NAME|URDF", help_heading = heading::CELL)]
    arm: Option<String>,
    /// Folder of the session; a new one under `sessions` if not given.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    out: Option<PathBuf>,
    /// Write the result as JSON to this file too; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
    /// The board on a real cell, which the built-in one and the public scene have as 10x7x15: inner corners and square in mm, or
    /// kind=charuco,columns=… with the options of `handeye target`.
    #[arg(long, value_name = "TEXT", help_heading = heading::TARGET)]
    target: Option<String>,
    /// Whether the camera is on the arm (eye_in_hand) or next to it, with the board on the arm (eye_to_hand); eye_in_hand if not
    /// given.
    #[arg(long, value_name = "MODE", value_parser = mode, help_heading = heading::CELL)]
    mode: Option<Mode>,
    /// Run the built-in cell like real time instead of as fast as it can.
    #[arg(long, help_heading = heading::CELL)]
    real_time: bool,
    /// Leave the simulation running at the end, also where it was this command that started it. Otherwise it is left as it was.
    #[arg(long, requires = "connect", help_heading = heading::CELL)]
    leave_running: bool,
    /// Images that are averaged for each capture.
    #[arg(long, value_name = "N", default_value_t = CaptureOptions::default().frames, value_parser = clap::value_parser!(u32).range(1..=64), help_heading = heading::POSES)]
    frames: u32,
    #[command(flatten)]
    robot: RobotArgs,
    #[command(flatten)]
    rerun: RerunArg,
}

/// What guided capture is asked for.
#[derive(Debug, Args)]
struct GuidedArgs {
    /// Error (95 %) to be reached, millimetres: what a tool arrives within where the arm or the accuracy of the robot is
    /// known, else that of a measured point; 0.3 if not given.
    #[arg(long, value_name = "MM", value_parser = positive, help_heading = heading::GUIDED)]
    goal: Option<f64>,
    /// Largest number of captures; 40 if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=400), help_heading = heading::GUIDED)]
    max_poses: Option<u32>,
    /// Time limit in minutes of the cell's time; none if not given.
    #[arg(long, value_name = "MIN", value_parser = positive, help_heading = heading::GUIDED)]
    max_minutes: Option<f64>,
    /// Captures afterwards, at random poses, that never enter the fit and check the answer; 3 if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100), help_heading = heading::GUIDED)]
    check_poses: Option<u32>,
    /// Where the tool works, in the camera (x right, y down, z forward): centre and edges, metres. The goal then holds for
    /// the worst point of it; without it for where the camera saw the board.
    #[arg(long = "box", value_name = "X,Y,Z,DX,DY,DZ", value_parser = box_arg::tool_box, allow_hyphen_values = true, help_heading = heading::GUIDED)]
    tool_box: Option<TipBox>,
}

fn mode(text: &str) -> Result<Mode, String> {
    match text {
        "eye_in_hand" => Ok(Mode::EyeInHand),
        "eye_to_hand" => Ok(Mode::EyeToHand),
        _ => Err("eye_in_hand or eye_to_hand is needed".to_owned()),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_none| "not a number".to_owned())?;
    if number > 0.0 && number.is_finite() { Ok(number) } else { Err("a number above 0 is needed".to_owned()) }
}

impl GuidedArgs {
    /// The first option that was given.
    fn given(&self) -> Option<&'static str> {
        let given = [
            ("--goal", self.goal.is_some()),
            ("--max-poses", self.max_poses.is_some()),
            ("--max-minutes", self.max_minutes.is_some()),
            ("--check-poses", self.check_poses.is_some()),
            ("--box", self.tool_box.is_some()),
        ];
        given.into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }

    fn options(&self, seed: u64) -> GuidedOptions {
        let default = GuidedOptions::default();
        GuidedOptions {
            goal_m: self.goal.map_or(default.goal_m, |mm| mm * 1e-3),
            most_views: self.max_poses.map_or(default.most_views, |poses| poses as usize),
            most_s: self.max_minutes.map_or(default.most_s, |minutes| minutes * 60.0),
            seed,
            tool_box: self.tool_box,
            ..default
        }
    }
}

/// At the end of its help.
pub const EXAMPLES: &str = "Examples:
  handeye auto --poses seed10 --out session --json result.json
  handeye auto --poses guided --goal 0.3 --scene panda --out guided

On a real cell, where --allow-motion for --dry-run moves the robot:
  handeye auto --driver \"python3 my_robot.py\" \\
      --camera-driver \"handeye driver v4l\" --target 9x6x25 \\
      --poses poses.toml --dry-run";

pub fn run(args: &AutoArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let scene = args.cell.scene()?;
    let by_default = if args.guided.given().is_some() { GUIDED } else { REFERENCE };
    let poses = args.poses.as_deref().unwrap_or(by_default);
    let is_guided = poses == GUIDED;
    if let Some(option) = args.guided.given().filter(|_| !is_guided) {
        return Err(Failure::unusable(anyhow::anyhow!("{option} goes with --poses guided")));
    }
    let target = target_of(args)?;
    let plans_here = args.cell.is_given() && poses == PLANNED;
    let mut plan = if plans_here || is_guided && args.cell.is_given() {
        Plan::from_here()
    } else {
        Plan::find(poses, &scene, args.cell.seed)?
    };
    // Read before anything moves.
    let keep_out = args.keep_out.as_deref().map(Surroundings::read).transpose().map_err(Failure::unusable)?;
    let seed = args.cell.seed.unwrap_or(scene.seed);
    let recorder = rerun_arg::start(&args.rerun, RerunChoice::Record, Pace::Everything, true)?;
    let folder = args.out.clone().unwrap_or_else(|| Path::new("sessions").join(timestamp()));
    let own = CellConfig { seed: args.cell.seed, real_time: Some(args.real_time), ..CellConfig::new(scene) };
    let mut cell = OpenCell::connect(&args.cell, own, &cancel)?;
    plan.check_joints(cell.facts.joints.len())?;
    cell.limit(&plan.limits);
    let ran_before = cell.robot_state()?.simulation != Simulation::Stopped;
    if let Some(named) = &args.arm {
        let known = named_arm(named, &mut cell)?;
        cell.plan_by(known);
    }
    if let Some(keep_out) = &keep_out {
        cell.keep_out(keep_out)?;
    }
    // An unknown chain is not an error: joint angles are then kept and not used.
    if let (true, Err(unknown)) = (is_guided, cell.robot()?) {
        return Err(Failure::failed(anyhow::anyhow!(
            "guided capture takes an arm whose chain is known: {unknown}; give the poses by a file, --poses FILE"
        )));
    }
    if plans_here {
        plan = Plan::planned_here(&mut cell, seed)?;
    }
    let towards_board = if is_guided && args.cell.is_given() { TowardsBoard::all(&mut cell)? } else { Vec::new() };
    if args.cell.dry_run {
        return print_plan(&mut cell, &plan, is_guided);
    }
    cell.allow_motion(args.cell.allow_motion)?;
    keep_earlier_session(&folder)?;
    let truth = cell.facts.truth.clone();
    let meta = SessionMeta {
        seeds: args.cell.seed.map(|seed| ("cell".to_owned(), seed)).into_iter().collect(),
        arm: start::arm(cell.kinematics()),
        tool_m: args.robot.tool_m,
        robot_accuracy_mm: args.robot.accuracy_mm,
        joint_kinds: start::joint_kinds(cell.facts.joints.iter().map(|joint| joint.kind)),
        target,
        mode: args.mode.unwrap_or(Mode::EyeInHand),
        ..start::meta(truth.as_ref(), timestamp_rfc3339())
    };
    let mut session = Store::create(&folder, meta).map_err(Failure::failed)?;
    recorder.note(Entry::Step(Step::Capture));
    record::document(&recorder, &session);
    record::cell(&recorder, &cell.facts);
    let mut sequence = PoseSequence {
        cell: &mut cell,
        plan: &plan,
        options: CaptureOptions { frames: args.frames, ..CaptureOptions::default() },
        real_time: args.real_time,
        session: &mut session,
        recorder: &recorder,
        cancel: &cancel,
        began: Instant::now(),
        images: Images::default(),
    };
    let mut guide = is_guided.then(|| Guide::new(args.guided.options(seed)));
    let captured = match &mut guide {
        Some(guide) => {
            let checks = args.guided.check_poses.map_or(CHECKS, |poses| poses as usize);
            GuidedSequence::new(&mut sequence, guide, checks, towards_board).run().map(Some)
        }
        None => sequence.run().map(|()| None),
    };
    // The simulation ends unless it was running before.
    cell.leave(captured.is_err() || cancel.is_cancelled(), !(ran_before || args.leave_running));
    if captured.is_err() && !session.document().captures.is_empty() {
        let (count, folder) = (session.document().captures.len(), folder.display());
        let captures = out::counted(count, "capture is", "captures are");
        tracing::warn!("{captures} kept in {folder}; `handeye calibrate {folder}` solves it");
    }
    if let Some(guide) = &guide {
        guided_record(guide).write(&folder.join(GUIDED_RECORD)).map_err(Failure::failed)?;
    }
    let ending = captured?;
    drop(cell);

    let goal_m = guide.as_ref().map_or(model::Goal::default().0, |guide| guide.options().goal_m);
    // The session has the tool and the accuracy.
    let robot = RobotArgs::default();
    let wanted = Wanted { method: Method::Joint, options: Options::default(), goal_m, robot };
    let mut solution = solve::folder(&folder, wanted, truth, &cancel)?;
    solution.guided_by(guide.as_ref().map(guided_record));
    finish(&session, args.json.as_ref(), &solution)?;
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)?;
    match ending {
        Some(ending) if !ending.is_success() => Err(Failure::failed(anyhow::anyhow!(
            "the goal is not reached. {}",
            ending.text().in_language(Language::English)
        ))),
        _ => Ok(()),
    }
}

/// The board: that of the built-in cell and of the public scene, or the one that was described. The board of a real cell is never
/// guessed.
fn target_of(args: &AutoArgs) -> Result<TargetSpec, Failure> {
    match &args.target {
        Some(text) => arguments::of_text(text).map_err(Failure::unusable),
        None if args.cell.driver.is_some() => Err(Failure::unusable(anyhow::anyhow!(
            "the board before a real camera has to be described: give --target, for example --target 10x7x15"
        ))),
        None => Ok(start::BOARD),
    }
}

/// The chain named by `--arm`, once it agrees with what the robot reports.
fn named_arm(named: &str, cell: &mut OpenCell) -> Result<ArmKinematics, Failure> {
    let here = cell.robot_state()?.joints_rad;
    if let Some(read) = cell.kinematics() {
        return arm_arg::checked(named, read, &here);
    }
    let unknown = cell.robot()?.err().map_or_else(String::new, |unknown| format!(": {unknown}"));
    Err(Failure::failed(anyhow::anyhow!("--arm {named} cannot be checked against the robot{unknown}")))
}

/// What `--dry-run` shows.
fn print_plan(cell: &mut OpenCell, plan: &Plan, is_guided: bool) -> Result<(), Failure> {
    let here = Goal::Joints(cell.robot_state()?.joints_rad.to_vec());
    out::line(format_args!("the robot stands at: {}", cell.described(&here)))?;
    if let Some(start) = &plan.start_joints {
        out::line(format_args!("1. to the start: {}", cell.described(&Goal::Joints(start.clone()))))?;
    }
    let first = usize::from(plan.start_joints.is_some()) + 1;
    for (number, (name, goal)) in (first..).zip(&plan.goals) {
        out::line(format_args!("{number}. to {name}: {}", cell.described(goal)))?;
    }
    if is_guided {
        out::line(
            "the first capture is taken where it stands; every further pose is chosen by what the captures before leave \
             open, on ways that are free, and is logged before the robot moves",
        )?;
    }
    out::line("nothing was moved")
}

fn finish(session: &Store, json: Option<&Output>, solution: &Solution) -> Result<(), Failure> {
    let (folder, result) = (session.folder(), solution.result());
    session.write_result(result).map_err(Failure::failed)?;
    solve::write_exports(&folder.join("exports"), result)?;
    solution.publish(json)?;
    if json.is_some_and(Output::is_standard) {
        return Ok(());
    }
    out::line(format_args!("session: {}", folder.display()))
}

/// Moves a session that is already there out of the way: nothing captured is ever overwritten. A session that another
/// program has open is not moved, or that program would continue writing into the new one.
fn keep_earlier_session(folder: &Path) -> Result<(), Failure> {
    if !Session::is_session(folder) {
        return Ok(());
    }
    let _not_open_elsewhere = FolderLock::take(folder).map_err(Failure::unusable)?;
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let kept = (1..u32::MAX)
        .map(|n| folder.with_file_name(format!("{name}.earlier-{n}")))
        .find(|path| !path.exists())
        .unwrap_or_else(|| folder.with_file_name(format!("{name}.earlier")));
    std::fs::rename(folder, &kept).map_err(|error| {
        Failure::failed(anyhow::anyhow!("the earlier session {} cannot be renamed: {error}", folder.display()))
    })?;
    tracing::warn!("{} held a session already; it is now {}", folder.display(), kept.display());
    Ok(())
}
