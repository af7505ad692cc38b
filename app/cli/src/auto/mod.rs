//! `handeye auto`: poses, captures, result and exports from one command.

mod guided;
mod poses;
pub(crate) mod sequence;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use handeye_coppeliasim::cell::{Arm, ArmKinematics, CellClient, CellPaths};
use handeye_coppeliasim::{ConnectionOptions, Endpoint, SimulationState};
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_estimate::{Method, Options};
use handeye_plan::Surroundings;
use handeye_plan::guided::{CHECKS, Guide, GuidedOptions};
use handeye_result::guided_record::GUIDED_RECORD;
use handeye_server::{CellConfig, CellServer};
use handeye_session::guided::guided_record;
use handeye_session::{FolderLock, Session, SessionMeta, Store};

use super::cell::SceneArg;
use super::output::Output;
use crate::auto::sequence::PoseSequence;
use crate::rerun_arg;
use crate::towards_board::TowardsBoard;
use crate::{Failure, ObjectArgs, RerunArg, arm_arg, box_arg, out, record, solve};
use guided::GuidedSequence;
use handeye_workbench::arguments::heading;
use handeye_workbench::model::{CaptureOptions, Goal, Step, Truth};
use handeye_workbench::rerun_log::{Entry, Pace, RerunChoice};
use handeye_workbench::session::start;
use handeye_workbench::text::Language;
use handeye_workbench::worker::{timestamp, timestamp_rfc3339};
use poses::{GUIDED, PLANNED, Plan, REFERENCE};
use solve::Solution;

/// Options of `handeye auto`.
#[derive(Debug, Args)]
pub struct AutoArgs {
    /// Address of a CoppeliaSim or cell; without it the built-in cell is started.
    #[arg(long, value_name = "ADDR", help_heading = heading::CELL)]
    connect: Option<String>,
    #[command(flatten)]
    objects: ObjectArgs,
    /// `seed10` (the ten reference poses), a pose file, `auto` (planned views of the board), or `guided` (each pose chosen
    /// by what the captures so far leave open, until the goal is reached). `seed10` if not given, and `guided` with an option
    /// of guided capture.
    #[arg(long, value_name = "seed10|FILE|auto|guided", help_heading = heading::POSES)]
    poses: Option<String>,
    #[command(flatten)]
    guided: GuidedArgs,
    /// What the arm must not touch, besides what the scene has: a file of boxes, with a work volume and limits of speed if wanted
    /// (docs/reference/surroundings.md). Every motion to joint values is then checked before it begins.
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
    #[command(flatten)]
    scene: SceneArg,
    /// Seed of everything random in the built-in cell, and of planned poses.
    #[arg(long, value_name = "N", help_heading = heading::CELL)]
    seed: Option<u64>,
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
    rerun: RerunArg,
}

