//! Hand-eye calibration from pairs of poses: of the robot, and of the target in the camera.
//!
//! The problem in its two set-ups, seven closed forms, and the estimation of both links with noise levels and without
//! outliers:
//!
//! ```
//! use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
//! use handeye_pairs::PosePair;
//! use handeye_pairs::closed_form::{ClosedForm as _, ParkMartin};
//! use nalgebra::{Isometry3, Vector3};
//!
//! # fn main() -> Result<(), handeye_pairs::HandEyeError> {
//! // What a robot would see that has its camera here, and the target there.
//! let mount_from_camera: Pose<Mount, Camera> =
//!     Pose::from_isometry(Isometry3::new(Vector3::new(0.05, 0.0, 0.08), Vector3::z() * 1.5));
//! let anchor_from_target: Pose<Anchor, Target> =
//!     Pose::from_isometry(Isometry3::new(Vector3::new(0.5, 0.1, 0.0), Vector3::x() * 3.1));
//! let pair = |k: f64| {
//!     let turn = Vector3::new(0.5 * k.cos(), 0.5 * k.sin(), 0.1 * k);
//!     let anchor_from_mount = Pose::from_isometry(Isometry3::new(Vector3::new(0.3, 0.1 * k, 0.5), turn));
//!     let camera_from_target = mount_from_camera.inverse() * anchor_from_mount.inverse() * anchor_from_target;
//!     PosePair { anchor_from_mount, camera_from_target }
//! };
//! let pairs: Vec<PosePair> = [0.0, 1.0, 2.0, 3.0, 4.0].map(pair).to_vec();
//!
//! let found = ParkMartin.solve(&pairs)?;
//! let (off_m, off_rad) = found.mount_from_camera.distance_to(&mount_from_camera);
//! assert!(off_m < 1e-9 && off_rad < 1e-7, "{off_m} {off_rad}");
//! # Ok(())
//! # }
//! ```
//!
//! No closed form weights its data, and none states an error. The joint estimate from corners, which does, begins with them: it is
//! in `handeye_estimate`.
//!
//! | module | does |
//! | --- | --- |
//! | [`closed_form`] | Tsai & Lenz, Park & Martin, Horaud & Dornaika, Andreff, Daniilidis, Shah, Li |
//! | [`consensus`] | a start that most views agree with |
//! | [`pose_graph`] | both links from all pairs, with noise levels |
//! | [`screening`] | views that do not agree with the others |
//! | [`scale`] | poses of a target of unknown size |
//! | [`one_axis`] | what turns about one axis determine |
//! | [`motion`] | whether the robot turned enough, and about what |
//! | [`numbering`] | targets that look the same after a turn |
//! | [`clock_offset`] | offset between the clocks of robot and camera |
//! | [`subset`], [`draw`] | views for work that grows with their square, random numbers that are the same every time |
//!
//! # The problem
//! Both set-ups are one problem once the two rigid links are named by their function: the *mount* carries the camera,
//! the *anchor* carries the target.
//!
//! | set-up | mount | anchor | `anchor_from_mount` of a view |
//! | --- | --- | --- | --- |
//! | eye in hand | tip | base | `base_from_tip` |
//! | eye to hand | base | tip | `tip_from_base` |
//!
//! Unknown are `mount_from_camera` and `anchor_from_target`, with
//! `anchor_from_mount_i * mount_from_camera * camera_from_target_i = anchor_from_target` for every view `i`.
//!
//! Never depends on images, files, OpenCV, windows or sockets.

#![warn(missing_docs)]

pub mod clock_offset;
pub mod closed_form;
pub mod consensus;
pub mod draw;
pub mod motion;
pub mod numbering;
pub mod one_axis;
pub mod pose_graph;
pub mod scale;
pub mod screening;
pub mod subset;

use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
pub use handeye_geometry::observations::Mode;
use handeye_wording::Text;
use handeye_wording::text;

/// The two rigid links that a hand-eye calibration finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HandEye {
    /// Camera on the tip.
    EyeInHand {
        /// The camera on the tip.
        tip_from_camera: Pose<Tip, Camera>,
        /// The target in the base.
        base_from_target: Pose<Base, Target>,
    },
    /// Camera next to the robot.
    EyeToHand {
        /// The camera in the base.
        base_from_camera: Pose<Base, Camera>,
        /// The target on the tip.
        tip_from_target: Pose<Tip, Target>,
    },
}

