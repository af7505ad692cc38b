//! Poses out of joint values, where a recording has no others and the chain of the arm is known.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::conventions::{Direction, LengthUnit, angles_for};
use super::error::{ImportError, reasons};
use super::formats::tree;
use super::recording::{JointSeries, Known, Numbers, Recording, Role, Sample, Stated, Track};
use handeye_arm::urdf::Urdf;
use handeye_arm::{Arm, ArmKind, JointKind};
use handeye_files::bounds::Bounds;
use handeye_wording::Text;
use handeye_wording::text;

/// Joint names of Universal Robots in ROS, from the base to the tip. Messages have them in alphabetical order.
const ROS_NAMES_OF_UR: [&str; 6] =
    ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"];

/// A recording with poses of the arm in place of joint values. Recorded poses of a robot are removed: naming the arm selects
/// those of its chain.
///
/// `arm` is the name of one that is built in, or a URDF file, followed by `,base=LINK` and `,tip=LINK` where the file leaves a
/// choice. A relative path is searched from the working directory, and then in the recording.
///
/// # Errors
/// [`ImportError::Arm`].
pub fn with_arm(recording: &Recording, arm: &str) -> Result<Recording, ImportError> {
    let fail = |why: Text| ImportError::Arm { arm: arm.to_owned(), why };
    let chain = Chain::of(arm, &recording.root, &recording.bounds).map_err(fail)?;
    let is_of_arm = |series: &JointSeries| chain.row_of(series).is_some();
    // Joint values with names are unambiguous; numbers without names are used only where there are no others.
    let (named, rows): (Vec<_>, Vec<_>) =
        (recording.joints.iter().collect(), recording.rows.iter().filter(|s| is_of_arm(s)).collect());
    if named.is_empty() && rows.is_empty() {
        let count = chain.arm.joint_count();
        return Err(fail(text!(
            "there are no joint values in this recording, nor rows of {count} numbers: leave `arm` out",
            count = count
        )));
    }
    let mut out = recording.clone();
    out.tracks.retain(|track| track.role == Role::Target);
    let mut troubles = Vec::new();
    let mut is_found = false;
    for (series, is_named) in named.into_iter().map(|s| (s, true)).chain(rows.into_iter().map(|s| (s, false))) {
        if !is_named && is_found {
            break;
        }
        match chain.tracks(series) {
            Ok(tracks) => {
                out.beliefs.extend(chain.left_out(series));
                out.tracks.extend(tracks);
                is_found |= is_named;
            }
            Err(why) => troubles.push(why),
        }
    }
    if out.tracks.iter().all(|track| track.role == Role::Target) {
        return Err(fail(reasons(troubles)));
    }
    out.beliefs.push(text!("poses are computed from joint values by the chain of {arm}", arm = &chain.name));
    out.warnings.extend(troubles);
    Ok(out)
}

struct Chain {
    /// Name in messages.
    name: String,
    arm: Arm,
    /// Names of its joints in files, from the base to the tip; one of these lists.
    joint_names: Vec<Vec<String>>,
}

impl Chain {
    fn of(text: &str, root: &Path, bounds: &Bounds) -> Result<Self, Text> {
        let own = |arm: &Arm| -> Vec<String> { arm.joints().iter().map(|joint| joint.name.clone()).collect() };
        if let Some(kind) = ArmKind::ALL.into_iter().find(|kind| kind.name() == text) {
            let arm = kind.arm();
            let ros = ROS_NAMES_OF_UR.map(str::to_owned).to_vec();
            return Ok(Self { name: kind.name().to_owned(), joint_names: vec![own(&arm), ros], arm });
        }
        let mut parts = text.split(',');
        let file = parts.next().unwrap_or_default();
        let (mut base, mut tip) = (None, None);
        for part in parts {
            match part.split_once('=') {
                Some(("base", link)) => base = Some(link),
                Some(("tip", link)) => tip = Some(link),
                _ => return Err(text!("“{part}” is neither base=LINK nor tip=LINK", part = part)),
            }
        }
        // Where files may not be named, all of them are reported as missing.
        let may_be = |path: &PathBuf| bounds.has(path) && path.is_file();
        let path = [Path::new(file).to_path_buf(), root.join(file)].into_iter().find(may_be);
        let Some(path) = path else {
            let built_in: Vec<&str> = ArmKind::ALL.into_iter().map(ArmKind::name).collect();
            return Err(text!("there is no such URDF file, and built in are {arms}", arms = built_in.join(", ")));
        };
        let arm = Urdf::read(&path).and_then(|urdf| urdf.arm(base, tip))?;
        Ok(Self { name: text.to_owned(), joint_names: vec![own(&arm)], arm })
    }

