//! Where an arm is mounted and what its tool is, from joint angles and reported poses; and whether the two belong
//! together.

use nalgebra::Isometry3;

use crate::handeye::closed_form::{ClosedForm as _, Shah};
use crate::handeye::{HandEyeError, PosePair};
use handeye_arm::{Arm, ArmError, JointKind};
use handeye_geometry::frames::{Base, Pose, Tip};

/// Why an arm cannot be placed by joint values and poses.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum PlacementError {
    /// The joint values are not usable.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// A length offset, which an estimate of the arm's errors does not model.
    #[error(
        "joint {joint} ({name}) is prismatic, and errors of an arm are estimated of revolute joints alone: calibrate without \
         the joint values of this arm"
    )]
    PrismaticOffset {
        /// The joint, counted from 1.
        joint: usize,
        /// Its name.
        name: String,
    },
    /// The poses do not determine where the arm is mounted and what its tool is.
    #[error("where the arm stands and where its tip is cannot be told from these poses: {0}")]
    NotPlaced(#[from] HandEyeError),
    /// Angles and poses do not belong to one arm.
    #[error(
        "the joint angles do not belong to the poses: {off} of {views} views are off by more than {limit_mm} mm or \
         {limit_deg}°, most of all view {view}, by {distance_mm:.1} mm and {angle_deg:.2}°; check the order, unit, sign \
         and zero of the joint angles, the convention of the poses, and which arm it is"
    )]
    Foreign {
        /// The view that is off most, counted from 1.
        view: usize,
        /// Distance between its reported tip and the one that its angles give, millimetres.
        distance_mm: f64,
        /// Angle between them, degrees.
        angle_deg: f64,
        /// How many views are off by more than is allowed.
        off: usize,
        /// All views.
        views: usize,
        /// Distance that is allowed, millimetres.
        limit_mm: f64,
        /// Angle that is allowed, degrees.
        limit_deg: f64,
    },
}

/// How far a reported tip may be from the one that its joint angles give, metres. A controller with the factory's own
/// calibration differs by some millimetres from the nominal arm; an error in the columns is centimetres and more. At
/// half a metre of reach it is 2 % of the twists, and an estimated offset is then 2 % off.
pub const DISTANCE_LIMIT_M: f64 = 0.010;
/// The same for the rotation, radians.
pub const ROTATION_LIMIT_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;

/// How far reported poses may be from those of the chain that they come from, metres: they are written to a tenth of a millimetre.
const ROUNDED_M: f64 = 1e-4;
/// The same for the rotation, radians: to a hundredth of a degree.
const ROUNDED_RAD: f64 = 0.01 * std::f64::consts::PI / 180.0;

/// The robot in one view: the reported pose of the tip, and the joint values in radians (metres for a prismatic joint).
#[derive(Debug, Clone, Copy)]
pub struct JointView<'a> {
    /// Tip pose as the controller reported it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Joint values as the controller reported them: radians, or metres for a prismatic joint.
    pub joints_rad: &'a [f64],
}

/// The joints at the tip, view by view, see [`Arm::tip_from_joints`].
pub type TipFromJoints = Vec<Vec<Isometry3<f64>>>;

/// An arm at the place that the poses determine.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// The arm with `base_from_first` and `flange_from_tip` of the poses.
    pub arm: Arm,
    /// Distance in metres and angle in radians between the reported tip and that by the joint angles, per view.
    pub misses: Vec<(f64, f64)>,
}

/// An arm, its tool, and its joints in the views of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmOfViews {
    /// Its place by the views, and the remaining distances.
    pub placement: Placement,
    /// Where the tip of its tool is in the frame of the tip, metres.
    pub tool_m: [f64; 3],
    /// Its joint values in each view, radians; `None` where a view has none.
    pub joints_rad: Vec<Option<Vec<f64>>>,
}

impl Placement {
    /// The joints at the tip in a view that need not be one of those that placed the arm.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`], [`ArmError::NotFinite`], [`PlacementError::PrismaticOffset`]; [`PlacementError::Foreign`] when its
    /// joint values do not belong to its pose.
    pub fn tip_from_joints(&self, view: &JointView<'_>) -> Result<Vec<Isometry3<f64>>, PlacementError> {
        let miss = self.arm.forward(view.joints_rad)?.distance_to(&view.base_from_tip);
        Self { arm: self.arm.clone(), misses: vec![miss] }.check()?;
        self.joints_of(view)
    }

    /// The joints at the tip, for an estimate of the arm's errors. It models zeros as angles: a length offset has no place in it,
    /// and one in radians would be wrong without being noticed.
    fn joints_of(&self, view: &JointView<'_>) -> Result<Vec<Isometry3<f64>>, PlacementError> {
        let joints = self.arm.joints();
        if let Some(i) = joints.iter().position(|joint| joint.kind == JointKind::Prismatic) {
            return Err(PlacementError::PrismaticOffset { joint: i + 1, name: joints[i].name.clone() });
        }
        Ok(self.arm.tip_from_joints(&view.base_from_tip, view.joints_rad)?)
    }

