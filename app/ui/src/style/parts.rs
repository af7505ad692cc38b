//! Small parts that panes share: sections, stated numbers, notices, and icons that need no font.

use egui::{
    Align, Button, CornerRadius, Frame, Id, Label, Layout, Margin, ProgressBar, Response, RichText, ScrollArea, Sense,
    Shape, Stroke, Ui, Vec2, WidgetInfo, WidgetType,
};

use crate::style::theme::{self, CAPTION, Palette, Tone};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Width of the captions in front of numbers.
const CAPTIONS: f32 = 128.0;
/// Size of buttons with an icon.
const SIGN_BUTTON: f32 = 24.0;

/// The body of a pane: scrolls when its tile is small.
pub(crate) fn body_ui(ui: &mut Ui, salt: &str, content_ui: impl FnOnce(&mut Ui)) {
    ScrollArea::vertical().id_salt(salt).auto_shrink(false).show(ui, |ui| {
        Frame::new().inner_margin(Margin::symmetric(12, 10)).show(ui, |ui| {
            ui.set_width(ui.available_width());
            ui.spacing_mut().item_spacing.y = 6.0;
            content_ui(ui);
        });
    });
}

/// A heading within a pane.
pub(crate) fn section_ui(ui: &mut Ui, title: &str) {
    section_with_ui(ui, title, |_| ());
}

/// A heading, and what is next to it.
pub(crate) fn section_with_ui(ui: &mut Ui, title: &str, beside_ui: impl FnOnce(&mut Ui)) {
    ui.add_space(6.0);
    ui.horizontal(|ui| {
        ui.label(RichText::new(title).strong().size(13.5).color(Palette::of(ui).text));
        beside_ui(ui);
    });
}

/// A sentence that explains.
pub(crate) fn hint_ui(ui: &mut Ui, text: &str) {
    let weak = Palette::of(ui).weak;
    ui.add(Label::new(RichText::new(text).color(weak)).wrap());
}

/// What an empty pane shows, and what to do about it.
pub(crate) fn empty_ui(ui: &mut Ui, title: &str, detail: &str) {
    let palette = Palette::of(ui);
    ui.add_space(14.0);
    ui.vertical_centered(|ui| {
        ui.label(RichText::new(title).size(16.0).color(palette.text));
        ui.add_space(2.0);
        ui.add(Label::new(RichText::new(detail).color(palette.weak)).wrap().halign(Align::Center));
    });
    ui.add_space(10.0);
}

/// A sentence with a tone, and what belongs to it, on a tinted strip.
pub(crate) fn notice_ui<R>(ui: &mut Ui, tone: Tone, text: &str, below_ui: impl FnOnce(&mut Ui) -> R) -> R {
    let palette = Palette::of(ui);
    Frame::new()
        .fill(palette.tinted(tone))
        .stroke(Stroke::new(1.0, palette.tone(tone).gamma_multiply(0.5)))
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::symmetric(10, 7))
        .show(ui, |ui| {
            ui.set_min_width(ui.available_width());
            ui.add(Label::new(RichText::new(text).color(palette.text)).wrap());
            below_ui(ui)
        })
        .inner
}

/// A caption and its value, read together by a screen reader.
pub(crate) fn stated_ui(ui: &mut Ui, caption: &str, value: &str) -> Response {
    let colour = Palette::of(ui).text;
    stated_in_ui(ui, caption, value, colour)
}

/// The same in a colour.
pub(crate) fn stated_in_ui(ui: &mut Ui, caption: &str, value: &str, colour: egui::Color32) -> Response {
    ui.scope(|ui| {
        // Numbers are closer together than controls.
        ui.spacing_mut().interact_size.y = 18.0;
        row_ui(ui, caption, |ui| value_ui(ui, caption, value, colour))
    })
    .inner
}

/// Width of a caption with this value in one line.
pub(crate) fn stated_width(ui: &Ui, value: &str) -> f32 {
    let font = egui::TextStyle::Monospace.resolve(ui.style());
    let value = ui.painter().layout_no_wrap(value.to_owned(), font, egui::Color32::WHITE).size().x;
    // One extra point for rounding.
    CAPTIONS + ui.spacing().item_spacing.x + value + 1.0
}

/// A value in digits of equal width, with the caption that a screen reader reads before it.
pub(crate) fn value_ui(ui: &mut Ui, caption: &str, value: &str, colour: egui::Color32) -> Response {
    let label = ui.add(Label::new(RichText::new(value).monospace().color(colour)).wrap().sense(Sense::hover()));
    label.widget_info(|| {
        let spoken = value.split_whitespace().collect::<Vec<_>>().join(" ");
        WidgetInfo::labeled(WidgetType::Label, true, format!("{caption}: {spoken}"))
    });
    label
}

