//! From links and joints to the chain between two of the links.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};

use super::{RawJoint, RawLimit, Urdf, UrdfError, UrdfProblem};
use crate::{Arm, ArmError, Joint, JointKind, JointRange, LONGEST_LINK_M, MAX_JOINTS};

/// Longest travel of a prismatic joint in metres, from its zero: tracks of twenty metres exist, and half a metre given
/// in millimetres is above it.
const LONGEST_WAY_M: f64 = 50.0;
/// Length of a vector below which its direction is undefined.
const NO_DIRECTION: f64 = 1e-6;

impl Urdf {
    /// The chain between two links, given by name or, where the file is unambiguous, found: the base is the only link
    /// without a parent, the tip the only one behind it without a child.
    ///
    /// The frame of the base link is the base, and that of the tip link the tip. Joints have the names, ranges and
    /// speeds in the file.
    ///
    /// # Errors
    /// [`UrdfError`]: links that are missing or ambiguous, joints on the path that a chain cannot have, numbers that are
    /// not valid for an arm.
    pub fn arm(&self, base: Option<&str>, tip: Option<&str>) -> Result<Arm, UrdfError> {
        let base = match base {
            Some(name) => self.link(name)?,
            None => self.only_root()?,
        };
        let tip = match tip {
            Some(name) => self.link(name)?,
            None => self.only_leaf(base)?,
        };
        let mut joints = Vec::new();
        let mut so_far = Isometry3::identity();
        for raw in self.way(base, tip)? {
            let fail = |problem| self.error(Some(raw), problem);
            if let Some(of) = &raw.mimic {
                return Err(fail(UrdfProblem::Mimic { joint: raw.name.clone(), of: of.clone() }));
            }
            so_far *= origin(raw, self.version).map_err(fail)?;
            let (kind, range) = match raw.kind.as_str() {
                "fixed" => continue,
                "continuous" => (JointKind::Revolute, endless(raw).map_err(fail)?),
                "revolute" => (JointKind::Revolute, self.range(raw).map_err(fail)?),
                "prismatic" => (JointKind::Prismatic, self.range(raw).map_err(fail)?),
                _ => {
                    let (joint, kind) = (raw.name.clone(), raw.kind.clone());
                    return Err(fail(UrdfProblem::Unsupported { joint, kind }));
                }
            };
            let axis = axis(raw).map_err(fail)?;
            joints.push(Joint { name: raw.name.clone(), kind, previous_from_joint: so_far, axis, range });
            so_far = Isometry3::identity();
        }
        let (base, tip) = (base.to_owned(), tip.to_owned());
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            return Err(self.error(None, UrdfProblem::JointCount { got: joints.len(), base, tip }));
        }
        Arm::new(joints, so_far).map_err(|error: ArmError| self.error(None, UrdfProblem::Arm { base, tip, error }))
    }

    fn link(&self, name: &str) -> Result<&str, UrdfError> {
        self.links.iter().find(|link| *link == name).map(String::as_str).ok_or_else(|| {
            self.error(None, UrdfProblem::NoSuchLink { name: name.to_owned(), links: self.links.clone() })
        })
    }

    fn only_root(&self) -> Result<&str, UrdfError> {
        let roots: Vec<&String> =
            self.links.iter().filter(|link| !self.joints.iter().any(|joint| joint.child == **link)).collect();
        match roots[..] {
            [root] => Ok(root),
            // A tree has a root: there are several.
            _ => Err(self.error(None, UrdfProblem::SeveralRoots { links: roots.into_iter().cloned().collect() })),
        }
    }

    fn only_leaf<'a>(&'a self, base: &'a str) -> Result<&'a str, UrdfError> {
        // Every link of the list is passed once; reading has checked that there is no loop.
        let (mut below, mut next) = (vec![base], 0);
        let mut leaves = Vec::new();
        while let Some(&link) = below.get(next) {
            let before = below.len();
            below.extend(self.joints.iter().filter(|joint| joint.parent == link).map(|joint| joint.child.as_str()));
            if below.len() == before {
                leaves.push(link);
            }
            next += 1;
        }
        if let [leaf] = leaves[..] {
            return Ok(leaf);
        }
        let links = leaves.into_iter().map(str::to_owned).collect();
        Err(self.error(None, UrdfProblem::SeveralLeaves { links }))
    }

    /// The joints from the base to the tip.
    fn way(&self, base: &str, tip: &str) -> Result<Vec<&RawJoint>, UrdfError> {
        let (mut way, mut link) = (Vec::new(), tip);
        while link != base {
            let Some(joint) = self.joints.iter().find(|joint| joint.child == link) else {
                let (base, tip) = (base.to_owned(), tip.to_owned());
                return Err(self.error(None, UrdfProblem::NotBelow { base, tip }));
            };
            way.push(joint);
            link = &joint.parent;
        }
        way.reverse();
        Ok(way)
    }

    /// Range and speed of a joint with limits.
    fn range(&self, raw: &RawJoint) -> Result<JointRange, UrdfProblem> {
        let missing = || UrdfProblem::NoLimit { joint: raw.name.clone(), kind: raw.kind.clone() };
        let limit = raw.limit.as_ref().ok_or_else(missing)?;
        let end = |attribute, text: Option<&String>, endless: f64| match text {
            Some(text) => numbers(raw, attribute, text, "a number").map(|[value]| value),
            None if self.version >= (1, 2) => Ok(endless),
            // The default of older versions is 0. One limit of 0 may be intended; both cannot.
            None if limit.lower.is_some() || limit.upper.is_some() => Ok(0.0),
            None => Err(missing()),
        };
        let lower = end("lower of <limit>", limit.lower.as_ref(), f64::NEG_INFINITY)?;
        let upper = end("upper of <limit>", limit.upper.as_ref(), f64::INFINITY)?;
        if lower >= upper {
            return Err(UrdfProblem::InvertedLimit { joint: raw.name.clone(), lower, upper });
        }
        let longest = [lower, upper].into_iter().filter(|end| end.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()));
        if raw.kind == "prismatic" && longest > LONGEST_WAY_M {
            let (joint, length_m) = (raw.name.clone(), longest);
            return Err(UrdfProblem::TooLong { joint, what: "the limit", length_m });
        }
        Ok(JointRange { min: lower, max: upper, speed: speed(raw, Some(limit))? })
    }
}

