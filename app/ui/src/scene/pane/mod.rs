//! Arm, cameras and board in three dimensions, for a look without a separate viewer.
//!
//! The pane is drawn with the painter of the window, from back to front: `eye` projects points onto the screen,
//! `canvas` sorts what is drawn, and each of the other files draws one kind of thing.

mod arm;
mod board;
mod boxes;
mod camera;
mod canvas;
mod captures;
mod content;
mod eye;
mod ground;
mod legend;
mod planned;

use egui::{
    Align, CornerRadius, FontId, Layout, PointerButton, Pos2, Rect, Response, RichText, Sense, Ui, UiBuilder, Vec2,
};
use egui::{WidgetInfo, WidgetType};
use handeye_session::CaptureId;

use crate::capture::rows as tables;
use crate::capture::rows::CaptureTable;
use crate::status::robot_age;
use crate::style::marks::{self, Marks};
use crate::style::parts;
use crate::style::theme::{self, Palette};
use canvas::Canvas;
use captures::Spot;
use eye::{Eye, Side};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::keep_out::state::with_drawn;
use handeye_workbench::model::{Model, SceneView};
use handeye_workbench::scene::fitted_view;
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{keep_out, scene, session};

/// Room above and below the controls of the line over the scene \[points\].
const HEADER_MARGIN: f32 = 4.0;
/// Distance of text to the edge of the pane.
const INSET: f32 = 10.0;
/// Zoom per point of wheel movement, as in the images.
const ZOOM_PER_POINT: f64 = 0.004;
/// A capture is pointed at this near to its middle, in points on the screen.
const GRASP: f32 = 9.0;

/// The pane.
pub fn scene_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    if content::is_empty(model) {
        let detail = tr!(language, "Arm, camera and board appear with the connection, captures with a session.");
        marks::nothing_yet_ui(ui, tr!(language, "Nothing to show in 3D yet"), detail);
        return;
    }
    let rect = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(rect);
    let height = ui.spacing().interact_size.y + 2.0 * HEADER_MARGIN;
    let header = Rect::from_min_max(rect.min, Pos2::new(rect.max.x, rect.min.y + height));
    let room = Rect::from_min_max(header.left_bottom(), rect.max);
    ui.painter().rect_filled(room, CornerRadius::ZERO, Palette::of(ui).well);
    let table = tables::table(ui.ctx(), model);
    ui.scope_builder(UiBuilder::new().max_rect(room).id_salt("scene"), |ui| {
        ui.set_clip_rect(ui.clip_rect().intersect(room));
        room_ui(ui, room, model, &table, outbox);
    });
    let row =
        UiBuilder::new().max_rect(header.shrink2(Vec2::new(INSET, 0.0))).layout(Layout::left_to_right(Align::Center));
    ui.scope_builder(row, |ui| header_ui(ui, model, outbox));
}

/// The view of everything.
fn first_view(model: &Model) -> SceneView {
    fitted_view(model).unwrap_or_default()
}

/// Views from the sides, and back to the first one.
fn header_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.spacing_mut().item_spacing.x = 4.0;
    let hint = if theme::is_for_fingers(ui) {
        tr!(language, "One finger turns, two shift and zoom")
    } else {
        tr!(language, "Drag to turn, Shift-drag to shift, wheel to zoom")
    };
    let what = tr!(language, "Show arm, camera and board whole; so does a double click");
    if ui.button(tr!(language, "Reset view")).on_hover_text(format!("{what}\n{hint}")).clicked() {
        outbox.send(scene::Command::SetView(first_view(model)));
    }
    for side in Side::ALL {
        let (name, what) = words(side, language);
        let view = side.view(model.scene);
        if ui.selectable_label(view == model.scene, name).on_hover_text(what).clicked() && view != model.scene {
            outbox.send(scene::Command::SetView(view));
        }
    }
    crate::keep_out::editor::header_ui(ui, model);
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let font = FontId::proportional(theme::CAPTION);
        let hint = ui.painter().layout_no_wrap(hint.to_owned(), font, Palette::of(ui).weak);
        // A truncated hint is not useful.
        if hint.size().x <= ui.available_width() {
            ui.add(egui::Label::new(hint));
        }
    });
}

fn words(side: Side, language: Language) -> (&'static str, &'static str) {
    match side {
        Side::Top => (tr!(language, "Top"), tr!(language, "From above: x of the base to the right, y up")),
        Side::Front => (tr!(language, "Front"), tr!(language, "Along y of the base: x to the right, z up")),
        Side::Right => (tr!(language, "Side"), tr!(language, "Against x of the base: y to the right, z up")),
    }
}