/// A caption at the left and what belongs to it at the right.
pub(crate) fn row_ui<R>(ui: &mut Ui, caption: &str, content_ui: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let weak = Palette::of(ui).weak;
        ui.allocate_ui_with_layout(Vec2::new(CAPTIONS, 18.0), Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(CAPTIONS);
            ui.add(Label::new(RichText::new(caption).size(12.0).color(weak)).truncate());
        });
        content_ui(ui)
    })
    .inner
}

/// A caption in small letters.
pub(crate) fn caption_ui(ui: &mut Ui, text: &str) -> Response {
    let weak = Palette::of(ui).weak;
    ui.add(Label::new(RichText::new(text).size(CAPTION).color(weak)).wrap())
}

/// A dot in the colour of a tone.
pub(crate) fn dot_ui(ui: &mut Ui, colour: egui::Color32) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(10.0, 18.0), Sense::hover());
    ui.painter().circle_filled(rect.center(), 4.0, colour);
}

/// A button that is disabled while there is a reason, which is then its tooltip.
pub(crate) fn gated_ui(ui: &mut Ui, reason: Option<&str>, button: Button<'_>) -> Response {
    ui.add_enabled(reason.is_none(), button).on_disabled_hover_text(reason.unwrap_or_default())
}

/// A progress bar, 0 to 1, with the text for screen readers and a button that ends it; returns whether that was
/// clicked.
pub(crate) fn progress_ui(ui: &mut Ui, part: f32, reported: &str, end: &str) -> bool {
    ui.label(RichText::new(reported).color(Palette::of(ui).text));
    ui.horizontal(|ui| {
        // From the right, so that the bar gets what the button leaves.
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let clicked = ui.button(end).clicked();
            let bar = ProgressBar::new(part).desired_width(ui.available_width()).desired_height(10.0);
            ui.add(bar).widget_info(|| WidgetInfo::labeled(WidgetType::ProgressIndicator, true, reported));
            clicked
        })
        .inner
    })
    .inner
}

/// A button that copies a text to the clipboard; `what` distinguishes it from others.
pub(crate) fn copy_ui(ui: &mut Ui, language: Language, what: &str, text: impl FnOnce() -> String) {
    let response = ui.add(small_button(ui, tr!(language, "Copy")));
    let reported = handeye_wording::text!("Copy {what}", what = what).in_language(language);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &reported));
    if response.on_hover_text(reported).clicked() {
        ui.ctx().copy_text(text());
    }
}

/// Icons of small buttons.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sign {
    /// Towards the top.
    Up,
    /// Towards the bottom.
    Down,
    /// Remove.
    Cross,
    /// Drag handle.
    Grip,
}

/// A button in a line of text, which is as large as others for touch input.
pub(crate) fn small_button<'a>(ui: &Ui, words: impl Into<egui::WidgetText>) -> Button<'a> {
    Button::new(words.into()).small().min_size(theme::least(ui, 0.0, 0.0))
}

/// A button with an icon, which has a name for screen readers.
pub(crate) fn sign_ui(ui: &mut Ui, sign: Sign, name: &str, enabled: bool) -> Response {
    let sense = if sign == Sign::Grip { Sense::drag() } else { Sense::click() };
    let button = Button::new("")
        .frame_when_inactive(false)
        .sense(sense)
        .min_size(theme::least(ui, SIGN_BUTTON, SIGN_BUTTON))
        .small();
    let response = ui.add_enabled(enabled, button);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, enabled, name));
    let palette = Palette::of(ui);
    let colour = if enabled { palette.weak } else { palette.edge };
    let centre = response.rect.center();
    let at = |x: f32, y: f32| centre + Vec2::new(x, y);
    let stroke = Stroke::new(1.5, colour);
    let painter = ui.painter();
    match sign {
        Sign::Up => {
            painter.add(Shape::line(vec![at(-4.0, 2.0), at(0.0, -2.5), at(4.0, 2.0)], stroke));
        }
        Sign::Down => {
            painter.add(Shape::line(vec![at(-4.0, -2.0), at(0.0, 2.5), at(4.0, -2.0)], stroke));
        }
        Sign::Cross => {
            painter.line_segment([at(-3.5, -3.5), at(3.5, 3.5)], stroke);
            painter.line_segment([at(-3.5, 3.5), at(3.5, -3.5)], stroke);
        }
        Sign::Grip => {
            for x in [-2.5, 2.5] {
                for y in [-5.0, 0.0, 5.0] {
                    painter.circle_filled(at(x, y), 1.2, colour);
                }
            }
        }
    }
    response.on_hover_text(name)
}

/// What a pane remembers between frames, for its own use only.
pub fn remembered<T: 'static + Clone + Default + Send + Sync>(ui: &Ui, id: Id) -> T {
    ui.data(|data| data.get_temp(id)).unwrap_or_default()
}

pub(crate) fn remember<T: 'static + Clone + Send + Sync>(ui: &Ui, id: Id, value: T) {
    ui.data_mut(|data| data.insert_temp(id, value));
}
