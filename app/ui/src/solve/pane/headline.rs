//! The numbers that matter: the expected error where the tool works, compared with the goal, and how near a tool gets with this
//! arm.

use handeye_estimate::diagnose::{Promise, Promised};
use handeye_estimate::reach_error::USUAL_TOOL_M;
use handeye_estimate::robot_accuracy::ROBOT_ACCURACY_MM;

use egui::{Align, CornerRadius, DragValue, Frame, Label, Layout, Margin, RichText, Stroke, Ui};

use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Solved};
use handeye_workbench::report::in_parts;
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{session, solve};

/// Size of the number.
const FIGURE: f32 = 28.0;

/// The card.
pub fn headline_ui(ui: &mut Ui, model: &Model, solved: &Solved, outbox: &mut Outbox) {
    let goal_m = model.view.goal.0;
    let promised = solved.promised(goal_m);
    let tone = match promised {
        Some(promised) if promised.error_m <= goal_m => Tone::Good,
        _ => Tone::Warning,
    };
    let palette = Palette::of(ui);
    Frame::new()
        .fill(palette.tinted(tone))
        .stroke(Stroke::new(1.0, palette.tone(tone).gamma_multiply(0.5)))
        .corner_radius(CornerRadius::same(8))
        .inner_margin(Margin::symmetric(12, 8))
        .show(ui, |ui| {
            ui.set_min_width(ui.available_width());
            let is_of_tool = reach_ui(ui, model, solved, outbox);
            if !is_of_tool {
                expected_error_ui(ui, model, solved, outbox);
            }
            if let Some(promised) = promised {
                verdict_ui(ui, model, solved, &promised, tone);
            }
            if is_of_tool {
                error_of_a_point_ui(ui, model, solved);
            }
        });
}

fn verdict_ui(ui: &mut Ui, model: &Model, solved: &Solved, promised: &Promised, tone: Tone) {
    let language = model.view.language;
    let is_reached = promised.error_m <= model.view.goal.0;
    let verdict = match (promised.of, is_reached) {
        (Promise::ReachCorrected, true) => tr!(
            language,
            "The goal is reached with corrected commands: the arm is the limit. “handeye correct” makes their table."
        ),
        (_, true) => tr!(language, "The goal is reached"),
        (_, false) => tr!(language, "The goal is not reached yet"),
    };
    let palette = Palette::of(ui);
    ui.add(Label::new(RichText::new(verdict).color(palette.tone(tone))).wrap());
    let reach = solved.calibration.reach_errors();
    let limit_m = reach.and_then(|reach| match promised.of {
        Promise::Point => None,
        Promise::ReachByAccuracy => Some(reach.as_it_is_least_95_m),
        Promise::Reach | Promise::ReachCorrected => reach.repeatability_95_m,
    });
    if let Some(limit_m) = limit_m.filter(|limit_m| !is_reached && *limit_m > model.view.goal.0) {
        let limit = format!("{:.2}", limit_m * 1e3);
        let words = if promised.of == Promise::ReachByAccuracy {
            text!(
                "{limit} mm of it follow from the accuracy of the robot: more captures do not lower that.",
                limit = limit
            )
        } else {
            text!("{limit} mm of it is what the arm does not repeat: more captures do not lower that.", limit = limit)
        };
        ui.add(Label::new(RichText::new(words.in_language(language)).color(palette.tone(Tone::Warning))).wrap());
    }
}

/// The expected error of a measured point, if nothing is known about a tool.
fn expected_error_ui(ui: &mut Ui, model: &Model, solved: &Solved, outbox: &mut Outbox) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let error_mm = solved.result.quality.tip_error_95_mm;
    ui.horizontal(|ui| {
        let figure = match error_mm {
            Some(error_mm) => format!("{error_mm:.3} mm"),
            None => tr!(language, "Not known").to_owned(),
        };
        ui.label(RichText::new(figure).size(FIGURE).color(palette.text));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| goal_ui(ui, model, outbox));
    });
    ui.label(RichText::new(tr!(language, "Expected error (95 %)")).strong().color(palette.text));
    let meaning = match (error_mm, model.method == "joint") {
        (Some(_), _) => meaning_of_point(language),
        (None, true) => tr!(
            language,
            "The captures contradict themselves or do not determine it: no error can be stated. See what was found below."
        ),
        (None, false) => tr!(language, "A closed form states no uncertainty: choose the joint estimate below."),
    };
    ui.add(Label::new(RichText::new(meaning).color(palette.weak)).wrap());
    let is_unknown = solved.result.arm.as_ref().is_none_or(|arm| arm.contradicted);
    if error_mm.is_some() && solved.result.mode.is_some() && is_unknown {
        let reach = tr!(
            language,
            "How near a tool arrives is not known. It takes the errors of the arm, by its kinematics and the joint values of every capture, \
             or the accuracy of the robot."
        );
        ui.add(Label::new(RichText::new(reach).color(palette.text)).wrap());
        robot_accuracy_ui(ui, model, outbox);
    }
    moved_ui(ui, model, solved, error_mm);
}

fn meaning_of_point(language: Language) -> &'static str {
    tr!(
        language,
        "In 95 of 100 cases the calibration puts a point where the board was seen no further off than this. \
         What the robot and the image add at that moment comes on top."
    )
}

