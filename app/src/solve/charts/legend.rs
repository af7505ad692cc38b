//! What the colours of captures mean.

use egui::{RichText, Sense, Ui, Vec2};

use crate::capture::rows::CaptureRow;
use crate::gui::style::marks::{self, Marks};
use crate::gui::style::theme::{CAPTION, Palette};
use crate::text::Language;
use crate::tr;

/// Side of the square of a colour.
const SQUARE: f32 = 9.0;

/// A square and a word for each kind of capture that there is.
pub fn legend_ui(ui: &mut Ui, rows: &[CaptureRow], language: Language) {
    let (palette, colours) = (Palette::of(ui), Marks::of(ui));
    let of = |excluded, verifies| marks::of_capture(colours, excluded, verifies);
    let kinds: [(fn(&CaptureRow) -> bool, _, _); 4] = [
        (|row| !row.excluded && !row.verifies() && !row.is_aside(), of(false, false), tr!(language, "in the fit")),
        (CaptureRow::is_aside, palette.warning, tr!(language, "outlier")),
        (|row| !row.excluded && row.verifies(), of(false, true), tr!(language, "for verification")),
        (|row| row.excluded, of(true, false), tr!(language, "excluded")),
    ];
    ui.spacing_mut().item_spacing.x = 5.0;
    for (is_kind, colour, name) in kinds {
        if rows.iter().any(is_kind) {
            let (square, _) = ui.allocate_exact_size(Vec2::splat(SQUARE), Sense::hover());
            ui.painter().rect_filled(square, 2.0, colour);
            ui.label(RichText::new(name).size(CAPTION).color(palette.weak));
            ui.add_space(5.0);
        }
    }
}
