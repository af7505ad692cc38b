//! A bar per capture: residuals with the line between good and bad ones, and influence.

use egui::{Align, Align2, Color32, CursorIcon, FontId, Layout, Pos2, Rect, RichText, Sense, Stroke, Ui, Vec2};
use egui::{UiBuilder, WidgetInfo, WidgetType};
use handeye_geometry::statistics::median_high;
use handeye_session::CaptureId;

use super::axes::{self, Scale};
use super::{instead_ui, legend};
use crate::capture::rows::{CaptureRow, CaptureTable};
use crate::style::marks::{self, Marks};
use crate::style::theme::{CAPTION, Palette};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{session, solve};

/// The line is first drawn at this multiple of the median residual.
const FIRST_LINE: f64 = 2.0;
/// Room for the line of controls.
const CONTROLS: f32 = 30.0;
/// Distance within which the line can be grabbed.
const GRASP: f32 = 5.0;
/// Bars that are much wider than high look like blocks.
const WIDEST: f32 = 46.0;

/// Residuals, with the line.
pub fn residuals_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    let language = model.view.language;
    if table.rows.iter().all(|row| row.rms_px.is_none()) {
        instead_ui(ui, tr!(language, "Residuals appear with the first calibration"));
        return;
    }
    controls_ui(ui, model, table, outbox);
    let value = |row: &CaptureRow| row.rms_px;
    let room = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(room);
    let line = model.outlier_line_px.filter(|line| line.is_finite());
    let largest = table.rows.iter().filter_map(value).chain(line).fold(0.0, f64::max);
    let scale = Scale::linear(largest);
    let plot = axes::plot_rect(room);
    let bars = Bars { name: tr!(language, "Residual"), y_name: tr!(language, "RMS residual [px]"), unit: "px", value };
    bars.bars_ui(ui, model, table, plot, scale, outbox);
    if let Some(line_px) = line {
        line_ui(ui, plot, scale, line_px, language, outbox);
    }
}

pub fn influence_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    let language = model.view.language;
    let value = |row: &CaptureRow| row.influence_mm;
    if table.rows.iter().all(|row| value(row).is_none()) {
        instead_ui(ui, tr!(language, "Influence appears with the first calibration from four captures or more"));
        return;
    }
    let what = tr!(language, "How far the answer moves when this capture is left out");
    ui.label(RichText::new(what).color(Palette::of(ui).weak));
    let room = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(room);
    let scale = Scale::linear(table.rows.iter().filter_map(value).fold(0.0, f64::max));
    let bars = Bars { name: tr!(language, "Influence"), y_name: tr!(language, "Influence [mm]"), unit: "mm", value };
    bars.bars_ui(ui, model, table, axes::plot_rect(room), scale, outbox);
}

/// The captures of the fit whose residuals are above the line.
pub fn above(table: &CaptureTable, line_px: f64) -> Vec<CaptureId> {
    let is_above =
        |row: &&CaptureRow| !row.excluded && !row.verifies() && row.rms_px.is_some_and(|rms_px| rms_px > line_px);
    table.rows.iter().filter(is_above).map(|row| row.id).collect()
}

/// Where the line is drawn first.
fn first_line_px(table: &CaptureTable) -> Option<f64> {
    let all = table.rows.iter().filter(|row| !row.verifies()).filter_map(|row| row.rms_px);
    median_high(all).map(|median| FIRST_LINE * median)
}

fn controls_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    let language = model.view.language;
    let layout = Layout::left_to_right(Align::Center);
    ui.allocate_ui_with_layout(Vec2::new(ui.available_width(), CONTROLS), layout, |ui| {
        let mut on = model.outlier_line_px.is_some();
        let what = tr!(language, "A line between good and bad residuals, which you drag up and down");
        if ui.checkbox(&mut on, tr!(language, "Outlier line")).on_hover_text(what).changed() {
            let line = if on { first_line_px(table) } else { None };
            outbox.send(solve::Command::SetOutlierLine(line));
        }
        let Some(line_px) = model.outlier_line_px else { return };
        let ids = above(table, line_px);
        let left = table.rows.iter().filter(|row| !row.excluded && !row.verifies()).count() - ids.len();
        let words = text!("Exclude {count} above the line", count = ids.len()).in_language(language);
        let listed = ids.iter().take(20).map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let more = if ids.len() > 20 { "…" } else { "" };
        let what = text!(
            "Takes captures {ids} out of the fit, leaves {left} in it and solves again; undo brings them back",
            ids = format!("{listed}{more}"),
            left = left
        );
        let none = tr!(language, "No capture of the fit is above the line");
        let button = ui.add_enabled(!ids.is_empty(), egui::Button::new(words));
        if button.on_hover_text(what.in_language(language)).on_disabled_hover_text(none).clicked() {
            outbox.send(session::Command::SetExcluded { ids, excluded: true });
        }
    });
}

/// What is drawn for every capture.
struct Bars {
    name: &'static str,
    y_name: &'static str,
    unit: &'static str,
    value: fn(&CaptureRow) -> Option<f64>,
}

