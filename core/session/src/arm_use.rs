//! What the arm of a session tells about its captures.

use std::collections::BTreeMap;

use nalgebra::Vector6;

use super::capture_id::CaptureId;
use super::document::{CaptureRecord, Document};
use handeye_dataset as dataset;
use handeye_dataset::write::Joints;
use handeye_estimate::placement::{self, JointView, PlacementError};

impl Document {
    /// How the tip moves with each joint in the captures, see [`handeye_arm::Arm::tip_by_joint_at`].
    ///
    /// The captures in use tell where the arm stands, as they do in the session's data set. Another one, excluded or
    /// kept for verification, is there when its joint angles belong to its pose. Nothing is there when the session
    /// names no arm, or one of the captures in use has no joint angles: the others alone would mislead.
    ///
    /// # Errors
    /// [`PlacementError`] when the joint angles are of no use: they do not fit the poses with this arm, or the captures do
    /// not determine where it stands.
    pub fn tip_by_joint(&self) -> Result<BTreeMap<CaptureId, Vec<Vector6<f64>>>, PlacementError> {
        let in_use: Option<Vec<JointView<'_>>> = self.in_use().map(joint_view).collect();
        let (Some(model), Some(in_use)) = (&self.meta.arm, in_use) else { return Ok(BTreeMap::new()) };
        let (placement, _) = placement::place_checked(&model.arm()?, &in_use)?;
        let twists = |capture| placement.tip_by_joint(&joint_view(capture)?).ok();
        Ok(self.captures.iter().filter_map(|capture| Some((capture.id, twists(capture)?))).collect())
    }

    /// The session's `dataset.toml` and `poses.csv`: the captures in use and no others, so that the command line solves
    /// what the window solves. Joint values are there when the arm or the kinds of its joints are known and every one of
    /// these captures has them. Without a robot there is no table.
    pub(super) fn as_dataset(&self) -> (String, Option<String>) {
        let meta = &self.meta;
        let describe = |joints| dataset::write::description(meta.mode, &meta.target, meta.camera.as_ref(), joints);
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
