//! Makes the arm follow the board, and shows the status.

use egui::{Button, DragValue, RichText, Ui, WidgetInfo, WidgetType};

use super::blocked::{Blocked, is_following};
use crate::style::theme::{Palette, Tone};
use crate::style::{form, parts};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{FollowRequest, FollowStatus, Model};
use handeye_workbench::motion::correction::corrected;
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::track;

/// Distances of the tip from a corner that can be requested [mm]: any nearer, the arm could touch the board.
const STAND_OFFS_MM: std::ops::RangeInclusive<f64> = 20.0..=600.0;

/// What is chosen before the arm gets the command.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Choice {
    to_corner: bool,
    /// Whether the arm may go to another place first.
    with_room: bool,
    /// Counted from 1.
    corner: usize,
    stand_off_mm: f64,
}

impl Default for Choice {
    fn default() -> Self {
        Self { to_corner: false, with_room: true, corner: 1, stand_off_mm: 150.0 }
    }
}

impl Choice {
    fn request(self) -> FollowRequest {
        if self.to_corner {
            FollowRequest::Corner { index: self.corner.saturating_sub(1), stand_off_m: self.stand_off_mm * 1e-3 }
        } else if self.with_room {
            FollowRequest::KeepViewWithRoom
        } else {
            FollowRequest::KeepView
        }
    }
}

/// The section.
pub fn follow_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Follow with the arm"));
    let key = ui.id().with("follow choice");
    let mut choice: Choice = parts::remembered(ui, key);
    let follows = is_following(model);
    ui.add_enabled_ui(!follows, |ui| {
        choice_ui(ui, model, &mut choice);
        corrected_ui(ui, model, outbox);
    });
    parts::remember(ui, key, choice);
    ui.horizontal_wrapped(|ui| {
        if follows {
            let what = tr!(language, "The arm comes to rest; STOP does the same at once");
            if ui.button(tr!(language, "Stop following")).on_hover_text(what).clicked() {
                outbox.send(track::Command::SetFollow(None));
            }
        } else {
            let button = Button::new(tr!(language, "Follow"));
            if parts::gated_ui(ui, blocked.follow, button).clicked() {
                outbox.send(track::Command::SetFollow(Some(choice.request())));
            }
        }
        status_ui(ui, model, follows);
    });
    if let (Some(reason), false, None) = (blocked.follow, follows, blocked.tracking) {
        parts::hint_ui(ui, reason);
    }
    if let FollowStatus::Ended(why) = &model.track.follow {
        let words = text!("The arm does not follow the board: {why}", why = why.clone()).in_language(language);
        let again = parts::notice_ui(ui, Tone::Warning, &words, |ui| {
            let what = tr!(language, "Follows as chosen above, from where the arm stands");
            parts::gated_ui(ui, blocked.follow, Button::new(tr!(language, "Follow again")))
                .on_hover_text(what)
                .clicked()
        });
        if again {
            outbox.send(track::Command::SetFollow(Some(choice.request())));
        }
    }
}

/// Whether the errors of the arm are corrected, if they are known.
fn corrected_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let Some((solved, _)) = corrected(model) else { return };
    let helps = solved.result.quality.correcting_helps();
    let mut is_corrected = model.track.wants_corrected.unwrap_or(helps);
    if ui.checkbox(&mut is_corrected, tr!(model.view.language, "Correct for the errors of the arm")).changed() {
        outbox.send(track::Command::SetCorrected(is_corrected));
    }
}

