//! The lines over the images: what is drawn over the colours, and which colours depths have.

use egui::{RichText, Ui};
use handeye_geometry::depth::ColourMap;

use handeye_workbench::command::Outbox;
use handeye_workbench::live;
use handeye_workbench::model::{DepthScale, Model};
use handeye_workbench::tr;

/// A switch per overlay.
pub fn overlays_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let before = model.view.overlays;
    let mut now = before;
    egui::ScrollArea::horizontal().id_salt("overlays").show(ui, |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 7.0;
        switch_ui(
            ui,
            &mut now.corners,
            tr!(language, "Corners"),
            tr!(language, "Corners that were found, coloured by row; the first one has a ring. Faint ones are of an earlier image"),
        );
        switch_ui(
            ui,
            &mut now.axes,
            tr!(language, "Axes"),
            tr!(language, "The axes of the board: x red, y green, z blue, into the board"),
        );
        switch_ui(
            ui,
            &mut now.predicted,
            tr!(language, "Predicted board"),
            tr!(language, "The board where the robot's pose and the calibration say that it is; while it is tracked, where tracking has it"),
        );
        switch_ui(
            ui,
            &mut now.coverage,
            tr!(language, "Coverage"),
            tr!(language, "Where the board was in past captures; dark where it never was"),
        );
        switch_ui(
            ui,
            &mut now.residuals,
            tr!(language, "Residuals"),
            tr!(language, "From predicted to measured corners, exaggerated: of a capture after the fit, of the live image by robot and calibration alone, or by the board's pose in it while the board is tracked"),
        );
    });
    if now != before {
        outbox.send(live::Command::SetOverlays(now));
    }
}

fn switch_ui(ui: &mut Ui, on: &mut bool, name: &str, what: &str) {
    let response = ui.selectable_label(*on, name).on_hover_text(what);
    if response.clicked() {
        *on = !*on;
    }
}

/// Colour map and range of the depth image.
pub fn depth_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    egui::ScrollArea::horizontal().id_salt("depth colours").show(ui, |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 7.0;
        for (map, name, what) in [
            (ColourMap::Turbo, tr!(language, "Turbo"), tr!(language, "A rainbow of even steps: shows the most detail")),
            (
                ColourMap::Viridis,
                tr!(language, "Viridis"),
                tr!(language, "Perceptually uniform, and readable with colour blindness"),
            ),
            (ColourMap::Grey, tr!(language, "Grey"), tr!(language, "Near is dark, far is light")),
        ] {
            let chosen = model.view.depth_colours == map;
            if ui.selectable_label(chosen, name).on_hover_text(what).clicked() && !chosen {
                outbox.send(live::Command::SetDepthColours(map));
            }
        }
        ui.separator();
        for (scale, name, what) in [
            (
                DepthScale::Auto,
                tr!(language, "Auto range"),
                tr!(language, "Colours for the depths that are in the image"),
            ),
            (
                DepthScale::Full,
                tr!(language, "Full range"),
                tr!(language, "Colours for all depths that the sensor can measure"),
            ),
        ] {
            let chosen = model.view.depth_scale == scale;
            if ui.selectable_label(chosen, RichText::new(name)).on_hover_text(what).clicked() && !chosen {
                outbox.send(live::Command::SetDepthScale(scale));
            }
        }
    });
}
