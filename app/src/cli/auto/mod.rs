//! `handeye auto`: poses, captures, result and exports from one command.

mod poses;
pub(crate) mod sequence;

use std::path::{Path, PathBuf};

use clap::Args;
use handeye_core::estimate::{Method, Options};
use handeye_core::project::session::{FolderLock, Session, SessionMeta, Store};
use handeye_sim_link::cell::server::{CellConfig, CellServer};
use handeye_sim_link::client::cell::{CellClient, CellPaths};
use handeye_sim_link::client::{ConnectionOptions, Endpoint, SimulationState};

use super::cell::SceneArg;
use super::output::Output;
use super::{Failure, RerunArg, out, record, rerun_arg, solve};
use crate::cli::auto::sequence::PoseSequence;
use crate::model::{CaptureOptions, Step, Truth};
use crate::rerun_log::{Entry, Pace, RerunChoice};
use crate::session::start;
use crate::shortfall;
use crate::text::Language;
use crate::worker::{timestamp, timestamp_rfc3339};
use poses::Plan;
use solve::Solution;

/// Options of `handeye auto`.
#[derive(Debug, Args)]
pub struct AutoArgs {
    /// Address of a CoppeliaSim or cell; without it the built-in cell is started.
    #[arg(long, value_name = "ADDR")]
    connect: Option<String>,
    /// `seed10` (the ten reference poses), a pose file, or `auto` (planned views of the board).
    #[arg(long, value_name = "seed10|FILE|auto", default_value = "seed10")]
    poses: String,
    /// Folder of the session; a new one under `sessions` if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the result as JSON to this file too; `-` for standard output instead of the report.
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    #[command(flatten)]
    scene: SceneArg,
    /// Seed of everything random in the built-in cell, and of planned poses.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Run the built-in cell like real time instead of as fast as it can.
    #[arg(long)]
    real_time: bool,
    /// Images that are averaged for each capture.
    #[arg(long, value_name = "N", default_value_t = CaptureOptions::default().frames, value_parser = clap::value_parser!(u32).range(1..=64))]
    frames: u32,
    #[command(flatten)]
    rerun: RerunArg,
}

pub fn run(args: &AutoArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    if args.connect.is_some() && args.scene.is_given() {
        return Err(Failure::unusable(anyhow::anyhow!(
            "--scene describes the built-in cell and --connect takes another: give one of them"
        )));
    }
    let scene = args.scene.load()?;
    let plan = Plan::find(&args.poses, &scene, args.seed)?;
    let recorder = args.rerun.start(RerunChoice::Record, Pace::Everything, true)?;
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
    let folder = args.out.clone().unwrap_or_else(|| Path::new("sessions").join(timestamp()));
    let mut cell = CellClient::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default())
        .map_err(Failure::failed)?;
    plan.check_joints(cell.info().joints.len())?;
    let truth = cell.camera().ground_truth().map_err(Failure::failed)?;
    let ran_before = cell.arm().sim().get_simulation_state().map_err(Failure::failed)? != SimulationState::Stopped;

    keep_earlier_session(&folder)?;
    // That it is another arm is no fault: its joint angles are then kept and not used.
    let kinematics = cell.arm().kinematics().map_err(Failure::failed)?.ok();
    if let Some(shortfall) = shortfall::of(cell.info().support(), kinematics.is_some()) {
        tracing::warn!("{}", shortfall.say(Language::English));
    }
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
    let captured = PoseSequence {
        cell: &mut cell,
        plan: &plan,
        options: CaptureOptions { frames: args.frames, ..CaptureOptions::default() },
        real_time: args.real_time,
        session: &mut session,
        recorder: &recorder,
        cancel: &cancel,
    }
    .run();
    // Whatever happened on the way, the arm is not left moving and the simulation not waiting for steps. It ends unless
    // somebody else had started it.
    let ended = cell.arm().stop().and_then(|()| {
        let sim = cell.arm().sim();
        sim.set_stepping(false)?;
        if ran_before { Ok(()) } else { sim.stop_simulation() }
    });
    if captured.is_err() && !session.document().captures.is_empty() {
        let (count, folder) = (session.document().captures.len(), folder.display());
        tracing::warn!("{count} captures are kept in {folder}; `handeye calibrate {folder}` solves them");
    }
    captured?;
    if let Err(error) = ended {
        tracing::warn!(%error, "the simulation could not be stopped");
    }
    drop(cell);
    drop(server);

    let solution = solve::folder(&folder, Method::Joint, Options::default(), Some(Truth::from(&truth)), &cancel)?;
    finish(&session, args.json.as_ref(), &solution)?;
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)
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
