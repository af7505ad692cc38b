//! Every capture separately.

use egui::{Grid, RichText, Ui};
use handeye_estimate::verify::{CaptureCheck, Verification};
use handeye_session::CaptureId;

use crate::style::numbers;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::session;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Squared error over the stated one that one capture in a hundred exceeds.
const UNLIKELY: f64 = 2.8;

/// The table; the first column shows the image.
pub fn captures_ui(
    ui: &mut Ui,
    model: &Model,
    captures: &[CaptureId],
    (verification, corrected): (&Verification, Option<&Verification>),
    outbox: &mut Outbox,
) {
    let language = model.view.language;
    Grid::new("verified captures").num_columns(6).spacing([12.0, 3.0]).striped(true).show(ui, |ui| {
        let weak = Palette::of(ui).weak;
        for (heading, what) in [
            (tr!(language, "Capture"), tr!(language, "Click to see its image")),
            ("mm", tr!(language, "Middle of the board: measured minus predicted")),
            ("°", tr!(language, "Orientation of the board: measured minus predicted")),
            ("px", tr!(language, "Corners: measured minus predicted, RMS")),
            (tr!(language, "depth mm"), tr!(language, "Measured depth minus that of the predicted board, median")),
            (
                tr!(language, "ratio"),
                tr!(language, "Squared error over what the stated uncertainty expects: 1 on average"),
            ),
        ] {
            ui.label(RichText::new(heading).small().color(weak)).on_hover_text(what);
        }
        ui.end_row();
        for (at, (id, check)) in captures.iter().zip(&verification.captures).enumerate() {
            let name = text!("Capture {id}", id = id.0).in_language(language);
            let is_selected = model.selection.contains(id);
            if ui.selectable_label(is_selected, name).clicked() && !is_selected {
                outbox.send(session::Command::Select(vec![*id]));
            }
            let corrected = corrected.and_then(|corrected| corrected.captures.get(at));
            check_ui(ui, check, corrected, language);
            ui.end_row();
        }
    });
}

fn millimetres(check: &CaptureCheck) -> String {
    format!("{:.3}", check.centre_error_m.norm() * 1e3)
}

fn check_ui(ui: &mut Ui, check: &CaptureCheck, corrected: Option<&CaptureCheck>, language: Language) {
    let palette = Palette::of(ui);
    let known = |value: Option<String>| value.unwrap_or_else(|| "–".to_owned());
    let is_unlikely = check.ratio.is_some_and(|ratio| ratio > UNLIKELY);
    let values = [
        millimetres(check),
        format!("{:.3}", check.orientation_error_rad.to_degrees()),
        format!("{:.3}", check.rms_px),
        known(check.depth_error_m.map(|metres| numbers::fixed(metres * 1e3, 2, 0))),
        known(check.ratio.map(|ratio| format!("{ratio:.2}"))),
    ];
    for (column, value) in values.into_iter().enumerate() {
        let colour = if column == 4 && is_unlikely { palette.warning } else { palette.text };
        let label = ui.label(RichText::new(value).monospace().size(12.0).color(colour));
        if let Some(corrected) = corrected.filter(|_| column == 0) {
            let what =
                text!("{mm} mm by the tip pose corrected for the errors of the arm", mm = millimetres(corrected));
            label.on_hover_text(what.in_language(language));
        }
    }
}
