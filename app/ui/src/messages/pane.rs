//! All messages, newest first.

use egui::{Align, Id, Label, Layout, RichText, ScrollArea, Sense, Ui, Vec2};

use crate::style::theme::Palette;
use crate::style::{empty, form};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Message, Model, Severity};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Width of the column of times.
const TIMES: f32 = 62.0;

/// The pane.
pub fn log_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    if model.messages.newest().is_none() {
        let detail = tr!(language, "Everything that happens is logged here.");
        empty::empty_ui(ui, tr!(language, "No messages yet"), detail);
        return;
    }
    let id = Id::new("log filter");
    let mut least: Severity = ui.data(|data| data.get_temp(id)).unwrap_or(Severity::Info);
    let chosen = |least: Severity| {
        model.messages.iter().rev().filter(move |message| message.severity >= least).collect::<Vec<_>>()
    };
    egui::Frame::new().inner_margin(egui::Margin::symmetric(12, 8)).show(ui, |ui| {
        ui.horizontal(|ui| {
            let choices = [
                (Severity::Info, tr!(language, "All"), ""),
                (Severity::Warning, tr!(language, "Warnings"), tr!(language, "Warnings and errors")),
                (Severity::Error, tr!(language, "Errors"), ""),
            ];
            if let Some(choice) = form::choice_ui(ui, least, &choices) {
                least = choice;
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let hint = tr!(language, "Copy these messages as text");
                if ui.button(tr!(language, "Copy")).on_hover_text(hint).clicked() {
                    let lines = chosen(least).into_iter().rev().map(|message| line(message, language));
                    ui.copy_text(lines.collect::<Vec<_>>().join("\n"));
                }
            });
        });
    });
    ui.data_mut(|data| data.insert_temp(id, least));
    let chosen = chosen(least);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        egui::Frame::new().inner_margin(egui::Margin { left: 12, right: 12, top: 0, bottom: 8 }).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 5.0;
            for message in chosen {
                message_ui(ui, message, language);
            }
        });
    });
}

fn message_ui(ui: &mut Ui, message: &Message, language: Language) {
    let palette = Palette::of(ui);
    ui.horizontal_top(|ui| {
        ui.spacing_mut().item_spacing.x = 8.0;
        let (rect, _) = ui.allocate_exact_size(Vec2::new(8.0, 18.0), Sense::hover());
        let colour = match message.severity {
            Severity::Info => palette.weak.gamma_multiply(0.5),
            severity => palette.severity(severity),
        };
        ui.painter().circle_filled(rect.center(), 3.5, colour);
        ui.allocate_ui(Vec2::new(TIMES, 18.0), |ui| {
            ui.set_min_width(TIMES);
            ui.label(RichText::new(clock(message.at_s)).color(palette.weak))
                .on_hover_text(tr!(language, "Hours, minutes and seconds since the start of the program"));
        });
        let ink = if message.severity == Severity::Info { palette.text } else { colour };
        ui.add(Label::new(RichText::new(words(message, language)).color(ink)).wrap().selectable(true));
    });
}

fn words(message: &Message, language: Language) -> String {
    match message.times {
        1 => message.text.in_language(language),
        times => format!("{} ({times}×)", message.text.in_language(language)),
    }
}

/// A message as a line of text.
fn line(message: &Message, language: Language) -> String {
    let severity = match message.severity {
        Severity::Info => tr!(language, "info"),
        Severity::Warning => tr!(language, "warning"),
        Severity::Error => tr!(language, "error"),
    };
    format!("{} {severity}: {}", clock(message.at_s), words(message, language))
}

/// `1:02:03`.
fn clock(at_s: f64) -> String {
    let seconds = at_s.max(0.0) as u64;
    format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_hours_minutes_and_seconds() {
        assert_eq!(clock(0.9), "0:00:00");
        assert_eq!(clock(3723.0), "1:02:03");
    }
}
