//! What is known of camera, board and truth at the present moment.

use std::sync::Arc;

use handeye_core::camera::Intrinsics;
use handeye_core::frames::{Base, Camera, Pose, Target, Tip};
use handeye_core::handeye::{HandEye, Mode};
use handeye_core::target::TargetSpec;

use crate::model::{CellFacts, Solved};

/// What of a simulated cell is true.
#[derive(Debug, Clone)]
pub(super) struct Truth {
    /// The camera on its mount.
    mount: Mount,
    /// The board; `None` where the cell does not say.
    board: Option<Anchor>,
    /// The camera.
    pub intrinsics: Option<Intrinsics>,
}

/// Where a camera is fixed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Mount {
    Tip(Pose<Tip, Camera>),
    Base(Pose<Base, Camera>),
}

/// Where a board is fixed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Base(Pose<Base, Target>),
    Tip(Pose<Tip, Target>),
}

impl Mount {
    pub fn of(hand_eye: &HandEye) -> Self {
        match *hand_eye {
            HandEye::EyeInHand { tip_from_camera, .. } => Self::Tip(tip_from_camera),
            HandEye::EyeToHand { base_from_camera, .. } => Self::Base(base_from_camera),
        }
    }

    pub fn base_from_camera(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Camera> {
        match *self {
            Self::Tip(tip_from_camera) => *base_from_tip * tip_from_camera,
            Self::Base(base_from_camera) => base_from_camera,
        }
    }

    fn mode(&self) -> Mode {
        match self {
            Self::Tip(_) => Mode::EyeInHand,
            Self::Base(_) => Mode::EyeToHand,
        }
    }
}

impl Anchor {
    pub fn of(hand_eye: &HandEye) -> Self {
        match *hand_eye {
            HandEye::EyeInHand { base_from_target, .. } => Self::Base(base_from_target),
            HandEye::EyeToHand { tip_from_target, .. } => Self::Tip(tip_from_target),
        }
    }

    pub fn base_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Target> {
        match *self {
            Self::Base(base_from_target) => base_from_target,
            Self::Tip(tip_from_target) => *base_from_tip * tip_from_target,
        }
    }
}

impl Truth {
    /// Of both links.
    pub fn of_links(links: &HandEye, intrinsics: Option<Intrinsics>) -> Self {
        Self { mount: Mount::of(links), board: Some(Anchor::of(links)), intrinsics }
    }

    /// As a cell publishes it.
    pub fn of_cell(facts: &CellFacts) -> Option<Self> {
        let truth = facts.truth.as_ref()?;
        Some(Self {
            mount: Mount::Tip(truth.tip_from_camera),
            board: truth.base_from_target.map(Anchor::Base),
            intrinsics: Some(truth.intrinsics),
        })
    }

    /// Where the camera is.
    pub fn base_from_camera(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Camera> {
        self.mount.base_from_camera(base_from_tip)
    }

    /// Where the board is.
    pub fn base_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Pose<Base, Target>> {
        Some(self.board?.base_from_target(base_from_tip))
    }
}

/// Everything that entries so far have told.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// Where the camera sits by the document; eye in hand before there is one.
    pub document_mode: Option<Mode>,
    /// What is looked at.
    pub target: Option<TargetSpec>,
    /// The cell.
    pub cell: Option<Arc<CellFacts>>,
    /// The truth that the document keeps.
    pub document_truth: Option<Truth>,
    /// The newest calibration.
    pub solved: Option<Arc<Solved>>,
    /// The newest tip.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// The far plane of the depth sensor \[m\], once a picture told.
    pub far_plane_m: Option<f32>,
}

impl Known {
    /// The newest calibration, if it has a hand-eye.
    pub fn hand_eye(&self) -> Option<&HandEye> {
        self.solved.as_ref()?.calibration.hand_eye.as_ref()
    }

    /// Where the camera sits.
    pub fn mode(&self) -> Mode {
        self.hand_eye().map(HandEye::mode).or(self.document_mode).unwrap_or(Mode::EyeInHand)
    }

    /// The truth, where it is known.
    pub fn truth(&self) -> Option<Truth> {
        self.cell.as_deref().and_then(Truth::of_cell).or_else(|| self.document_truth.clone())
    }

    /// The camera: as calibrated, or else as the cell's settings say.
    pub fn intrinsics(&self) -> Option<Intrinsics> {
        let calibrated = self.solved.as_ref().and_then(|solved| solved.calibration.intrinsics);
        calibrated
            .or_else(|| Some(self.cell.as_ref()?.nominal_intrinsics))
            .or_else(|| self.document_truth.as_ref()?.intrinsics)
    }

    /// The camera on its mount: as calibrated, or else as the cell says of itself, so that there is something to see
    /// before the first calibration. `None` for a robot that says nothing.
    pub fn mount(&self) -> Option<Mount> {
        self.hand_eye().map(Mount::of).or_else(|| Some(self.truth()?.mount)).filter(|mount| mount.mode() == self.mode())
    }

    /// Where the camera is when the robot reports this pose, see [`Self::mount`].
    pub fn base_from_camera(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Pose<Base, Camera>> {
        Some(self.mount()?.base_from_camera(base_from_tip))
    }

    /// Where the calibration has the board in a picture from this pose: the bare chain.
    pub fn predicted_camera_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Pose<Camera, Target>> {
        let hand_eye = self.hand_eye()?;
        let base_from_camera = Mount::of(hand_eye).base_from_camera(base_from_tip);
        Some(base_from_camera.inverse() * Anchor::of(hand_eye).base_from_target(base_from_tip))
    }
}
