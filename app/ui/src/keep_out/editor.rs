//! The boxes that the arm keeps out of, next to the 3D view: drawn, typed, read and written.

use egui::{
    Align, Button, DragValue, Frame, Id, Label, Layout, Margin, Rect, RichText, ScrollArea, TextEdit, Ui, UiBuilder,
    Vec2, WidgetInfo, WidgetType,
};
use handeye_plan::surroundings::{KeepOutBox, KeepOutFile};

use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::keep_out::state::with_drawn;
use handeye_workbench::model::{Dialog, Model};
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{keep_out, shell};

/// Width of the editor.
const WIDTH: f32 = 268.0;
/// Width that its whole name takes in the header.
const NAME: f32 = 130.0;
/// Farthest place and longest edge \[mm\]: files with more are refused, too.
const FARTHEST_MM: f64 = 10_000.0;

fn open_key() -> Id {
    Id::new("keep-out boxes are open")
}

fn drawing_key() -> Id {
    Id::new("keep-out box is drawn")
}

/// Whether a drag draws a box.
pub fn is_drawing(ui: &Ui) -> bool {
    ui.data(|data| data.get_temp(drawing_key())).unwrap_or(false)
}

/// Makes a drag draw a box, or turn the view.
pub fn set_drawing(ui: &Ui, is_on: bool) {
    ui.data_mut(|data| data.insert_temp(drawing_key(), is_on));
}

/// Opens and closes the editor.
pub fn header_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let is_open = is_open(ui);
    let name = match model.keep_out.content.boxes.len() {
        _ if ui.available_width() < NAME => tr!(language, "Boxes").to_owned(),
        0 => tr!(language, "Keep-out boxes").to_owned(),
        count => text!("Keep-out boxes: {count}", count = count).in_language(language),
    };
    let what = tr!(language, "What the arm must not touch, besides what the cell says stands around it");
    let keep_out = &model.keep_out;
    let is_wrong = keep_out.fault.is_some() || keep_out.unkept.is_some() && !keep_out.content.boxes.is_empty();
    let name = if is_wrong { RichText::new(name).color(Palette::of(ui).bad) } else { RichText::new(name) };
    if ui.selectable_label(is_open, name).on_hover_text(what).clicked() {
        ui.data_mut(|data| data.insert_temp(open_key(), !is_open));
        set_drawing(ui, false);
    }
}

fn is_open(ui: &Ui) -> bool {
    ui.data(|data| data.get_temp(open_key())).unwrap_or(false)
}

/// The part of a room that the editor leaves for the cell.
pub fn room_next_to(ui: &Ui, room: Rect) -> Rect {
    let is_next_to = is_open(ui) && room.width() > 2.0 * WIDTH;
    if is_next_to { Rect::from_min_max(room.min, room.max - Vec2::new(WIDTH, 0.0)) } else { room }
}

/// The editor at the right of the view, where it is open.
pub fn editor_ui(ui: &mut Ui, room: Rect, model: &Model, outbox: &mut Outbox) {
    if !is_open(ui) {
        return;
    }
    let width = WIDTH.min(room.width() - 20.0);
    let place = Rect::from_min_size(
        room.right_top() + Vec2::new(-width - 10.0, 10.0),
        Vec2::new(width, (room.height() - 20.0).max(40.0)),
    );
    ui.scope_builder(UiBuilder::new().max_rect(place).id_salt("keep-out boxes"), |ui| {
        Frame::popup(ui.style()).inner_margin(Margin::same(10)).show(ui, |ui| {
            ui.set_width(width - 22.0);
            ui.spacing_mut().item_spacing.y = 6.0;
            buttons_ui(ui, model, outbox);
            ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| boxes_ui(ui, model, outbox));
        });
    });
}

fn buttons_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let is_on = is_drawing(ui);
    ui.horizontal_wrapped(|ui| {
        if ui.selectable_label(is_on, tr!(language, "Draw a box")).clicked() {
            set_drawing(ui, !is_on);
        }
        if ui.button(tr!(language, "Add a box")).clicked() {
            let in_front = with_drawn(&model.keep_out.content, [0.4, -0.1], [0.6, 0.1]);
            outbox.send(keep_out::Command::Set(Box::new(in_front.expect("a rectangle"))));
        }
        if ui.button(tr!(language, "Read…")).clicked() {
            outbox.send(shell::Command::SetDialog(Some(Dialog::ImportKeepOut)));
        }
        let is_whole = model.keep_out.fault.is_none() && model.keep_out.content != KeepOutFile::default();
        if ui.add_enabled(is_whole, Button::new(tr!(language, "Write…"))).clicked() {
            outbox.send(shell::Command::SetDialog(Some(Dialog::ExportKeepOut)));
        }
    });
    let hint = if is_on {
        tr!(language, "Drag over the ground from one corner to the opposite one")
    } else {
        tr!(language, "Millimetres in the base. The arm keeps out of them from its next motion on.")
    };
    parts::hint_ui(ui, hint);
    let keep_out = &model.keep_out;
    for why in [&keep_out.fault, &keep_out.unkept, &keep_out.unsaved].into_iter().flatten() {
        let colour = Palette::of(ui).bad;
        ui.add(Label::new(RichText::new(why.in_language(language)).color(colour)).wrap());
    }
}