    /// The poses that a series of joint values means, in every unit that they may have.
    fn tracks(&self, series: &JointSeries) -> Result<Vec<Track>, Text> {
        let order = self.order(series)?;
        let revolute = |i: usize| self.arm.joints()[i].kind == JointKind::Revolute;
        let angles = series.samples.iter().flat_map(|sample| {
            order.iter().enumerate().filter(|(i, _)| revolute(*i)).filter_map(|(_, from)| sample.values.get(*from))
        });
        let largest = angles.map(|angle| angle.abs()).fold(0.0, f64::max);
        let units = match &series.unit {
            Some(known) => vec![known.value],
            None => angles_for(largest),
        };
        let mut tracks = Vec::new();
        for unit in &units {
            let name =
                if units.len() == 1 { series.name.clone() } else { format!("{} ({})", series.name, unit.name()) };
            let samples = series.samples.iter().filter_map(|sample| {
                let values: Vec<f64> = order
                    .iter()
                    .enumerate()
                    .map(|(i, from)| Some(sample.values.get(*from)? * if revolute(i) { unit.radians() } else { 1.0 }))
                    .collect::<Option<_>>()?;
                let pose = self.arm.forward(&values).ok()?;
                Some(Sample {
                    image: sample.image.clone(),
                    number: sample.number,
                    place: Arc::clone(&sample.place),
                    numbers: Numbers::Matrix(pose.matrix()),
                    joints: sample.values.clone(),
                })
            });
            let by = |what: &str| format!("{what} by the chain of {} from joint values in {}", self.name, unit.name());
            let stated = Stated {
                length: Some(Known::by(by("computed"), LengthUnit::Metre)),
                direction: Some(Known::by(by("the tip in the base"), Direction::Forward)),
                ..Stated::default()
            };
            if let Some(mut track) =
                tree::track(name, "robot", stated, samples.collect()).filter(|track| !track.is_still())
            {
                track.role = Role::Robot;
                tracks.push(track);
            }
        }
        if tracks.is_empty() {
            return Err(text!("{series} has no three different configurations of its joints", series = &series.name));
        }
        Ok(tracks)
    }

    /// Columns of the arm's values, in rows that have as many, or a counter before them.
    fn row_of(&self, series: &JointSeries) -> Option<std::ops::Range<usize>> {
        let count = self.arm.joint_count();
        let first: Vec<f64> = series.samples.iter().filter_map(|sample| sample.values.first().copied()).collect();
        let counts = || first.windows(2).all(|pair| matches!(pair, [a, b] if b - a == 1.0));
        match series.samples.first()?.values.len() {
            has if has == count => Some(0..count),
            has if has == count + 1 && counts() => Some(1..has),
            _ => None,
        }
    }

    /// The warning for values that the arm has no joints for.
    fn left_out(&self, series: &JointSeries) -> Option<Text> {
        let (count, has) = (self.arm.joint_count(), series.samples.first()?.values.len());
        let is_open = series.joints.is_empty() && has > count && self.row_of(series).is_none();
        is_open.then(|| {
            text!(
                "{series} has {has} values a row: the first {count} are taken for the joints of {arm}",
                series = &series.name,
                has = has,
                count = count,
                arm = &self.name
            )
        })
    }

    /// For every joint of the chain its place among the values: by their names, or in their order.
    fn order(&self, series: &JointSeries) -> Result<Vec<usize>, Text> {
        let count = self.arm.joint_count();
        let has = series.samples.first().map_or(0, |sample| sample.values.len());
        if series.joints.is_empty() {
            if let Some(order) = self.row_of(series) {
                return Ok(order.collect());
            }
            // Fingers are reported after the joints of the arm; as many again would be those of another arm.
            return if has > count && has < 2 * count {
                Ok((0..count).collect())
            } else {
                Err(text!(
                    "{series} has {has} joint values and the arm {count}",
                    series = &series.name,
                    has = has,
                    count = count
                ))
            };
        }
        // Drivers put what a robot is called before the names of its joints.
        let is = |given: &str, wanted: &str| given == wanted || given.ends_with(&format!("_{wanted}"));
        let found = self.joint_names.iter().find_map(|names| {
            names
                .iter()
                .map(|wanted| {
                    let exact = series.joints.iter().position(|given| given == wanted);
                    let mut near = series.joints.iter().enumerate().filter(|(_, given)| is(given, wanted));
                    let only = near.next().map(|(i, _)| i).filter(|_| near.next().is_none());
                    exact.or(only)
                })
                .collect::<Option<Vec<usize>>>()
        });
        found.ok_or_else(|| {
            let wanted = self.joint_names.last().map(|names| names.join(", ")).unwrap_or_default();
            text!(
                "{series} has the joints {joints}, and the arm has {wanted}",
                series = &series.name,
                joints = series.joints.join(", "),
                wanted = wanted
            )
        })
    }
}

#[cfg(test)]
#[path = "chain_tests.rs"]
mod tests;
