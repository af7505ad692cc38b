//! The images, colour and depth: live, or recorded with a capture.

mod feedback;
mod overlays;
mod readout;
mod shown;
mod toolbar;
pub(crate) mod view;

pub use shown::Shown;

use egui::{Align, CornerRadius, Layout, Pos2, Rect, Ui, UiBuilder, Vec2};
use handeye_session::CaptureId;

use super::colour_bar;
use crate::live::textures::LiveTextures;
use crate::status;
use crate::style::empty;
use crate::style::marks;
use crate::style::theme::Palette;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{ImagePoint, Model};
use handeye_workbench::tr;

/// Room above and below the controls of the line at the top \[points\].
const HEADER_MARGIN: f32 = 4.0;
/// Height of what is under an image, the same for both so that they stay of one size.
const FOOTER: f32 = 46.0;
/// Distance of text to the edge of a pane.
const INSET: f32 = 10.0;

/// The colour image with everything drawn over it. Returns the pixel under the pointer: at most one of both images has
/// one, and the caller that draws both passes it to the model with `live::Command::PointAt`.
pub fn colour_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) -> Option<ImagePoint> {
    let language = model.view.language;
    let shown = match content(model, textures) {
        Content::Images(shown) => shown,
        Content::Reading(id) => {
            feedback::reading_ui(ui, model, id, outbox);
            return None;
        }
        Content::Nothing => {
            empty::status_ui(ui, &status::before_first_image(model), language, outbox);
            return None;
        }
    };
    let image = view::Image {
        texture: textures.rgb.as_ref(),
        name: tr!(language, "Colour image"),
        model,
        shown,
        with_overlays: true,
    };
    tile_ui(
        ui,
        model,
        outbox,
        |ui, outbox| toolbar::overlays_ui(ui, model, outbox),
        |ui, outbox| image.image_ui(ui, outbox),
        |ui, _| readout::readout_ui(ui, model, &shown),
    )
}

/// The depth image. Returns the pixel of the colour image under the pointer, as [`colour_ui`] does.
pub fn depth_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) -> Option<ImagePoint> {
    let language = model.view.language;
    let Content::Images(shown) = content(model, textures) else {
        let detail = tr!(language, "It comes together with the colour image.");
        marks::nothing_yet_ui(ui, tr!(language, "No depth image yet"), detail);
        return None;
    };
    let image = view::Image {
        texture: textures.depth.as_ref(),
        name: tr!(language, "Depth image"),
        model,
        shown,
        with_overlays: false,
    };
    tile_ui(
        ui,
        model,
        outbox,
        |ui, outbox| toolbar::depth_ui(ui, model, outbox),
        |ui, outbox| image.image_ui(ui, outbox),
        |ui, _| match shown.depth_range_m {
            Some(range_m) => {
                let depth_m = model.cursor.and_then(|point| shown.depth_m(point));
                colour_bar::colour_bar_ui(ui, model.view.depth_colours, range_m, depth_m, language);
            }
            None => {
                ui.label(tr!(language, "There is no depth in this image"));
            }
        },
    )
}

enum Content<'a> {
    Images(Shown<'a>),
    /// The images of this capture are on their way from the disk.
    Reading(CaptureId),
    Nothing,
}

fn content<'a>(model: &'a Model, textures: &LiveTextures) -> Content<'a> {
    match (Shown::of(model, textures), &model.review) {
        (Some(shown), _) => Content::Images(shown),
        (None, Some(review)) => Content::Reading(review.id),
        (None, None) => Content::Nothing,
    }
}

/// A line at the top, an image, and a line at the bottom. Returns the result of the image.
fn tile_ui<R>(
    ui: &mut Ui,
    model: &Model,
    outbox: &mut Outbox,
    header_ui: impl FnOnce(&mut Ui, &mut Outbox),
    image_ui: impl FnOnce(&mut Ui, &mut Outbox) -> R,
    footer_ui: impl FnOnce(&mut Ui, &mut Outbox),
) -> R {
    let palette = Palette::of(ui);
    let rect = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(rect);
    let height = ui.spacing().interact_size.y + 2.0 * HEADER_MARGIN;
    let header = Rect::from_min_max(rect.min, Pos2::new(rect.max.x, rect.min.y + height));
    let footer = Rect::from_min_max(Pos2::new(rect.min.x, rect.max.y - FOOTER), rect.max);
    let row = |rect: Rect| {
        UiBuilder::new().max_rect(rect.shrink2(Vec2::new(INSET, 0.0))).layout(Layout::left_to_right(Align::Center))
    };
    ui.scope_builder(row(header), |ui| header_ui(ui, outbox));
    let mut well = Rect::from_min_max(header.left_bottom(), footer.right_top());
    if let Some(review) = &model.review {
        let strip = Rect::from_min_size(well.min, Vec2::new(well.width(), feedback::STRIP));
        ui.scope_builder(UiBuilder::new().max_rect(strip).id_salt("review"), |ui| {
            feedback::review_ui(ui, model, review.id, outbox);
        });
        well.min.y = strip.max.y;
    }
    ui.painter().rect_filled(well, CornerRadius::ZERO, palette.well);
    let result = ui.scope_builder(UiBuilder::new().max_rect(well), |ui| image_ui(ui, outbox)).inner;
    ui.scope_builder(row(footer), |ui| footer_ui(ui, outbox));
    result
}

#[cfg(test)]
mod tests;
