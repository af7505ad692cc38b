//! The corrected arm as rows of Denavit and Hartenberg, with Hayati's angle where the next axis is nearly parallel.
//!
//! `base_from_tip = Π Rz(q + theta_offset) · Tz(d) · Tx(a) · Rx(alpha) · Ry(beta)` over all rows, with `q` the value of the row's
//! joint and 0 in the rows `base` and `tip`, which are what is fixed at both ends. The row of a joint leads to the axis of the next
//! one: along the common normal, or, where the two are nearly parallel and that is anywhere, from one axis to the other across (`d`
//! 0) and then by two small angles.
//!
//! Source: Hayati & Mirmirani 1985, "Improving the absolute positioning accuracy of robot manipulators".

use std::fmt::Write as _;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::corrected::{CorrectedChain, about_arm, frames_at_zero};
use super::text::{compare_isometry, compare_numbers, compare_text, number, parse_number};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_arm::Arm;
use handeye_wording::Text;

pub(super) struct DhTable;

const HEADER: &str = "joint,a_m,alpha_rad,d_m,theta_offset_rad,beta_rad";
/// Sine of the angle between two axes below which they are nearly parallel: six degrees, far from the quarter turns and the
/// errors of arms.
const PARALLEL: f64 = 0.1;
/// Distance \[m\] across below which an axis goes on in the one before it.
const SAME_LINE_M: f64 = 1e-12;

/// A row: what follows the turn of its joint.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    a_m: f64,
    alpha_rad: f64,
    d_m: f64,
    theta_offset_rad: f64,
    beta_rad: f64,
}

impl Row {
    fn numbers(&self) -> [f64; 5] {
        [self.a_m, self.alpha_rad, self.d_m, self.theta_offset_rad, self.beta_rad].map(|value| value + 0.0)
    }

    fn of_numbers([a_m, alpha_rad, d_m, theta_offset_rad, beta_rad]: [f64; 5]) -> Self {
        Self { a_m, alpha_rad, d_m, theta_offset_rad, beta_rad }
    }

    fn at(&self, value: f64) -> Isometry3<f64> {
        let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
        let turn = about(Vector3::z_axis(), value + self.theta_offset_rad);
        let link = about(Vector3::x_axis(), self.alpha_rad) * about(Vector3::y_axis(), self.beta_rad);
        let link = Isometry3::from_parts(Translation3::new(self.a_m, 0.0, self.d_m), link);
        Isometry3::from_parts(Translation3::identity(), turn) * link
    }

    /// To a frame whose z axis is that of `next`, both in the frame before the row. `is_last` has `d` go along to the next origin
    /// where it may go anywhere.
    fn to_axis(next: &Isometry3<f64>, is_last: bool) -> Self {
        let (point, z) = (next.translation.vector, next.rotation * Vector3::z());
        if z.x.hypot(z.y) < PARALLEL {
            return Self::across(&point, &z, is_last);
        }
        // Along the common normal, in whichever direction takes the smaller turn.
        let normal = Vector3::new(-z.y, z.x, 0.0).normalize();
        let normal = if normal.x < 0.0 { -normal } else { normal };
        let theta_offset_rad = normal.y.atan2(normal.x);
        let side = Vector3::z().cross(&normal);
        let a_m = point.dot(&normal);
        // Distance along the next axis of the foot of the normal from its point.
        let along = -point.dot(&side) / z.dot(&side);
        let alpha_rad = (-z.dot(&side)).atan2(z.z);
        Self { a_m, alpha_rad, d_m: point.z + along * z.z, theta_offset_rad, beta_rad: 0.0 }
    }

    /// From one axis to one that is nearly parallel: to where that crosses the plane at `d`.
    fn across(point: &Vector3<f64>, z: &Vector3<f64>, is_last: bool) -> Self {
        let d_m = if is_last { point.z } else { 0.0 };
        let crossing = point + z * ((d_m - point.z) / z.z);
        let distance = crossing.x.hypot(crossing.y);
        let sign = if crossing.x < 0.0 { -1.0 } else { 1.0 };
        let is_one = distance < SAME_LINE_M;
        let theta_offset_rad = if is_one { 0.0 } else { (sign * crossing.y).atan2(sign * crossing.x) };
        let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -theta_offset_rad);
        let z = back * z;
        let beta_rad = z.x.clamp(-1.0, 1.0).asin();
        let a_m = if is_one { 0.0 } else { sign * distance };
        Self { a_m, alpha_rad: (-z.y).atan2(z.z), d_m, theta_offset_rad, beta_rad }
    }
}

