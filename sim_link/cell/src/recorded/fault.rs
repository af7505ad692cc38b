//! What can be wrong with a session.

use std::fmt;
use std::str::FromStr;

use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Translation3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::Moment;
use crate::scene::Scene;
use handeye_arm::{ArmError, JointValues, MAX_JOINTS};

/// Random numbers of a fault, apart from those of scene and corners.
const FAULT_STREAM: u64 = 4;
/// Halvings of the way to find where the arm was: the last is a thousandth of a millimetre of a metre.
const HALVINGS: usize = 20;

/// One thing that is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// The board slips in its plane before this view, in a direction that follows from the seed.
    BoardSlipped {
        /// The first view after it, counted from 1.
        view: usize,
        /// How far, metres.
        by_m: f64,
    },
    /// The board is not printed as it is stated.
    SquareScale {
        /// True size over stated size.
        scale: f64,
    },
    /// A joint is not where its encoder says.
    JointOffset {
        /// Counted from 1 at the base.
        joint: usize,
        /// True angle minus the encoder's, degrees.
        offset_deg: f64,
    },
    /// One image is taken before the arm has arrived at the pose that is recorded.
    InMotion {
        /// Which, counted from 1.
        view: usize,
        /// How far the tip still has to go, metres.
        by_m: f64,
    },
    /// Every pose is recorded as `tip_from_base`, and stated to be `base_from_tip`.
    PosesInverted,
    /// Positions are recorded in millimetres and stated to be in metres.
    Millimetres,
}

/// A name that no fault has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "there is no fault {0:?}; it is one of slip, square, joint1 to joint{MAX_JOINTS}, motion, inverted, millimetres"
)]
pub struct UnknownFault(pub String);

impl Fault {
    /// The six that a diagnosis has to find: a slip of 5 mm at view 12, squares 2 % too large, joint 4 off by 0.2°, view
    /// 12 taken 10 mm before its pose, inverted poses, millimetres.
    pub const STUDIED: [Self; 6] = [
        Self::BoardSlipped { view: 12, by_m: 0.005 },
        Self::SquareScale { scale: 1.02 },
        Self::JointOffset { joint: 4, offset_deg: 0.2 },
        Self::InMotion { view: 12, by_m: 0.010 },
        Self::PosesInverted,
        Self::Millimetres,
    ];

    /// The view that it begins at or is in, counted from 1, if it is of some views only.
    pub(super) fn view(self) -> Option<usize> {
        match self {
            Self::BoardSlipped { view, .. } | Self::InMotion { view, .. } => Some(view),
            _ => None,
        }
    }

    /// What of it is a matter of the scene.
    pub(super) fn change_scene(self, scene: &mut Scene) {
        match self {
            Self::SquareScale { scale } => {
                scene.board.square_m *= scale;
                // The sheet is as much larger, so that a print that just fits still does.
                scene.board.paper_m = scene.board.paper_m.map(|side| side * scale.max(1.0));
            }
            Self::JointOffset { joint, offset_deg } => {
                let joints = scene.robot.start_joints_deg.len();
                let offsets = scene.robot.joint_offset_deg.get_or_insert(JointValues::zeros(joints));
                if let Some(offset) = joint.checked_sub(1).and_then(|index| offsets.get_mut(index)) {
                    *offset += offset_deg;
                }
            }
            _ => {}
        }
    }

    /// Where the sheet is, in its own axes, when the image is taken.
    pub(super) fn slip(self, moment: &Moment<'_>) -> Isometry3<f64> {
        match self {
            Self::BoardSlipped { view, by_m } if moment.view >= view => {
                let mut rng = ChaCha8Rng::seed_from_u64(moment.truth.seed);
                rng.set_stream(FAULT_STREAM);
                let heading = std::f64::consts::TAU * rng.random::<f64>();
                Translation3::new(by_m * heading.cos(), by_m * heading.sin(), 0.0).into()
            }
            _ => Isometry3::identity(),
        }
    }

    /// What the encoders showed when the image was taken.
    pub(super) fn encoders_of_image(self, moment: &Moment<'_>) -> Result<JointValues, ArmError> {
        let Self::InMotion { view, by_m } = self else { return Ok(moment.encoders) };
        if moment.view != view {
            return Ok(moment.encoders);
        }
        // Back along the straight way in joint space; all of it where that is shorter.
        let (here, before) = (moment.encoders, moment.before);
        let at = |part: f64| JointValues::from_fn(here.len(), |i| here[i] + part * (before[i] - here[i]));
        let arrived = moment.truth.reported_tip(&here)?;
        let distance_m = |part: f64| moment.truth.reported_tip(&at(part)).map(|tip| tip.distance_to(&arrived).0);
        let (mut near, mut far) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (near + far);
            if distance_m(middle)? < by_m { near = middle } else { far = middle }
        }
        Ok(at(far))
    }

    /// How a reported pose is written down.
    pub(super) fn written(self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Tip> {
        match self {
            // The mistake itself: what is `tip_from_base` is stated to be `base_from_tip`.
            Self::PosesInverted => base_from_tip.inverse().relabel(),
            Self::Millimetres => {
                let millimetres = base_from_tip.translation() * 1e3;
                Pose::from_isometry(Isometry3::from_parts(millimetres.into(), base_from_tip.rotation()))
            }
            _ => *base_from_tip,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BoardSlipped { .. } => f.write_str("slip"),
            Self::SquareScale { .. } => f.write_str("square"),
            Self::JointOffset { joint, .. } => write!(f, "joint{joint}"),
            Self::InMotion { .. } => f.write_str("motion"),
            Self::PosesInverted => f.write_str("inverted"),
            Self::Millimetres => f.write_str("millimetres"),
        }
    }
}

impl FromStr for Fault {
    type Err = UnknownFault;

    /// The fault of that name with the size that [`Self::STUDIED`] has; any joint for `joint4`.
    fn from_str(text: &str) -> Result<Self, UnknownFault> {
        let joint = (1..=MAX_JOINTS).map(|joint| Self::JointOffset { joint, offset_deg: 0.2 });
        let found = Self::STUDIED.into_iter().chain(joint).find(|fault| fault.to_string() == text);
        found.ok_or_else(|| UnknownFault(text.to_owned()))
    }
}
