//! Chains of revolute joints as published by their makers, and joint values for a pose by Newton's method.

use std::collections::BTreeMap;

use handeye_arm::{Arm, ArmKind, testing};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix6xX, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::Failure;

/// One link as in a URDF: `Trans(xyz) Rz(yaw) Ry(pitch) Rx(roll)`, then the joint about z.
#[derive(Clone, Copy)]
pub struct Link {
    pub place: Vector3<f64>,
    pub turn: Vector3<f64>,
}

/// A chain from the base to the tip.
#[derive(Clone)]
pub struct Chain {
    pub links: Vec<Link>,
    /// The tip in the frame of the last joint.
    pub flange: Isometry3<f64>,
}

/// The name of an arm, its pose before its work, and its masses, kilograms after each joint.
pub struct Model {
    pub believed: Chain,
    pub start: Vec<f64>,
    pub masses_kg: Vec<f64>,
    pub arm: Arm,
    /// Another arm of its maker, or one with other lengths.
    pub other: Chain,
}

impl Chain {
    pub fn forward(&self, joints: &[f64]) -> Isometry3<f64> {
        self.frames(joints).last().copied().unwrap_or_else(Isometry3::identity) * self.flange
    }

    /// The frame after each joint, in the base.
    pub fn frames(&self, joints: &[f64]) -> Vec<Isometry3<f64>> {
        let behind = self.links.iter().zip(joints).scan(Isometry3::identity(), |pose, (link, angle)| {
            let [roll, pitch, yaw] = [link.turn.x, link.turn.y, link.turn.z];
            let fixed = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let joint = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *angle);
            *pose = *pose * Translation3::from(link.place) * fixed * joint;
            Some(*pose)
        });
        behind.collect()
    }

    /// The same with lengths that are 5 % longer in its first half and 5 % shorter in its second.
    fn of_other_lengths(&self) -> Self {
        let factor = |j: usize| if 2 * j < self.links.len() { 1.05 } else { 0.95 };
        let other = |(j, link): (usize, &Link)| Link { place: link.place * factor(j), ..*link };
        Self { links: self.links.iter().enumerate().map(other).collect(), ..self.clone() }
    }

    fn of(links: &[([f64; 3], [f64; 3])], flange_m: f64) -> Self {
        let link = |(place, turn): &([f64; 3], [f64; 3])| Link {
            place: Vector3::from(*place) * 1e-3,
            turn: Vector3::from(*turn) * std::f64::consts::FRAC_PI_2,
        };
        Self { links: links.iter().map(link).collect(), flange: Isometry3::translation(0.0, 0.0, flange_m) }
    }

    /// The numbers of the data sheet: millimetres and quarter turns.
    fn nominal(model: &str) -> Option<Self> {
        if model == "panda" {
            let links = [
                ([0.0, 0.0, 333.0], [0.0; 3]),
                ([0.0; 3], [-1.0, 0.0, 0.0]),
                ([0.0, -316.0, 0.0], [1.0, 0.0, 0.0]),
                ([82.5, 0.0, 0.0], [1.0, 0.0, 0.0]),
                ([-82.5, 384.0, 0.0], [-1.0, 0.0, 0.0]),
                ([0.0; 3], [1.0, 0.0, 0.0]),
                ([88.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
            ];
            return Some(Self::of(&links, 0.107));
        }
        if model == "four" {
            let links = [
                ([12.0, 0.0, 17.0], [0.0; 3]),
                ([0.0, 0.0, 59.5], [-1.0, 0.0, 0.0]),
                ([24.0, -128.0, 0.0], [0.0; 3]),
                ([124.0, 0.0, 0.0], [0.0; 3]),
            ];
            let hand = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
            let flange = Isometry3::from_parts(Translation3::new(0.126, 0.0, 0.0), hand);
            return Some(Self { flange, ..Self::of(&links, 0.0) });
        }
        if model == "xarm6" {
            let links = [
                ([0.0, 0.0, 267.0], [0.0; 3]),
                ([0.0; 3], [-1.0, 0.0, 0.0]),
                ([53.0, -284.5, 0.0], [0.0; 3]),
                ([77.5, 342.5, 0.0], [-1.0, 0.0, 0.0]),
                ([0.0; 3], [1.0, 0.0, 0.0]),
                ([76.0, 97.0, 0.0], [-1.0, 0.0, 0.0]),
            ];
            return Some(Self::of(&links, 0.0));
        }
        let [z, fore, wrist_x, wrist_z, second, third] = match model {
            "ur3" => [151.9, -243.65, -213.25, 112.35, -85.35, 81.9],
            "ur5" => [89.159, -425.0, -392.25, 109.15, -94.65, 82.3],
            "ur10" => [127.3, -612.0, -572.3, 163.941, -115.7, 92.2],
            "ur3e" => [151.85, -243.55, -213.2, 131.05, -85.35, 92.1],
            "ur5e" => [162.5, -425.0, -392.2, 133.3, -99.7, 99.6],
            "ur10e" => [180.7, -612.7, -571.55, 174.15, -119.85, 116.55],
            _ => return None,
        };
        let links = [
            ([0.0, 0.0, z], [0.0; 3]),
            ([0.0; 3], [1.0, 0.0, 0.0]),
            ([fore, 0.0, 0.0], [0.0; 3]),
            ([wrist_x, 0.0, wrist_z], [0.0; 3]),
            ([0.0, second, 0.0], [1.0, 0.0, 0.0]),
            ([0.0, third, 0.0], [1.0, 2.0, 2.0]),
        ];
        Some(Self::of(&links, 0.0))
    }
}

/// An arm that the program knows as well, from its own numbers.
pub fn model(name: &str) -> Result<Model, Failure> {
    let believed = Chain::nominal(name).ok_or_else(|| format!("no chain of {name}"))?;
    let (start, masses_kg): (Vec<f64>, Vec<f64>) = match name {
        "panda" => (vec![0.0, -0.5, 0.0, -2.3, 0.0, 1.8, 0.8], vec![3.1, 2.3, 3.2, 2.6, 2.1, 1.5, 0.7]),
        "xarm6" => (vec![0.0, -0.3, -0.9, 0.0, 1.2, 0.0], vec![2.4, 2.0, 1.7, 1.2, 1.2, 0.2]),
        "four" => (vec![0.0, -0.6, 0.4, 1.5], vec![0.1, 0.15, 0.15, 0.2]),
        _ => (vec![0.0, -1.6, 1.9, -1.8, -1.57, 0.0], vec![3.8, 8.1, 2.8, 1.4, 1.3, 0.4]),
    };
    let arm = match name {
        "panda" => testing::PANDA.arm()?,
        "xarm6" => testing::XARM6.arm()?,
        "four" => testing::FOUR_JOINTS.arm()?,
        _ => ArmKind::ALL.into_iter().find(|kind| kind.name() == name).map(ArmKind::arm).ok_or("no such arm")?,
    };
    let other =
        if name == "ur5e" { Chain::nominal("ur5") } else { None }.unwrap_or_else(|| believed.of_other_lengths());
    Ok(Model { believed, start, masses_kg, arm, other })
}

/// Newton's method on joints from `near`; `None` if it does not converge.
pub fn newton(
    forward: impl Fn(&[f64]) -> Isometry3<f64>,
    near: &[f64],
    off: impl Fn(&Isometry3<f64>) -> Vector6<f64>,
) -> Option<Vec<f64>> {
    let mut joints = near.to_vec();
    for _ in 0..60 {
        let here = off(&forward(&joints));
        if here.norm() < 1e-11 {
            // Within one turn.
            return Some(joints.iter().map(|angle| angle.sin().atan2(angle.cos())).collect());
        }
        let columns: Vec<Vector6<f64>> = (0..joints.len())
            .map(|j| {
                let mut moved = joints.clone();
                moved[j] += 1e-7;
                (here - off(&forward(&moved))) / 1e-7
            })
            .collect();
        let by_joints = Matrix6xX::from_columns(&columns);
        // The shortest step if there are redundant joints.
        let damped = &by_joints * by_joints.transpose() + DMatrix::identity(6, 6) * 1e-8;
        let step: DVector<f64> = by_joints.transpose() * damped.lu().solve(&here)?;
        let shorter = 0.4 / step.amax().max(0.4);
        joints.iter_mut().zip(step.iter()).for_each(|(q, s)| *q += s * shorter);
    }
    None
}

/// Joint values with which a function of the pose is least, from `near`: for chains that do not reach poses in general.
pub fn nearest(
    forward: impl Fn(&[f64]) -> Isometry3<f64>,
    near: &[f64],
    off: impl Fn(&Isometry3<f64>) -> Vector6<f64>,
) -> Option<Vec<f64>> {
    let mut joints = near.to_vec();
    for _ in 0..200 {
        let here = off(&forward(&joints));
        let columns: Vec<Vector6<f64>> = (0..joints.len())
            .map(|j| {
                let mut moved = joints.clone();
                moved[j] += 1e-6;
                (off(&forward(&moved)) - here) / 1e-6
            })
            .collect();
        let by_joints = Matrix6xX::from_columns(&columns);
        let step = by_joints.clone().svd(true, true).solve(&-here, 1e-9).ok()?;
        let shorter = 0.2 / step.amax().max(0.2);
        joints.iter_mut().zip(step.iter()).for_each(|(q, s)| *q += s * shorter);
        if step.amax() < 1e-8 {
            return Some(joints);
        }
    }
    None
}

/// What takes a pose to another, by its translation and its rotation vector.
pub fn between(tip: &Isometry3<f64>, goal: &Isometry3<f64>) -> Vector6<f64> {
    let off = tip.inverse() * goal;
    let turn = off.rotation.scaled_axis();
    Vector6::new(off.translation.x, off.translation.y, off.translation.z, turn.x, turn.y, turn.z)
}

/// Number, model and chain of the arms in a CSV of factory calibrations.
pub fn read(csv: &str) -> Result<BTreeMap<usize, (String, Chain)>, Failure> {
    let mut arms: BTreeMap<usize, (String, Chain)> = BTreeMap::new();
    for line in csv.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number =
            |i: usize| fields.get(i).ok_or("a column is missing")?.parse::<f64>().map_err(|_not_a_number| "no number");
        let link = Link {
            place: Vector3::new(number(3)?, number(4)?, number(5)?),
            turn: Vector3::new(number(6)?, number(7)?, number(8)?),
        };
        let of_arm = || (fields[1].to_owned(), Chain { links: Vec::new(), flange: Isometry3::identity() });
        arms.entry(fields[0].parse()?).or_insert_with(of_arm).1.links.push(link);
    }
    Ok(arms)
}