/// Range and speed of a continuous joint.
fn endless(raw: &RawJoint) -> Result<JointRange, UrdfProblem> {
    Ok(JointRange { speed: speed(raw, raw.limit.as_ref())?, ..JointRange::ENDLESS })
}

fn speed(raw: &RawJoint, limit: Option<&RawLimit>) -> Result<f64, UrdfProblem> {
    let Some(text) = limit.and_then(|limit| limit.velocity.as_ref()) else { return Ok(f64::INFINITY) };
    let [speed] = numbers(raw, "velocity of <limit>", text, "a number")?;
    if speed > 0.0 { Ok(speed) } else { Err(UrdfProblem::BadSpeed { joint: raw.name.clone(), speed }) }
}

/// `origin` of a joint: its frame in that of the parent link.
fn origin(raw: &RawJoint, version: (u32, u32)) -> Result<Isometry3<f64>, UrdfProblem> {
    let Some(origin) = &raw.origin else { return Ok(Isometry3::identity()) };
    let [x, y, z] = match &origin.xyz {
        Some(text) => numbers(raw, "xyz of <origin>", text, "three numbers")?,
        None => [0.0; 3],
    };
    let shift = Vector3::new(x, y, z);
    if shift.norm() > LONGEST_LINK_M {
        let (joint, length_m) = (raw.name.clone(), shift.norm());
        return Err(UrdfProblem::TooLong { joint, what: "the <origin>", length_m });
    }
    let rotation = match (&origin.rpy, &origin.quat_xyzw) {
        (None, None) => UnitQuaternion::identity(),
        (Some(text), None) => {
            let [roll, pitch, yaw] = numbers(raw, "rpy of <origin>", text, "three angles in radians")?;
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        }
        (None, Some(text)) if version >= (1, 1) => {
            let needs = "four numbers x y z w, not all of them zero";
            let [x, y, z, w] = numbers(raw, "quat_xyzw of <origin>", text, needs)?;
            let bad = || bad_number(raw, "quat_xyzw of <origin>", text, needs);
            UnitQuaternion::try_new(Quaternion::new(w, x, y, z), NO_DIRECTION).ok_or_else(bad)?
        }
        (_, Some(text)) => {
            let needs = "no place beside rpy, nor in a file whose robot is not of version 1.1";
            return Err(bad_number(raw, "quat_xyzw of <origin>", text, needs));
        }
    };
    Ok(Isometry3::from_parts(Translation3::from(shift), rotation))
}

/// The direction of a joint; x where the file states none, as in URDF.
fn axis(raw: &RawJoint) -> Result<UnitVector3<f64>, UrdfProblem> {
    let Some(text) = &raw.axis else { return Ok(Vector3::x_axis()) };
    let [x, y, z] = numbers(raw, "xyz of <axis>", text, "three numbers")?;
    let zero = || UrdfProblem::ZeroAxis { joint: raw.name.clone() };
    UnitVector3::try_new(Vector3::new(x, y, z), NO_DIRECTION).ok_or_else(zero)
}

/// `N` finite numbers.
fn numbers<const N: usize>(
    raw: &RawJoint,
    attribute: &'static str,
    text: &str,
    needs: &'static str,
) -> Result<[f64; N], UrdfProblem> {
    let parsed: Option<Vec<f64>> =
        text.split_whitespace().map(|part| part.parse().ok().filter(|value: &f64| value.is_finite())).collect();
    parsed.and_then(|values| <[f64; N]>::try_from(values).ok()).ok_or_else(|| bad_number(raw, attribute, text, needs))
}

fn bad_number(raw: &RawJoint, attribute: &'static str, text: &str, needs: &'static str) -> UrdfProblem {
    UrdfProblem::BadNumber { joint: raw.name.clone(), attribute, text: text.to_owned(), needs }
}