/// Rows with what they are called.
fn rows(arm: &Arm) -> Vec<(String, Row)> {
    let (axes, tip) = frames_at_zero(arm);
    let names = (1..=axes.len()).map(|joint| joint.to_string());
    let names: Vec<String> = std::iter::once("base".to_owned()).chain(names).collect();
    let last = axes.len();
    let mut base_from_row = Isometry3::identity();
    let mut found = Vec::with_capacity(names.len() + 1);
    for (at, (next, name)) in axes.iter().chain([&tip]).zip(names).enumerate() {
        let row = Row::to_axis(&(base_from_row.inverse() * next), at == last);
        base_from_row *= row.at(0.0);
        found.push((name, row));
    }
    // On the z axis of the tip already: a rotation about it and a shift along it remain.
    let rest = base_from_row.inverse() * tip;
    let x = rest.rotation * Vector3::x();
    let row = Row::of_numbers([0.0, 0.0, rest.translation.z, x.y.atan2(x.x), 0.0]);
    found.push(("tip".to_owned(), row));
    found
}

fn forward(rows: &[Row], joints: &[f64]) -> Isometry3<f64> {
    let values = std::iter::once(&0.0).chain(joints).chain(std::iter::once(&0.0));
    rows.iter().zip(values).fold(Isometry3::identity(), |before, (row, value)| before * row.at(*value))
}

/// Joint values at which a table is multiplied out again.
fn compared_at(joints: usize) -> [Vec<f64>; 2] {
    [0.7, 2.9].map(|by| (0..joints).map(|joint| 2.5 * (by * (joint as f64 + 1.0)).sin()).collect())
}

impl Format for DhTable {
    fn name(&self) -> &'static str {
        "dh_table"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("rows of Denavit and Hartenberg of the corrected arm, with Hayati's angle (CSV)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let arm = CorrectedChain::of(input, self.name())?.corrected;
        let words = "no Euler angles: the product over all rows of Rz(q + theta_offset) Tz(d) Tx(a) Rx(alpha) Ry(beta), radians, q \
                     the joint's value and 0 in base and tip";
        let mut text = format!(
            "# {}\n{HEADER}\n",
            about_arm(input, [&input.names.base_frame, &input.names.effector_frame], words)
        );
        for (name, row) in rows(&arm) {
            let _infallible = writeln!(text, "{name},{}", row.numbers().map(number).join(","));
        }
        Ok(vec![ExportFile::new(format!("{}_dh.csv", input.names.calibration), text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let arm = CorrectedChain::of(input, self.name()).map_err(|e| e.to_string())?.corrected;
        let mut lines = file.text.lines().filter(|line| !line.starts_with('#'));
        compare_text("the header", lines.next().unwrap_or_default(), HEADER)?;
        let expected = rows(&arm);
        let mut read = Vec::with_capacity(expected.len());
        for (name, row) in &expected {
            let line = lines.next().ok_or_else(|| format!("no row {name}"))?;
            let (got, rest) = line.split_once(',').unwrap_or((line, ""));
            compare_text("a row's name", got, name)?;
            let numbers = rest.split(',').map(|word| parse_number(name, word)).collect::<Result<Vec<_>, _>>()?;
            compare_numbers(name, &numbers, &row.numbers())?;
            read.extend(<[f64; 5]>::try_from(numbers).map(Row::of_numbers));
        }
        if let Some(line) = lines.next() {
            return Err(format!("{line:?} does not belong there"));
        }
        for joints in compared_at(arm.joint_count()) {
            let own = arm.forward(&joints).map_err(|e| e.to_string())?;
            compare_isometry("the product of the rows", &forward(&read, &joints), own.isometry())?;
        }
        Ok(())
    }
}
