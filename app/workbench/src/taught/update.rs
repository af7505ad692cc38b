//! Taught poses.

use std::path::{Path, PathBuf};

use handeye_arm::{JointKind, JointValues};
use handeye_dataset::taught_poses::{Goal, TaughtPose, TaughtPoses};
use handeye_session::{Edit, TaughtChange};

use crate::app::App;
use crate::model::{MotionGoal, MotionOutcome, Severity};
use crate::session::start::REFERENCE_POSES;
use crate::worker::FileTask;
use handeye_wording::text;

/// The reference poses.
pub fn reference_poses() -> Vec<TaughtPose> {
    match TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES) {
        Ok(taught) => taught.poses,
        // It is part of the program and a test reads it.
        Err(error) => {
            tracing::error!(%error, "the reference poses cannot be read");
            Vec::new()
        }
    }
}

impl App {
    /// These are the poses of this cell now; those of others stay.
    fn edit_taught(&mut self, change: TaughtChange, poses: Vec<TaughtPose>) {
        let Some(cell) = self.model.taught_on(self.model.document().meta.target) else {
            return self.say(Severity::Warning, text!("Taught poses belong to an arm: connect it first"));
        };
        let mut all = self.model.document().taught.clone();
        all.retain(|pose| !pose.is_of(Some(&cell)));
        all.extend(poses.into_iter().map(|pose| TaughtPose { cell: Some(cell.clone()), ..pose }));
        self.edit(Edit::SetTaught { change, poses: all });
    }

    fn taught(&self) -> Vec<TaughtPose> {
        self.model.taught().into_iter().cloned().collect()
    }

    /// Joints are remembered and not the tip, because they bring the arm back on the same way.
    pub(crate) fn teach(&mut self, name: Option<String>) {
        let Some(robot) = &self.model.robot else {
            self.say(Severity::Warning, text!("The position of the arm is not known: connect first"));
            return;
        };
        let goal = Goal::Joints(robot.joints_rad.to_vec());
        let mut poses = self.taught();
        let name = name.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
        let name = name.unwrap_or_else(|| free_name(&poses));
        poses.push(TaughtPose::new(name.clone(), goal));
        self.edit_taught(TaughtChange::Add(name), poses);
    }

    pub(crate) fn remove_taught(&mut self, name: &str) {
        let mut poses = self.taught();
        poses.retain(|pose| pose.name != name);
        self.edit_taught(TaughtChange::Remove(name.to_owned()), poses);
    }

    pub(crate) fn rename_taught(&mut self, from: &str, to: &str) {
        let to = to.trim();
        if from == to {
            return;
        }
        let mut poses = self.taught();
        for pose in poses.iter_mut().filter(|pose| pose.name == from) {
            to.clone_into(&mut pose.name);
        }
        self.edit_taught(TaughtChange::Rename { from: from.to_owned(), to: to.to_owned() }, poses);
    }

    pub(crate) fn reorder_taught(&mut self, name: &str, to: usize) {
        let mut poses = self.taught();
        let Some(from) = poses.iter().position(|pose| pose.name == name) else { return };
        let pose = poses.remove(from);
        poses.insert(to.min(poses.len()), pose);
        self.edit_taught(TaughtChange::Reorder(name.to_owned()), poses);
    }

    pub(crate) fn teach_reference(&mut self) {
        if self.model.has_reference_poses() {
            self.edit_taught(TaughtChange::Replace, reference_poses());
        }
    }