fn boxes_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let mut content = model.keep_out.content.clone();
    let mut gone = None;
    for (index, entry) in content.boxes.iter_mut().enumerate() {
        ui.push_id(index, |ui| {
            ui.separator();
            if box_ui(ui, entry, index + 1, language) {
                gone = Some(index);
            }
        });
    }
    if let Some(index) = gone {
        content.boxes.remove(index);
    }
    if content.volume.is_some() || content.limits.is_some() {
        ui.separator();
        parts::hint_ui(ui, tr!(language, "The file has a work volume or limits of speed, too; they are kept to."));
    }
    if content != model.keep_out.content {
        outbox.send(keep_out::Command::Set(Box::new(content)));
    }
}

/// One box; whether to remove it.
fn box_ui(ui: &mut Ui, entry: &mut KeepOutBox, number: usize, language: Language) -> bool {
    let mut goes = false;
    ui.horizontal(|ui| {
        let name = ui.add(TextEdit::singleline(&mut entry.name).char_limit(80).desired_width(130.0));
        let label = text!("Name of box {number}", number = number).in_language(language);
        name.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, &label));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let what = text!("Delete box {number}", number = number).in_language(language);
            let delete = ui.button(tr!(language, "Delete"));
            delete.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &what));
            goes = delete.clicked();
        });
    });
    millimetres_ui(ui, tr!(language, "Middle"), &mut entry.centre_m, -FARTHEST_MM, number, language);
    millimetres_ui(ui, tr!(language, "Edges"), &mut entry.size_m, 1.0, number, language);
    caption_ui(ui, tr!(language, "Yaw"), |ui| {
        if entry.rotation_xyzw.is_some() {
            ui.label(tr!(language, "as in the file"));
            return;
        }
        let mut yaw_deg = entry.yaw_deg.unwrap_or(0.0);
        let drag = ui.add(
            // A value in a file that is out of range stays as it is until the user changes it.
            DragValue::new(&mut yaw_deg)
                .range(-180.0..=180.0)
                .clamp_existing_to_range(false)
                .speed(1.0)
                .suffix("°")
                .max_decimals(1),
        );
        let label = text!("Yaw of box {number}", number = number).in_language(language);
        drag.widget_info(|| WidgetInfo { label: Some(label.clone()), ..WidgetInfo::drag_value(true, yaw_deg) });
        if drag.changed() {
            entry.yaw_deg = (yaw_deg != 0.0).then_some(yaw_deg);
        }
    });
    goes
}

fn caption_ui(ui: &mut Ui, caption: &str, content_ui: impl FnOnce(&mut Ui)) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let weak = Palette::of(ui).weak;
        let height = ui.spacing().interact_size.y;
        ui.allocate_ui_with_layout(Vec2::new(52.0, height), Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(52.0);
            ui.add(Label::new(RichText::new(caption).color(weak)).truncate());
        });
        content_ui(ui);
    });
}

/// Three lengths in millimetres, no shorter than `least_mm`.
fn millimetres_ui(ui: &mut Ui, caption: &str, metres: &mut [f64; 3], least_mm: f64, number: usize, language: Language) {
    caption_ui(ui, caption, |ui| {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(metres) {
            let mut mm = *value * 1e3;
            let drag = DragValue::new(&mut mm)
                .range(least_mm..=FARTHEST_MM)
                .clamp_existing_to_range(false)
                .speed(2.0)
                .max_decimals(0);
            let drag = ui.add_sized([54.0, ui.spacing().interact_size.y], drag);
            let label = text!("{what} of box {number} along {axis}, mm", what = caption, number = number, axis = axis)
                .in_language(language);
            drag.widget_info(|| WidgetInfo { label: Some(label.clone()), ..WidgetInfo::drag_value(true, mm) });
            let drag = drag.on_hover_text(&label);
            // A fraction of a millimetre in a file, or a value out of range, stays as it is until the user changes it.
            if drag.changed() {
                *value = mm * 1e-3;
            }
        }
    });
}
