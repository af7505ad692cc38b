//! Colours of what is drawn over images and in charts: the same thing has the same colour in both.

use egui::text::LayoutJob;
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, Ui, Vec2};

use super::theme::Palette;
use handeye_geometry::depth::ColourMap;

/// Colours with a meaning of their own, in addition to the [`Palette`].
#[derive(Debug, Clone, Copy)]
pub struct Marks {
    /// Captures that enter the fit.
    pub fit: Color32,
    /// Captures that verify it.
    pub verify: Color32,
    /// Captures that the user excluded.
    pub excluded: Color32,
    /// The board where the calibration predicts it.
    pub predicted: Color32,
    /// The board at a pose that the arm moves to next.
    pub planned: Color32,
    pub residual: Color32,
    /// What is drawn of a recorded image, to distinguish it from the live one.
    pub review: Color32,
    /// Text on `review`.
    pub on_review: Color32,
    /// Text on the accent of the palette.
    pub on_accent: Color32,
    /// The axes x, y and z.
    pub axes: [Color32; 3],
    /// A point that was picked.
    pub picked: Color32,
    /// Where something is according to a simulated cell.
    pub truth: Color32,
}

const DARK: Marks = Marks {
    fit: Color32::from_rgb(92, 159, 255),
    verify: Color32::from_rgb(190, 140, 255),
    excluded: Color32::from_rgb(120, 126, 138),
    review: Color32::from_rgb(240, 176, 64),
    on_review: Color32::from_rgb(30, 22, 6),
    on_accent: Color32::from_rgb(10, 22, 40),
    truth: Color32::from_rgb(255, 124, 192),
    ..OVER_IMAGES
};

const LIGHT: Marks = Marks {
    fit: Color32::from_rgb(38, 116, 224),
    verify: Color32::from_rgb(132, 72, 208),
    excluded: Color32::from_rgb(150, 156, 168),
    review: Color32::from_rgb(180, 106, 0),
    on_review: Color32::from_rgb(255, 255, 255),
    on_accent: Color32::from_rgb(255, 255, 255),
    predicted: Color32::from_rgb(0, 140, 170),
    axes: [Color32::from_rgb(208, 44, 44), Color32::from_rgb(24, 138, 74), Color32::from_rgb(36, 96, 220)],
    truth: Color32::from_rgb(190, 24, 120),
    ..OVER_IMAGES
};

/// Images look the same in both themes.
const OVER_IMAGES: Marks = Marks {
    fit: Color32::from_rgb(92, 159, 255),
    verify: Color32::from_rgb(190, 140, 255),
    excluded: Color32::from_rgb(160, 166, 178),
    predicted: Color32::from_rgb(64, 224, 255),
    planned: Color32::from_rgb(255, 255, 255),
    residual: Color32::from_rgb(255, 214, 64),
    review: Color32::from_rgb(240, 176, 64),
    on_review: Color32::from_rgb(30, 22, 6),
    on_accent: Color32::from_rgb(10, 22, 40),
    axes: [Color32::from_rgb(255, 82, 82), Color32::from_rgb(82, 214, 112), Color32::from_rgb(88, 148, 255)],
    picked: Color32::from_rgb(255, 92, 200),
    truth: Color32::from_rgb(255, 124, 192),
};

impl Marks {
    /// The colours on the surfaces of the theme that `ui` is drawn in.
    pub fn of(ui: &Ui) -> &'static Self {
        if ui.visuals().dark_mode { &DARK } else { &LIGHT }
    }

    /// The colours over images.
    pub fn over_images() -> &'static Self {
        &OVER_IMAGES
    }
}

/// Draws a line over an image that is visible on any background: a dark line under the coloured one.
pub fn outlined_line(painter: &Painter, points: &[Pos2], width: f32, colour: Color32) {
    if points.len() < 2 {
        return;
    }
    let under = Color32::from_black_alpha((f32::from(colour.a()) * 0.55) as u8);
    painter.line(points.to_vec(), Stroke::new(width + 1.6, under));
    painter.line(points.to_vec(), Stroke::new(width, colour));
}