/// By how much the findings would change an error.
fn moved_ui(ui: &mut Ui, model: &Model, solved: &Solved, error_mm: Option<f64>) {
    let moved_mm = solved.result.estimate.as_ref().and_then(|estimate| estimate.moved_mm);
    if let Some((error_mm, moved_mm)) = error_mm.zip(moved_mm) {
        let (moved, rest) = in_parts(error_mm, moved_mm);
        let words = text!(
            "What was found below would move the answer by {moved} mm, which is known to {rest} mm.",
            moved = moved,
            rest = rest
        );
        let tone = Palette::of(ui).tone(Tone::Warning);
        ui.add(Label::new(RichText::new(words.in_language(model.view.language)).color(tone)).wrap());
    }
}

/// The same below the bound for a tool: the part of the calibration alone.
fn error_of_a_point_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let Some(error_mm) = solved.result.quality.tip_error_95_mm else { return };
    let words = text!("Expected error of a measured point: {error} mm (95 %)", error = format!("{error_mm:.3}"));
    let label = RichText::new(words.in_language(language)).color(Palette::of(ui).weak);
    ui.add_space(4.0);
    ui.label(label).on_hover_text(meaning_of_point(language));
    moved_ui(ui, model, solved, Some(error_mm));
}

/// How near a tool gets, which is the purpose of the calibration; whether that is known.
fn reach_ui(ui: &mut Ui, model: &Model, solved: &Solved, outbox: &mut Outbox) -> bool {
    let language = model.view.language;
    let quality = &solved.result.quality;
    let Some(as_it_is) = quality.reach_error_95_mm else { return false };
    let palette = Palette::of(ui);
    ui.horizontal(|ui| {
        ui.label(RichText::new(tr!(language, "A tool arrives within (95 %)")).strong().color(palette.text));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| goal_ui(ui, model, outbox));
    });
    ui.horizontal_wrapped(|ui| {
        let corrected = quality.reach_error_corrected_95_mm.map(|mm| (mm, tr!(language, "with corrected commands")));
        let ways = std::iter::once((as_it_is, tr!(language, "by the controller as it is"))).chain(corrected);
        for (mm, how) in ways {
            ui.label(RichText::new(format!("{mm:.2} mm")).size(FIGURE).color(palette.text));
            ui.label(RichText::new(how).color(palette.weak));
            ui.add_space(12.0);
        }
    });
    let tool = solved.calibration.tool_length_m().unwrap_or(USUAL_TOOL_M);
    let meaning = text!(
        "Distance between a point of the board that the camera saw and the tip of a tool of {tool} mm that is sent there.",
        tool = format!("{:.0}", tool * 1e3)
    );
    ui.add(Label::new(RichText::new(meaning.in_language(language)).color(palette.weak)).wrap());
    if quality.robot_accuracy_mm.is_some() {
        robot_accuracy_ui(ui, model, outbox);
    }
    true
}

/// The stated accuracy of the robot, and a field to change it.
fn robot_accuracy_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let stated_mm = model.document().meta.robot_accuracy_mm;
    let mut accuracy_mm = stated_mm.unwrap_or(0.0);
    ui.horizontal_wrapped(|ui| {
        let name = ui.label(tr!(language, "Accuracy of the robot"));
        let meaning = tr!(
            language,
            "How far the TCP is from where the robot reports it, RMS over the region where it works: some tenths of a millimetre and \
             more, not the repeatability of the data sheet. At 0 it is not known."
        );
        let unknown = tr!(language, "not known");
        let shown = move |mm: f64, _| if mm > 0.0 { format!("{mm} mm") } else { unknown.to_owned() };
        let field = DragValue::new(&mut accuracy_mm)
            .range(0.0..=*ROBOT_ACCURACY_MM.end())
            .speed(0.01)
            .max_decimals(3)
            .custom_formatter(shown)
            .custom_parser(millimetres)
            .update_while_editing(false);
        let response = ui.add(field).labelled_by(name.id).on_hover_text(meaning);
        // Every value during a drag would be a change of the session.
        if response.drag_stopped() || (response.changed() && !response.dragged()) {
            let known = Some(accuracy_mm).filter(|mm| mm >= ROBOT_ACCURACY_MM.start());
            if known != stated_mm {
                outbox.send(session::Command::SetRobotAccuracy(known));
            }
        }
    });
}

/// A length with or without its unit.
fn millimetres(text: &str) -> Option<f64> {
    text.trim().trim_end_matches("mm").trim().parse().ok()
}

fn goal_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let mut goal_mm = model.view.goal.0 * 1e3;
    // From the right: the field first, then its name.
    let field = DragValue::new(&mut goal_mm).range(0.001..=1000.0).speed(0.01).max_decimals(3).suffix(" mm");
    // A partly typed number is not a goal.
    let field = field.update_while_editing(false);
    let response = ui.add(field).on_hover_text(tr!(language, "The error that is good enough for what you do"));
    let name = ui.label(RichText::new(tr!(language, "Goal")).color(Palette::of(ui).weak));
    if response.labelled_by(name.id).changed() {
        outbox.send(solve::Command::SetGoal(goal_mm * 1e-3));
    }
}
