//! Where everything is in the cell: one list of items, from which the 3D pane is painted and the recording is written.
//!
//! [`Known`] is what has been reported so far about cell, camera, board and truth; the items follow from it. An item is
//! plain data: what it is, where it is, and its shape. How that looks, and when it is drawn, is up to the renderer.

mod arm;
mod captures;
pub mod command;
mod extent;
mod known;
pub(crate) mod update;
pub(crate) mod view;

pub use arm::{PosedArm, posed_arm};
pub use captures::{BAD_AT_MEDIANS, CaptureItem, CaptureUse, Captures, outcome};
pub use command::Command;
pub use extent::Extent;
pub use known::{Known, Truth};
pub use view::{AZIMUTH_RAD, ELEVATION_RAD, OPENING_RAD, SceneView};

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Frame, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use nalgebra::{Isometry3, Point3};

use crate::model::Model;

/// What something is fixed to.
#[derive(Debug, Clone, Copy)]
pub enum Fixed<F: Frame> {
    Base(Pose<Base, F>),
    Tip(Pose<Tip, F>),
}

impl<F: Frame> Fixed<F> {
    /// Where it is with the tip there; `None` for something on the tip if the tip is not known.
    pub fn in_base(&self, base_from_tip: Option<&Pose<Base, Tip>>) -> Option<Pose<Base, F>> {
        match self {
            Self::Base(base_from_it) => Some(*base_from_it),
            Self::Tip(tip_from_it) => base_from_tip.map(|base_from_tip| *base_from_tip * *tip_from_it),
        }
    }

    /// Its pose in what it is fixed to.
    pub fn isometry(&self) -> &Isometry3<f64> {
        match self {
            Self::Base(base_from_it) => base_from_it.isometry(),
            Self::Tip(tip_from_it) => tip_from_it.isometry(),
        }
    }
}

/// How the place of something is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// From the calibration.
    Predictor,
    /// As the cell reports it, before there is a calibration.
    Reported,
    /// From tracking.
    Tracked,
    /// As a simulated cell reports it, for comparison.
    True,
}

/// Something in the cell.
#[derive(Debug, Clone, Copy)]
pub struct Item<F: Frame, Shape> {
    /// How its place is known.
    pub role: Role,
    /// Where it is.
    pub place: Fixed<F>,
    /// What it looks like, where that is known.
    pub shape: Option<Shape>,
}

pub type CameraItem = Item<Camera, Intrinsics>;
pub type BoardItem = Item<Target, TargetSpec>;

/// What will be at a pose that the arm moves to.
#[derive(Debug, Clone, Copy)]
pub enum PlannedItem {
    /// The camera on the tip.
    Camera(Pose<Base, Camera>, Intrinsics),
    /// The board on the tip.
    Board(Pose<Base, Target>, TargetSpec),
}

/// The view of everything that the window shows of the cell; `None` if there is nothing.
pub fn fitted_view(model: &Model) -> Option<SceneView> {
    let robot = model.robot.as_ref().filter(|robot| robot.base_from_tip.is_finite());
    let arm = robot.and_then(|robot| posed_arm(model.cell.as_ref(), &robot.base_from_tip, &robot.joints_rad));
    let captures = model.document().captures.iter().filter_map(|capture| capture.base_from_tip.as_ref());
    let extent = Extent::of(&Known::of(model), arm.as_ref(), captures)?;
    Some(SceneView { centre_m: extent.centre.into(), distance_m: extent.distance_m(), ..SceneView::default() })
}

/// The corners of the end of the pyramid that a camera sees, at this distance \[m\], in its frame: top left, top right,
/// bottom right, bottom left. Lens distortion is not included.
pub fn frustum_end(intrinsics: &Intrinsics, length_m: f64) -> [Point3<f64>; 4] {
    let Intrinsics { width, height, fx, fy, cx, cy, .. } = *intrinsics;
    let (right, bottom) = (f64::from(width) - 0.5, f64::from(height) - 0.5);
    let corner = |u: f64, v: f64| Point3::new((u - cx) / fx, (v - cy) / fy, 1.0) * length_m;
    [corner(-0.5, -0.5), corner(right, -0.5), corner(right, bottom), corner(-0.5, bottom)]
}

/// The corners of the outer edge of a board, with the row of squares around the inner corners of a chessboard, wider by a
/// part of a square: the first next to the origin, then along x.
pub fn outline(target: &TargetSpec, margin: f64) -> [Point3<f64>; 4] {
    let before = (1.0 + margin) * target.grid().square_m;
    let far = target.extent().add_scalar(before);
    let at = |x: f64, y: f64| Point3::new(x, y, 0.0);
    [at(-before, -before), at(far.x, -before), at(far.x, far.y), at(-before, far.y)]
}
