//! The start button, and what is under way.

use egui::{Button, RichText, Spinner, Ui, Vec2};
use handeye_estimate::diagnose::{Promise, Promised};
use handeye_plan::guided::{CHECKS, Guide};

use crate::shell::reasons::immovable;
use crate::shell::{asked::asked_ui, reasons::unknown_arm};
use crate::style::marks::Marks;
use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::guided::state::{GuidedProgress, Waits};
use handeye_workbench::model::{Model, Motion, Pane, PoseSequence};
use handeye_workbench::text::Text;
use handeye_workbench::tr;
use handeye_workbench::{guided, taught};

/// The button, if nothing is under way.
pub fn begin_ui(ui: &mut Ui, model: &Model, hindrance: Option<&'static str>, height: f32, outbox: &mut Outbox) {
    if !model.takes_chosen_poses() {
        return;
    }
    let language = model.view.language;
    let words = RichText::new(tr!(language, "Calibrate for me")).strong().color(Marks::of(ui).on_accent);
    let button = Button::new(words).fill(Palette::of(ui).accent).min_size(Vec2::new(0.0, height));
    let what = tr!(
        language,
        "Begins with the board in view: moves the arm to one pose after the other, each chosen by what it adds to the answer, \
         captures there until the goal is reached, and checks the answer at three more poses. Stop the sequence and STOP end \
         it; what was captured is kept"
    );
    if parts::gated_ui(ui, blocked(model, hindrance), button).on_hover_text(what).clicked() {
        outbox.send(guided::Command::CalibrateForMe);
    }
    if let Some(pose) = way_to_board(model, hindrance) {
        let words = text!("Go to {name}", name = pose).in_language(language);
        let what = tr!(
            language,
            "The board is not in the image here. This is the first of the taught poses, which look at it: go there, then let it \
             be calibrated"
        );
        if ui.add(Button::new(words).min_size(Vec2::new(0.0, height))).on_hover_text(what).clicked() {
            outbox.send(taught::Command::GoTo(pose.to_owned()));
        }
    }
}

/// The taught pose to go to, where nothing but the board is missing.
fn way_to_board<'m>(model: &'m Model, hindrance: Option<&'static str>) -> Option<&'m str> {
    let is_missing = hindrance.is_none() && hindered(model).is_none() && board_is_missing(model);
    model.taught().first().filter(|_| is_missing).map(|pose| pose.name.as_str())
}

fn board_is_missing(model: &Model) -> bool {
    model.board_seen_s.is_none() && model.document().captures.is_empty()
}

/// What is in the way of moving the arm from pose to pose.
fn hindered(model: &Model) -> Option<&'static str> {
    let is_moving = model.motion != Motion::Idle;
    immovable(model)
        .or_else(|| unknown_arm(model))
        .or_else(|| is_moving.then(|| tr!(model.view.language, "The arm is moving: wait until it stands, or stop it")))
}

/// Whether there is more to do: no captures yet, or an answer that is not below the goal.
pub fn is_wanted(model: &Model) -> bool {
    let goal_m = model.view.goal.0;
    let promised = model.solve.solved.as_ref().and_then(|solved| solved.promised(goal_m));
    model.document().captures.is_empty() || promised.is_none_or(|promised| promised.error_m > goal_m)
}

/// Why it cannot start.
pub fn blocked(model: &Model, hindrance: Option<&'static str>) -> Option<&'static str> {
    let unseen = || {
        let what =
            tr!(model.view.language, "The board has not been seen: move the arm until the whole board is in the image");
        board_is_missing(model).then_some(what)
    };
    hindrance.or_else(|| hindered(model)).or_else(unseen)
}

/// The progress and the reason for the present pose; afterwards, how it ended.
pub fn progress_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence, outbox: &mut Outbox) {
    let language = model.view.language;
    let Some(guided) = sequence.guided.as_deref() else { return };
    if !model.sequence_runs {
        if let Some(message) = model.messages.shown_in(Pane::Poses) {
            parts::notice_ui(ui, Tone::Warning, &message.text.in_language(language), |_| ());
        } else if let Some(ending) = guided.ending.as_ref().filter(|_| model.solve.fresh) {
            let tone = if ending.is_success() { Tone::Good } else { Tone::Warning };
            parts::notice_ui(ui, tone, &ending.text().in_language(language), |_| ());
        }
        return;
    }
    ui.horizontal_wrapped(|ui| {
        if model.asked.is_none() {
            ui.add(Spinner::new().size(14.0).color(Palette::of(ui).busy));
        }
        ui.label(RichText::new(under_way(model, sequence, guided).in_language(language)).strong());
    });
    if let Some(why) = sequence.last_skipped() {
        let reported = text!("The pose before was left out: {why}", why = why.clone());
        parts::notice_ui(ui, Tone::Warning, &reported.in_language(language), |_| ());
    }
    asked_ui(ui, model, outbox);
    if let Some(why) = &guided.why {
        parts::hint_ui(ui, &why.text().in_language(language));
    }
    error_ui(ui, model, &guided.guide, left(model, sequence, guided));
    confirm_moves_ui(ui, model, outbox);
}

