//! The tracked board, and the arm that follows it.

mod blocked;
mod cell_board;
mod follow;
mod plots;
mod pose;
mod state;

use egui::{Ui, Vec2};

use crate::style::parts;
use crate::style::theme::Tone;
pub use blocked::Blocked;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Moves};
use handeye_workbench::tr;
use handeye_workbench::track;

/// Minimum width of the column next to the numbers: its buttons and plots need it.
const LEAST_BESIDE: f32 = 300.0;
/// Distance of the columns.
const GUTTER: f32 = 22.0;

/// The pane.
pub fn track_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let blocked = Blocked::of(model);
    parts::body_ui(ui, "track", |ui| {
        tracking_ui(ui, model, &blocked, outbox);
        // Numbers are never wrapped to make room for a second column.
        let numbers = pose::width(ui, model.view.rotation);
        let beside = ui.available_width() - GUTTER - numbers;
        if beside < LEAST_BESIDE {
            follow::follow_ui(ui, model, &blocked, outbox);
            pose::pose_ui(ui, model);
            plots::plots_ui(ui, model);
            cell_board::board_ui(ui, model, &blocked, outbox);
            return;
        }
        // Halves, unless the numbers need more.
        let left = numbers.max((ui.available_width() - GUTTER) / 2.0);
        let right = ui.available_width() - GUTTER - left;
        ui.horizontal_top(|ui| {
            ui.spacing_mut().item_spacing.x = GUTTER;
            let column = |ui: &mut Ui, width: f32, content_ui: &mut dyn FnMut(&mut Ui)| {
                ui.allocate_ui_with_layout(Vec2::new(width, 0.0), egui::Layout::top_down(egui::Align::Min), |ui| {
                    ui.spacing_mut().item_spacing = Vec2::new(8.0, 6.0);
                    ui.set_width(width);
                    content_ui(ui);
                });
            };
            column(ui, left, &mut |ui| {
                pose::pose_ui(ui, model);
            });
            column(ui, right, &mut |ui| {
                if model.moves() == Moves::Freely {
                    follow::follow_ui(ui, model, &blocked, outbox);
                    cell_board::board_ui(ui, model, &blocked, outbox);
                }
                plots::plots_ui(ui, model);
            });
        });
    });
}

/// Start, stop, and the status.
fn tracking_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.horizontal_wrapped(|ui| {
        if model.track.on {
            if ui.button(tr!(language, "Stop tracking")).clicked() {
                outbox.send(track::Command::SetTracking(false));
            }
        } else {
            let button = egui::Button::new(tr!(language, "Start tracking"));
            let what = tr!(language, "Look for the board in every image and tell where it is in the base");
            if parts::gated_ui(ui, blocked.tracking, button).on_hover_text(what).clicked() {
                outbox.send(track::Command::SetTracking(true));
            }
        }
        state::state_ui(ui, model);
    });
    if let Some(reason) = blocked.tracking {
        parts::notice_ui(ui, Tone::Warning, reason, |_| ());
    }
}

#[cfg(test)]
mod tests;
