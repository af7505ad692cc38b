//! A point of the image in the base, measured in two ways.

use egui::Ui;
use handeye_estimate::stated_uncertainty::StatedUncertainty;
use handeye_estimate::verify::MeasuredPoint;
use nalgebra::Vector3;

use crate::style::numbers;
use crate::style::parts;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::live;
use handeye_workbench::model::{MeasuredTwice, Model};
use handeye_workbench::text::Text;
use handeye_workbench::tr;

/// The point, or how to pick one.
pub fn picked_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Picked point, in the base"));
    let Some(picked) = &model.picked else {
        parts::hint_ui(
            ui,
            tr!(
                language,
                "In the step Verify, click a point of the board in the live image. Its place in the base is then \
                 measured twice: from the depth at the pixel, and from the board as it is seen."
            ),
        );
        return;
    };
    ui.horizontal(|ui| {
        let pixel = text!("Pixel {column}, {row}", column = picked.pixel.column, row = picked.pixel.row);
        parts::hint_ui(ui, &pixel.in_language(language));
        if ui.add(parts::small_button(ui, tr!(language, "Clear the point"))).clicked() {
            outbox.send(live::Command::Pick(None));
        }
    });
    let MeasuredTwice { from_depth, from_board } = &picked.as_reported;
    point_ui(ui, model, tr!(language, "From depth [mm]"), from_depth);
    point_ui(ui, model, tr!(language, "From the board [mm]"), from_board);
    if let (Ok(depth), Ok(board)) = (from_depth, from_board) {
        let difference_mm = (depth.in_base.point() - board.in_base.point()) * 1e3;
        parts::stated_ui(ui, tr!(language, "Difference [mm]"), &millimetres(&difference_mm));
        parts::stated_ui(ui, tr!(language, "Its length [mm]"), &numbers::fixed(difference_mm.norm(), 2, 8));
    }
    if let Some(corrected) = &picked.corrected {
        let why = tr!(
            language,
            "With the tip pose corrected for the errors of the arm: for commands that are corrected as well, and no others:"
        );
        parts::hint_ui(ui, why);
        point_ui(ui, model, tr!(language, "From depth, corrected [mm]"), &corrected.from_depth);
        point_ui(ui, model, tr!(language, "From the board, corrected [mm]"), &corrected.from_board);
    }
    let solved = model.solve.solved.as_ref();
    let modelled =
        solved.is_none_or(|solved| *solved.calibration.stated_uncertainty() == StatedUncertainty::AsModelled);
    let meaning = if modelled {
        tr!(
            language,
            "± is one standard deviation, as far as the calibration causes it; what the image adds comes on top."
        )
    } else {
        tr!(
            language,
            "± is one standard deviation by the noise alone: what was found in the calibration comes on top, see Solve."
        )
    };
    parts::hint_ui(ui, meaning);
}

fn point_ui(ui: &mut Ui, model: &Model, caption: &str, point: &Result<MeasuredPoint, Text>) {
    match point {
        Err(why) => {
            parts::row_ui(ui, caption, |ui| parts::hint_ui(ui, &why.in_language(model.view.language)));
        }
        Ok(point) => {
            parts::stated_ui(ui, caption, &millimetres(&(point.in_base.point().coords * 1e3)));
            if let Some(sigma_m) = point.sigma_m() {
                parts::stated_ui(ui, "± 1 σ [mm]", &millimetres(&(sigma_m * 1e3)));
            }
        }
    }
}

fn millimetres(vector: &Vector3<f64>) -> String {
    numbers::row(vector.as_slice(), 2, 8)
}
