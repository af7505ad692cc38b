//! The effect of a hypothesis on the views: its columns in the linear model.

use std::ops::Range;

use nalgebra::{DMatrix, Vector6};

use super::model::Model;
use handeye_geometry::targets::observation::tip_by_joint;

/// A hypothesis that one change explains many views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Effect {
    /// The target is larger or smaller than stated: relative size minus one.
    Scale,
    /// The board is bent: the two warps of [`handeye_geometry::targets::bent`], metres.
    Warp,
    /// The intrinsics given are wrong: all parameters of the lens.
    Lens,
    /// The centre of the intrinsics given is wrong: two pixels. Of the lens it is what the images show least and what other
    /// programs count in another way; alone it is significant where all parameters together are not.
    Centre,
    /// The target moved on its carrier before this view: a twist in the target's frame.
    BoardMoved(usize),
    /// The camera moved on its carrier before this view: a twist in the camera's frame.
    CameraMoved(usize),
    /// A joint's zero is off: radians.
    Joint(usize),
}

/// Places of cx and cy among the parameters of every lens.
const CENTRE: Range<usize> = 2..4;

impl Effect {
    /// Whether it is an error of the given intrinsics.
    pub fn is_of_lens(self) -> bool {
        matches!(self, Self::Lens | Self::Centre)
    }

    /// How many numbers it takes.
    pub fn numbers(self, lens: usize) -> usize {
        match self {
            Self::Scale | Self::Joint(_) => 1,
            Self::Warp | Self::Centre => 2,
            Self::Lens => lens,
            Self::BoardMoved(_) | Self::CameraMoved(_) => 6,
        }
    }

    /// Which columns of the form it frees: those of the lens come first, then the warps.
    pub fn form_columns(self, lens: usize) -> Vec<usize> {
        match self {
            Self::Warp => vec![lens, lens + 1],
            Self::Lens => (0..lens).collect(),
            Self::Centre => CENTRE.collect(),
            _ => Vec::new(),
        }
    }

    /// Jacobian of the residual of a view with respect to its numbers.
    pub fn columns(self, model: &Model<'_>, view: usize) -> DMatrix<f64> {
        let (row, seen) = (&model.rows[view], &model.sight.views[view]);
        let lens = model.sight.lens_count();
        let square = |matrix: &nalgebra::Matrix6<f64>, moved: bool| {
            if moved { DMatrix::from_iterator(6, 6, matrix.iter().copied()) } else { DMatrix::zeros(6, 6) }
        };
        match self {
            // A larger target is farther away by the same factor; its pose was measured too near.
            Self::Scale => {
                let pose = &seen.camera_from_target;
                let along = pose.rotation.inverse() * pose.translation.vector;
                DMatrix::from_fn(6, 1, |i, _| if i < 3 { -along[i] } else { 0.0 })
            }
            Self::Warp => seen.by_form.columns(lens, 2).into_owned(),
            Self::Lens => seen.by_form.columns(0, lens).into_owned(),
            Self::Centre => seen.by_form.columns(CENTRE.start, CENTRE.len()).into_owned(),
            Self::BoardMoved(from) => square(&nalgebra::Matrix6::identity(), view >= from),
            Self::CameraMoved(from) => square(&row.by_hand_eye, view >= from),
            Self::Joint(joint) => {
                let twist = seen.tip_from_joints.get(joint).map_or_else(Vector6::zeros, tip_by_joint);
                let turned = row.by_robot * twist;
                DMatrix::from_iterator(6, 1, turned.iter().copied())
            }
        }
    }
}