fn room_ui(ui: &mut Ui, room: Rect, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    let language = model.view.language;
    let response = ui.interact(room, ui.id().with("view"), Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, tr!(language, "The cell in 3D")));
    let key = ui.id().with("pointed at");
    let pointed: Option<CaptureId> = parts::remembered(ui, key);
    let eye = Eye::new(&model.scene, crate::keep_out::editor::room_next_to(ui, room));
    let mut canvas = Canvas::new(eye, Palette::of(ui).ink);
    let drawn = content::draw(&mut canvas, ui, model, table, pointed);
    let is_drawing = crate::keep_out::editor::is_drawing(ui);
    if is_drawing {
        draw_box(ui, &response, &mut canvas, model, outbox);
    }
    canvas.paint(ui.painter());
    legend::legend_ui(ui, room, &drawn.entries);
    if let Some(age) = robot_age(model).filter(|_| model.robot.is_some()) {
        let words = text!("Robot: {age}", age = age).in_language(language);
        let plate = marks::plate(ui.painter(), room.min + Vec2::splat(INSET), &words, Marks::over_images().review);
        let reported = ui.interact(plate, ui.id().with("age"), Sense::hover());
        reported.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, &words));
    }
    let now = spots_ui(ui, room, model, table, &drawn.spots, outbox);
    if now != pointed {
        parts::remember(ui, key, now);
    }
    if !is_drawing {
        navigate(ui, &response, room, model, outbox);
    }
    crate::keep_out::editor::editor_ui(ui, room, model, outbox);
}

/// A box over the rectangle of the ground that is dragged over.
fn draw_box(ui: &Ui, response: &Response, canvas: &mut Canvas, model: &Model, outbox: &mut Outbox) {
    let ends = ui.input(|input| Some([input.pointer.press_origin()?, input.pointer.latest_pos()?]));
    let key = ui.id().with("drawn rectangle");
    if response.dragged()
        && let Some([from, to]) = ends
        && let (Some(from), Some(to)) = (canvas.eye.on_ground(from), canvas.eye.on_ground(to))
    {
        boxes::rectangle(canvas, [from, to], Palette::of(ui));
        parts::remember(ui, key, Some([[from.x, from.y], [to.x, to.y]]));
    }
    if response.drag_stopped()
        && let Some([from, to]) = parts::remembered::<Option<[[f64; 2]; 2]>>(ui, key)
    {
        parts::remember(ui, key, None::<[[f64; 2]; 2]>);
        if let Some(content) = with_drawn(&model.keep_out.content, from, to) {
            outbox.send(keep_out::Command::Set(Box::new(content)));
            crate::keep_out::editor::set_drawing(ui, false);
        }
    }
}

/// Pointer interaction with captures; returns the one that it is over.
fn spots_ui(
    ui: &mut Ui,
    room: Rect,
    model: &Model,
    table: &CaptureTable,
    spots: &[Spot],
    outbox: &mut Outbox,
) -> Option<CaptureId> {
    let language = model.view.language;
    let mut pointed = None;
    for spot in spots.iter().filter(|spot| room.contains(spot.at)) {
        let Some(row) = table.row(spot.id) else { continue };
        let place = Rect::from_center_size(spot.at, Vec2::splat(2.0 * GRASP)).intersect(room);
        let response = ui.interact(place, ui.id().with(("capture", spot.id)), Sense::CLICK);
        let selected = model.selection.contains(&spot.id);
        let name = text!("Capture {name}", name = row.title()).in_language(language);
        response.widget_info(|| {
            let label = text!("{capture} in 3D", capture = &name).in_language(language);
            WidgetInfo::selected(WidgetType::SelectableLabel, true, selected, label)
        });
        if response.hovered() {
            pointed = Some(spot.id);
        }
        if response.clicked() {
            outbox.send(session::Command::Select(vec![spot.id]));
        }
        response.on_hover_ui_at_pointer(|ui| {
            ui.label(RichText::new(&name).strong());
            ui.label(match row.rms_px {
                Some(rms_px) => text!("residual {rms} px", rms = format!("{rms_px:.3}")).in_language(language),
                None => tr!(language, "not in a calibration yet").to_owned(),
            });
            let mm = crate::style::numbers::row((spot.taken_m.coords * 1e3).as_slice(), 1, 0);
            ui.label(text!("taken from {mm} mm in the base", mm = mm).in_language(language));
        });
    }
    pointed
}

/// Wheel, drag, two fingers and double click.
fn navigate(ui: &Ui, response: &Response, room: Rect, model: &Model, outbox: &mut Outbox) {
    let now = model.scene;
    let mut next = now;
    if ui.rect_contains_pointer(room) {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
        let factor = (f64::from(scroll) * ZOOM_PER_POINT).exp() * f64::from(pinch);
        if (factor - 1.0).abs() > 1e-4 {
            next = eye::zoomed(next, factor);
        }
    }
    let drag = response.drag_delta();
    let fingers = ui.input(egui::InputState::multi_touch).filter(|touch| room.contains(touch.center_pos));
    if let Some(fingers) = fingers {
        next = eye::panned(next, fingers.translation_delta, room);
    } else if response.dragged() && drag != Vec2::ZERO {
        let shifts = ui.input(|input| input.modifiers.shift) || !response.dragged_by(PointerButton::Primary);
        next = if shifts { eye::panned(next, drag, room) } else { eye::orbited(next, drag) };
    }
    if response.double_clicked() {
        next = first_view(model);
    }
    if next != now {
        outbox.send(scene::Command::SetView(next));
    }
}

#[cfg(test)]
mod tests;
