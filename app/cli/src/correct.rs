//! `handeye correct`: what to command so that the tip gets to the goal, given the errors of the arm that a calibration found.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;
use handeye_dataset::correct_table::CorrectTable;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_workbench::arguments::heading;
use serde::Serialize;

use super::export::read_result;
use super::output::Output;
use crate::{Failure, out};

/// At the end of its help.
pub const EXAMPLES: &str = "Examples:
  handeye correct result.json wanted.csv --out commands.csv
  handeye correct result.json reported.csv --from-reported --out real.csv
  handeye correct result.json - --json -";

/// Name of the table in messages when it is read from there.
const STANDARD_INPUT: &str = "standard input";

/// Options of `handeye correct`.
#[derive(Debug, Args)]
pub struct CorrectArgs {
    /// Solved session or dataset (a folder with result.json or calibration.json), or a result JSON, of an arm whose joints are
    /// known.
    calibration: PathBuf,
    /// CSV with a row for each pose that the tip should reach: x,y,z,qx,qy,qz,qw in the base, metres; q1,q2,… may follow, joint
    /// values in radians near which the arm should be. `-` for standard input.
    table: PathBuf,
    /// The rows are joint values q1,q2,… instead, radians, and the answer is where the tip really is.
    #[arg(long, help_heading = heading::POSES)]
    from_reported: bool,
    /// Write the answer to this file instead of standard output.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    out: Option<Output>,
    /// Write the answer as JSON to this file; `-` for standard output instead of the table.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
}

/// The answer for a row.
#[derive(Debug, Serialize)]
struct Answer {
    joints_rad: Vec<f64>,
    translation_m: [f64; 3],
    rotation_xyzw: [f64; 4],
    error_95_mm: f64,
}

impl Answer {
    fn new(joints_rad: Vec<f64>, pose: &Pose<Base, Tip>, error_95_m: f64) -> Self {
        let (translation_m, rotation_xyzw) = (pose.translation().into(), pose.xyzw());
        Self { joints_rad, translation_m, rotation_xyzw, error_95_mm: error_95_m * 1e3 }
    }
}

/// Writes the answers: joint values, the pose from the controller's own kinematics (with `--from-reported` the real one), and the
/// largest expected error of the tip. Moves nothing.
pub fn run(args: &CorrectArgs) -> Result<(), Failure> {
    let json_is_printed = args.json.as_ref().is_some_and(Output::is_standard);
    if json_is_printed && args.out.as_ref().is_some_and(Output::is_standard) {
        return Err(Failure::unusable(anyhow!("--json and --out both go to standard output: give one of them a file")));
    }
    let result = read_result(&args.calibration)?;
    let arm = result.arm.as_ref().ok_or_else(|| {
        Failure::unusable(anyhow!(
            "{} knows no errors of an arm: calibrate with the arm (`[robot.arm]` in dataset.toml, or a cell that says which it is) and \
             joint values in every row",
            args.calibration.display()
        ))
    })?;
    if arm.contradicted {
        tracing::warn!(
            "views left out of the calibration are predicted worse by corrected poses than by reported ones: do not use these \
             commands before more views agree with them"
        );
    }
    let corrected = arm.corrected_arm().map_err(Failure::unusable)?;
    let answers = if args.from_reported { actual(&corrected, args)? } else { commands(&corrected, args)? };
    if let Some(output) = &args.json {
        let text = serde_json::to_string_pretty(&answers).map_err(Failure::failed)?;
        output.write((text + "\n").as_bytes())?;
    }
    match &args.out {
        Some(output) => output.write(table(&answers, corrected.arm.joint_count()).as_bytes()),
        None if json_is_printed => Ok(()),
        None => out::print(&table(&answers, corrected.arm.joint_count())),
    }
}

fn is_standard(args: &CorrectArgs) -> bool {
    args.table == Path::new("-")
}

fn read(args: &CorrectArgs) -> Result<CorrectTable, Failure> {
    let table = if is_standard(args) {
        CorrectTable::of_reader(Path::new(STANDARD_INPUT), std::io::stdin().lock())
    } else {
        CorrectTable::open(&args.table)
    };
    table.map_err(Failure::unusable)
}

/// An error of a row.
fn at(args: &CorrectArgs, line: usize, error: impl std::fmt::Display) -> Failure {
    let name = if is_standard(args) { Path::new(STANDARD_INPUT) } else { &args.table };
    Failure::unusable(anyhow!("{}, row {line}: {error}", name.display()))
}

fn commands(corrected: &CorrectedArm, args: &CorrectArgs) -> Result<Vec<Answer>, Failure> {
    let mut near = corrected.middle_rad();
    let mut answers = Vec::new();
    for wanted in read(args)?.wanted(corrected.arm.joint_count()).map_err(Failure::unusable)? {
        near = wanted.near_rad.unwrap_or(near);
        let command = corrected.command(&wanted.base_from_tip, &near).map_err(|error| at(args, wanted.line, error))?;
        near.clone_from(&command.joints_rad);
        answers.push(Answer::new(command.joints_rad, &command.base_from_tip, command.error_95_m));
    }
    Ok(answers)
}

