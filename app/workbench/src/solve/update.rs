//! Solves automatically whenever the set of captures changes.

use std::sync::Arc;

use handeye_estimate::handeye::motion::MIN_VIEWS;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_estimate::{Method, Options};
use handeye_geometry::progress::Stage;
use handeye_geometry::targets::observation::{Corners, Sight};
use handeye_session::{CaptureId, Document, SessionObservations};

use super::command::{Command, Event};
use super::question::Question;
use crate::app::context::{Context, Numbers};
use crate::export::update::preview_exports;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::archive::ArchiveTask;
use crate::session::desk::SessionThreads;
use crate::session::requests::send_intrinsics;
use crate::shell::view::Goal;
use crate::solve::SolveOutcome;
use crate::solve::state::{JobId, SolveState, SolveStatus};
use crate::solve::tip_box::{BoxState, WorkBox, in_camera as box_in_camera, judge_box};
use crate::solve::worker::SolveJob;
use crate::track::update::{send_tracking, set_tracking};
use handeye_wording::text;

/// Does what is wanted of the calibration.
pub(crate) fn apply(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, command: Command) {
    match command {
        Command::Solve => solve_again(model, desk, numbers),
        Command::Cancel => desk.cancel_solve(),
        Command::SetMethod(name) => set_method(model, desk, numbers, &name),
        Command::SetKeepOutliers(keep) => set_keep_outliers(model, desk, numbers, keep),
        Command::SetTipBox(chosen) => set_tip_box(model, chosen),
        Command::SetGoal(goal) => set_goal(model, desk, numbers, goal),
        Command::SetOutlierLine(line_px) => model.outlier_line_px = line_px,
    }
}

/// Takes in the progress of a solve.
pub(crate) fn absorb(cx: &mut Context, event: Event) {
    match event {
        Event::Progress { job, stage, part } => solve_progress(&mut cx.model, job, stage, part),
        Event::Ended { job, outcome } => solve_ended(cx, job, outcome),
    }
}

fn question(model: &Model) -> Question {
    let document = model.document();
    Question {
        meta: (document.meta.mode, document.meta.target, document.meta.camera),
        robot_accuracy_mm: document.meta.robot_accuracy_mm,
        captures: document
            .captures
            .iter()
            .map(|it| (it.id, it.role, it.excluded, model.observed(it.id).is_some()))
            .collect(),
        folder: model.session.folder.clone(),
        method: model.method.clone(),
        keep_outliers: model.keep_outliers,
        goal: model.view.goal,
    }
}

/// Solves unless the answer to the present question is available or on its way.
pub(crate) fn solve_if_changed(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    // Half of a session that was just opened would give half an answer.
    let document = model.document();
    if !document.captures.iter().all(|it| model.observed.contains_key(&it.id)) {
        return;
    }
    let question = question(model);
    if numbers.asked.as_ref() != Some(&question) {
        numbers.asked = Some(question);
        solve(model, desk, numbers);
    }
}

fn solve_again(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    numbers.asked = Some(question(model));
    solve(model, desk, numbers);
}

fn solve(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers) {
    // From here on reports of an earlier job are ignored.
    numbers.job = JobId(numbers.job.0 + 1);
    let id = numbers.job;
    model.solve.fresh = false;
    let document = Arc::clone(&model.session.document);
    let seen = document.in_use().filter(|it| corners(model, it.id).is_some()).count();
    if seen < MIN_VIEWS {
        desk.cancel_solve();
        model.solve.status = if document.captures.is_empty() {
            SolveStatus::Idle
        } else if document.mode().is_none() {
            SolveStatus::Failed {
                why: text!(
                    "{seen} {seen|image|images} with the board in use, at least {need} are needed",
                    seen = seen,
                    need = MIN_VIEWS
                ),
            }
        } else {
            SolveStatus::Failed {
                why: text!(
                    "{seen} {seen|capture|captures} with the board in use, at least {need} are needed: capture more poses",
                    seen = seen,
                    need = MIN_VIEWS
                ),
            }
        };
        return;
    }
    let since_s = model.now_s;
    model.solve.status = SolveStatus::Running { job: id, stage: Stage::Intrinsics, part: 0.0, since_s };
    let job = job(model, id, &document);
    desk.solve(job);
}

pub(crate) fn corners(model: &Model, id: CaptureId) -> Option<&Corners> {
    model.observed(id)?.corners.as_ref()
}

fn sight(model: &Model, id: CaptureId) -> Option<Sight> {
    let observed = model.observed(id)?;
    Some(Sight { corners: observed.corners.clone()?, depth: observed.depth })
}

