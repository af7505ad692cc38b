//! The arm, its tip, and the way that the tip went.

use handeye_core::frames::{Base, Pose, Tip};
use handeye_sim_link::cell::kinematics::{self, ArmPose};
use handeye_sim_link::cell::render::{Shape, Solid, props};
use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::client::cell::{JOINTS, JointAngles};
use nalgebra::{Isometry3, Vector3};
use rerun::{AsComponents, Capsules3D, Color, Cylinders3D, FillMode, LineStrips3D, Radius, Scalars, SeriesLines};

use super::convert::{axes, point, quaternion, transform, transform_of, vector};
use super::error::RecordError;
use super::pen::Pen;
use super::{paths, style};

/// Two configurations that differ by less \[rad\] say the same about where the arm stands.
const OTHER_CONFIGURATION_RAD: f64 = 0.2;
/// How far apart two measurements of where the arm stands may be \[m, rad\].
const SAME_PLACE_M: f64 = 2e-3;
const SAME_PLACE_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// The solids of the arm, where they are drawn.
///
/// Where the arm stands follows from tip and joints when the tip is on the flange where the built-in scene has it. It is
/// believed when the arm then stands where it does in the built-in scene, or when two configurations agree about it.
#[derive(Debug)]
pub(super) struct Arm {
    built_in: Option<BuiltIn>,
    /// Whether the arm may be one that stands elsewhere.
    may_be_ours: bool,
    place: Place,
    has_solids: bool,
}

#[derive(Debug, Clone, Copy)]
struct BuiltIn {
    base_from_arm: Isometry3<f64>,
    connection_from_tip: Isometry3<f64>,
}

#[derive(Debug, Clone, Copy)]
enum Place {
    Unknown,
    Once {
        joints: JointAngles,
        base_from_arm: Isometry3<f64>,
    },
    Known {
        base_from_arm: Isometry3<f64>,
    },
    /// The arm is another one, or its tip is elsewhere on the flange.
    Other,
}

impl Arm {
    pub fn new() -> Self {
        let built_in = Scene::reference().and_then(|scene| scene.resolve(0)).ok().map(|scene| BuiltIn {
            base_from_arm: scene.world_from_arm,
            connection_from_tip: scene.connection_from_tip,
        });
        Self { built_in, may_be_ours: false, place: Place::Unknown, has_solids: false }
    }

    /// Another cell was connected.
    pub fn reconnected(&mut self, kinematics_known: bool) {
        self.may_be_ours = kinematics_known;
        self.place = Place::Unknown;
    }

    /// The links, if the arm is known.
    pub fn write(
        &mut self,
        pen: Pen<'_>,
        base_from_tip: &Pose<Base, Tip>,
        joints: &JointAngles,
    ) -> Result<(), RecordError> {
        let Some(built_in) = self.built_in.filter(|_| joints.iter().all(|q| q.is_finite())) else { return Ok(()) };
        let pose = kinematics::forward(joints);
        self.place = self.place.with(&built_in, self.may_be_ours, base_from_tip.isometry(), joints, &pose);
        let Place::Known { base_from_arm } = self.place else { return Ok(()) };
        if !self.has_solids {
            write_solids(pen)?;
            self.has_solids = true;
        }
        pen.write(paths::ARM, &transform_of(&base_from_arm))?;
        for (index, moved) in link_motions(&pose).iter().enumerate() {
            pen.write(&paths::link(index), &transform_of(moved))?;
        }
        Ok(())
    }
}

impl Place {
    fn with(
        self,
        built_in: &BuiltIn,
        may_be_ours: bool,
        base_from_tip: &Isometry3<f64>,
        joints: &JointAngles,
        pose: &ArmPose,
    ) -> Self {
        let base_from_arm = base_from_tip * (pose.arm_from_connection * built_in.connection_from_tip).inverse();
        match self {
            Self::Known { .. } | Self::Other => self,
            _ if are_same(&base_from_arm, &built_in.base_from_arm) => Self::Known { base_from_arm },
            Self::Unknown if may_be_ours => Self::Once { joints: *joints, base_from_arm },
            Self::Unknown => self,
            Self::Once { joints: before, .. } if is_near(&before, joints) => self,
            Self::Once { base_from_arm: before, .. } if are_same(&before, &base_from_arm) => {
                Self::Known { base_from_arm }
            }
            Self::Once { .. } => Self::Other,
        }
    }
}

fn are_same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < SAME_PLACE_M
        && a.rotation.angle_to(&b.rotation) < SAME_PLACE_RAD
}

fn is_near(a: &JointAngles, b: &JointAngles) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < OTHER_CONFIGURATION_RAD)
}

/// What the joints do to points that are given in the arm frame with all joints zero: foot and links.
fn link_motions(pose: &ArmPose) -> [Isometry3<f64>; JOINTS + 1] {
    let at_zero = kinematics::forward(&[0.0; JOINTS]);
    std::array::from_fn(|index| match index.checked_sub(1) {
        None => Isometry3::identity(),
        Some(joint) => pose.arm_from_link[joint] * at_zero.arm_from_link[joint].inverse(),
    })
}

/// The solids of each link in the arm frame with all joints zero.
fn solids() -> [Vec<Solid>; JOINTS + 1] {
    let owners = std::cell::RefCell::new(Vec::new());
    let all = props::ur5(&Isometry3::identity(), |link| {
        owners.borrow_mut().push(link);
        Isometry3::identity()
    });
    let mut by_link: [Vec<Solid>; JOINTS + 1] = Default::default();
    for (link, solid) in owners.into_inner().into_iter().zip(all) {
        if let Some(of_link) = by_link.get_mut(link) {
            of_link.push(solid);
        }
    }
    by_link
}