    /// A person says that arm, base and target are as they were where the poses were taught.
    pub(crate) fn adopt_taught(&mut self) {
        let Some(cell) = self.model.taught_on(self.model.document().meta.target) else { return };
        let fits = |pose: &&TaughtPose| match &pose.goal {
            Goal::Joints(joints) => joints.len() == cell.joints.len(),
            Goal::Tip(_) => true,
        };
        let elsewhere = self.model.document().taught.iter().filter(|pose| !pose.is_of(Some(&cell)));
        let (fit, others): (Vec<&TaughtPose>, Vec<&TaughtPose>) = elsewhere.partition(fits);
        let (adopted, others) = (fit.into_iter().cloned().collect::<Vec<_>>(), others.len());
        if others > 0 {
            let said = text!("{n} {n|pose has|poses have} another number of joints than this arm", n = others);
            self.say(Severity::Warning, said);
        }
        if adopted.is_empty() {
            return;
        }
        let change = TaughtChange::Import(adopted.len() as u32);
        let mut poses = self.taught();
        let mut all = self.model.document().taught.clone();
        all.retain(|pose| !adopted.contains(pose) && !pose.is_of(Some(&cell)));
        add_under_free_names(&mut poses, adopted);
        all.extend(poses.into_iter().map(|pose| TaughtPose { cell: Some(cell.clone()), ..pose }));
        self.edit(Edit::SetTaught { change, poses: all });
    }

    pub(crate) fn import_taught(&mut self, file: PathBuf) {
        let asked = self.desk.files(FileTask::ReadPoses(file));
        self.expect(text!("The poses were not read"), asked);
    }

    pub(crate) fn poses_read(&mut self, read: Vec<TaughtPose>) {
        let count = read.len() as u32;
        let mut poses = self.taught();
        add_under_free_names(&mut poses, read);
        self.edit_taught(TaughtChange::Import(count), poses);
    }

    pub(crate) fn export_taught(&mut self, file: PathBuf) {
        let poses = self.taught();
        let joints = poses.iter().find_map(|pose| match &pose.goal {
            Goal::Joints(joints) => Some(joints.len()),
            Goal::Tip(_) => None,
        });
        let is_prismatic = |joint: &usize| self.model.joint_kind(*joint) == JointKind::Prismatic;
        let prismatic = (0..joints.unwrap_or(0)).filter(is_prismatic).collect();
        let asked = self.desk.files(FileTask::WritePoses { file, poses, prismatic });
        self.expect(text!("The poses were not written"), asked);
    }

    pub(crate) fn visit_taught(&mut self, name: &str) {
        if self.may_set_out() {
            self.go_to_taught(name);
        }
    }

    pub(crate) fn go_to_taught(&mut self, name: &str) {
        let what = text!("pose {name}", name = name);
        let goal = self.model.taught().into_iter().find(|pose| pose.name == name).map(|pose| match &pose.goal {
            Goal::Tip(base_from_tip) => Some(MotionGoal::Tip(*base_from_tip)),
            Goal::Joints(joints) => JointValues::try_from(&joints[..]).ok().map(MotionGoal::Joints),
        });
        match goal {
            Some(Some(goal)) => self.set_out(goal, what),
            Some(None) => {
                let why = text!("no arm has as many joints as the pose");
                self.moved(self.numbers.motion, MotionOutcome::Refused(why));
            }
            None => {
                let why = text!("it is no longer taught");
                self.moved(self.numbers.motion, MotionOutcome::Refused(why));
            }
        }
    }
}

/// Adds poses, each under a name that no other has.
fn add_under_free_names(poses: &mut Vec<TaughtPose>, others: Vec<TaughtPose>) {
    for mut pose in others {
        let base = pose.name.clone();
        let mut copy = 2;
        while poses.iter().any(|other| other.name == pose.name) {
            pose.name = format!("{base} ({copy})");
            copy += 1;
        }
        poses.push(pose);
    }
}

/// A name that no pose has.
fn free_name(poses: &[TaughtPose]) -> String {
    let is_free = |name: &String| poses.iter().all(|pose| pose.name != *name);
    // One of them is free: there are more numbers than poses.
    let numbers = poses.len() + 1..=2 * poses.len() + 1;
    numbers.map(|number| format!("pose {number}")).find(is_free).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_poses_come_with_the_program() {
        assert_eq!(reference_poses().len(), 10);
    }
}
