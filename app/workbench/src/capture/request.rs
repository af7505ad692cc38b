//! The request.

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_session::Document;

use crate::capture::state::{CaptureOptions, CapturePurpose};

/// A requested capture.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureRequest {
    /// Its number, included in everything that is reported about it.
    pub number: u64,
    pub purpose: CapturePurpose,
    /// How it is taken.
    pub options: CaptureOptions,
    /// Name of the pose that it is taken at, where it has one.
    pub pose_name: Option<String>,
    /// The existing captures, by number, from which it must differ.
    pub others: Vec<(u32, Pose<Base, Tip>)>,
}

impl CaptureRequest {
    /// For a session. At a pose that has a name a capture may be arbitrarily similar to others: if two poses were
    /// taught close to each other both are wanted, and the reference poses contain one twice.
    pub fn new(
        number: u64,
        purpose: CapturePurpose,
        mut options: CaptureOptions,
        pose_name: Option<String>,
        session: &Document,
    ) -> Self {
        if pose_name.is_some() {
            (options.least_distance_m, options.least_angle_rad) = (0.0, 0.0);
        }
        let others = session.captures.iter().filter_map(|it| Some((it.id.0, it.base_from_tip?))).collect();
        Self { number, purpose, options, pose_name, others }
    }
}
