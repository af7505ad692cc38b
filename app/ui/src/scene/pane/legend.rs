//! What the lines of the 3D pane mean.

use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo, WidgetType};

use crate::style::theme::{CAPTION, Palette};

/// Height of a line.
const ROW: f32 = 17.0;
/// Length of a sign.
const SIGN: f32 = 16.0;
/// Distance to the edge of the pane.
const INSET: f32 = 10.0;

/// How something is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    Line,
    /// A line of dashes.
    Dashes,
    /// A pyramid.
    Frustum,
    /// A sheet with squares.
    Board,
    /// Crossing lines.
    Grid,
}

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// How it is drawn.
    pub sign: Sign,
    pub colour: Color32,
    pub name: String,
    /// The same at length, with units.
    pub what: String,
}

/// The legend at the lower left of a room; nothing if the room is too small for it.
pub fn legend_ui(ui: &mut Ui, room: Rect, entries: &[Entry]) {
    let height = ROW * entries.len() as f32;
    if room.height() < height + 90.0 || room.width() < 240.0 {
        return;
    }
    let palette = Palette::of(ui);
    let mut top = room.bottom() - INSET - height;
    for entry in entries {
        let middle = top + ROW / 2.0;
        let sign = Rect::from_center_size(Pos2::new(room.left() + INSET + SIGN / 2.0, middle), Vec2::new(SIGN, 10.0));
        draw(ui, entry.sign, sign, entry.colour);
        let galley = ui.painter().layout_no_wrap(entry.name.clone(), FontId::proportional(CAPTION), palette.weak);
        let at = Pos2::new(sign.right() + 7.0, middle);
        let words = Align2::LEFT_CENTER.anchor_size(at, galley.size());
        ui.painter().galley(words.min, galley, palette.weak);
        let response = ui.interact(sign.union(words), ui.id().with(("legend", &entry.name)), Sense::HOVER);
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, &entry.name));
        response.on_hover_text(&entry.what);
        top += ROW;
    }
}

fn draw(ui: &Ui, sign: Sign, rect: Rect, colour: Color32) {
    let painter = ui.painter();
    let (left, right) = (rect.left_center(), rect.right_center());
    let stroke = Stroke::new(1.8, colour);
    match sign {
        Sign::Line => {
            painter.line_segment([left, right], stroke);
        }
        Sign::Dashes => {
            painter.extend(Shape::dashed_line(&[left, right], stroke, 4.0, 2.5));
        }
        Sign::Frustum => {
            let apex = left + Vec2::new(2.0, 0.0);
            let (above, below) = (rect.right_top() - Vec2::new(3.0, 0.0), rect.right_bottom() - Vec2::new(3.0, 0.0));
            let outline = vec![apex, above, below];
            painter.add(Shape::convex_polygon(outline, colour.gamma_multiply(0.2), Stroke::new(1.3, colour)));
        }
        Sign::Board => {
            let palette = Palette::of(ui);
            let sheet = Rect::from_center_size(rect.center(), Vec2::new(12.0, 8.0));
            painter.rect_filled(sheet, 0.0, palette.paper);
            for column in 0..3 {
                for row in 0..2 {
                    if (column + row) % 2 == 0 {
                        let min = sheet.min + Vec2::new(4.0 * column as f32, 4.0 * row as f32);
                        painter.rect_filled(Rect::from_min_size(min, Vec2::splat(4.0)), 0.0, palette.ink);
                    }
                }
            }
            painter.rect_stroke(sheet, 0.0, Stroke::new(1.0, colour), egui::StrokeKind::Outside);
        }
        Sign::Grid => {
            let faint = Stroke::new(1.0, colour);
            for part in [0.25, 0.75] {
                painter.hline(rect.x_range(), rect.top() + part * rect.height(), faint);
                painter.vline(rect.left() + part * rect.width(), rect.y_range(), faint);
            }
        }
    }
}
