//! The answers of the closed forms next to the requested one.

use egui::{Grid, RichText, Ui};
use handeye_estimate::Method;
use handeye_geometry::frames::{Camera, Mount, Pose};

use crate::style::parts;
use crate::style::theme::Palette;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Solved};
use handeye_workbench::solve;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;

/// The table; the first column chooses.
pub fn methods_ui(ui: &mut Ui, model: &Model, solved: &Solved, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Methods compared"));
    parts::hint_ui(
        ui,
        tr!(
            language,
            "Closed forms do not weight noise: they start the joint estimate and show how well the views determine it."
        ),
    );
    keep_ui(ui, model, outbox);
    let answer = solved.calibration.hand_eye.map(|hand_eye| hand_eye.mount_from_camera());
    Grid::new("methods").num_columns(4).spacing([12.0, 4.0]).striped(true).show(ui, |ui| {
        let weak = Palette::of(ui).weak;
        for heading in [tr!(language, "Method"), tr!(language, "from answer [mm]"), "[°]", tr!(language, "Status")] {
            ui.label(RichText::new(heading).small().color(weak));
        }
        ui.end_row();
        for name in Method::names() {
            if ui.radio(model.method == name, title(name, language)).clicked() && model.method != name {
                outbox.send(solve::Command::SetMethod(name.to_owned()));
            }
            row_ui(ui, name, answer.as_ref(), solved, language);
            ui.end_row();
        }
    });
}

/// Whether views that do not fit the others stay in the answer.
fn keep_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let mut keep = model.keep_outliers;
    let what = tr!(
        language,
        "Views and corners that do not fit the others are left out as outliers and named. With this they stay in the answer, so \
         that you see the difference; it may then be much worse than it says"
    );
    if ui.checkbox(&mut keep, tr!(language, "Keep all views")).on_hover_text(what).changed() {
        outbox.send(solve::Command::SetKeepOutliers(keep));
    }
}

fn row_ui(ui: &mut Ui, name: &str, answer: Option<&Pose<Mount, Camera>>, solved: &Solved, language: Language) {
    let palette = Palette::of(ui);
    let Some(method) = solved.calibration.methods.iter().find(|method| method.name == name) else {
        ui.label("");
        ui.label("");
        ui.label(RichText::new(tr!(language, "weights all noise")).small().color(palette.weak));
        return;
    };
    match &method.outcome {
        Ok(solution) => {
            let differs = answer.map(|answer| solution.mount_from_camera.distance_to(answer));
            let (mm, deg) = differs.map_or(("–".to_owned(), "–".to_owned()), |(metres, radians)| {
                (format!("{:.3}", metres * 1e3), format!("{:.4}", radians.to_degrees()))
            });
            ui.label(RichText::new(mm).monospace());
            ui.label(RichText::new(deg).monospace());
            ui.label(RichText::new(tr!(language, "solved")).small().color(palette.weak));
        }
        Err(error) => {
            ui.label("–");
            ui.label("–");
            ui.label(RichText::new(tr!(language, "no answer")).small().color(palette.warning))
                .on_hover_text(Text::from(error).in_language(language));
        }
    }
}

/// A method by the names of its authors.
pub fn title(name: &'static str, language: Language) -> &'static str {
    match name {
        "joint" => tr!(language, "Joint estimate"),
        "tsai_lenz" => "Tsai & Lenz",
        "park_martin" => "Park & Martin",
        "horaud" => "Horaud & Dornaika",
        "andreff" => "Andreff",
        "daniilidis" => "Daniilidis",
        "shah" => "Shah",
        "li" => "Li",
        other => other,
    }
}