/// What guided capture is asked for.
#[derive(Debug, Args)]
struct GuidedArgs {
    /// Expected error (95 %) to be reached, millimetres; 0.3 if not given.
    #[arg(long, value_name = "MM", value_parser = positive, help_heading = heading::GUIDED)]
    goal: Option<f64>,
    /// Captures at the most; 40 if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=400), help_heading = heading::GUIDED)]
    max_poses: Option<u32>,
    /// Minutes of the cell's time at the most; no limit if not given.
    #[arg(long, value_name = "MIN", value_parser = positive, help_heading = heading::GUIDED)]
    max_minutes: Option<f64>,
    /// Captures afterwards, at poses at random, that never enter the fit and check the answer; 3 if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100), help_heading = heading::GUIDED)]
    check_poses: Option<u32>,
    /// Where the tool works, in the camera (x right, y down, z forward): middle and edges, metres. The goal then holds for
    /// the worst point of it; without it for where the camera saw the board.
    #[arg(long = "box", value_name = "X,Y,Z,DX,DY,DZ", value_parser = box_arg::tool_box, allow_hyphen_values = true, help_heading = heading::GUIDED)]
    tool_box: Option<TipBox>,
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
  handeye auto --poses guided --goal 0.3 --scene panda --out guided";

pub fn run(args: &AutoArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    if args.connect.is_some() && args.scene.is_given() {
        return Err(Failure::unusable(anyhow::anyhow!(
            "--scene describes the built-in cell and --connect takes another: give one of them"
        )));
    }
    let by_default = if args.guided.given().is_some() { GUIDED } else { REFERENCE };
    let poses = args.poses.as_deref().unwrap_or(by_default);
    let is_guided = poses == GUIDED;
    if let Some(option) = args.guided.given().filter(|_| !is_guided) {
        return Err(Failure::unusable(anyhow::anyhow!("{option} goes with --poses guided")));
    }
    let scene = args.scene.load()?;
    let plans_here = args.connect.is_some() && poses == PLANNED;
    let mut plan = match args.connect {
        Some(_) if is_guided || plans_here => Plan::from_here(),
        _ => Plan::find(poses, &scene, args.seed)?,
    };
    // Read before anything moves.
    let keep_out = args.keep_out.as_deref().map(Surroundings::read).transpose().map_err(Failure::unusable)?;
    let seed = args.seed.unwrap_or(scene.seed);
    let recorder = rerun_arg::start(&args.rerun, RerunChoice::Record, Pace::Everything, true)?;
    let paths = if args.connect.is_some() { CellPaths::default() } else { CellPaths::below(&scene.robot.name) };
    let server = match args.connect {
        Some(_) => None,
        None => Some(
            CellServer::start(CellConfig {
                seed: args.seed,
                real_time: Some(args.real_time),
                ..CellConfig::new(scene)
            })
            .map_err(Failure::failed)?,
        ),
    };
    let address = match (&args.connect, &server) {
        (Some(address), _) => address.clone(),
        (None, Some(server)) => server.endpoint(),
        (None, None) => String::new(),
    };
    let endpoint: Endpoint = address.parse().map_err(Failure::unusable)?;
    let paths = args.objects.paths(paths);
    let folder = args.out.clone().unwrap_or_else(|| Path::new("sessions").join(timestamp()));
    let options = if server.is_some() { ConnectionOptions::own_cell() } else { ConnectionOptions::default() };
    let mut cell = CellClient::connect(&endpoint, &options, &paths).map_err(Failure::failed)?;
    plan.check_joints(cell.info().joints.len())?;
    let truth = cell.camera().ground_truth().map_err(Failure::failed)?;
    let ran_before = cell.arm().sim().get_simulation_state().map_err(Failure::failed)? != SimulationState::Stopped;

    keep_earlier_session(&folder)?;
    // That it is another arm is no fault: its joint angles are then kept and not used.
    let kinematics = cell.arm().kinematics().map_err(Failure::failed)?;
    if let (true, Err(unknown)) = (is_guided, &kinematics) {
        return Err(Failure::failed(anyhow::anyhow!(
            "guided capture takes an arm whose chain is known: {unknown}; give the poses by a file, --poses FILE"
        )));
    }
    let kinematics = match &args.arm {
        None => kinematics.ok(),
        Some(named) => {
            let read = kinematics.map_err(|unknown| {
                Failure::failed(anyhow::anyhow!("--arm {named} cannot be checked against the robot: {unknown}"))
            })?;
            let here = cell.arm().joint_values().map_err(Failure::failed)?;
            Some(arm_arg::checked(named, &read, &here)?)
        }
    };
    let around = surroundings(cell.arm(), kinematics.as_ref(), is_guided || plans_here, keep_out)?;
    if plans_here {
        plan = Plan::planned_here(cell.arm(), kinematics.as_ref(), &truth, &around, seed)?;
    }
    let towards_board = match &kinematics {
        Some(kinematics) if is_guided && args.connect.is_some() => {
            TowardsBoard::all(cell.arm(), kinematics, &truth, &around)?
        }
        _ => Vec::new(),
    };
    let meta = SessionMeta {
        seeds: args.seed.map(|seed| ("cell".to_owned(), seed)).into_iter().collect(),
        arm: start::arm(kinematics.as_ref()),
        joint_kinds: start::joint_kinds(cell.info().joint_kinds()),
        ..start::meta(Some(&Truth::from(&truth)), timestamp_rfc3339())
    };
    let mut session = Store::create(&folder, meta).map_err(Failure::failed)?;
    recorder.note(Entry::Step(Step::Capture));
    record::document(&recorder, &session);
    record::cell(&recorder, cell.arm(), &truth).map_err(Failure::failed)?;
    let mut sequence = PoseSequence {
        cell: &mut cell,
        plan: &plan,
        options: CaptureOptions { frames: args.frames, ..CaptureOptions::default() },
        real_time: args.real_time,
        session: &mut session,
        recorder: &recorder,
        cancel: &cancel,
        began: Instant::now(),
        images: 0,
    };
    let mut guide = is_guided.then(|| Guide::new(args.guided.options(seed)));
    let captured = match (&mut guide, &kinematics) {
        (Some(guide), Some(kinematics)) => {
            let checks = args.guided.check_poses.map_or(CHECKS, |poses| poses as usize);
            GuidedSequence::new(&mut sequence, guide, kinematics, around, checks, towards_board).run().map(Some)
        }
        _ => sequence.run().map(|()| None),
    };
    // Whatever happened on the way, the arm is not left moving and the simulation not waiting for steps. It ends unless
    // somebody else had started it.
    let ended = cell.arm().stop().and_then(|()| {
        let sim = cell.arm().sim();
        sim.set_stepping(false)?;
        if ran_before || args.leave_running { Ok(()) } else { sim.stop_simulation_and_wait() }
    });
    if captured.is_err() && !session.document().captures.is_empty() {
        let (count, folder) = (session.document().captures.len(), folder.display());
        let captures = out::counted(count, "capture is", "captures are");
        tracing::warn!("{captures} kept in {folder}; `handeye calibrate {folder}` solves it");
    }
    if let Some(guide) = &guide {
        guided_record(guide).write(&folder.join(GUIDED_RECORD)).map_err(Failure::failed)?;
    }
    let ending = captured?;
    if let Err(error) = ended {
        tracing::warn!(%error, "the simulation could not be stopped");
    }
    drop(cell);
    drop(server);

    let goal_m = guide.as_ref().map_or(Goal::default().0, |guide| guide.options().goal_m);
    let truth = Some(Truth::from(&truth));
    let mut solution = solve::folder(&folder, Method::Joint, Options::default(), goal_m, truth, &cancel)?;
    solution.guided_by(guide.as_ref().map(guided_record));
    finish(&session, args.json.as_ref(), &solution)?;
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)?;
    match ending {
        Some(ending) if !ending.is_success() => {
            Err(Failure::failed(anyhow::anyhow!("the goal is not reached. {}", ending.text().say(Language::English))))
        }
        _ => Ok(()),
    }
}

