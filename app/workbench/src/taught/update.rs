//! Taught poses.

use std::path::{Path, PathBuf};

use handeye_arm::JointKind;
use handeye_dataset::taught_poses::{Goal, TaughtPose, TaughtPoses};
use handeye_session::{Edit, TaughtChange};

use super::command::{Command, Event};
use crate::app::context::Context;
use crate::guided::update::continue_guided;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::ask::may_set_out;
use crate::session::desk::SessionThreads;
use crate::session::requests::edit;
use crate::session::start::REFERENCE_POSES;
use crate::session::state::PoseSequence;
use crate::taught::confirm::{confirm_move, set_confirm_moves, skip_move};
use crate::taught::sequence::{go_to_taught, next_stop, plan_verification, planned, run_sequence, stop_sequence};
use crate::worker::files::FileTask;
use handeye_wording::text;

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

/// Does what is wanted of taught poses and sequences.
pub(crate) fn apply(cx: &mut Context, command: Command) {
    match command {
        Command::Teach { name } => teach(&mut cx.model, &cx.desk, name),
        Command::Remove(name) => remove_taught(&mut cx.model, &cx.desk, &name),
        Command::Rename { from, to } => rename_taught(&mut cx.model, &cx.desk, &from, &to),
        Command::Reorder { name, to } => reorder_taught(&mut cx.model, &cx.desk, &name, to),
        Command::TeachReference => teach_reference(&mut cx.model, &cx.desk),
        Command::Adopt => adopt_taught(&mut cx.model, &cx.desk),
        Command::Import(file) => import_taught(&mut cx.model, &cx.desk, file),
        Command::Export(file) => export_taught(&mut cx.model, &cx.desk, file),
        Command::GoTo(name) => visit_taught(cx, &name),
        Command::RunSequence { purpose } => run_sequence(cx, purpose),
        Command::ContinueSequence => continue_sequence(cx),
        Command::ConfirmMove => confirm_move(cx),
        Command::SkipMove => skip_move(cx),
        Command::SetConfirmMoves(confirm) => set_confirm_moves(cx, confirm),
        Command::StopSequence => stop_sequence(&mut cx.model, &cx.workers),
        Command::VerifyAtPlanned => plan_verification(&mut cx.model, &cx.workers, &mut cx.numbers),
    }
}

/// Continues an interrupted sequence: the pose where it was interrupted is visited again.
fn continue_sequence(cx: &mut Context) {
    if cx.model.capture.is_some() {
        // It would be taken for the capture of the pose.
        return cx.model.notify(Severity::Warning, text!("A capture is under way: wait until it is kept"));
    }
    if continue_guided(cx) {
        return;
    }
    let left = cx.model.sequence.as_ref().and_then(PoseSequence::current);
    if left.is_some() && !cx.model.sequence_runs && !cx.model.planning {
        cx.model.sequence_runs = true;
        cx.model.let_go = false;
        next_stop(cx);
    }
}

/// Takes in poses that were read or planned.
pub(crate) fn absorb(cx: &mut Context, event: Event) {
    match event {
        Event::Read { poses } => poses_read(&mut cx.model, &cx.desk, poses),
        Event::Planned { id, views } => planned(cx, id, views),
    }
}

/// The poses of this cell become these; those of others stay.
fn edit_taught(model: &mut Model, desk: &SessionThreads, change: TaughtChange, poses: Vec<TaughtPose>) {
    let Some(cell) = model.taught_on(model.document().meta.target) else {
        return model.notify(Severity::Warning, text!("Taught poses belong to an arm: connect it first"));
    };
    let mut all = model.document().taught.clone();
    all.retain(|pose| !pose.is_of(Some(&cell)));
    all.extend(poses.into_iter().map(|pose| TaughtPose { cell: Some(cell.clone()), ..pose }));
    edit(model, desk, Edit::SetTaught { change, poses: all });
}

fn taught(model: &Model) -> Vec<TaughtPose> {
    model.taught().into_iter().cloned().collect()
}

/// Stores the joints and not the tip, because they bring the arm back the same way.
fn teach(model: &mut Model, desk: &SessionThreads, name: Option<String>) {
    let Some(robot) = &model.robot else {
        model.notify(Severity::Warning, text!("The position of the arm is not known: connect first"));
        return;
    };
    let goal = Goal::Joints(robot.joints_rad.to_vec());
    let mut poses = taught(model);
    let name = name.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
    let name = name.unwrap_or_else(|| free_name(&poses));
    poses.push(TaughtPose::new(name.clone(), goal));
    edit_taught(model, desk, TaughtChange::Add(name), poses);
}

