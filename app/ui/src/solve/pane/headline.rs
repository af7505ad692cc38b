//! The numbers that matter: the expected error where the tool works, against the goal, and how near a tool arrives by this arm.

use handeye_estimate::reach_error::USUAL_TOOL_M;
use nalgebra::Vector3;

use egui::{Align, CornerRadius, DragValue, Frame, Label, Layout, Margin, RichText, Stroke, Ui};

use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Solved};
use handeye_workbench::report::in_parts;
use handeye_workbench::solve;
use handeye_workbench::tr;

/// Size of the number.
const FIGURE: f32 = 28.0;
/// Size of those of the arm.
const REACH_FIGURE: f32 = 20.0;

/// The card.
pub fn headline_ui(ui: &mut Ui, model: &Model, solved: &Solved, outbox: &mut Outbox) {
    let language = model.view.language;
    let goal_mm = model.view.goal.0 * 1e3;
    let error_mm = solved.result.quality.tip_error_95_mm;
    let tone = match error_mm {
        Some(error_mm) if error_mm <= goal_mm => Tone::Good,
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
            ui.horizontal(|ui| {
                let figure = match error_mm {
                    Some(error_mm) => format!("{error_mm:.3} mm"),
                    None => tr!(language, "Not known").to_owned(),
                };
                ui.label(RichText::new(figure).size(FIGURE).color(palette.text));
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| goal_ui(ui, model, goal_mm, outbox));
            });
            ui.label(RichText::new(tr!(language, "Expected error (95 %)")).strong().color(palette.text));
            let meaning = match (error_mm, model.method == "joint") {
                (Some(_), _) => tr!(
                    language,
                    "In 95 of 100 cases the calibration puts a point where the board was seen no further off than this. \
                     What the robot and the image add at that moment comes on top."
                ),
                (None, true) => tr!(
                    language,
                    "The captures contradict themselves or do not determine it: no error can be stated. See what was found below."
                ),
                (None, false) => tr!(language, "A closed form states no uncertainty: choose the joint estimate below."),
            };
            ui.add(Label::new(RichText::new(meaning).color(palette.weak)).wrap());
            let moved_mm = solved.result.estimate.as_ref().and_then(|estimate| estimate.moved_mm);
            if let Some((error_mm, moved_mm)) = error_mm.zip(moved_mm) {
                let (moved, rest) = in_parts(error_mm, moved_mm);
                let words = text!(
                    "What was found below would move the answer by {moved} mm, which is known to {rest} mm.",
                    moved = moved,
                    rest = rest
                );
                ui.add(Label::new(RichText::new(words.in_language(language)).color(palette.tone(Tone::Warning))).wrap());
            }
            if let Some(error_mm) = error_mm {
                let verdict = if error_mm <= goal_mm {
                    tr!(language, "The goal is reached")
                } else {
                    tr!(language, "The goal is not reached yet")
                };
                ui.label(RichText::new(verdict).color(palette.tone(tone)));
            }
            reach_ui(ui, model, solved);
        });
}

/// How near a tool arrives, where the arm is known: the calibration is one part of that, and the arm another.
fn reach_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let quality = &solved.result.quality;
    let Some((as_it_is, corrected)) = quality.reach_error_95_mm.zip(quality.reach_error_corrected_95_mm) else {
        return;
    };
    let palette = Palette::of(ui);
    ui.add_space(4.0);
    ui.label(RichText::new(tr!(language, "A tool arrives within (95 %)")).strong().color(palette.text));
    ui.horizontal_wrapped(|ui| {
        for (mm, how) in [
            (as_it_is, tr!(language, "by the controller as it is")),
            (corrected, tr!(language, "with corrected commands")),
        ] {
            ui.label(RichText::new(format!("{mm:.2} mm")).size(REACH_FIGURE).color(palette.text));
            ui.label(RichText::new(how).color(palette.weak));
            ui.add_space(12.0);
        }
    });
    let tool = solved.result.arm.as_ref().map_or(USUAL_TOOL_M, |arm| Vector3::from(arm.tool_m).norm());
    let meaning = text!(
        "Distance between a point of the board that the camera saw and the tip of a tool of {tool} mm that is sent there.",
        tool = format!("{:.0}", tool * 1e3)
    );
    ui.add(Label::new(RichText::new(meaning.in_language(language)).color(palette.weak)).wrap());
    let goal_mm = model.view.goal.0 * 1e3;
    let calibrated = quality.tip_error_95_mm.is_some_and(|error_mm| error_mm <= goal_mm);
    if as_it_is > goal_mm && (calibrated || solved.calibration.moved_by_arm_m().is_some()) {
        let advice = if corrected <= goal_mm {
            tr!(language, "The arm is the limit: correct its commands, for which “handeye correct” makes the table.")
        } else {
            tr!(
                language,
                "The arm is the limit: captures with more different postures of the arm tell its \
                 errors better."
            )
        };
        ui.add(Label::new(RichText::new(advice).color(palette.tone(Tone::Warning))).wrap());
    }
}

fn goal_ui(ui: &mut Ui, model: &Model, goal_mm: f64, outbox: &mut Outbox) {
    let language = model.view.language;
    let mut goal_mm = goal_mm;
    // From the right: the field first, then its name.
    let field = DragValue::new(&mut goal_mm).range(0.001..=1000.0).speed(0.01).max_decimals(3).suffix(" mm");
    // Half a number is no goal.
    let field = field.update_while_editing(false);
    let response = ui.add(field).on_hover_text(tr!(language, "The error that is good enough for what you do"));
    let name = ui.label(RichText::new(tr!(language, "Goal")).color(Palette::of(ui).weak));
    if response.labelled_by(name.id).changed() {
        outbox.send(solve::Command::SetGoal(goal_mm * 1e-3));
    }
}
