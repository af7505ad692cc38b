//! The table: heads, the rows that can be seen, selection by pointer and keys.

use egui::{EventFilter, Id, Key, Modifiers, Rect, ScrollArea, Sense, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_session::{CaptureId, Role};

use super::columns::{self, HEAD, Sort};
use super::flags::Circumstances;
use super::row::row_ui;
use super::selecting;
use crate::capture::rows::{CaptureRow, CaptureTable};
use crate::live::textures::Thumbnails;
use crate::style::theme::Palette;
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::{CapturePurpose, Model, RefusalKind};
use handeye_workbench::tr;
use handeye_workbench::{motion, session};

/// What the table remembers from one frame to the next: how it is viewed.
#[derive(Debug, Clone, Copy, Default)]
struct Look {
    sort: Sort,
    /// Where a range that is selected with Shift begins.
    anchor: Option<CaptureId>,
    /// The row that was last brought into view.
    in_view: Option<CaptureId>,
}

/// Heads, and rows of a height.
pub fn table_ui(
    ui: &mut Ui,
    model: &Model,
    table: &CaptureTable,
    height: f32,
    thumbnails: &mut Thumbnails,
    outbox: &mut Outbox,
) {
    let key = Id::new("look of the table of captures");
    let mut look: Look = ui.data(|data| data.get_temp(key)).unwrap_or_default();
    // The scroll bar of the rows leaves no room for the last column.
    let width = ui.available_width() - ui.spacing().scroll.allocated_width();
    ui.spacing_mut().item_spacing = Vec2::ZERO;
    let (heads, _) = ui.allocate_exact_size(Vec2::new(width, HEAD), Sense::hover());
    look.sort = columns::heads_ui(ui, heads, look.sort, model.view.language);
    let order = columns::sorted(&table.rows, look.sort);
    let ids: Vec<CaptureId> = order.iter().map(|&index| table.rows[index].id).collect();
    keys_ui(ui, model, &ids, &mut look, outbox);
    ScrollArea::vertical().id_salt("rows").auto_shrink(false).show_viewport(ui, |ui, viewport| {
        ui.set_height(height * order.len() as f32);
        let top = ui.max_rect().top();
        let left = ui.max_rect().left();
        let place = |at: usize| {
            let min = egui::pos2(left, top + height * at as f32);
            Rect::from_min_size(min, Vec2::new(width, height))
        };
        bring_into_view(ui, model, &ids, &mut look, place);
        let first = (viewport.top() / height).floor().max(0.0) as usize;
        let last = ((viewport.bottom() / height).ceil().max(0.0) as usize).min(order.len());
        for (at, &index) in order.iter().enumerate().take(last).skip(first) {
            let row = &table.rows[index];
            let circumstances =
                Circumstances { outlier_line_px: model.outlier_line_px, refused_here: refused_here(model, row.id) };
            let response = row_ui(ui, model, row, place(at), circumstances, thumbnails, outbox);
            if response.clicked() {
                let modifiers = ui.input(|input| input.modifiers);
                select(model, &ids, row.id, modifiers, &mut look, outbox);
                ui.memory_mut(|memory| memory.request_focus(focus_id()));
            }
            response.context_menu(|ui| menu_ui(ui, model, table, row, outbox));
        }
    });
    ui.data_mut(|data| data.insert_temp(key, look));
}

/// The table as a whole has the focus of the keyboard.
fn focus_id() -> Id {
    Id::new("table of captures has the keys")
}

fn select(
    model: &Model,
    order: &[CaptureId],
    id: CaptureId,
    modifiers: Modifiers,
    look: &mut Look,
    outbox: &mut Outbox,
) {
    let anchor = look.anchor.or(model.selection.last().copied());
    let next = selecting::clicked(order, &model.selection, anchor, id, modifiers);
    if !modifiers.shift || look.anchor.is_none() {
        look.anchor = if modifiers.shift { anchor } else { Some(id) };
    }
    look.in_view = Some(id);
    if next != model.selection {
        outbox.send(session::Command::Select(next));
    }
}

/// Arrows, Delete and Ctrl+A, while the table has the keys.
fn keys_ui(ui: &Ui, model: &Model, order: &[CaptureId], look: &mut Look, outbox: &mut Outbox) {
    let id = focus_id();
    let focus = ui.interact(ui.available_rect_before_wrap(), id, Sense::focusable_noninteractive());
    focus.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, tr!(model.view.language, "Captures")));
    if !focus.has_focus() {
        return;
    }
    let filter = EventFilter { vertical_arrows: true, ..EventFilter::default() };
    ui.memory_mut(|memory| memory.set_focus_lock_filter(id, filter));
    let frame = ui.available_rect_before_wrap();
    ui.painter().hline(frame.x_range(), frame.top() - 0.5, egui::Stroke::new(1.5, Palette::of(ui).accent));
    let pressed = |modifiers, key| ui.input_mut(|input| input.consume_key(modifiers, key));
    for (key, down) in [(Key::ArrowDown, true), (Key::ArrowUp, false)] {
        for modifiers in [Modifiers::SHIFT, Modifiers::NONE] {
            if pressed(modifiers, key)
                && let Some(next) = selecting::neighbour(order, model.selection.last().copied(), down)
            {
                select(model, order, next, modifiers, look, outbox);
                // Keys select rows that may be out of view.
                look.in_view = None;
            }
        }
    }
    if pressed(Modifiers::COMMAND, Key::A) {
        outbox.send(session::Command::Select(order.to_vec()));
    }
    if !model.selection.is_empty() && pressed(Modifiers::NONE, Key::Delete) {
        outbox.send(session::Command::Delete(model.selection.clone()));
    }
}

