//! What the colours of captures mean.

use egui::{RichText, Sense, Ui, Vec2};

use crate::capture::rows::CaptureTable;
use crate::style::marks::Marks;
use crate::style::theme::{CAPTION, Palette};
use handeye_workbench::scene::CaptureUse;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Side of the square of a colour.
const SQUARE: f32 = 9.0;

/// A square and a word for each kind of capture that there is.
pub fn legend_ui(ui: &mut Ui, table: &CaptureTable, language: Language) {
    let (palette, marks) = (Palette::of(ui), Marks::of(ui));
    ui.spacing_mut().item_spacing.x = 5.0;
    for (used_as, colour, name) in [
        (CaptureUse::Fit, marks.fit, tr!(language, "in the fit")),
        (CaptureUse::Rejected, palette.warning, tr!(language, "outlier")),
        (CaptureUse::Verification, marks.verify, tr!(language, "for verification")),
        (CaptureUse::Excluded, marks.excluded, tr!(language, "excluded")),
    ] {
        if table.count(used_as) > 0 {
            let (square, _) = ui.allocate_exact_size(Vec2::splat(SQUARE), Sense::hover());
            ui.painter().rect_filled(square, 2.0, colour);
            ui.label(RichText::new(name).size(CAPTION).color(palette.weak));
            ui.add_space(5.0);
        }
    }
}