fn actual(corrected: &CorrectedArm, args: &CorrectArgs) -> Result<Vec<Answer>, Failure> {
    let mut answers = Vec::new();
    for (line, joints_rad) in read(args)?.joint_values(corrected.arm.joint_count()).map_err(Failure::unusable)? {
        let pose = corrected.actual(&joints_rad).map_err(|error| at(args, line, error))?;
        let error_95_m = corrected.error_95_m(&joints_rad).map_err(|error| at(args, line, error))?;
        answers.push(Answer::new(joints_rad, &pose, error_95_m));
    }
    Ok(answers)
}

fn table(answers: &[Answer], joints: usize) -> String {
    let joints = (1..=joints).map(|joint| format!("q{joint}"));
    let rest = ["x", "y", "z", "qx", "qy", "qz", "qw", "error_95_mm"].map(str::to_owned);
    let mut text = joints.chain(rest).collect::<Vec<_>>().join(",") + "\n";
    for answer in answers {
        for value in answer.joints_rad.iter().chain(&answer.translation_m).chain(&answer.rotation_xyzw) {
            // A nanometre and a nanoradian, and no minus sign before zero.
            let _infallible = write!(text, "{:.9},", value + 0.0);
        }
        let _infallible = writeln!(text, "{:.3}", answer.error_95_mm);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(path: &std::path::Path) -> Vec<f64> {
        let text = std::fs::read_to_string(path).expect("an answer");
        let row = text.lines().nth(1).expect("a row");
        row.split(',').map(|word| word.parse().expect("a number")).collect()
    }

    #[test]
    fn the_joints_of_a_command_take_the_tip_where_it_was_wanted_and_what_is_wrong_names_its_row() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let result = handeye_result::testing::golden();
        std::fs::write(at("result.json"), result.to_json().expect("plain data")).expect("written");
        let arm = result.arm.as_ref().expect("golden").corrected_arm().expect("an arm");
        let tip = arm.arm.forward(&[0.3, -1.3, 1.7, -1.9, -1.6, 0.4]).expect("six joints");
        let (t, [qx, qy, qz, qw]) = (tip.translation(), tip.xyzw());
        let wanted = format!(
            "x,y,z,qx,qy,qz,qw,q1,q2,q3,q4,q5,q6\n{},{},{},{qx},{qy},{qz},{qw},0.3,-1.3,1.7,-1.9,-1.6,0.4\n",
            t.x, t.y, t.z
        );
        std::fs::write(at("wanted.csv"), &wanted).expect("written");
        let arguments = |table: &str, from_reported: bool, out: &str| CorrectArgs {
            calibration: at("result.json"),
            table: at(table),
            from_reported,
            out: Some(at(out).into_os_string().into()),
            json: Some(at(&format!("{out}.json")).into_os_string().into()),
        };
        run(&arguments("wanted.csv", false, "commands.csv")).expect("within reach");
        let command = numbers(&at("commands.csv"));
        assert_eq!(command.len(), 6 + 7 + 1);
        assert!((command[6] - t.x).abs() > 1e-5, "the errors are seen");
        let json = std::fs::read_to_string(at("commands.csv.json")).expect("an answer");
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(json.as_array().map(Vec::len), Some(1));
        let number = |path: &str| json.pointer(path).and_then(serde_json::Value::as_f64).expect(path);
        let paths = (0..6).map(|i| format!("/0/joints_rad/{i}")).chain((0..3).map(|i| format!("/0/translation_m/{i}")));
        let paths = paths.chain((0..4).map(|i| format!("/0/rotation_xyzw/{i}")));
        for (path, value) in paths.zip(&command) {
            assert!((number(&path) - value).abs() < 1e-9, "{path}: {json}");
        }
        assert!((number("/0/error_95_mm") - command[13]).abs() < 1e-3, "{json}");
        let joints: Vec<String> = command[..6].iter().map(f64::to_string).collect();
        std::fs::write(at("reported.csv"), format!("q1,q2,q3,q4,q5,q6\n{}\n", joints.join(","))).expect("written");
        run(&arguments("reported.csv", true, "real.csv")).expect("joints");
        let real = numbers(&at("real.csv"));
        for (a, b) in real[6..9].iter().zip(t.iter()) {
            assert!((a - b).abs() < 1e-8, "{real:?} {t}");
        }
        std::fs::write(at("far.csv"), wanted.replacen(&format!("\n{}", t.x), "\n9", 1)).expect("written");
        let error = run(&arguments("far.csv", false, "none.csv")).expect_err("out of reach");
        assert!(format!("{error}").contains("far.csv, row 2"), "{error}");
        assert!(!at("none.csv").exists() && !at("none.csv.json").exists());
        let both = CorrectArgs {
            out: Some(std::ffi::OsString::from("-").into()),
            json: Some(std::ffi::OsString::from("-").into()),
            ..arguments("wanted.csv", false, "none.csv")
        };
        let error = run(&both).expect_err("one standard output");
        assert!(format!("{error}").contains("give one of them a file"), "{error}");
    }
}