/// What stands around: in the scene, and in the file where one is given. With a file every motion is checked, and kept within
/// its limits; without one only who chooses poses so asks for it.
fn surroundings(
    arm: &mut Arm,
    kinematics: Option<&ArmKinematics>,
    is_asked: bool,
    keep_out: Option<Surroundings>,
) -> Result<Surroundings, Failure> {
    let kinematics = match (kinematics, &keep_out) {
        (Some(kinematics), Some(_)) => kinematics,
        (Some(kinematics), None) if is_asked => kinematics,
        (_, None) => return Ok(Surroundings::default()),
        (None, Some(_)) => {
            return Err(Failure::failed(anyhow::anyhow!(
                "--keep-out needs an arm whose chain is known, to know what it would touch: leave the option out, or \
                 give the scene an arm whose tip hangs on its base (docs/reference/arms.md)"
            )));
        }
    };
    let standing = arm.surroundings(kinematics).map_err(Failure::failed)?.all();
    let Some(keep_out) = keep_out else { return Ok(standing) };
    let around = standing.and(keep_out);
    arm.keep_clear(Some(kinematics.among(around.clone(), None)));
    Ok(around)
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
/// program has open stays where it is, or that program would go on writing into the new one.
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
        Failure::failed(anyhow::anyhow!("the earlier session {} cannot be moved aside: {error}", folder.display()))
    })?;
    tracing::warn!("{} held a session already; it is now {}", folder.display(), kept.display());
    Ok(())
}
