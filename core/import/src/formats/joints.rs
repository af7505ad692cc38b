//! Joint values without poses: MoveIt's joint states, lists and files of them. A chain makes poses of them.

use std::sync::Arc;

use super::tree::{self, LEAST_POSES};
use crate::conventions::AngleUnit;
use crate::recording::{JointSample, JointSeries, Known};
use crate::value::Value;
use handeye_wording::Text;
use handeye_wording::text;

/// Joints of the largest robots that are calibrated.
const MOST_JOINTS: usize = 64;
/// Numbers of a row without names that may be joint values, with one that counts before them.
const ROW: std::ops::RangeInclusive<usize> = 4..=16;

/// The joint values of a document, if it has any.
pub(super) fn of_document(value: &Value, file: &str) -> Option<JointSeries> {
    moveit(value, file).or_else(|| listed(value, file))
}

/// `joint_names` with rows of `joint_values`, as MoveIt calibration saves its robot states.
fn moveit(value: &Value, file: &str) -> Option<JointSeries> {
    let joints: Vec<String> =
        value.get("joint_names")?.list().iter().map(|name| name.text().map(str::to_owned)).collect::<Option<_>>()?;
    let rows = value.get("joint_values")?.list();
    let samples = rows.iter().enumerate().filter_map(|(i, row)| {
        let values = row.numbers(MOST_JOINTS).filter(|values| values.len() == joints.len())?;
        Some(sample(text!("{file}, joint state {number}", file = file, number = i + 1), None, None, values))
    });
    let unit = Some(Known::by("MoveIt writes radians", AngleUnit::Radian));
    let samples = samples.collect();
    series(file.to_owned(), joints, unit, samples)
}

/// A list of values with names of joints, of things that have joint values and no pose, or a list that is called so.
fn listed(value: &Value, file: &str) -> Option<JointSeries> {
    let (name, items) = match value {
        Value::List(items) => (file.to_owned(), items),
        Value::Map(entries) => entries.iter().find_map(|(key, inner)| match inner {
            Value::List(items) if items.len() >= LEAST_POSES => {
                let has = tree::is_about_joints(key) || items.iter().all(|item| !tree::fields(item).joints.is_empty());
                has.then(|| (tree::track_name(file, key), items))
            }
            _ => None,
        })?,
        _ => return None,
    };
    let rows_are_joints = matches!(value, Value::Map(_));
    let samples = items.iter().enumerate().filter_map(|(i, item)| {
        let fields = tree::fields(item);
        let values = match item {
            Value::List(_) if rows_are_joints => item.numbers(MOST_JOINTS)?,
            _ if fields.poses.is_empty() && !fields.joints.is_empty() => fields.joints,
            _ => return None,
        };
        let place = text!("{file}, entry {entry}", file = file, entry = i + 1);
        Some(sample(place, fields.image, fields.number, values))
    });
    series(name, Vec::new(), None, samples.collect())
}

/// Rows of numbers without names, each with its image, its number and its place, as possible joint values.
pub(crate) fn unnamed(
    name: &str,
    rows: impl Iterator<Item = (Option<String>, Option<u64>, Text, Vec<f64>)>,
) -> Option<JointSeries> {
    let samples = rows.filter(|(.., numbers)| ROW.contains(&numbers.len()));
    series(
        name.to_owned(),
        Vec::new(),
        None,
        samples.map(|(image, n, place, row)| sample(place, image, n, row)).collect(),
    )
}

pub(crate) fn sample(place: Text, image: Option<String>, number: Option<u64>, values: Vec<f64>) -> JointSample {
    JointSample { image, number, place: Arc::new(place), values }
}

/// A series of samples with as many values each; `None` when too few are left.
pub(crate) fn series(
    name: String,
    joints: Vec<String>,
    unit: Option<Known<AngleUnit>>,
    mut samples: Vec<JointSample>,
) -> Option<JointSeries> {
    let count = samples.first()?.values.len();
    samples.retain(|sample| sample.values.len() == count && sample.values.iter().all(|value| value.is_finite()));
    (samples.len() >= LEAST_POSES).then_some(JointSeries { name, joints, unit, samples })
}