impl Bars {
    fn bars_ui(&self, ui: &mut Ui, model: &Model, table: &CaptureTable, plot: Rect, scale: Scale, outbox: &mut Outbox) {
        let language = model.view.language;
        let palette = Palette::of(ui);
        let pitch = (plot.width() / table.rows.len().max(1) as f32).min(WIDEST);
        let middle = |index: usize| plot.left() + (index as f32 + 0.5) * pitch;
        let ticks: Vec<(f32, String)> =
            table.rows.iter().enumerate().map(|(index, row)| (middle(index), row.id.to_string())).collect();
        axes::axes_ui(ui, plot, scale, self.y_name, tr!(language, "Capture"), &ticks);
        let beside = UiBuilder::new().max_rect(axes::next_to_name(plot)).layout(Layout::left_to_right(Align::Center));
        ui.scope_builder(beside, |ui| legend::legend_ui(ui, table, language));
        let response = ui.interact(plot, ui.id().with(self.name), Sense::click());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, self.y_name));
        let index_at = |at: Pos2| {
            let index = ((at.x - plot.left()) / pitch) as usize;
            table.rows.get(index).map(|row| (index, row))
        };
        let pointed = response.hover_pos().and_then(index_at);
        for (index, row) in table.rows.iter().enumerate() {
            let slot = Rect::from_x_y_ranges(middle(index) - pitch / 2.0..=middle(index) + pitch / 2.0, plot.y_range());
            let is_pointed = pointed.is_some_and(|(other, _)| other == index);
            if model.selection.contains(&row.id) {
                ui.painter().rect_filled(slot, 0.0, palette.accent.gamma_multiply(0.16));
            }
            let Some(value) = (self.value)(row) else { continue };
            let colour = self.colour(ui, model, row, value, is_pointed);
            let top = axes::y(plot, scale, value).min(plot.bottom() - 1.0);
            let width = (pitch * 0.72).max(0.8);
            let bar =
                Rect::from_x_y_ranges(middle(index) - width / 2.0..=middle(index) + width / 2.0, top..=plot.bottom());
            ui.painter().rect_filled(bar, if width > 6.0 { 2.0 } else { 0.0 }, colour);
        }
        if response.clicked()
            && let Some((_, row)) = response.interact_pointer_pos().and_then(index_at)
        {
            outbox.send(session::Command::Select(vec![row.id]));
        }
        if let Some((_, row)) = pointed {
            let words = self.words(row, language);
            response.on_hover_cursor(CursorIcon::PointingHand).on_hover_text_at_pointer(words);
        }
    }

    fn colour(&self, ui: &Ui, model: &Model, row: &CaptureRow, value: f64, is_pointed: bool) -> Color32 {
        let palette = Palette::of(ui);
        let is_above = self.unit == "px" && model.outlier_line_px.is_some_and(|line_px| value > line_px);
        let colour = if row.is_rejected() || (is_above && !row.excluded && !row.verifies()) {
            palette.warning
        } else {
            marks::of_capture(Marks::of(ui), row.excluded, row.verifies())
        };
        let colour = if model.solve.fresh { colour } else { colour.gamma_multiply(0.5) };
        if is_pointed { colour.lerp_to_gamma(palette.text, 0.3) } else { colour }
    }

    fn words(&self, row: &CaptureRow, language: Language) -> String {
        let value = (self.value)(row).map_or_else(|| "–".to_owned(), |value| format!("{value:.3} {}", self.unit));
        let what = match (row.excluded, row.verifies()) {
            (true, _) => tr!(language, "excluded"),
            (false, true) => tr!(language, "for verification: error of the prediction"),
            (false, false) if row.is_rejected() => tr!(language, "outlier"),
            (false, false) => tr!(language, "in the fit"),
        };
        format!("{}\n{} {value}\n{what}", text!("Capture {name}", name = row.title()).in_language(language), self.name)
    }
}

/// The line that is dragged.
fn line_ui(ui: &mut Ui, plot: Rect, scale: Scale, line_px: f64, language: Language, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let y = axes::y(plot, scale, line_px);
    let grasp = Rect::from_x_y_ranges(plot.x_range(), y - GRASP..=y + GRASP);
    let response =
        ui.interact(grasp, ui.id().with("outlier line"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeVertical);
    response.widget_info(|| WidgetInfo::slider(true, line_px, tr!(language, "Outlier line [px]")));
    let held = response.hovered() || response.dragged();
    let stroke = Stroke::new(if held { 2.5 } else { 1.5 }, palette.warning);
    ui.painter().hline(plot.x_range(), y, stroke);
    let words = format!("{line_px:.3} px");
    let at = Pos2::new(plot.right() - 4.0, y - 3.0);
    ui.painter().text(at, Align2::RIGHT_BOTTOM, words, FontId::proportional(CAPTION), palette.warning);
    if let Some(at) = response.interact_pointer_pos().filter(|_| response.dragged()) {
        // A drag beyond the top makes the chart higher step by step.
        let part = f64::from((plot.bottom() - at.y) / plot.height()).clamp(0.0, 1.1);
        let next = scale.value(part);
        if (next - line_px).abs() > f64::EPSILON {
            outbox.send(solve::Command::SetOutlierLine(Some(next)));
        }
    }
}
