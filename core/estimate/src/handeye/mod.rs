//! Hand-eye calibration: the problem and its closed forms, from [`handeye_pairs`], and the [joint estimate](joint).

pub mod joint;

pub(crate) use handeye_pairs::consensus;
pub(crate) use handeye_pairs::determined;
pub(crate) use handeye_pairs::draw;
pub(crate) use handeye_pairs::scale;
pub use handeye_pairs::{
    HandEye, HandEyeError, Mode, PosePair, closed_form, motion, numbering, one_axis, pose_graph, screening, subset,
};
