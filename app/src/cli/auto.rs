//! `handeye auto`: poses, captures, result and exports from one command.

mod poses;

use std::path::{Path, PathBuf};

use clap::Args;
use handeye_core::arm::ArmModel;
use handeye_core::calibrate::{Method, Options};
use handeye_core::handeye::{HandEye, Mode};
use handeye_core::poses_file::Goal;
use handeye_core::progress::CancelToken;
use handeye_core::result::CalibrationResult;
use handeye_core::session::{Capture, FolderLock, GroundTruth, Session, SessionMeta, Store};
use handeye_sim_link::cell::server::{CellConfig, CellServer};
use handeye_sim_link::client::cell::{CellClient, CellPaths, Frame, MotionTolerance, SettleOptions};
use handeye_sim_link::client::{ConnectionOptions, Endpoint, LinkError};
use time::OffsetDateTime;
use time::macros::format_description;

use super::cell::SceneArg;
use super::{Failure, RerunArg, record, report, rerun_arg, solve};
use crate::model::Step;
use crate::rerun_log::{Entry, Pace, Recorder, RerunChoice};
use crate::session_start::{BOARD, BUILT_IN_ARM};
use poses::Plan;

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
    /// Write the result as JSON to this file too.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArg,
    /// Seed of everything random in the built-in cell, and of planned poses.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Run the built-in cell like real time instead of as fast as it can.
    #[arg(long)]
    real_time: bool,
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
    let folder = args.out.clone().map_or_else(new_session_folder, Ok)?;
    let mut cell = CellClient::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default())
        .map_err(Failure::failed)?;
    let truth = cell.ground_truth().map_err(Failure::failed)?;

    keep_earlier_session(&folder)?;
    // That it is another arm is no fault: its joint angles are then kept and not used.
    let arm = cell.arm().kinematics().map_err(Failure::failed)?.ok().map(|_ur5| BUILT_IN_ARM);
    let mut session = Store::create(&folder, meta(&truth, args.seed, arm)?).map_err(Failure::failed)?;
    recorder.note(Entry::Step(Step::Capture));
    record::document(&recorder, &session);
    record::cell(&recorder, cell.arm(), &truth).map_err(Failure::failed)?;
    let captured = capture_all(&mut cell, &plan, args.real_time, &mut session, &recorder, &cancel);
    // Whatever happened on the way, the arm is not left moving and the simulation not running or waiting for steps.
    let ended = cell.stop().and_then(|()| {
        let sim = cell.arm().sim();
        sim.set_stepping(false)?;
        sim.stop_simulation()
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

    let solution = solve::folder(&folder, Method::Joint, Options::default(), Some(record::known(&truth)), &cancel)?;
    finish(&session, args.json.as_deref(), solution.result())?;
    solution.note(&recorder);
    rerun_arg::finish(recorder, &cancel)
}

fn finish(session: &Store, json: Option<&Path>, result: &CalibrationResult) -> Result<(), Failure> {
    let folder = session.folder();
    session.write_result(result).map_err(Failure::failed)?;
    solve::write_exports(&folder.join("exports"), result)?;
    if let Some(file) = json {
        result.write(file).map_err(Failure::failed)?;
    }
    print!("{}", report::text(result));
    println!("session: {}", folder.display());
    Ok(())
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

/// `sessions/2026-05-02T10-11-12`, under the current folder.
fn new_session_folder() -> Result<PathBuf, Failure> {
    let name = OffsetDateTime::now_utc()
        .format(format_description!("[year]-[month]-[day]T[hour]-[minute]-[second]"))
        .map_err(Failure::failed)?;
    Ok(Path::new("sessions").join(name))
}

fn meta(
    truth: &handeye_sim_link::client::cell::GroundTruth,
    seed: Option<u64>,
    arm: Option<ArmModel>,
) -> Result<SessionMeta, Failure> {
    let created =
        OffsetDateTime::now_utc().format(&time::format_description::well_known::Rfc3339).map_err(Failure::failed)?;
    Ok(SessionMeta {
        created,
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        mode: Mode::EyeInHand,
        target: BOARD,
        camera: None,
        seeds: seed.map(|seed| ("cell".to_owned(), seed)).into_iter().collect(),
        ground_truth: truth.base_from_target.map(|base_from_target| {
            let links = HandEye::EyeInHand { tip_from_camera: truth.tip_from_camera, base_from_target };
            GroundTruth::new(&links, Some(truth.intrinsics))
        }),
        arm,
    })
}

/// Visits every pose and captures there. A pose that the arm cannot reach is named and left out; anything else ends it.
fn capture_all(
    cell: &mut CellClient,
    plan: &Plan,
    real_time: bool,
    session: &mut Store,
    recorder: &Recorder,
    cancel: &CancelToken,
) -> Result<(), Failure> {
    let info = cell.info().clone();
    // Stepped, a pass takes as long as it takes, and the same command gives the same pictures on every machine.
    let sim = cell.arm().sim();
    sim.set_stepping(!real_time).and_then(|()| sim.start_simulation()).map_err(Failure::failed)?;
    if let Some(start) = &plan.start_joints {
        cell.move_to_joints(start, &plan.joint_limits, cancel).map_err(Failure::failed)?;
    }
    for (index, (name, goal)) in plan.goals.iter().enumerate() {
        let moved = match goal {
            Goal::Tip(pose) => cell.move_to_pose(pose, &plan.tip_limits, &MotionTolerance::default(), cancel),
            Goal::Joints(joints) => joints.as_slice().try_into().map_or_else(
                |_wrong_length| {
                    Err(LinkError::BadMotion { what: "the goal", expected: "six joints", value: joints.len() as f64 })
                },
                |joints| cell.move_to_joints(joints, &plan.joint_limits, cancel),
            ),
        };
        match moved {
            Ok(()) => {}
            Err(error @ LinkError::Unreached { .. }) => {
                tracing::warn!("pose {name:?} is left out: {error}");
                continue;
            }
            Err(error) => return Err(Failure::failed(error)),
        }
        // An arm that still swings, or a picture from before it stood, would be a capture in motion.
        cell.arm().settle(&SettleOptions::default(), cancel).map_err(Failure::failed)?;
        let frame = cell.grab().map_err(Failure::failed)?;
        store(session, &frame, name)?;
        record::capture(recorder, &info, index as u64 + 1, frame, session);
        tracing::info!("pose {} of {} captured ({name})", index + 1, plan.goals.len());
    }
    Ok(())
}

fn store(session: &mut Store, frame: &Frame, pose_name: &str) -> Result<(), Failure> {
    session
        .add_capture(&Capture {
            depth_m: Some(&frame.depth),
            joints_rad: Some(&frame.joints),
            sim_time_s: Some(frame.sim_time_s),
            pose_name: Some(pose_name),
            ..Capture::new(&frame.rgb, frame.base_from_tip)
        })
        .map_err(Failure::failed)?;
    Ok(())
}