/// Whether moves wait to be confirmed; switched on while the arm is moving, it takes effect before the next pose.
pub fn confirm_moves_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let mut confirm = model.confirms_moves();
    let what = tr!(
        language,
        "Holds before each pose until you let the arm move. On at first wherever the cell is not the built-in one; it can be \
         switched at any time"
    );
    if ui.checkbox(&mut confirm, tr!(language, "Confirm each move")).on_hover_text(what).changed() {
        outbox.send(taught::Command::SetConfirmMoves(confirm));
    }
}

/// Poses and time that are left, by the plan and the pace so far.
fn left(model: &Model, sequence: &PoseSequence, guided: &GuidedProgress) -> Option<Text> {
    let poses = guided.views_left.filter(|poses| *poses > 0)?;
    let (since_s, before) = guided.since;
    let done = sequence.outcomes.len().saturating_sub(before);
    // A pace that includes waiting for the user is meaningless, and two poses are too few.
    if model.confirms_moves() || done < 2 {
        return Some(text!("about {n} more {n|pose|poses}", n = poses));
    }
    let pose_s = (model.now_s - since_s) / done as f64;
    let left_s = pose_s * (poses + CHECKS) as f64;
    // Not more precise than it is known.
    let seconds = format!("{:.0}", (left_s / 10.0).ceil() * 10.0);
    Some(text!("about {n} more {n|pose|poses}, {seconds} s with the checks", n = poses, seconds = seconds))
}

/// What is done now.
pub fn under_way(model: &Model, sequence: &PoseSequence, guided: &GuidedProgress) -> Text {
    let number = sequence.outcomes.len() + 1;
    match (guided.waits, &guided.ending) {
        (_, Some(_)) if model.asked.is_some() => {
            text!("Check {n} of {of} waits for you", n = guided.checked + 1, of = CHECKS)
        }
        (_, None) if model.asked.is_some() => text!("Pose {n} waits for you", n = number),
        (_, Some(_)) => {
            text!("Check {n} of {of}: a pose that is not in the fit", n = guided.checked + 1, of = CHECKS)
        }
        (Waits::Nothing, None) => text!("Pose {n}: moving there, then a capture", n = number),
        (Waits::Answer, None) => text!("Solving with {n} {n|pose|poses}", n = number - 1),
        (Waits::Choice, None) => text!("Choosing pose {n}", n = number),
    }
}

/// The error next to the goal, and what is left; nothing before there is an error.
pub fn error_ui(ui: &mut Ui, model: &Model, guide: &Guide, left: Option<Text>) {
    let language = model.view.language;
    let goal_m = guide.options().goal_m;
    let Some(solved) = &model.solve.solved else { return };
    let in_box = model.tip_box.chosen.is_some();
    let promised = if in_box {
        let point = model.tip_box.judged.map(|(_, over)| over.worst_m);
        let judged =
            guide.judged().filter(|judged| judged.tool_box.is_some() && judged.tool_box == guide.options().tool_box);
        let of_tool = judged.map(|judged| judged.promised).filter(|promised| promised.of != Promise::Point);
        of_tool.or_else(|| Promised::of(goal_m, None, None, point))
    } else {
        solved.promised(goal_m)
    };
    let Some(promised) = promised else { return };
    let (error, goal) = (format!("{:.3}", promised.error_m * 1e3), format!("{:.3}", goal_m * 1e3));
    let error = match (promised.of, in_box) {
        (Promise::Point, true) => {
            text!("Expected error over the box {error} mm (95 %), goal {goal} mm", error = error, goal = goal)
        }
        (Promise::Point, false) => {
            text!("Expected error {error} mm (95 %), goal {goal} mm", error = error, goal = goal)
        }
        (Promise::Reach | Promise::ReachByAccuracy, true) => {
            text!("In the box a tool arrives within {error} mm (95 %), goal {goal} mm", error = error, goal = goal)
        }
        (Promise::Reach | Promise::ReachByAccuracy, false) => {
            text!("A tool arrives within {error} mm (95 %), goal {goal} mm", error = error, goal = goal)
        }
        (Promise::ReachCorrected, true) => text!(
            "In the box a tool arrives within {error} mm with corrected commands (95 %), goal {goal} mm",
            error = error,
            goal = goal
        ),
        (Promise::ReachCorrected, false) => text!(
            "A tool arrives within {error} mm with corrected commands (95 %), goal {goal} mm",
            error = error,
            goal = goal
        ),
    };
    let reported = std::iter::once(error).chain(left).map(|text| text.in_language(language));
    ui.label(reported.collect::<Vec<_>>().join(" · "));
    if let Some(hold) = guide.hold() {
        parts::hint_ui(ui, &hold.text().in_language(language));
    }
}
