//! Messages below the steps, where they cover nothing. They disappear automatically; errors stay until they are closed.

use std::sync::Arc;

use egui::text::LayoutJob;
use egui::{CornerRadius, FontId, Galley, Rect, Sense, Stroke, StrokeKind, Ui, Vec2, WidgetInfo, WidgetType};

use crate::shell::layout::Layout;
use crate::style::icons::{self, Icon};
use crate::style::theme::{CARD_RADIUS, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::messages;
use handeye_workbench::model::{Home, Message, Model, Severity};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// More would be a second log.
const MOST: usize = 4;
/// Lines of a message; the rest of it is in the log, and under the pointer.
const MOST_LINES: usize = 7;
/// Size of the letters.
const LETTERS: f32 = 12.0;
/// Room around the text: left of it the bar of colour, right of it the cross.
const LEFT: f32 = 14.0;
const RIGHT: f32 = 24.0;
const ABOVE: f32 = 8.0;
/// Distance between messages.
const BETWEEN: f32 = 6.0;

/// How long \[s\] a message stays; `None` until it is closed.
fn lifetime_s(severity: Severity) -> Option<f64> {
    match severity {
        Severity::Info => Some(4.0),
        Severity::Warning => Some(10.0),
        Severity::Error => None,
    }
}

/// The messages that are up now, newest first: those that are not visible anywhere else.
fn up<'a>(model: &'a Model, layout: &Layout) -> Vec<&'a Message> {
    let is_up = |message: &&Message| {
        let has_no_other_place = match message.home {
            Home::Toast => true,
            Home::Pane(pane) => !layout.is_in_front(pane),
            Home::Log | Home::StatusLine | Home::Connection => false,
        };
        has_no_other_place
            && !message.dismissed
            && lifetime_s(message.severity).is_none_or(|lifetime_s| model.now_s - message.at_s < lifetime_s)
    };
    model.messages.iter().rev().filter(is_up).take(MOST).collect()
}

/// Draws them into the room that is left, newest at the bottom. What does not fit is in the log.
pub fn toasts_ui(ui: &mut Ui, model: &Model, layout: &Layout, outbox: &mut Outbox) {
    let language = model.view.language;
    let room = ui.available_rect_before_wrap();
    let mut bottom = room.bottom();
    for message in up(model, layout) {
        let reported = reported(message, language);
        let galley = galley(ui, &reported, room.width() - LEFT - RIGHT);
        let height = galley.size().y + 2.0 * ABOVE;
        if bottom - height < room.top() {
            return;
        }
        let rect = Rect::from_min_max(egui::pos2(room.left(), bottom - height), egui::pos2(room.right(), bottom));
        bottom -= height + BETWEEN;
        if toast_ui(ui, rect, message, &reported, galley, language) {
            outbox.send(messages::Command::Dismiss(message.number));
        }
    }
}

fn reported(message: &Message, language: Language) -> String {
    match message.times {
        1 => message.text.in_language(language),
        times => format!("{} ({times}×)", message.text.in_language(language)),
    }
}

fn galley(ui: &Ui, text: &str, width: f32) -> Arc<Galley> {
    let ink = Palette::of(ui).text;
    let mut job = LayoutJob::simple(text.to_owned(), FontId::proportional(LETTERS), ink, width);
    job.wrap.max_rows = MOST_LINES;
    ui.painter().layout_job(job)
}

/// One message; whether it was closed.
fn toast_ui(
    ui: &mut Ui,
    rect: Rect,
    message: &Message,
    reported: &str,
    galley: Arc<Galley>,
    language: Language,
) -> bool {
    let palette = Palette::of(ui);
    let colour = match message.severity {
        Severity::Info => palette.accent,
        severity => palette.severity(severity),
    };
    let id = ui.id().with(("toast", message.number));
    let card = ui.interact(rect, id, Sense::hover());
    card.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, reported));
    let (radius, edge) = (CornerRadius::same(CARD_RADIUS), Stroke::new(1.0, palette.edge));
    ui.painter().rect(rect, radius, palette.raised(), edge, StrokeKind::Inside);
    let bar = Rect::from_min_size(rect.min + Vec2::new(5.0, ABOVE), Vec2::new(3.0, rect.height() - 2.0 * ABOVE));
    ui.painter().rect_filled(bar, CornerRadius::same(2), colour);
    ui.painter().galley(rect.min + Vec2::new(LEFT, ABOVE), galley, palette.text);
    let corner = Rect::from_min_size(rect.right_top() + Vec2::new(-RIGHT, 3.0), Vec2::splat(RIGHT - 3.0));
    let cross = ui.interact(corner, id.with("cross"), Sense::click());
    cross.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, tr!(language, "Dismiss")));
    let ink = if cross.hovered() || cross.has_focus() { palette.text } else { palette.weak };
    icons::draw(ui.painter(), Icon::Close, corner, 10.0, ink);
    card.on_hover_text(reported);
    cross.clicked()
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::model::{CellSource, Pane, ViewSettings};
    use handeye_workbench::text::Text;

    #[test]
    fn messages_go_by_themselves_but_errors_wait_for_the_user() {
        let mut model = Model::new(CellSource::default(), ViewSettings::default());
        for severity in [Severity::Info, Severity::Warning, Severity::Error] {
            model.messages.notify_at(Home::Toast, severity, Text::verbatim("so it is"), 10.0);
        }
        let layout = Layout::default();
        let seen = |model: &Model| up(model, &layout).into_iter().map(|message| message.severity).collect::<Vec<_>>();
        model.now_s = 11.0;
        assert_eq!(seen(&model), [Severity::Error, Severity::Warning, Severity::Info]);
        model.now_s = 15.0;
        assert_eq!(seen(&model), [Severity::Error, Severity::Warning]);
        model.now_s = 1e6;
        assert_eq!(seen(&model), [Severity::Error]);
        model.messages.dismiss(2);
        assert_eq!(seen(&model), []);
    }

    #[test]
    fn what_a_pane_in_front_or_a_strip_or_the_status_line_says_is_not_said_again() {
        let mut model = Model::new(CellSource::default(), ViewSettings::default());
        model.now_s = 10.0;
        let homes = [Home::Pane(Pane::Track), Home::Connection, Home::StatusLine];
        for home in homes {
            model.messages.notify_at(home, Severity::Warning, Text::verbatim(format!("{home:?}")), 10.0);
        }
        let mut layout = Layout::default();
        layout.show(Pane::Jog);
        let seen = |layout: &Layout| up(&model, layout).into_iter().map(|it| it.home).collect::<Vec<_>>();
        assert_eq!(seen(&layout), [Home::Pane(Pane::Track)], "nothing else says it now");
        layout.show(Pane::Track);
        assert_eq!(seen(&layout), []);
    }
}
