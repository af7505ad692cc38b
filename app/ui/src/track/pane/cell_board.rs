//! Moves and hides the board of a simulated cell, to try tracking on.

use egui::{DragValue, RichText, Ui, WidgetInfo, WidgetType};

use super::blocked::Blocked;
use crate::style::theme::Palette;
use crate::style::{form, parts};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{BoardMotion, BoardPath, Model};
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::track;

/// The first speed that is requested [m/s]: about as fast as a slow conveyor.
const FIRST_SPEED_M_S: f64 = 0.05;
/// Speeds that can be requested [m/s].
const SPEEDS_M_S: std::ops::RangeInclusive<f64> = 0.01..=0.5;

/// The section; empty for a cell that does not report where its board is.
pub fn board_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, outbox: &mut Outbox) {
    if model.cell.as_ref().is_none_or(|cell| cell.truth.is_none()) {
        return;
    }
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Board of the simulated cell"));
    ui.add_enabled_ui(blocked.cell.is_none(), |ui| {
        let motion = model.track.board;
        let speed_m_s = if motion.speed_m_s > 0.0 { motion.speed_m_s } else { FIRST_SPEED_M_S };
        let choices = BoardPath::ALL.map(|path| {
            let (name, what) = words(path, language);
            (path, name, what)
        });
        if let Some(path) = form::choice_ui(ui, motion.path, &choices) {
            outbox.send(track::Command::MoveBoard(BoardMotion { path, speed_m_s }));
        }
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new(tr!(language, "Speed")).color(Palette::of(ui).weak));
            let mut next_m_s = speed_m_s;
            let field = DragValue::new(&mut next_m_s).range(SPEEDS_M_S).speed(0.002).max_decimals(3).suffix(" m/s");
            // A partly typed number is not a speed.
            let field = field.update_while_editing(false);
            let response = ui.add_sized([86.0, ui.spacing().interact_size.y], field);
            let is_enabled = ui.is_enabled();
            response.widget_info(|| WidgetInfo {
                value: Some(next_m_s),
                ..WidgetInfo::labeled(WidgetType::DragValue, is_enabled, tr!(language, "Speed of the board in m/s"))
            });
            if response.changed() {
                outbox.send(track::Command::MoveBoard(BoardMotion { path: motion.path, speed_m_s: next_m_s }));
            }
            let mut hidden = model.track.board_hidden;
            let what = tr!(language, "Hide the board for a while, to see tracking coast, lose it and find it again");
            if ui.checkbox(&mut hidden, tr!(language, "Hide the board")).on_hover_text(what).changed() {
                outbox.send(track::Command::HideBoard(hidden));
            }
        });
    });
}

fn words(path: BoardPath, language: Language) -> (&'static str, &'static str) {
    match path {
        BoardPath::Still => (tr!(language, "Still"), tr!(language, "The board stands where it is")),
        BoardPath::Circle => (tr!(language, "Circle"), tr!(language, "A circle in the plane of the board")),
        BoardPath::FigureEight => {
            (tr!(language, "Eight"), tr!(language, "A figure of eight in the plane of the board"))
        }
        BoardPath::RandomWalk => (tr!(language, "Random"), tr!(language, "Random places, with small turns")),
        BoardPath::Step => (tr!(language, "Jumps"), tr!(language, "Every two seconds at another of five places")),
    }
}
