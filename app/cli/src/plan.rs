//! `handeye plan`: which poses would lower the expected error of a session or dataset folder most.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{Promise, calibrate_with};
use handeye_estimate::handeye::HandEyeError;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_estimate::{CalibrateError, Method, Options};
use handeye_geometry::frames::{Frame, Pose};
use handeye_plan::guided::choose::Proposal;
use handeye_plan::guided::{Guide, GuidedOptions, Known, Next, Why};
use serde::Serialize;

use super::output::Output;
use crate::{Failure, box_arg, out, solve};
use handeye_workbench::arguments::heading;

/// The error of the distance from a tool to a point of the board, with uncorrected commands and with corrected ones.
const REACH: &str = "reach";
const REACH_CORRECTED: &str = "reach_corrected";

/// Options of `handeye plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Session or dataset folder: images, a pose table and dataset.toml.
    path: PathBuf,
    /// How many poses to propose.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=50), help_heading = heading::POSES)]
    count: u32,
    /// Seed of the random views that are compared.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = heading::POSES)]
    seed: u64,
    /// Where the tool works, in the camera (x right, y down, z forward): centre and edges, metres. Errors are then those of
    /// the worst point of it; without it those where the camera saw the board.
    #[arg(long = "box", value_name = "X,Y,Z,DX,DY,DZ", value_parser = box_arg::tool_box, allow_hyphen_values = true, help_heading = heading::POSES)]
    tool_box: Option<TipBox>,
    /// Write the poses as JSON to this file; `-` for standard output instead of the table.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
}

/// The next poses.
#[derive(Debug, Serialize)]
struct PlanDocument {
    format: &'static str,
    version: u32,
    /// What the errors refer to, if the joints of the arm are known: `reach_corrected`, the distance from a tool to a point of the
    /// board with corrected commands, or `reach`, with uncorrected commands if correcting brings the tool no nearer. Else `point`,
    /// a measured point, from the noise alone.
    error_of: &'static str,
    /// The error now, 95 %, millimetres.
    error_mm: f64,
    poses: Vec<PlannedPose>,
}

#[derive(Debug, Serialize)]
struct PlannedPose {
    base_from_tip: Transform,
    camera_from_target: Transform,
    /// Expected error with this pose and those before it, 95 %, millimetres.
    error_mm: f64,
}

#[derive(Debug, Serialize)]
struct Transform {
    translation_m: [f64; 3],
    rotation_xyzw: [f64; 4],
}

impl<Dst: Frame, Src: Frame> From<&Pose<Dst, Src>> for Transform {
    fn from(pose: &Pose<Dst, Src>) -> Self {
        Self { translation_m: pose.translation().into(), rotation_xyzw: pose.xyzw() }
    }
}

/// Prints the poses. Whether the path to them is free is not known here.
pub fn run(args: &PlanArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let seen = solve::read(&args.path, &cancel)?.seen;
    let observations = seen.observations;
    let wanted = FindingOptions::default().with_arm(seen.arm.as_ref()).with_robot_accuracy(seen.robot_accuracy);
    let solved = calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &cancel);
    let calibration = solved.map_err(|error| match error {
        CalibrateError::HandEye(HandEyeError::Cancelled) => Failure::failed(error),
        error => solve::unsolved(error, &args.path, &observations, &cancel),
    })?;
    if calibration.hand_eye.is_none() || calibration.joint.is_none() {
        return Err(Failure::unusable(anyhow::anyhow!(
            "poses are planned for a robot and a camera: {} has no robot poses, or no corners",
            args.path.display()
        )));
    }
    let options = GuidedOptions {
        // Poses are requested, however good the answer is.
        goal_m: 0.0,
        least_gain: 0.0,
        most_views: usize::MAX,
        ahead: args.count as usize,
        seed: args.seed,
        tool_box: args.tool_box,
        ..GuidedOptions::default()
    };
    let known = Known { observations: &observations, calibration: Some(&calibration), robot: None, elapsed_s: 0.0 };
    let mut guide = Guide::new(options);
    let next = guide.next(&known, &cancel);
    if cancel.is_cancelled() {
        return Err(Failure::failed(HandEyeError::Cancelled));
    }
    let plan = match next {
        Next::Go { plan, why: Why::Gain { .. } } => plan,
        Next::Go { .. } | Next::End(_) => {
            return Err(undetermined(&args.path));
        }
    };
    let expected = |ratio: f64| guide.expected_m(&known, ratio).ok_or_else(|| undetermined(&args.path));
    let pose = |proposal: &Proposal| -> Result<PlannedPose, Failure> {
        Ok(PlannedPose {
            base_from_tip: (&proposal.base_from_tip).into(),
            camera_from_target: (&proposal.camera_from_target).into(),
            error_mm: expected(proposal.error_ratio)?.0 * 1e3,
        })
    };
    let poses = plan.proposals.iter().map(pose).collect::<Result<_, _>>()?;
    let (error_m, of) = expected(1.0)?;
    let error_of = match of {
        Promise::Point => "point",
        Promise::Reach | Promise::ReachByAccuracy => REACH,
        Promise::ReachCorrected => REACH_CORRECTED,
    };
    let document = PlanDocument { format: "handeye-plan", version: 1, error_of, error_mm: error_m * 1e3, poses };
    if let Some(output) = &args.json {
        let text = serde_json::to_string_pretty(&document).map_err(Failure::failed)?;
        output.write(format!("{text}\n").as_bytes())?;
    }
    if args.json.as_ref().is_some_and(Output::is_standard) { Ok(()) } else { out::print(&table(&document)) }
}

fn undetermined(folder: &Path) -> Failure {
    Failure::failed(anyhow::anyhow!(
        "the views of {} do not determine an answer that poses could be planned from; `handeye doctor` says why",
        folder.display()
    ))
}

fn table(document: &PlanDocument) -> String {
    let (what, reached) = match document.error_of {
        REACH_CORRECTED => ("a tool arrives now, by corrected commands, within", "whether the way there is free"),
        REACH => ("a tool arrives now within", "whether the way there is free"),
        _ => ("expected error now, by the noise alone:", "whether the arm reaches them"),
    };
    let mut text = format!("{what} {:.3} mm (95 %)\n", document.error_mm);
    let _written = writeln!(text, "poses of the tip in the base; {reached} is not checked");
    text += "      x [mm]    y [mm]    z [mm]       qx       qy       qz       qw   then [mm]\n";
    for (index, pose) in document.poses.iter().enumerate() {
        let [x, y, z] = pose.base_from_tip.translation_m.map(|m| m * 1e3);
        let [qx, qy, qz, qw] = pose.base_from_tip.rotation_xyzw;
        // Writing to a string cannot fail.
        let _written = writeln!(
            text,
            "{:2} {x:9.1} {y:9.1} {z:9.1} {qx:8.4} {qy:8.4} {qz:8.4} {qw:8.4} {:11.3}",
            index + 1,
            pose.error_mm
        );
    }
    text
}