/// The colour of a row of a board: a rainbow from the first to the last, as OpenCV draws boards.
pub fn of_board_row(row: usize, rows: usize) -> Color32 {
    // The dark ends of the map cannot be seen on an image.
    let part = 0.12 + 0.76 * row as f64 / rows.saturating_sub(1).max(1) as f64;
    super::theme::pixel(ColourMap::Turbo.colour(part))
}

/// A few words on a dark plate, readable over any image; returns where it is.
pub fn plate(painter: &Painter, at: Pos2, words: &str, colour: Color32) -> Rect {
    plate_at(painter, (Align2::LEFT_TOP, at), words, super::theme::CAPTION, colour)
}

/// The same with a font size, and with a chosen corner at the point. The whole text is inside the painter's clip rectangle:
/// wrapped if too long, and shifted if it would cross the edge.
pub fn plate_at(painter: &Painter, (corner, at): (Align2, Pos2), words: &str, size: f32, colour: Color32) -> Rect {
    const INSET: Vec2 = Vec2::new(6.0, 3.0);
    /// Distance to the edge.
    const EDGE: f32 = 4.0;
    let room = painter.clip_rect().shrink(EDGE);
    let mut job = LayoutJob::simple(
        words.to_owned(),
        FontId::proportional(size),
        colour,
        (room.width() - 2.0 * INSET.x).max(40.0),
    );
    job.halign = corner.x();
    let galley = painter.layout_job(job);
    let mut rect = corner.anchor_size(at, galley.size() + 2.0 * INSET);
    // A label of something out of view stays out of view.
    if room.contains(at) {
        let over = (rect.max - room.max).max(Vec2::ZERO) - (room.min - rect.min).max(Vec2::ZERO);
        rect = rect.translate(-over);
    }
    painter.rect_filled(rect, 4.0, Color32::from_black_alpha(170));
    // Lines that are centred are about the middle.
    painter.galley(rect.min + INSET - galley.rect.min.to_vec2(), galley, colour);
    rect
}

/// The colour of a capture by its purpose.
pub fn of_capture(marks: &Marks, excluded: bool, verifies: bool) -> Color32 {
    match (excluded, verifies) {
        (true, _) => marks.excluded,
        (false, true) => marks.verify,
        (false, false) => marks.fit,
    }
}

/// Where there is nothing: oblique lines in a rectangle.
pub fn hatch(painter: &Painter, rect: Rect, colour: Color32) {
    const STEP: f32 = 7.0;
    let painter = painter.with_clip_rect(rect.intersect(painter.clip_rect()));
    let mut x = rect.left() - rect.height();
    while x < rect.right() {
        let line = [Pos2::new(x, rect.bottom()), Pos2::new(x + rect.height(), rect.top())];
        painter.line_segment(line, Stroke::new(1.0, colour));
        x += STEP;
    }
}

/// A title and what to do, in the middle of a pane that has nothing to show.
pub fn nothing_yet_ui(ui: &mut Ui, title: &str, detail: &str) {
    nothing_yet_but_ui(ui, title, detail, 60.0, |_| ());
}

/// The same, with what else can be done below it; `height` is the approximate height of all of it.
pub fn nothing_yet_but_ui(ui: &mut Ui, title: &str, detail: &str, height: f32, more_ui: impl FnOnce(&mut Ui)) {
    const TEXT_WIDTH: f32 = 440.0;
    let palette = Palette::of(ui);
    let size = ui.available_size();
    ui.allocate_ui_with_layout(size, egui::Layout::top_down(egui::Align::Center), |ui| {
        ui.set_min_size(size);
        ui.add_space(((size.y - height) * 0.42).max(0.0));
        ui.scope(|ui| {
            ui.set_max_width(TEXT_WIDTH.min(size.x - 24.0).max(0.0));
            ui.label(egui::RichText::new(title).size(15.0).color(palette.text));
            ui.add_space(4.0);
            let detail = egui::RichText::new(detail).color(palette.weak);
            ui.add(egui::Label::new(detail).wrap().halign(egui::Align::Center));
            more_ui(ui);
        });
    });
}
