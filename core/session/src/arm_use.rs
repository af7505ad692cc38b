//! What the arm of a session shows about its captures.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use super::capture_id::CaptureId;
use super::document::{CaptureRecord, Document};
use handeye_dataset as dataset;
use handeye_dataset::write::Joints;
use handeye_estimate::placement::{self, JointView, Placement, PlacementError};

impl Document {
    /// The arm where the captures in use put it, as they do in the session's data set. `None` when the session names no arm, or
    /// one of the captures in use has no joint angles: the others alone would mislead.
    ///
    /// # Errors
    /// [`PlacementError`] when the joint angles are of no use: they do not fit the poses with this arm, or the captures do
    /// not determine where the arm is.
    pub(crate) fn placement(&self) -> Result<Option<Placement>, PlacementError> {
        let in_use: Option<Vec<JointView<'_>>> = self.in_use().map(joint_view).collect();
        let (Some(model), Some(in_use)) = (&self.meta.arm, in_use) else { return Ok(None) };
        let (placement, _) = placement::place_checked(&model.arm()?, &in_use)?;
        Ok(Some(placement))
    }

    /// Poses of the joints relative to the tip in the captures, see [`handeye_arm::Arm::tip_from_joints`]. A capture that is
    /// excluded or kept for verification is included when its joint angles belong to its pose.
    pub(crate) fn tip_from_joints(&self, placement: &Placement) -> BTreeMap<CaptureId, Vec<Isometry3<f64>>> {
        let frames = |capture| placement.tip_from_joints(&joint_view(capture)?).ok();
        self.captures.iter().filter_map(|capture| Some((capture.id, frames(capture)?))).collect()
    }

    /// The session's `dataset.toml` and `poses.csv`: the captures in use and no others, so that the command line solves
    /// what the window solves. Joint values are there when the arm or the kinds of its joints are known and every one of
    /// these captures has them. Without a robot there is no table.
    pub(super) fn as_dataset(&self) -> (String, Option<String>) {
        let meta = &self.meta;
        let describe = |joints| {
            let (tool_m, accuracy_mm) = (meta.tool_m, meta.robot_accuracy_mm);
            let robot = dataset::write::Robot { joints, tool_m, accuracy_mm };
            dataset::write::description(meta.mode, &meta.target, meta.camera.as_ref(), robot)
        };
        if self.mode().is_none() {
            let images = self.in_use().map(|capture| capture.image.as_str());
            let description = dataset::write::description_of_images(images, &meta.target, meta.camera.as_ref());
            return (description, None);
        }
        if let Some((joints, table)) = self.joints().and_then(|joints| Some((joints, self.table_with_joints(joints)?)))
        {
            return (describe(Some(joints)), Some(table));
        }
        let views = self.in_use().filter_map(|capture| Some((capture.image.as_str(), capture.base_from_tip.as_ref()?)));
        (describe(None), Some(dataset::write::pose_table(views)))
    }

    fn joints(&self) -> Option<Joints<'_>> {
        let unknown = || self.meta.joint_kinds.as_ref().map(|kinds| Joints::Count(kinds.len()));
        self.meta.arm.as_ref().map(Joints::Of).or_else(unknown)
    }

    fn table_with_joints(&self, joints: Joints<'_>) -> Option<String> {
        let joints = joints.count()?;
        let rows = self
            .in_use()
            .map(|capture| {
                let joints_rad = capture.joints_rad.as_deref().filter(|values| values.len() == joints)?;
                Some((capture.image.as_str(), capture.base_from_tip.as_ref()?, joints_rad))
            })
            .collect::<Option<Vec<_>>>()?;
        Some(dataset::write::pose_table_with_joints(joints, rows))
    }
}

fn joint_view(capture: &CaptureRecord) -> Option<JointView<'_>> {
    Some(JointView { base_from_tip: capture.base_from_tip?, joints_rad: capture.joints_rad.as_deref()? })
}

#[cfg(test)]
#[path = "arm_use_tests.rs"]
mod tests;
