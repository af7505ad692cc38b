//! Shows what a sequence of captures has led to: when it has ended and its answer is there, the pane of the step that is
//! reached comes to the front. Once, and only if the user is not busy elsewhere.

use handeye_session::Role;

use handeye_workbench::model::{CapturePurpose, Model, PoseSequence, Step};

/// Looks at the model frame by frame.
#[derive(Debug, Default)]
pub struct Arrival {
    waits: Option<Waits>,
}

/// A sequence whose end or answer is waited for.
#[derive(Debug)]
struct Waits {
    /// What it leads to.
    step: Step,
    /// Whether it is still under way.
    under_way: bool,
    /// Whether the user has chosen what is in front since it began.
    chosen: bool,
}

/// What the user is doing now.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Busy {
    /// Text is typed, or a dialog is open: that continues undisturbed.
    pub elsewhere: bool,
    /// A button of the pointer is down: over in a moment.
    pub pointing: bool,
}

impl Arrival {
    /// The user chose what is in front.
    pub fn chosen(&mut self) {
        if let Some(waits) = &mut self.waits {
            waits.chosen = true;
        }
    }

    /// The step whose pane comes to the front now, if one does.
    pub fn look(&mut self, model: &Model, busy: Busy) -> Option<Step> {
        let is_new = !self.waits.as_ref().is_some_and(|waits| waits.under_way);
        if model.sequence_runs && is_new {
            self.waits = step_of(model).map(|step| Waits { step, under_way: true, chosen: false });
        }
        let waits = self.waits.as_mut()?;
        if model.sequence_runs {
            return None;
        }
        if std::mem::take(&mut waits.under_way) && !is_complete(model) {
            // A user who stopped it wants to do something else.
            self.waits = None;
            return None;
        }
        if waits.chosen {
            self.waits = None;
            return None;
        }
        if busy.pointing || !is_answered(model, waits.step) {
            return None;
        }
        let step = waits.step;
        self.waits = None;
        (!busy.elsewhere).then_some(step)
    }
}

/// What the sequence leads to.
fn step_of(model: &Model) -> Option<Step> {
    Some(match model.sequence.as_ref()?.purpose? {
        CapturePurpose::Calibrate => Step::Solve,
        CapturePurpose::Verify => Step::Verify,
    })
}

/// Whether every pose was visited.
fn is_complete(model: &Model) -> bool {
    let is_over = |sequence: &PoseSequence| {
        // Between two poses of a guided sequence no pose is under way either.
        let is_chosen = sequence.guided.as_ref().is_none_or(|guided| guided.ending.is_some());
        is_chosen && sequence.current().is_none()
    };
    model.sequence.as_ref().is_some_and(is_over)
}

/// Whether the answer is there and includes the last captures.
fn is_answered(model: &Model, step: Step) -> bool {
    let Some(solved) = model.solve.current() else { return false };
    let document = model.document();
    let has = |role, among: &[_]| {
        let captures = document.captures.iter().filter(|it| it.role == role && !it.excluded);
        captures
            .filter(|it| model.observed(it.id).is_none_or(|seen| seen.corners.is_some()))
            .all(|it| among.contains(&it.id))
    };
    match step {
        Step::Verify => solved.verification.is_some() && has(Role::Verification, &solved.verified_captures),
        _ => has(Role::Calibration, &solved.captures),
    }
}

#[cfg(test)]
#[path = "arrival_tests.rs"]
mod tests;
