//! Jogging along and about the axes of a frame, with buttons and keys.

use egui::{Color32, Id, Key, RichText, Stroke, Ui, WidgetInfo, WidgetType};

use super::blocked::Blocked;
use super::hold::{self, Hold};
use super::settings::frame_name;
use crate::style::parts;
use crate::style::theme::{self, Palette};
use handeye_wording::text;
use handeye_workbench::model::{Axis, Jog, JogFrame, Model};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// The two keys of every axis, backward and forward. With Shift they turn.
const KEYS: [(Axis, Key, Key); 3] = [
    (Axis::X, Key::ArrowLeft, Key::ArrowRight),
    (Axis::Y, Key::ArrowDown, Key::ArrowUp),
    (Axis::Z, Key::PageDown, Key::PageUp),
];

pub fn pad_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, hold: &mut Hold) {
    let language = model.view.language;
    let frame = model.view.jog.frame;
    let wide = ((ui.available_width() - 84.0) / 4.0).clamp(36.0, 76.0);
    ui.add_enabled_ui(blocked.tip.is_none(), |ui| {
        egui::Grid::new("jog pad").num_columns(6).spacing([6.0, 5.0]).min_col_width(0.0).show(ui, |ui| {
            for name in [tr!(language, "Move"), tr!(language, "Turn")] {
                ui.label("");
                parts::caption_ui(ui, name);
                ui.label("");
            }
            ui.end_row();
            for (axis, backward, forward) in KEYS {
                let colour = axis_colour(ui, axis);
                for turn in [false, true] {
                    ui.label(RichText::new(letter(axis)).strong().color(colour));
                    for (key, is_forward) in [(backward, false), (forward, true)] {
                        let jog = jog_of(frame, axis, is_forward, turn);
                        let sign = if is_forward { "+" } else { "−" };
                        let face = RichText::new(sign).strong().color(colour);
                        let button = hold::button(face)
                            .min_size(theme::least(ui, wide, 28.0))
                            .stroke(Stroke::new(1.0, colour.gamma_multiply(0.5)));
                        let name = name(axis, is_forward, turn, language);
                        let response = ui.add(button);
                        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, blocked.tip.is_none(), &name));
                        hold.button(ui, &response, jog);
                        response
                            .on_hover_text(tooltip(&name, frame, key, turn, language))
                            .on_disabled_hover_text(blocked.tip.unwrap_or_default());
                    }
                }
                ui.end_row();
            }
        });
    });
    keys_ui(ui, model, blocked, hold);
}

/// The switch for keys, and the keys.
fn keys_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, hold: &mut Hold) {
    let language = model.view.language;
    let id = Id::new("jog with keys");
    let mut on = parts::remembered::<bool>(ui, id);
    let response = ui.checkbox(&mut on, tr!(language, "Jog with keys")).on_hover_text(tr!(
        language,
        "Arrow keys move along x and y, Page Up and Page Down along z; with Shift they turn. They act while no field is \
         being edited"
    ));
    if response.changed() {
        parts::remember(ui, id, on);
    }
    let is_free = !ui.ctx().egui_wants_keyboard_input() && model.dialog.is_none();
    if !on || !is_free || blocked.tip.is_some() {
        return;
    }
    let frame = model.view.jog.frame;
    let (modifiers, down) = ui.input(|input| {
        let down = KEYS.into_iter().find_map(|(axis, backward, forward)| {
            let (backward, forward) = (input.key_down(backward), input.key_down(forward));
            // Both at once cancel each other.
            (backward != forward).then_some((axis, forward))
        });
        (input.modifiers, down)
    });
    if let Some((axis, forward)) = down.filter(|_| !modifiers.any() || modifiers.shift_only()) {
        hold.key(jog_of(frame, axis, forward, modifiers.shift));
    }
}

fn jog_of(frame: JogFrame, axis: Axis, forward: bool, turn: bool) -> Jog {
    if turn { Jog::Rotate { frame, axis, forward } } else { Jog::Translate { frame, axis, forward } }
}

fn letter(axis: Axis) -> &'static str {
    match axis {
        Axis::X => "X",
        Axis::Y => "Y",
        Axis::Z => "Z",
    }
}

/// Red, green and blue, as everywhere.
fn axis_colour(ui: &Ui, axis: Axis) -> Color32 {
    let palette = Palette::of(ui);
    match axis {
        Axis::X => palette.axis_x,
        Axis::Y => palette.axis_y,
        Axis::Z => palette.accent,
    }
}

fn name(axis: Axis, forward: bool, turn: bool, language: Language) -> String {
    let axis = format!("{}{}", if forward { "+" } else { "−" }, letter(axis));
    if turn { text!("Turn {axis}", axis = axis) } else { text!("Move {axis}", axis = axis) }.in_language(language)
}

fn tooltip(name: &str, frame: JogFrame, key: Key, turn: bool, language: Language) -> String {
    let key = match key {
        Key::ArrowLeft => "←",
        Key::ArrowRight => "→",
        Key::ArrowUp => "↑",
        Key::ArrowDown => "↓",
        Key::PageUp => "Page Up",
        _ => "Page Down",
    };
    let key = if turn { format!("Shift {key}") } else { key.to_owned() };
    let frame = frame_name(frame, language);
    text!("{name}, axes of: {frame}. Hold to move. Key: {key}", name = name, frame = frame, key = key)
        .in_language(language)
}
