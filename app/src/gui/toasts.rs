//! Messages that come up at the lower right and go by themselves; errors stay until they are put aside.

use egui::{Align2, Area, CornerRadius, Frame, Id, Label, Margin, Order, Rect, Sense, Stroke, Vec2};
use egui::{WidgetInfo, WidgetType};

use super::icons::{self, Icon};
use super::theme::{CARD_RADIUS, GAP, Palette};
use crate::command::{Command, Outbox};
use crate::model::{Message, Model, Severity};
use crate::text::Language;
use crate::tr;

/// More would cover the work; the log has all of them.
const MOST: usize = 4;
/// Width of a message.
const WIDTH: f32 = 340.0;

/// How long [s] a message stays; `None` until it is put aside.
fn lifetime_s(severity: Severity) -> Option<f64> {
    match severity {
        Severity::Info => Some(4.0),
        Severity::Warning => Some(10.0),
        Severity::Error => None,
    }
}

/// The messages that are up now, newest first.
fn up(model: &Model) -> Vec<&Message> {
    let is_up = |message: &&Message| {
        !message.dismissed
            && lifetime_s(message.severity).is_none_or(|lifetime_s| model.now_s - message.at_s < lifetime_s)
    };
    model.messages.iter().rev().filter(is_up).take(MOST).collect()
}

/// Draws them into the lower right corner of `within`.
pub fn toasts_ui(ctx: &egui::Context, within: Rect, model: &Model, outbox: &mut Outbox) {
    let messages = up(model);
    if messages.is_empty() {
        return;
    }
    let corner = within.right_bottom() - Vec2::splat(GAP + 6.0);
    Area::new(Id::new("toasts")).order(Order::Foreground).pivot(Align2::RIGHT_BOTTOM).fixed_pos(corner).show(
        ctx,
        |ui| {
            ui.spacing_mut().item_spacing.y = 6.0;
            for message in messages.into_iter().rev() {
                toast_ui(ui, message, model.view.language, outbox);
            }
        },
    );
}

fn toast_ui(ui: &mut egui::Ui, message: &Message, language: Language, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let colour = match message.severity {
        Severity::Info => palette.accent,
        severity => palette.severity(severity),
    };
    let frame = Frame::new()
        .fill(palette.card)
        .stroke(Stroke::new(1.0, palette.edge))
        .shadow(ui.visuals().popup_shadow)
        .corner_radius(CornerRadius::same(CARD_RADIUS))
        .inner_margin(Margin { left: 16, right: 8, top: 9, bottom: 9 });
    let shown = frame.show(ui, |ui| {
        ui.set_width(WIDTH);
        ui.horizontal_top(|ui| {
            let text = match message.times {
                1 => message.text.say(language),
                times => format!("{} ({times}×)", message.text.say(language)),
            };
            ui.scope(|ui| {
                ui.set_width(WIDTH - 34.0);
                ui.add(Label::new(text).wrap());
            });
            let (_, close) = ui.allocate_exact_size(Vec2::splat(18.0), Sense::click());
            close.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, tr!(language, "Dismiss")));
            let ink = if close.hovered() { palette.text } else { palette.weak };
            icons::draw(ui.painter(), Icon::Close, close.rect, 12.0, ink);
            if close.clicked() {
                outbox.send(Command::DismissMessage(message.number));
            }
        });
    });
    let rect = shown.response.rect;
    let bar = Rect::from_min_size(rect.min + Vec2::new(5.0, 8.0), Vec2::new(3.0, rect.height() - 16.0));
    ui.painter().rect_filled(bar, CornerRadius::same(2), colour);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{CellSource, ViewSettings};
    use crate::text::Text;

    #[test]
    fn messages_go_by_themselves_but_errors_wait_for_the_user() {
        let mut model = Model::new(CellSource::BuiltIn, ViewSettings::default());
        for severity in [Severity::Info, Severity::Warning, Severity::Error] {
            model.messages.say(severity, Text::verbatim("so it is"), 10.0);
        }
        let seen = |model: &Model| up(model).into_iter().map(|message| message.severity).collect::<Vec<_>>();
        model.now_s = 11.0;
        assert_eq!(seen(&model), [Severity::Error, Severity::Warning, Severity::Info]);
        model.now_s = 15.0;
        assert_eq!(seen(&model), [Severity::Error, Severity::Warning]);
        model.now_s = 1e6;
        assert_eq!(seen(&model), [Severity::Error]);
        model.messages.dismiss(2);
        assert_eq!(seen(&model), []);
    }
}
