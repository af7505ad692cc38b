//! What is known of camera, board and truth at the present moment.

use std::sync::Arc;

use handeye_estimate::handeye::{HandEye, Mode};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;

use super::{BoardItem, CameraItem, Fixed, Item, PlannedItem, Role};
use crate::model::Model;
use crate::solve::state::Solved;
use handeye_link::CellFacts;

/// The ground truth of a simulated cell.
#[derive(Debug, Clone)]
pub struct Truth {
    camera: Fixed<Camera>,
    /// `None` where the cell does not report it.
    board: Option<Fixed<Target>>,
    intrinsics: Option<Intrinsics>,
}

/// Camera and board.
fn places(links: &HandEye) -> (Fixed<Camera>, Fixed<Target>) {
    match *links {
        HandEye::EyeInHand { tip_from_camera, base_from_target } => {
            (Fixed::Tip(tip_from_camera), Fixed::Base(base_from_target))
        }
        HandEye::EyeToHand { base_from_camera, tip_from_target } => {
            (Fixed::Base(base_from_camera), Fixed::Tip(tip_from_target))
        }
    }
}

impl Truth {
    /// From both links.
    pub fn of_links(links: &HandEye, intrinsics: Option<Intrinsics>) -> Self {
        let (camera, board) = places(links);
        Self { camera, board: Some(board), intrinsics }
    }

    /// As published by a cell.
    fn of_cell(facts: &CellFacts) -> Option<Self> {
        let truth = facts.truth.as_ref()?;
        Some(Self {
            camera: Fixed::Tip(truth.tip_from_camera),
            board: truth.base_from_target.map(Fixed::Base),
            intrinsics: Some(truth.intrinsics),
        })
    }
}

/// Everything that was reported so far.
#[derive(Debug, Default)]
pub struct Known {
    /// Where the camera is mounted according to the document; eye in hand before there is one.
    pub document_mode: Option<Mode>,
    /// The target.
    pub target: Option<TargetSpec>,
    pub cell: Option<CellFacts>,
    /// The truth that the document keeps.
    pub document_truth: Option<Truth>,
    /// The newest calibration.
    pub solved: Option<Arc<Solved>>,
    /// The newest tip.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// Where the board is in the newest image according to a simulated cell, which may move it.
    pub base_from_target_true: Option<Pose<Base, Target>>,
    /// Where the board is according to tracking.
    pub base_from_target_tracked: Option<Pose<Base, Target>>,
}

impl Known {
    /// What the window shows. It compares with the truth of the cell that is connected, not with that of the session.
    pub fn of(model: &Model) -> Self {
        let meta = &model.document().meta;
        let tracked = model.track.newest.as_ref().filter(|_| model.track.on);
        Self {
            document_mode: Some(meta.mode),
            target: Some(meta.target),
            cell: model.cell.clone(),
            document_truth: None,
            solved: model.solve.solved.clone(),
            base_from_tip: model.robot.as_ref().map(|robot| robot.base_from_tip),
            base_from_target_true: model.frame.as_ref().and_then(|frame| frame.info.base_from_target_true),
            base_from_target_tracked: tracked.and_then(|it| Some(it.update.estimate.as_ref()?.base_from_target)),
        }
    }

    /// The newest calibration, if it has a hand-eye.
    fn hand_eye(&self) -> Option<&HandEye> {
        self.solved.as_ref()?.calibration.hand_eye.as_ref()
    }

    /// Where the camera is mounted.
    pub fn mode(&self) -> Mode {
        self.hand_eye().map(HandEye::mode).or(self.document_mode).unwrap_or(Mode::EyeInHand)
    }

    /// The truth, where it is known.
    pub fn truth(&self) -> Option<Truth> {
        self.cell.as_ref().and_then(Truth::of_cell).or_else(|| self.document_truth.clone())
    }

    /// The camera: as calibrated, or else from the cell's settings.
    pub fn intrinsics(&self) -> Option<Intrinsics> {
        let calibrated = self.solved.as_ref().and_then(|solved| solved.calibration.intrinsics());
        calibrated
            .or_else(|| self.cell.as_ref()?.nominal_intrinsics)
            .or_else(|| self.document_truth.as_ref()?.intrinsics)
    }

