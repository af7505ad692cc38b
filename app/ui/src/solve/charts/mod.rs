//! Charts of the captures and of the calibration.

mod accuracy;
pub(crate) mod axes;
mod bars;
mod coverage;
mod legend;

use egui::{Frame, Id, Margin, Rect, Ui, UiBuilder, Vec2};

use crate::capture::rows::{self, CaptureTable};
use crate::style::marks;
use crate::style::theme::{GAP, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// With this much room all charts are shown at once.
const ROOM_FOR_ALL: Vec2 = Vec2::new(860.0, 520.0);

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Chart {
    #[default]
    Residuals,
    Influence,
    Accuracy,
    Coverage,
}

impl Chart {
    const ALL: [Self; 4] = [Self::Residuals, Self::Influence, Self::Accuracy, Self::Coverage];

    fn name(self, language: Language) -> &'static str {
        match self {
            Self::Residuals => tr!(language, "Residuals"),
            Self::Influence => tr!(language, "Influence"),
            Self::Accuracy => tr!(language, "Expected error"),
            Self::Coverage => tr!(language, "Coverage"),
        }
    }
}

/// The pane.
pub fn charts_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let table = rows::table(ui.ctx(), model);
    if table.rows.is_empty() {
        let detail = tr!(language, "Residuals, influence, coverage and the expected error appear with the captures.");
        marks::nothing_yet_ui(ui, tr!(language, "Nothing to draw yet"), detail);
        return;
    }
    let room = ui.available_rect_before_wrap();
    if room.width() >= ROOM_FOR_ALL.x && room.height() >= ROOM_FOR_ALL.y {
        ui.advance_cursor_after_rect(room);
        all_ui(ui, model, &table, room.shrink(GAP), outbox);
    } else {
        tabs_ui(ui, model, &table, outbox);
    }
}

fn all_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, room: Rect, outbox: &mut Outbox) {
    let size = (room.size() - Vec2::splat(GAP)) / 2.0;
    for (number, chart) in Chart::ALL.into_iter().enumerate() {
        let offset = Vec2::new((number % 2) as f32, (number / 2) as f32) * (size + Vec2::splat(GAP));
        let rect = Rect::from_min_size(room.min + offset, size);
        ui.scope_builder(UiBuilder::new().max_rect(rect).id_salt(number), |ui| {
            ui.label(egui::RichText::new(chart.name(model.view.language)).strong());
            chart_ui(ui, chart, model, table, outbox);
        });
    }
}

fn tabs_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    let key = Id::new("chart in front");
    let mut front: Chart = ui.data(|data| data.get_temp(key)).unwrap_or_default();
    Frame::new().inner_margin(Margin { left: 8, right: 8, top: 6, bottom: 8 }).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 2.0;
            for chart in Chart::ALL {
                if ui.selectable_label(front == chart, chart.name(model.view.language)).clicked() {
                    front = chart;
                }
            }
        });
        chart_ui(ui, front, model, table, outbox);
    });
    ui.data_mut(|data| data.insert_temp(key, front));
}

fn chart_ui(ui: &mut Ui, chart: Chart, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    match chart {
        Chart::Residuals => bars::residuals_ui(ui, model, table, outbox),
        Chart::Influence => bars::influence_ui(ui, model, table, outbox),
        Chart::Accuracy => accuracy::accuracy_ui(ui, model),
        Chart::Coverage => coverage::coverage_ui(ui, model, table),
    }
}

/// Words where a chart would be.
fn instead_ui(ui: &mut Ui, words: &str) {
    ui.centered_and_justified(|ui| {
        ui.label(egui::RichText::new(words).color(Palette::of(ui).weak));
    });
}

#[cfg(test)]
mod tests;