fn choice_ui(ui: &mut Ui, model: &Model, choice: &mut Choice) {
    let language = model.view.language;
    let choices = [
        (
            false,
            tr!(language, "Keep this view"),
            tr!(language, "The camera stays where it is relative to the board now, wherever the board goes"),
        ),
        (
            true,
            tr!(language, "Tip to a corner"),
            tr!(language, "The tip goes to a corner and stays in front of it, pointing at the board"),
        ),
    ];
    if let Some(to_corner) = form::choice_ui(ui, choice.to_corner, &choices) {
        choice.to_corner = to_corner;
    }
    if !choice.to_corner {
        let what = tr!(
            language,
            "Where the arm would soon be stretched, too close to its column or have two axes in line, it first moves to the nearest place from which it can follow the board, and keeps the view from there"
        );
        ui.checkbox(&mut choice.with_room, tr!(language, "Make room first where it is needed")).on_hover_text(what);
        return;
    }
    let grid = model.document().meta.target.grid();
    choice.corner = choice.corner.clamp(1, grid.len().max(1));
    ui.horizontal_wrapped(|ui| {
        let columns = grid.columns.max(1);
        let (row, column) = ((choice.corner - 1) / columns + 1, (choice.corner - 1) % columns + 1);
        ui.label(RichText::new(tr!(language, "Corner")).color(Palette::of(ui).weak));
        let corner = choice.corner as f64;
        let field = DragValue::new(&mut choice.corner).range(1..=grid.len().max(1)).speed(0.1);
        let what = text!(
            "Corner in row {row}, column {column}; 1 is the origin of the board, and they are counted row by row",
            row = row,
            column = column
        );
        number_ui(ui, tr!(language, "Corner to go to"), corner, field).on_hover_text(what.in_language(language));
        ui.label(RichText::new(tr!(language, "at")).color(Palette::of(ui).weak));
        let stand_off_mm = choice.stand_off_mm;
        let field =
            DragValue::new(&mut choice.stand_off_mm).range(STAND_OFFS_MM).speed(1.0).max_decimals(0).suffix(" mm");
        let what = tr!(language, "Distance of the tip from the corner along the normal of the board");
        number_ui(ui, tr!(language, "Stand-off in mm"), stand_off_mm, field).on_hover_text(what);
    });
}

/// A number with a name for screen readers.
fn number_ui(ui: &mut Ui, name: &str, value: f64, field: DragValue<'_>) -> egui::Response {
    let response = ui.add_sized([72.0, ui.spacing().interact_size.y], field);
    let is_enabled = ui.is_enabled();
    response.widget_info(|| WidgetInfo {
        value: Some(value),
        ..WidgetInfo::labeled(WidgetType::DragValue, is_enabled, name)
    });
    response
}

fn status_ui(ui: &mut Ui, model: &Model, follows: bool) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let (colour, words) = match (&model.track.follow, follows) {
        (FollowStatus::Following { distance_m, angle_rad, is_kept_off }, _) => {
            let colour = if *is_kept_off { palette.busy } else { palette.good };
            (colour, following(*distance_m, *angle_rad, *is_kept_off, language))
        }
        (FollowStatus::MakingRoom, _) => {
            (palette.busy, tr!(language, "Moving to where the arm has room to follow…").to_owned())
        }
        (FollowStatus::Waiting, _) => {
            (palette.busy, tr!(language, "The arm waits until the board is seen again").to_owned())
        }
        (FollowStatus::Off, true) => (palette.busy, tr!(language, "Starting to follow…").to_owned()),
        (FollowStatus::Off | FollowStatus::Ended(_), _) => return,
    };
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        parts::dot_ui(ui, colour);
        let what = tr!(language, "Distance of the tip from its goal, and angle between both");
        ui.label(RichText::new(words).color(palette.text)).on_hover_text(what);
    });
}

fn following(distance_m: f64, angle_rad: f64, is_kept_off: bool, language: Language) -> String {
    let (distance, angle) = (format!("{:.1}", distance_m * 1e3), format!("{:.2}", angle_rad.to_degrees()));
    let reported = if is_kept_off {
        text!(
            "Keeping clear of an obstacle: {distance} mm and {angle}° from the goal",
            distance = distance,
            angle = angle
        )
    } else {
        text!("Following: {distance} mm and {angle}° from the goal", distance = distance, angle = angle)
    };
    reported.in_language(language)
}
