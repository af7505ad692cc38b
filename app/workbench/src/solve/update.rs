//! Solving by itself whenever the set of captures is another.

use std::sync::Arc;

use handeye_estimate::handeye::motion::MIN_VIEWS;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_estimate::{Method, Options};
use handeye_geometry::progress::Stage;
use handeye_geometry::targets::observation::{Corners, Sight};
use handeye_session::{CaptureId, Document, SessionObservations};

use super::question::Question;
use crate::app::App;
use crate::model::{BoxState, Goal, JobId, Severity, SolveState, SolveStatus, WorkBox, box_in_camera, judge_box};
use crate::solve::SolveOutcome;
use crate::text::Text;
use crate::worker::{ArchiveTask, SolveJob};
use handeye_wording::text;

impl App {
    fn question(&self) -> Question {
        let document = self.model.document();
        Question {
            meta: (document.meta.mode, document.meta.target, document.meta.camera),
            captures: document
                .captures
                .iter()
                .map(|it| (it.id, it.role, it.excluded, self.model.observed(it.id).is_some()))
                .collect(),
            folder: self.model.session.folder.clone(),
            method: self.model.method.clone(),
            keep_outliers: self.model.keep_outliers,
            goal: self.model.view.goal,
        }
    }

    /// Solves unless the answer to the present question is there or on its way.
    pub(crate) fn solve_if_changed(&mut self) {
        // Half of a session that was just opened would give half an answer.
        let document = self.model.document();
        if !document.captures.iter().all(|it| self.model.observed.contains_key(&it.id)) {
            return;
        }
        let question = self.question();
        if self.asked.as_ref() != Some(&question) {
            self.asked = Some(question);
            self.solve();
        }
    }

    pub(crate) fn solve_again(&mut self) {
        self.asked = Some(self.question());
        self.solve();
    }

    fn solve(&mut self) {
        // From here on what an earlier job reports is of no interest.
        self.numbers.job = JobId(self.numbers.job.0 + 1);
        let id = self.numbers.job;
        self.model.solve.fresh = false;
        let document = Arc::clone(&self.model.session.document);
        let seen = document.in_use().filter(|it| self.corners(it.id).is_some()).count();
        if seen < MIN_VIEWS {
            self.desk.cancel_solve();
            self.model.solve.status = if document.captures.is_empty() {
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
        let since_s = self.model.now_s;
        self.model.solve.status = SolveStatus::Running { job: id, stage: Stage::Intrinsics, part: 0.0, since_s };
        let job = self.job(id, &document);
        self.desk.solve(job);
    }

    pub(crate) fn corners(&self, id: CaptureId) -> Option<&Corners> {
        self.model.observed(id)?.corners.as_ref()
    }

    fn sight(&self, id: CaptureId) -> Option<Sight> {
        let observed = self.model.observed(id)?;
        Some(Sight { corners: observed.corners.clone()?, depth: observed.depth })
    }

    /// What was observed in the captures.
    pub(crate) fn seen(&self, document: &Document) -> SessionObservations {
        document.observations(self.image_size(), |id| self.sight(id))
    }

    /// Whether the present question was asked, of captures that have all been looked at.
    pub(crate) fn is_asked(&self) -> bool {
        let document = self.model.document();
        let are_seen = document.captures.iter().all(|it| self.model.observed.contains_key(&it.id));
        are_seen && self.asked.as_ref() == Some(&self.question())
    }

    fn job(&self, id: JobId, document: &Document) -> SolveJob {
        let SessionObservations { observations, captures, verification } = self.seen(document);
        SolveJob {
            id,
            observations,
            captures,
            verification,
            method: Method::by_name(&self.model.method).unwrap_or_default(),
            options: Options { keep_outliers: self.model.keep_outliers, ..Options::default() },
            goal_m: self.model.view.goal.0,
            truth: self.model.cell.as_ref().and_then(|cell| cell.truth.clone()),
        }
    }

    /// Width and height of the images in pixels: all captures of a session have the same.
    fn image_size(&self) -> (u32, u32) {
        self.model.observed.values().flatten().map(|observed| observed.image_size).next().unwrap_or_default()
    }

    /// Forgets question and answer: they are of another session.
    pub(crate) fn forget_solve(&mut self) {
        self.desk.cancel_solve();
        self.numbers.job = JobId(self.numbers.job.0 + 1);
        self.asked = None;
        self.model.solve = SolveState::default();
        self.model.tip_box = BoxState::default();
        self.set_tracking(false);
    }

    pub(crate) fn cancel_solve(&mut self) {
        self.desk.cancel_solve();
    }

    pub(crate) fn set_method(&mut self, name: &str) {
        if Method::by_name(name).is_some() {
            name.clone_into(&mut self.model.method);
            self.solve_if_changed();
        }
    }

    pub(crate) fn set_keep_outliers(&mut self, keep: bool) {
        self.model.keep_outliers = keep;
        self.solve_if_changed();
    }

    pub(crate) fn set_tip_box(&mut self, chosen: Option<WorkBox>) {
        let is_finite = |work_box: &WorkBox| work_box.from_m.iter().chain(&work_box.to_m).all(|m| m.is_finite());
        if chosen.as_ref().is_none_or(is_finite) {
            self.model.tip_box.chosen = chosen;
            self.judge_tip_box();
        }
    }

    /// The box that was chosen, where the camera sees it by the newest answer: guided capture judges its goal over it.
    pub(crate) fn chosen_box(&self) -> Option<TipBox> {
        let (chosen, solved) = (self.model.tip_box.chosen?, self.model.solve.solved.as_deref()?);
        box_in_camera(&chosen, solved, self.model.document())
    }

    /// Some milliseconds, so only when box or answer are others.
    fn judge_tip_box(&mut self) {
        let model = &self.model;
        let judged = model.solve.solved.as_deref().and_then(|it| judge_box(model.tip_box.chosen, it, model.document()));
        self.model.tip_box.judged = judged;
    }

    pub(crate) fn set_goal(&mut self, goal_m: f64) {
        if goal_m.is_finite() && goal_m > 0.0 {
            self.model.view.goal = Goal(goal_m);
            self.solve_if_changed();
        }
    }

    pub(crate) fn solve_progress(&mut self, job: JobId, now: Stage, now_part: f64) {
        if let SolveStatus::Running { job: running, stage, part, .. } = &mut self.model.solve.status
            && *running == job
        {
            (*stage, *part) = (now, now_part);
        }
    }

    pub(crate) fn solve_ended(&mut self, job: JobId, outcome: SolveOutcome) {
        // An answer to an earlier question is no longer of interest.
        if job != self.numbers.job {
            return;
        }
        match outcome {
            SolveOutcome::Solved(solved) => {
                self.model.solve.status = SolveStatus::Idle;
                self.model.solve.fresh = true;
                let result = Box::new(solved.result.clone());
                self.model.solve.solved = Some(solved);
                self.judge_tip_box();
                self.send_intrinsics();
                self.send_tracking();
                self.preview_exports();
                let Some(folder) = self.model.session.folder.clone() else { return };
                if self.desk.archive(ArchiveTask::Result { folder, result }).is_err() {
                    self.say(
                        Severity::Warning,
                        text!("The result was not kept beside the session; solve again to keep it"),
                    );
                }
            }
            SolveOutcome::Failed(why) => self.no_answer(why),
            SolveOutcome::Cancelled => self.model.solve.status = SolveStatus::Cancelled,
        }
    }

    fn no_answer(&mut self, why: Text) {
        self.model.solve.status = SolveStatus::Failed { why };
    }
}
