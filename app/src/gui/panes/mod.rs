//! The panes. Each draws a part of the model and returns what the user wants through the outbox.

mod banner;
mod colour_bar;
#[cfg(test)]
pub mod driven;
mod empty;
#[cfg_attr(not(test), expect(dead_code, reason = "the tiles that show it come with the frame of the window"))]
mod export;
#[cfg_attr(not(test), expect(dead_code, reason = "the tiles that show it come with the frame of the window"))]
mod jog;
pub mod parts;
mod pictures;
#[cfg_attr(not(test), expect(dead_code, reason = "the tiles that show it come with the frame of the window"))]
mod result;
mod status_bar;
#[cfg_attr(not(test), expect(dead_code, reason = "the tiles that show it come with the frame of the window"))]
mod taught;
mod top_bar;
#[cfg_attr(not(test), expect(dead_code, reason = "the tiles that show it come with the frame of the window"))]
mod verify;

use egui::{CentralPanel, Frame, Margin, Panel, Stroke, Ui};

use super::status::{self, Action};
use super::textures::LiveTextures;
use super::theme::{GAP, Palette};
use crate::command::{Command, Outbox};
use crate::model::Model;

/// The whole window.
pub fn all_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let bar = Frame::new().fill(palette.bar).stroke(Stroke::NONE).inner_margin(Margin::symmetric(14, 8));
    Panel::top("top_bar").frame(bar).resizable(false).show(ui, |ui| top_bar::top_bar_ui(ui, model, outbox));
    Panel::bottom("status_bar").frame(bar).resizable(false).show(ui, |ui| status_bar::status_bar_ui(ui, model, outbox));
    let centre = Frame::new().fill(palette.backdrop).inner_margin(Margin::same(GAP as i8));
    CentralPanel::default().frame(centre).show(ui, |ui| {
        if model.frame.is_none() {
            empty::empty_ui(ui, &status::before_first_picture(model), outbox);
            return;
        }
        if let Some(hindrance) = status::hindrance(model) {
            banner::banner_ui(ui, &hindrance, outbox);
            ui.add_space(GAP);
        }
        pictures::pictures_ui(ui, model, textures, outbox);
    });
}

/// The button for an action.
fn action_ui(ui: &mut Ui, action: Option<Action>, outbox: &mut Outbox) {
    let (text, command) = match action {
        None => return,
        Some(Action::Reconnect) => ("Try again now", Command::Reconnect),
        Some(Action::StartSimulation) => ("Start simulation", Command::StartSimulation),
    };
    if ui.button(text).clicked() {
        outbox.send(command);
    }
}
