//! The panes. Each draws a part of the model and returns what the user wants through the outbox.

pub(crate) mod asked;
pub(crate) mod capturing;
pub(crate) mod layout;
mod menu;
pub(crate) mod panes;
pub(crate) mod rail;
pub(crate) mod reasons;
pub(crate) mod sequence;
mod status_bar;
mod tiles;
mod top_bar;

use egui::{CentralPanel, Frame, Margin, Panel, Ui};

use super::shell::layout::Layout;
use super::status;
use super::style::theme::{GAP, Palette};
use crate::live::textures::Textures;
use crate::messages::toasts;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Step};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// The whole window.
pub fn all_ui(ui: &mut Ui, model: &Model, textures: &mut Textures, layout: &mut Layout, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let bar = Frame::new().fill(palette.bar).inner_margin(Margin::symmetric(14, 8));
    Panel::top("top_bar").frame(bar).resizable(false).show(ui, |ui| top_bar::top_bar_ui(ui, model, outbox));
    Panel::bottom("status_bar").frame(bar).resizable(false).show(ui, |ui| status_bar::status_bar_ui(ui, model, outbox));
    let side = Frame::new().fill(palette.bar).inner_margin(Margin { left: 8, right: 8, top: 10, bottom: 8 });
    Panel::left("rail").frame(side).resizable(false).exact_size(rail::WIDTH).show(ui, |ui| {
        rail::rail_ui(ui, model, outbox);
        ui.add_space(GAP);
        if let Some(hindrance) = status::hindrance(model).filter(|_| model.frame.is_some()) {
            crate::messages::banner::banner_ui(ui, &hindrance, model.view.language, outbox);
            ui.add_space(GAP);
        }
        toasts::toasts_ui(ui, model, layout, outbox);
    });
    let centre = Frame::new().fill(palette.backdrop).inner_margin(Margin::same(GAP as i8));
    CentralPanel::default().frame(centre).show(ui, |ui| {
        tiles::tiles_ui(ui, model, textures, layout, outbox);
    });
}

/// What a step is called.
pub fn step_name(step: Step, language: Language) -> &'static str {
    match step {
        Step::Connect => tr!(language, "Connect"),
        Step::Target => tr!(language, "Target"),
        Step::Capture => tr!(language, "Capture"),
        Step::Solve => tr!(language, "Solve"),
        Step::Verify => tr!(language, "Verify"),
        Step::Export => tr!(language, "Export"),
        Step::Track => tr!(language, "Track"),
    }
}
