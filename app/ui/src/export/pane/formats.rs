//! The formats, and which of them are chosen.

use std::collections::BTreeSet;

use egui::{Align, Layout, Ui, WidgetInfo, WidgetType};
use handeye_export::Format;

use super::preview;
use crate::style::parts;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::export;
use handeye_workbench::model::Model;
use handeye_workbench::tr;

/// The list.
pub fn formats_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::section_with_ui(ui, tr!(language, "Formats"), |ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if ui.add(parts::small_button(ui, tr!(language, "Choose none"))).clicked() {
                outbox.send(export::Command::ChooseFormats(BTreeSet::new()));
            }
            if ui.add(parts::small_button(ui, tr!(language, "Choose all"))).clicked() {
                let possible = handeye_export::formats()
                    .iter()
                    .map(|format| format.name())
                    .filter(|name| is_possible(model, name));
                outbox.send(export::Command::ChooseFormats(possible.map(str::to_owned).collect()));
            }
        });
    });
    for format in handeye_export::formats() {
        format_ui(ui, model, *format, outbox);
    }
}

/// Formats that are chosen and can represent this result.
pub fn chosen(model: &Model) -> Vec<&'static str> {
    let names = handeye_export::formats().iter().map(|format| format.name());
    names.filter(|name| model.export.chosen.contains(*name) && is_possible(model, name)).collect()
}

/// One without a preview yet is assumed to be possible.
fn is_possible(model: &Model, name: &str) -> bool {
    !matches!(model.export.previews.get(name), Some(Err(_)))
}

fn format_ui(ui: &mut Ui, model: &Model, format: &dyn Format, outbox: &mut Outbox) {
    let language = model.view.language;
    let name = format.name();
    let refusal = match model.export.previews.get(name) {
        Some(Err(why)) => Some(why.in_language(language)),
        _ => None,
    };
    ui.horizontal(|ui| {
        let mut is_chosen = model.export.chosen.contains(name) && refusal.is_none();
        let box_ = ui.add_enabled(refusal.is_none(), egui::Checkbox::new(&mut is_chosen, name));
        if box_.on_disabled_hover_text(refusal.clone().unwrap_or_default()).changed() {
            let mut chosen = model.export.chosen.clone();
            if is_chosen {
                chosen.insert(name.to_owned());
            } else {
                chosen.remove(name);
            }
            outbox.send(export::Command::ChooseFormats(chosen));
        }
        if refusal.is_some() {
            return;
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_shown = model.export.shown.as_deref() == Some(name);
            let response = ui.selectable_label(is_shown, tr!(language, "Show"));
            let reported = text!("Show {format}", format = name).in_language(language);
            response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, is_shown, &reported));
            if response.clicked() {
                outbox.send(export::Command::ShowFormat((!is_shown).then(|| name.to_owned())));
            }
        });
    });
    ui.indent(name, |ui| match refusal {
        Some(why) => {
            let reported = text!("Not possible: {why}", why = why).in_language(language);
            let warning = crate::style::theme::Palette::of(ui).warning;
            ui.add(egui::Label::new(egui::RichText::new(reported).small().color(warning)).wrap());
        }
        None => {
            parts::caption_ui(ui, &format.description().in_language(language));
        }
    });
    if model.export.shown.as_deref() == Some(name) {
        preview::preview_ui(ui, model, name);
    }
}