/// Moves the rows when another capture is shown: by keys, or by a click in a chart.
fn bring_into_view(ui: &Ui, model: &Model, order: &[CaptureId], look: &mut Look, place: impl Fn(usize) -> Rect) {
    let current = model.selection.last().copied();
    if current == look.in_view {
        return;
    }
    look.in_view = current;
    if let Some(at) = current.and_then(|id| order.iter().position(|&other| other == id)) {
        ui.scroll_to_rect(place(at), None);
    }
}

/// Whether the last capture was refused because the robot is where this one was taken. It may have moved since.
fn refused_here(model: &Model, id: CaptureId) -> bool {
    let too_similar = model.refused.as_ref().is_some_and(|refused| refused.kind == RefusalKind::TooSimilar);
    let (true, Some(robot), Some(record)) = (too_similar, &model.robot, model.document().capture(id)) else {
        return false;
    };
    let Some(taken_at) = &record.base_from_tip else { return false };
    let (distance_m, angle_rad) = robot.base_from_tip.distance_to(taken_at);
    let options = model.view.capture;
    distance_m < options.least_distance_m && angle_rad < options.least_angle_rad
}

/// What can be done with a capture, or with all selected ones when it is among them.
fn menu_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, row: &CaptureRow, outbox: &mut Outbox) {
    let language = model.view.language;
    let ids = if model.selection.contains(&row.id) { model.selection.clone() } else { vec![row.id] };
    let mut item = |ui: &mut Ui, words: &str, command: Command| {
        if ui.button(words).clicked() {
            outbox.send(command);
            ui.close();
        }
    };
    if model.document().mode().is_some() {
        item(ui, tr!(language, "Go there again"), motion::Command::GoToCapture(row.id).into());
        ui.separator();
    }
    let every = |is: fn(&CaptureRow) -> bool| ids.iter().filter_map(|&id| table.row(id)).all(is);
    if every(|row| row.excluded) {
        item(ui, tr!(language, "Include"), session::Command::SetExcluded { ids: ids.clone(), excluded: false }.into());
    } else {
        item(ui, tr!(language, "Exclude"), session::Command::SetExcluded { ids: ids.clone(), excluded: true }.into());
    }
    if every(|row| row.role == Role::Verification) {
        let command = session::Command::SetPurpose { ids: ids.clone(), purpose: CapturePurpose::Calibrate }.into();
        item(ui, tr!(language, "Use for the fit"), command);
    } else if model.document().mode().is_some() {
        let command = session::Command::SetPurpose { ids: ids.clone(), purpose: CapturePurpose::Verify }.into();
        item(ui, tr!(language, "Use for verification"), command);
    }
    ui.separator();
    item(ui, tr!(language, "Delete"), session::Command::Delete(ids.clone()).into());
}