fn write_solids(pen: Pen<'_>) -> Result<(), RecordError> {
    for (index, solids) in solids().iter().enumerate() {
        let link = paths::link(index);
        let (mut cylinders, mut capsules) = (Vec::new(), Vec::new());
        for solid in solids {
            match solid.shape {
                Shape::Cylinder { radius, half_height } => {
                    cylinders.push((solid, radius as f32, (2.0 * half_height) as f32));
                }
                Shape::Capsule { a, b, radius } => {
                    let ends = [a, b].map(|end| point(&(solid.world_from_shape * end)));
                    capsules.push((solid, ends, radius as f32));
                }
                // The arm has no other shapes; the picture of one that got some would lack them.
                Shape::Sphere { .. } | Shape::Box { .. } | Shape::Plane => {}
            }
        }
        if !cylinders.is_empty() {
            let housings = Cylinders3D::from_lengths_and_radii(
                cylinders.iter().map(|(_, _, length)| *length),
                cylinders.iter().map(|(_, radius, _)| *radius),
            )
            .with_centers(cylinders.iter().map(|(solid, ..)| vector(&solid.world_from_shape.translation.vector)))
            .with_quaternions(cylinders.iter().map(|(solid, ..)| quaternion(&solid.world_from_shape.rotation)))
            .with_colors(cylinders.iter().map(|(solid, ..)| colour(solid)))
            .with_fill_mode(FillMode::Solid);
            pen.write_static(&paths::below(&link, "housings"), &housings)?;
        }
        if !capsules.is_empty() {
            let tubes = Capsules3D::from_endpoints_and_radii(
                capsules.iter().map(|(_, [a, _], _)| *a),
                capsules.iter().map(|(_, [_, b], _)| *b),
                capsules.iter().map(|(.., radius)| *radius),
            )
            .with_colors(capsules.iter().map(|(solid, ..)| colour(solid)))
            .with_fill_mode(FillMode::Solid);
            pen.write_static(&paths::below(&link, "tubes"), &tubes)?;
        }
    }
    Ok(())
}

fn colour(solid: &Solid) -> Color {
    let [red, green, blue] = solid.colour.map(|c| (c.clamp(0.0, 1.0) * 255.0) as u8);
    Color::from_rgb(red, green, blue)
}

/// The tip.
pub(super) fn write_tip(pen: Pen<'_>, base_from_tip: &Pose<Base, Tip>) -> Result<(), RecordError> {
    pen.write(paths::TIP, &[&transform(base_from_tip) as &dyn AsComponents, &axes(style::LARGE_AXES)])
}

/// The joint angles as numbers.
pub(super) fn write_joints(pen: Pen<'_>, joints_rad: &[f64]) -> Result<(), RecordError> {
    if joints_rad.is_empty() {
        return Ok(());
    }
    pen.write(paths::PLOT_JOINTS, &Scalars::new(joints_rad.iter().map(|q| q.to_degrees())))
}

/// Names of the joints in the plot.
pub(super) fn joint_series() -> SeriesLines {
    SeriesLines::new().with_names((1..=JOINTS).map(|joint| format!("joint {joint} [°]")))
}

/// A line that grows, in blocks, so that what was written once is not written again with every point.
#[derive(Debug)]
pub(super) struct Trail {
    path: &'static str,
    colour: Color,
    blocks: usize,
    newest: Vec<Vector3<f64>>,
}

impl Trail {
    /// Points closer together than this \[m\] are one: thinner than the line on the screen.
    const SPACING_M: f64 = 2e-3;
    /// A tip that jumps farther \[m\] was not seen meanwhile, and there is no line.
    const JUMP_M: f64 = 0.3;
    /// Points of a block.
    const BLOCK: usize = 100;

    pub fn new(path: &'static str, colour: Color) -> Self {
        Self { path, colour, blocks: 0, newest: Vec::new() }
    }

    /// Begins anew.
    pub fn restart(&mut self, pen: Pen<'_>) -> Result<(), RecordError> {
        if self.newest.is_empty() {
            return Ok(());
        }
        *self = Self::new(self.path, self.colour);
        pen.clear(self.path)
    }

    /// The tip is there now.
    pub fn go(&mut self, pen: Pen<'_>, to: &Vector3<f64>) -> Result<(), RecordError> {
        if let Some(last) = self.newest.last().copied() {
            let distance = (to - last).norm();
            if distance.is_nan() || distance < Self::SPACING_M {
                return Ok(());
            }
            if distance > Self::JUMP_M {
                self.next_block(None);
            } else if self.newest.len() >= Self::BLOCK {
                self.next_block(Some(last));
            }
        }
        self.newest.push(*to);
        let strip = LineStrips3D::new([self.newest.iter().map(vector).collect::<Vec<_>>()])
            .with_colors([self.colour])
            .with_radii([Radius::new_ui_points(style::THIN_UI_POINTS)]);
        pen.write(&paths::below(self.path, &self.blocks.to_string()), &strip)
    }

    fn next_block(&mut self, first: Option<Vector3<f64>>) {
        self.blocks += 1;
        self.newest.clear();
        self.newest.extend(first);
    }
}