fn remove_taught(model: &mut Model, desk: &SessionThreads, name: &str) {
    let mut poses = taught(model);
    poses.retain(|pose| pose.name != name);
    edit_taught(model, desk, TaughtChange::Remove(name.to_owned()), poses);
}

fn rename_taught(model: &mut Model, desk: &SessionThreads, from: &str, to: &str) {
    let to = to.trim();
    if from == to {
        return;
    }
    let mut poses = taught(model);
    for pose in poses.iter_mut().filter(|pose| pose.name == from) {
        to.clone_into(&mut pose.name);
    }
    edit_taught(model, desk, TaughtChange::Rename { from: from.to_owned(), to: to.to_owned() }, poses);
}

fn reorder_taught(model: &mut Model, desk: &SessionThreads, name: &str, to: usize) {
    let mut poses = taught(model);
    let Some(from) = poses.iter().position(|pose| pose.name == name) else { return };
    let pose = poses.remove(from);
    poses.insert(to.min(poses.len()), pose);
    edit_taught(model, desk, TaughtChange::Reorder(name.to_owned()), poses);
}

fn teach_reference(model: &mut Model, desk: &SessionThreads) {
    if model.has_reference_poses() {
        edit_taught(model, desk, TaughtChange::Replace, reference_poses());
    }
}

/// The user states that arm, base and target are as they were where the poses were taught.
fn adopt_taught(model: &mut Model, desk: &SessionThreads) {
    let Some(cell) = model.taught_on(model.document().meta.target) else { return };
    let fits = |pose: &&TaughtPose| match &pose.goal {
        Goal::Joints(joints) => joints.len() == cell.joints.len(),
        Goal::Tip(_) => true,
    };
    let elsewhere = model.document().taught.iter().filter(|pose| !pose.is_of(Some(&cell)));
    let (fit, others): (Vec<&TaughtPose>, Vec<&TaughtPose>) = elsewhere.partition(fits);
    let (adopted, others) = (fit.into_iter().cloned().collect::<Vec<_>>(), others.len());
    if others > 0 {
        let reported = text!("{n} {n|pose has|poses have} another number of joints than this arm", n = others);
        model.notify(Severity::Warning, reported);
    }
    if adopted.is_empty() {
        return;
    }
    let change = TaughtChange::Import(adopted.len() as u32);
    let mut poses = taught(model);
    let mut all = model.document().taught.clone();
    all.retain(|pose| !adopted.contains(pose) && !pose.is_of(Some(&cell)));
    add_under_free_names(&mut poses, adopted);
    all.extend(poses.into_iter().map(|pose| TaughtPose { cell: Some(cell.clone()), ..pose }));
    edit(model, desk, Edit::SetTaught { change, poses: all });
}

fn import_taught(model: &mut Model, desk: &SessionThreads, file: PathBuf) {
    let asked = desk.files(FileTask::ReadPoses(file));
    model.notify_if_refused(text!("The poses were not read"), asked);
}

fn poses_read(model: &mut Model, desk: &SessionThreads, read: Vec<TaughtPose>) {
    let count = read.len() as u32;
    let mut poses = taught(model);
    add_under_free_names(&mut poses, read);
    edit_taught(model, desk, TaughtChange::Import(count), poses);
}

fn export_taught(model: &mut Model, desk: &SessionThreads, file: PathBuf) {
    let poses = taught(model);
    let joints = poses.iter().find_map(|pose| match &pose.goal {
        Goal::Joints(joints) => Some(joints.len()),
        Goal::Tip(_) => None,
    });
    let is_prismatic = |joint: &usize| model.joint_kind(*joint) == JointKind::Prismatic;
    let prismatic = (0..joints.unwrap_or(0)).filter(is_prismatic).collect();
    let asked = desk.files(FileTask::WritePoses { file, poses, prismatic });
    model.notify_if_refused(text!("The poses were not written"), asked);
}

fn visit_taught(cx: &mut Context, name: &str) {
    if may_set_out(&mut cx.model) {
        go_to_taught(cx, name);
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
