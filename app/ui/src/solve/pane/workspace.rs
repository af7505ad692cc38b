//! The expected error over a box of the workspace.

use egui::{DragValue, Grid, RichText, Ui, WidgetInfo, WidgetType};

use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::solve;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Farther than any arm reaches \[mm\].
const FARTHEST_MM: f64 = 10_000.0;
/// Width of a field.
const FIELD: f32 = 76.0;

/// The corners of the box, and how well points between them are measured; nothing if no uncertainty is stated.
pub fn workspace_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let Some((work_box, error)) = model.tip_box.judged else { return };
    parts::section_with_ui(ui, tr!(language, "Expected error over a box"), |ui| {
        if model.tip_box.chosen.is_some()
            && ui.add(parts::small_button(ui, tr!(language, "Box about the board"))).clicked()
        {
            outbox.send(solve::Command::SetTipBox(None));
        }
    });
    let what = tr!(
        language,
        "Between two corners in the base [mm]. A camera on the tip counts from that capture from which the box is seen \
         worst."
    );
    parts::hint_ui(ui, what);
    let mut wanted = work_box;
    Grid::new("box of the workspace").num_columns(4).spacing([8.0, 4.0]).show(ui, |ui| {
        for (is_from, corner) in [(true, &mut wanted.from_m), (false, &mut wanted.to_m)] {
            corner_ui(ui, is_from, corner, language);
            ui.end_row();
        }
    });
    if wanted != work_box {
        outbox.send(solve::Command::SetTipBox(Some(wanted)));
    }
    stated_ui(ui, tr!(language, "Worst, 95 %"), error.worst_m, language).on_hover_text(
        text!("At {place} mm in the base", place = place_mm(error.worst_at.coords.into())).in_language(language),
    );
    stated_ui(ui, tr!(language, "Mean, 95 %"), error.mean_m, language);
}

fn corner_ui(ui: &mut Ui, is_from: bool, corner_m: &mut [f64; 3], language: Language) {
    let weak = Palette::of(ui).weak;
    let heading = if is_from { tr!(language, "from x y z") } else { tr!(language, "to x y z") };
    ui.label(RichText::new(heading).small().color(weak));
    for (axis, metres) in ["x", "y", "z"].into_iter().zip(corner_m) {
        let mut mm = *metres * 1e3;
        let field = DragValue::new(&mut mm)
            .range(-FARTHEST_MM..=FARTHEST_MM)
            .clamp_existing_to_range(false)
            .speed(1.0)
            .max_decimals(1)
            .suffix(" mm")
            // A partly typed number is not a place.
            .update_while_editing(false);
        let response = ui.add_sized([FIELD, ui.spacing().interact_size.y], field);
        let reported =
            if is_from { text!("Box from {axis}", axis = axis) } else { text!("Box to {axis}", axis = axis) };
        let reported = reported.in_language(language);
        response.widget_info(|| WidgetInfo { label: Some(reported.clone()), ..WidgetInfo::new(WidgetType::DragValue) });
        if response.changed() {
            *metres = mm * 1e-3;
        }
    }
}

fn stated_ui(ui: &mut Ui, caption: &str, metres: f64, language: Language) -> egui::Response {
    let value =
        if metres.is_finite() { format!("{:.3} mm", metres * 1e3) } else { tr!(language, "Not known").to_owned() };
    parts::stated_ui(ui, caption, &value)
}

fn place_mm(place_m: [f64; 3]) -> String {
    place_m.map(|metres| format!("{:.0}", metres * 1e3)).join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::model::{self, BoxState, WorkBox};
    use handeye_workbench::testing::sample;

    fn with_box() -> Model {
        let mut model = sample::solved();
        let chosen = Some(WorkBox { from_m: [0.3, 0.0, 0.0], to_m: [0.5, 0.2, 0.1] });
        let judged = model::judge_box(chosen, model.solve.current().expect("solved"), model.document());
        model.tip_box = BoxState { chosen, judged };
        model
    }

    fn pane(model: Model) -> Driven {
        Driven::new(workspace_ui, model)
    }

    #[test]
    fn worst_and_mean_are_in_millimetres_and_the_corners_are_typed() {
        let model = with_box();
        let (_, error) = model.tip_box.judged.expect("judged");
        let mut pane = pane(model);
        assert!(pane.sees(&format!("Worst, 95 %: {:.3} mm", error.worst_m * 1e3)));
        assert!(pane.sees(&format!("Mean, 95 %: {:.3} mm", error.mean_m * 1e3)));
        pane.type_into("Box to z", "250");
        let sent = pane.press(egui::Key::Enter);
        let last = sent.last().expect("a command");
        let Command::Solve(solve::Command::SetTipBox(Some(wanted))) = last else { panic!("{sent:?}") };
        assert!((wanted.to_m[2] - 0.25).abs() < 1e-9, "{wanted:?}");
        assert_eq!(wanted.from_m, [0.3, 0.0, 0.0], "the other corner stays");
        assert!(pane.nothing_is_cut_off());
    }

    #[test]
    fn the_box_goes_back_to_the_board_and_is_not_there_without_uncertainty() {
        let mut pane = pane(with_box());
        assert_eq!(pane.click("Box about the board"), [Command::Solve(solve::Command::SetTipBox(None))]);
        pane.model().tip_box = BoxState::default();
        pane.steps();
        assert!(!pane.sees("Expected error over a box"));
    }
}