/// What was observed in the captures.
pub(crate) fn seen(model: &Model, document: &Document) -> SessionObservations {
    document.observations(image_size(model), |id| sight(model, id))
}

/// Whether the present question was asked, with captures that have all been searched.
pub(crate) fn is_asked(model: &Model, numbers: &Numbers) -> bool {
    let document = model.document();
    let are_seen = document.captures.iter().all(|it| model.observed.contains_key(&it.id));
    are_seen && numbers.asked.as_ref() == Some(&question(model))
}

fn job(model: &Model, id: JobId, document: &Document) -> SolveJob {
    let SessionObservations { observations, captures, verification, arm, robot_accuracy } = seen(model, document);
    SolveJob {
        id,
        observations,
        captures,
        verification,
        method: Method::by_name(&model.method).unwrap_or_default(),
        options: Options { keep_outliers: model.keep_outliers, ..Options::default() },
        goal_m: model.view.goal.0,
        arm,
        robot_accuracy,
        truth: model.cell.as_ref().and_then(|cell| cell.truth.clone()),
    }
}

/// Width and height of the images in pixels: all captures of a session have the same.
fn image_size(model: &Model) -> (u32, u32) {
    model.observed.values().flatten().map(|observed| observed.image_size).next().unwrap_or_default()
}

/// Clears question and answer: they belong to another session.
pub(crate) fn forget_solve(cx: &mut Context) {
    cx.desk.cancel_solve();
    cx.numbers.job = JobId(cx.numbers.job.0 + 1);
    cx.numbers.asked = None;
    cx.model.solve = SolveState::default();
    cx.model.tip_box = BoxState::default();
    set_tracking(&mut cx.model, &cx.workers, &mut cx.numbers, false);
}

pub(crate) fn set_method(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, name: &str) {
    if Method::by_name(name).is_some() {
        name.clone_into(&mut model.method);
        solve_if_changed(model, desk, numbers);
    }
}

fn set_keep_outliers(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, keep: bool) {
    model.keep_outliers = keep;
    solve_if_changed(model, desk, numbers);
}

fn set_tip_box(model: &mut Model, chosen: Option<WorkBox>) {
    let is_finite = |work_box: &WorkBox| work_box.from_m.iter().chain(&work_box.to_m).all(|m| m.is_finite());
    if chosen.as_ref().is_none_or(is_finite) {
        model.tip_box.chosen = chosen;
        judge_tip_box(model);
    }
}

/// The chosen box as the camera sees it with the newest answer: guided capture judges its goal over it.
pub(crate) fn chosen_box(model: &Model) -> Option<TipBox> {
    let (chosen, solved) = (model.tip_box.chosen?, model.solve.solved.as_deref()?);
    box_in_camera(&chosen, solved, model.document())
}

/// Takes some milliseconds, so only done when the box or the answer changes.
fn judge_tip_box(model: &mut Model) {
    let judged = model.solve.solved.as_deref().and_then(|it| judge_box(model.tip_box.chosen, it, model.document()));
    model.tip_box.judged = judged;
}

fn set_goal(model: &mut Model, desk: &mut SessionThreads, numbers: &mut Numbers, goal_m: f64) {
    if goal_m.is_finite() && goal_m > 0.0 {
        model.view.goal = Goal(goal_m);
        solve_if_changed(model, desk, numbers);
    }
}

fn solve_progress(model: &mut Model, job: JobId, now: Stage, now_part: f64) {
    if let SolveStatus::Running { job: running, stage, part, .. } = &mut model.solve.status
        && *running == job
    {
        (*stage, *part) = (now, now_part);
    }
}

fn solve_ended(cx: &mut Context, job: JobId, outcome: SolveOutcome) {
    // The answer to an earlier question is ignored.
    if job != cx.numbers.job {
        return;
    }
    match outcome {
        SolveOutcome::Solved(solved) => {
            cx.model.solve.status = SolveStatus::Idle;
            cx.model.solve.fresh = true;
            let result = Box::new(solved.result.clone());
            cx.model.solve.solved = Some(solved);
            judge_tip_box(&mut cx.model);
            send_intrinsics(&mut cx.model, &cx.workers);
            send_tracking(&mut cx.model, &cx.workers);
            preview_exports(&mut cx.model, &cx.desk);
            let Some(folder) = cx.model.session.folder.clone() else { return };
            if cx.desk.archive(ArchiveTask::Result { folder, result }).is_err() {
                cx.model.notify(
                    Severity::Warning,
                    text!("The result was not kept beside the session; solve again to keep it"),
                );
            }
        }
        SolveOutcome::Failed(why) => cx.model.solve.status = SolveStatus::Failed { why },
        SolveOutcome::Cancelled => cx.model.solve.status = SolveStatus::Cancelled,
    }
}
