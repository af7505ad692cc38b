//! The menu of the window.

use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Button, PopupCloseBehavior, Ui, Vec2, WidgetInfo, WidgetType};

use super::panes::title;
use crate::style::icons::{self, Icon};
use crate::style::theme::{self, Palette};
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::{Dialog, Model, Pane, ThemeChoice};
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{session, shell};

/// The button that opens the menu.
pub fn menu_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let button = Button::new("").min_size(theme::least(ui, 34.0, 30.0)).frame(false);
    let (response, _) = MenuButton::from_button(button).config(config).ui(ui, |ui| content_ui(ui, model, outbox));
    let palette = Palette::of(ui);
    if response.hovered() || response.has_focus() {
        ui.painter().rect_filled(response.rect, 6.0, palette.card.lerp_to_gamma(palette.text, 0.08));
    }
    icons::draw(ui.painter(), Icon::Menu, response.rect, 15.0, palette.text);
    let name = tr!(language, "Menu");
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, name));
}

fn item_ui(ui: &mut Ui, outbox: &mut Outbox, name: &str, keys: &str, command: impl Into<Command>) {
    let button = Button::new(name).shortcut_text(keys).min_size(Vec2::new(ui.available_width(), 0.0));
    if ui.add(button).clicked() {
        outbox.send(command);
        ui.close();
    }
}

fn content_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.set_min_width(220.0);
    item_ui(ui, outbox, tr!(language, "New session…"), "Ctrl+N", shell::Command::SetDialog(Some(Dialog::New)));
    item_ui(ui, outbox, tr!(language, "Open session…"), "Ctrl+O", shell::Command::SetDialog(Some(Dialog::Open)));
    if !model.opening && !model.sequence_runs {
        item_ui(ui, outbox, tr!(language, "Open a sample"), "", session::Command::OpenSample);
    }
    item_ui(ui, outbox, tr!(language, "Save session…"), "Ctrl+S", shell::Command::SetDialog(Some(Dialog::SaveAs)));
    ui.separator();
    ui.menu_button(tr!(language, "Theme"), |ui| {
        for (theme, name) in
            [(ThemeChoice::Dark, tr!(language, "Dark theme")), (ThemeChoice::Light, tr!(language, "Light theme"))]
        {
            if ui.radio(model.view.theme == theme, name).clicked() {
                outbox.send(shell::Command::SetTheme(theme));
                ui.close();
            }
        }
    });
    ui.menu_button(tr!(language, "Language"), |ui| {
        for other in Language::ALL {
            if ui.radio(language == other, other.own_name()).clicked() {
                outbox.send(shell::Command::SetLanguage(other));
                ui.close();
            }
        }
    });
    ui.menu_button(tr!(language, "Layout"), |ui| {
        for pane in Pane::ALL {
            if ui.button(title(pane, language)).clicked() {
                outbox.send(shell::Command::ShowPane(pane));
                ui.close();
            }
        }
        ui.separator();
        if ui.button(tr!(language, "Reset layout")).clicked() {
            outbox.send(shell::Command::ResetLayout);
            ui.close();
        }
    });
    ui.separator();
    item_ui(ui, outbox, tr!(language, "All commands"), "Ctrl+K", shell::Command::SetDialog(Some(Dialog::Palette)));
    item_ui(ui, outbox, tr!(language, "Keyboard"), "F1", shell::Command::SetDialog(Some(Dialog::Help)));
    item_ui(ui, outbox, tr!(language, "About"), "", shell::Command::SetDialog(Some(Dialog::About)));
}