    /// The camera on its mount: as calibrated, or else as the cell reports it, so that there is something to see before
    /// the first calibration. `None` for a robot that does not report it.
    pub fn mount(&self) -> Option<(Role, Fixed<Camera>)> {
        if let Some(hand_eye) = self.hand_eye() {
            return Some((Role::Predictor, places(hand_eye).0));
        }
        let camera = self.truth()?.camera;
        let mode = if matches!(camera, Fixed::Tip(_)) { Mode::EyeInHand } else { Mode::EyeToHand };
        (mode == self.mode()).then_some((Role::Reported, camera))
    }

    /// Where the camera is when the robot reports this pose, see [`Self::mount`].
    pub fn base_from_camera(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Pose<Base, Camera>> {
        self.mount()?.1.in_base(Some(base_from_tip))
    }

    /// Where the calibration predicts the board in an image from this pose: the bare chain.
    pub fn predicted_camera_from_target(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Pose<Camera, Target>> {
        let (camera, board) = places(self.hand_eye()?);
        Some(camera.in_base(Some(base_from_tip))?.inverse() * board.in_base(Some(base_from_tip))?)
    }

    /// The camera, see [`Self::mount`].
    pub fn camera(&self) -> Option<CameraItem> {
        let (role, place) = self.mount()?;
        Some(Item { role, place, shape: Some(self.intrinsics()?) })
    }

    /// What will be seen at a pose that the arm moves to; `None` where the mounting on the tip is not known.
    pub fn planned(&self, base_from_tip: &Pose<Base, Tip>) -> Option<PlannedItem> {
        if let Some(BoardItem { place: Fixed::Tip(tip_from_target), shape: Some(target), .. }) = self.board() {
            return Some(PlannedItem::Board(*base_from_tip * tip_from_target, target));
        }
        let Fixed::Tip(tip_from_camera) = self.camera()?.place else { return None };
        Some(PlannedItem::Camera(*base_from_tip * tip_from_camera, self.intrinsics()?))
    }

    /// The camera where it truly is.
    pub fn true_camera(&self) -> Option<CameraItem> {
        let truth = self.truth()?;
        let place = Fixed::Base(truth.camera.in_base(self.base_from_tip.as_ref())?);
        Some(Item { role: Role::True, place, shape: truth.intrinsics })
    }

    /// The board where it is tracked, where the calibration has it, and where it truly is, as far as that is known.
    pub fn boards(&self) -> impl Iterator<Item = BoardItem> {
        [self.tracked_board(), self.board(), self.true_board()].into_iter().flatten()
    }

    /// The board according to the calibration: where it was, or on the tip.
    pub fn board(&self) -> Option<BoardItem> {
        Some(self.board_at(Role::Predictor, places(self.hand_eye()?).1))
    }

    /// The board where it truly is.
    pub fn true_board(&self) -> Option<BoardItem> {
        let reported = || self.truth()?.board?.in_base(self.base_from_tip.as_ref());
        Some(self.board_at(Role::True, Fixed::Base(self.base_from_target_true.or_else(reported)?)))
    }

    /// The board as it is tracked.
    pub fn tracked_board(&self) -> Option<BoardItem> {
        Some(self.board_at(Role::Tracked, Fixed::Base(self.base_from_target_tracked?)))
    }

    fn board_at(&self, role: Role, place: Fixed<Target>) -> BoardItem {
        Item { role, place, shape: self.target }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::sample;

    #[test]
    fn before_a_calibration_the_camera_is_where_the_cell_says_unless_the_session_has_it_elsewhere() {
        let known = Known::of(&sample::connected());
        assert_eq!(known.camera().map(|camera| camera.role), Some(Role::Reported));
        let beside = Known { document_mode: Some(Mode::EyeToHand), ..known };
        assert!(beside.camera().is_none());
        let calibrated = Known::of(&sample::solved());
        assert_eq!(calibrated.camera().map(|camera| camera.role), Some(Role::Predictor));
    }

    #[test]
    fn a_board_that_the_cell_has_moved_is_where_its_newest_image_has_it() {
        let known = Known::of(&sample::tracking());
        let newest = known.base_from_target_true.expect("the cell says");
        let place = known.true_board().and_then(|board| board.place.in_base(None)).expect("in the base");
        assert_eq!(place, newest);
        let still = Known { base_from_target_true: None, ..known };
        let place = still.true_board().and_then(|board| board.place.in_base(None)).expect("in the base");
        assert_ne!(place, newest);
        let roles: Vec<Role> = still.boards().map(|board| board.role).collect();
        assert_eq!(roles, [Role::Tracked, Role::Predictor, Role::True]);
    }
}