impl HandEye {
    /// The links of the common problem in the frames of a set-up.
    pub fn new(mode: Mode, mount_from_camera: Pose<Mount, Camera>, anchor_from_target: Pose<Anchor, Target>) -> Self {
        match mode {
            Mode::EyeInHand => Self::EyeInHand {
                tip_from_camera: mount_from_camera.relabel(),
                base_from_target: anchor_from_target.relabel(),
            },
            Mode::EyeToHand => Self::EyeToHand {
                base_from_camera: mount_from_camera.relabel(),
                tip_from_target: anchor_from_target.relabel(),
            },
        }
    }

    /// The set-up.
    pub fn mode(&self) -> Mode {
        match self {
            Self::EyeInHand { .. } => Mode::EyeInHand,
            Self::EyeToHand { .. } => Mode::EyeToHand,
        }
    }

    /// The hand-eye transform proper, in the frames of the common problem.
    pub fn mount_from_camera(&self) -> Pose<Mount, Camera> {
        match self {
            Self::EyeInHand { tip_from_camera, .. } => tip_from_camera.relabel(),
            Self::EyeToHand { base_from_camera, .. } => base_from_camera.relabel(),
        }
    }

    /// Where the target is, in the frames of the common problem.
    pub fn anchor_from_target(&self) -> Pose<Anchor, Target> {
        match self {
            Self::EyeInHand { base_from_target, .. } => base_from_target.relabel(),
            Self::EyeToHand { tip_from_target, .. } => tip_from_target.relabel(),
        }
    }

    /// Pose of the target in the camera for a tip pose.
    pub fn camera_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Camera, Target> {
        match *self {
            Self::EyeInHand { tip_from_camera, base_from_target } => {
                tip_from_camera.inverse() * base_from_tip.inverse() * base_from_target
            }
            Self::EyeToHand { base_from_camera, tip_from_target } => {
                base_from_camera.inverse() * *base_from_tip * tip_from_target
            }
        }
    }

    /// The tip pose at which the target is seen like this.
    pub fn base_from_tip(&self, camera_from_target: &Pose<Camera, Target>) -> Pose<Base, Tip> {
        match *self {
            Self::EyeInHand { tip_from_camera, base_from_target } => {
                base_from_target * camera_from_target.inverse() * tip_from_camera.inverse()
            }
            Self::EyeToHand { base_from_camera, tip_from_target } => {
                base_from_camera * *camera_from_target * tip_from_target.inverse()
            }
        }
    }
}

/// One view as input to the closed-form solvers: the robot's pose and the target's pose in the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosePair {
    /// Robot pose, see the table of [this crate](self).
    pub anchor_from_mount: Pose<Anchor, Mount>,
    /// Target pose in the camera, from PnP.
    pub camera_from_target: Pose<Camera, Target>,
}

/// Why a hand-eye calibration has no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum HandEyeError {
    /// Fewer views than the method needs.
    #[error("views with a robot pose and the target in sight: {got}, at least {need} are needed; capture more poses")]
    TooFewViews {
        /// Usable views.
        got: usize,
        /// Views needed.
        need: usize,
    },
    /// The robot never turned, so the rotation of the camera on it cannot be determined.
    #[error(
        "the robot turned by no more than {largest_deg:.3}° between any two views: turn the tip by 30° or more about \
         two different axes"
    )]
    NoRotation {
        /// Largest rotation between two views, degrees.
        largest_deg: f64,
    },
    /// The robot turned about one direction only, so the translation along it cannot be determined.
    #[error(
        "all rotations are about the same axis [{x:.3} {y:.3} {z:.3}] of the {frame} (spread {spread_deg:.3}°): add views \
         turned about another axis",
        x = axis[0],
        y = axis[1],
        z = axis[2],
        frame = named(frame)
    )]
    ParallelAxes {
        /// The common axis.
        axis: [f64; 3],
        /// Frame in which it is given.
        frame: &'static str,
        /// How far the axes spread, degrees.
        spread_deg: f64,
    },
    /// A robot or target pose is not a finite transform.
    #[error("the pose of view {index} is not finite")]
    NotFinite {
        /// Which view, counted from 0.
        index: usize,
    },
    /// The caller asked the work to end.
    #[error("cancelled")]
    Cancelled,
    /// The linear algebra found no solution although the views look sufficient.
    #[error("{method} found no solution for these {views} views: {reason}")]
    NoSolution {
        /// Name of the closed form, or of the pose graph.
        method: &'static str,
        /// Number of views.
        views: usize,
        /// What failed.
        reason: &'static str,
    },
}

fn named(frame: &str) -> Text {
    match frame {
        "tip" => text!("tip"),
        "base" => text!("base"),
        other => Text::verbatim(other),
    }
}

/// The solution; `None` where the data do not determine one.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn determined<T>(found: Result<T, HandEyeError>) -> Result<Option<T>, HandEyeError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(HandEyeError::Cancelled) => Err(HandEyeError::Cancelled),
        Err(_) => Ok(None),
    }
}