    /// The arm, where the reported poses are those of its own chain; `None` where the controller uses another one, such as its
    /// factory calibration. Errors that are found relative to reported poses are then not those of this chain.
    pub fn arm_of_poses(&self) -> Option<&Arm> {
        let count = self.misses.len().max(1) as f64;
        let rms_rad = (self.misses.iter().map(|miss| miss.1 * miss.1).sum::<f64>() / count).sqrt();
        (self.rms_m() <= ROUNDED_M && rms_rad <= ROUNDED_RAD).then_some(&self.arm)
    }

    /// Root mean square of the distances, metres.
    pub fn rms_m(&self) -> f64 {
        let count = self.misses.len().max(1) as f64;
        (self.misses.iter().map(|miss| miss.0 * miss.0).sum::<f64>() / count).sqrt()
    }

    /// Whether every view is within [`DISTANCE_LIMIT_M`] and [`ROTATION_LIMIT_RAD`].
    ///
    /// # Errors
    /// [`PlacementError::Foreign`] names the view that is off most.
    pub(crate) fn check(&self) -> Result<(), PlacementError> {
        // In units of the limits, so that both count; NaN exceeds them.
        let excess = |miss: &(f64, f64)| (miss.0 / DISTANCE_LIMIT_M).max(miss.1 / ROTATION_LIMIT_RAD);
        let is_off = |miss: &&(f64, f64)| !(0.0..=1.0).contains(&excess(miss));
        let off = self.misses.iter().filter(is_off).count();
        let worst = self.misses.iter().enumerate().max_by(|a, b| excess(a.1).total_cmp(&excess(b.1)));
        match worst {
            Some((view, miss)) if off > 0 => Err(PlacementError::Foreign {
                view: view + 1,
                distance_mm: miss.0 * 1e3,
                angle_deg: miss.1.to_degrees(),
                off,
                views: self.misses.len(),
                limit_mm: DISTANCE_LIMIT_M * 1e3,
                limit_deg: ROTATION_LIMIT_RAD.to_degrees(),
            }),
            _ => Ok(()),
        }
    }
}

/// Finds where the arm is mounted and where its tip is: `base_from_first` and `flange_from_tip` with `base_from_tip_i =
/// base_from_first · chain(q_i) · flange_from_tip`, whatever `arm` has for them.
///
/// This is robot-world calibration, `A X = Z B`, with the chain in the place of the camera; poses that are rounded to a
/// tenth of a millimetre place the arm equally well. A constant error of the first or the last joint goes into the
/// answer.
///
/// # Needs
/// Three views with rotations about two axes.
///
/// # Errors
/// [`ArmError::WrongCount`], [`ArmError::NotFinite`]; [`PlacementError::NotPlaced`] when the poses do not determine it.
/// Whether the answer fits is checked by [`Placement::check`].
pub fn place(arm: &Arm, views: &[JointView<'_>]) -> Result<Placement, PlacementError> {
    let bare = arm.clone().mounted(nalgebra::Isometry3::identity(), nalgebra::Isometry3::identity());
    let first_from_flange = views.iter().map(|view| bare.forward(view.joints_rad)).collect::<Result<Vec<_>, _>>()?;
    let pairs: Vec<PosePair> = views
        .iter()
        .zip(&first_from_flange)
        // H = Z F T reads as F⁻¹ = T H⁻¹ Z: the flange sees the arm's foot as a camera, on the tip at T⁻¹, sees a target
        // that is in the base at Z.
        .map(|(view, pose)| PosePair {
            anchor_from_mount: view.base_from_tip.relabel(),
            camera_from_target: pose.inverse().relabel(),
        })
        .collect();
    let found = Shah.solve(&pairs)?;
    let base_from_first = *found.anchor_from_target.isometry();
    let flange_from_tip = found.mount_from_camera.isometry().inverse();
    let misses = views
        .iter()
        .zip(&first_from_flange)
        .map(|(view, pose)| {
            Pose::from_isometry(base_from_first * pose.isometry() * flange_from_tip).distance_to(&view.base_from_tip)
        })
        .collect();
    Ok(Placement { arm: bare.mounted(base_from_first, flange_from_tip), misses })
}

/// Finds where the arm is mounted, see [`place`], checks that joint angles and poses belong together, and gives the
/// joints relative to the tip in every view, see [`Arm::tip_from_joints`].
///
/// # Errors
/// Those of [`place`], [`PlacementError::Foreign`], and [`PlacementError::PrismaticOffset`]: an estimate of the arm's errors, which
/// needs these frames, supports revolute joints only.
pub fn place_checked(arm: &Arm, views: &[JointView<'_>]) -> Result<(Placement, TipFromJoints), PlacementError> {
    let placement = place(arm, views)?;
    placement.check()?;
    let twists = views.iter().map(|view| placement.joints_of(view)).collect::<Result<_, _>>()?;
    Ok((placement, twists))
}

#[cfg(test)]
#[path = "placement_tests.rs"]
mod tests;
