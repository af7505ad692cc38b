//! Commands of ROS's `static_transform_publisher`, as shell scripts.
//!
//! ROS 2 has flags (Humble and later); ROS 1's `tf2_ros` has nine positional arguments with a quaternion. Comments have
//! the older positional forms with Euler angles, whose order is yaw, pitch, roll: URDF's backwards.
//! Source: `parse_args` in `tf2_ros/src/static_transform_broadcaster_program.cpp` (geometry2) and the usage texts of
//! ROS 1's `tf2_ros` and `tf`.

use nalgebra::{Isometry3, Translation3};

use super::input::NamedTransform;
use super::text::{
    Rotation, about_transform, compare_isometry, compare_numbers, compare_text, number, parse_exactly, spaced,
};
use super::{ExportError, ExportFile, ExportInput, Format, rotation};
use handeye_wording::Text;

/// `ros2 run tf2_ros static_transform_publisher` with flags.
pub(super) struct Ros2;

/// `rosrun tf2_ros static_transform_publisher` with positions.
pub(super) struct Ros1;

const FLAGS: [&str; 7] = ["--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw"];
/// How often ROS 1's `tf` sends the transform again.
const PERIOD_MS: f64 = 100.0;

fn numbers_of(transform: &NamedTransform<'_>) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (transform.translation(), transform.xyzw());
    [x, y, z, qx, qy, qz, qw]
}

/// `x y z yaw pitch roll parent child`.
fn yaw_pitch_roll(transform: &NamedTransform<'_>) -> String {
    let ([x, y, z], [roll, pitch, yaw]) = (transform.translation(), transform.rpy());
    format!("{} {} {}", spaced(&[x, y, z, yaw, pitch, roll]), transform.parent, transform.child)
}

fn script(transform: &NamedTransform<'_>, input: &ExportInput<'_>, body: &str) -> String {
    let about = about_transform(transform, "Metres", Rotation::QuaternionAndRpy, input.result);
    format!("#!/bin/sh\n# {about}\n{body}")
}

/// What follows `command` in its line.
fn arguments<'a>(text: &'a str, command: &str) -> Result<&'a str, String> {
    let mut found = text.lines().filter_map(|line| line.strip_prefix(command)?.strip_prefix(' '));
    let rest = found.next().ok_or_else(|| format!("no line {command:?}"))?;
    if found.next().is_some() { Err(format!("more than one line {command:?}")) } else { Ok(rest) }
}

/// Splits the last `count` words off.
fn frames(arguments: &str, count: usize) -> Result<(String, Vec<&str>), String> {
    let words: Vec<&str> = arguments.split_whitespace().collect();
    let at = words.len().checked_sub(count).ok_or_else(|| format!("too few arguments in {arguments:?}"))?;
    Ok((words[..at].join(" "), words[at..].to_vec()))
}

fn compare_names(got: &[&str], transform: &NamedTransform<'_>) -> Result<(), String> {
    compare_text("the parent frame", got[0], transform.parent)?;
    compare_text("the child frame", got[1], transform.child)
}

/// Compares `x y z yaw pitch roll parent child` as the publisher takes it.
fn compare_yaw_pitch_roll(arguments: &str, transform: &NamedTransform<'_>) -> Result<(), String> {
    let (numbers, names) = frames(arguments, 2)?;
    let [x, y, z, yaw, pitch, roll] = parse_exactly("x y z yaw pitch roll", &numbers)?;
    let got = Isometry3::from_parts(Translation3::new(x, y, z), rotation::from_rpy([roll, pitch, yaw]));
    compare_isometry("the transform with yaw, pitch, roll", &got, &transform.isometry)?;
    compare_names(&names, transform)
}

impl Format for Ros2 {
    fn name(&self) -> &'static str {
        "static_transform_ros2"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("shell script that publishes the hand-eye on tf (ROS 2, Humble and later)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let words: Vec<String> =
            FLAGS.iter().zip(numbers_of(&transform)).map(|(flag, v)| format!("{flag} {}", number(v))).collect();
        let body = format!(
            "# Before Humble, and deprecated: x y z YAW PITCH ROLL parent child, which is not the order of URDF's rpy.\n\
             # ros2 run tf2_ros static_transform_publisher {}\n\
             exec ros2 run tf2_ros static_transform_publisher {} \\\n  {} \\\n  --frame-id {} --child-frame-id {}\n",
            yaw_pitch_roll(&transform),
            words[..3].join(" "),
            words[3..].join(" "),
            transform.parent,
            transform.child,
        );
        Ok(vec![ExportFile::new("static_transform_ros2.sh", script(&transform, input, &body))])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let text = file.text.replace("\\\n", " ");
        let words = arguments(&text, "exec ros2 run tf2_ros static_transform_publisher")?;
        let words: Vec<&str> = words.split_whitespace().collect();
        let value = |flag: &str| {
            let at = words.iter().position(|word| *word == flag).ok_or_else(|| format!("no {flag}"))?;
            words.get(at + 1).copied().ok_or_else(|| format!("nothing behind {flag}"))
        };
        let numbers = FLAGS.iter().map(|flag| value(flag)).collect::<Result<Vec<_>, _>>()?.join(" ");
        compare_numbers("the flags", &parse_exactly::<7>("the flags", &numbers)?, &numbers_of(&transform))?;
        compare_names(&[value("--frame-id")?, value("--child-frame-id")?], &transform)?;
        let count = words.len();
        if count != 2 * (FLAGS.len() + 2) {
            return Err(format!("{count} words behind the command"));
        }
        compare_yaw_pitch_roll(arguments(&text, "# ros2 run tf2_ros static_transform_publisher")?, &transform)
    }
}

impl Format for Ros1 {
    fn name(&self) -> &'static str {
        "static_transform_ros1"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("shell script that publishes the hand-eye on tf (ROS 1)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.published(self.name())?;
        let body = format!(
            "# The older package tf: x y z YAW PITCH ROLL parent child PERIOD_MS, which is not the order of URDF's rpy.\n\
             # rosrun tf static_transform_publisher {} {}\n\
             exec rosrun tf2_ros static_transform_publisher {} {} {}\n",
            yaw_pitch_roll(&transform),
            PERIOD_MS,
            spaced(&numbers_of(&transform)),
            transform.parent,
            transform.child,
        );
        Ok(vec![ExportFile::new("static_transform_ros1.sh", script(&transform, input, &body))])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.published(self.name()).map_err(|e| e.to_string())?;
        let (numbers, names) = frames(arguments(&file.text, "exec rosrun tf2_ros static_transform_publisher")?, 2)?;
        compare_numbers("x y z qx qy qz qw", &parse_exactly::<7>("the arguments", &numbers)?, &numbers_of(&transform))?;
        compare_names(&names, &transform)?;
        let (older, period) = frames(arguments(&file.text, "# rosrun tf static_transform_publisher")?, 1)?;
        compare_numbers("the period", &parse_exactly::<1>("the period", period[0])?, &[PERIOD_MS])?;
        compare_yaw_pitch_roll(&older, &transform)
    }
}
