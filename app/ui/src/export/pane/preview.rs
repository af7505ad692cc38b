//! The text of a format as it would be written.

use egui::{FontId, Id, RichText, ScrollArea, TextEdit, Ui, WidgetInfo, WidgetType};

use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::model::{Model, PreviewFile};
use handeye_workbench::tr;

/// Texts higher than this scroll.
const MOST_HEIGHT: f32 = 260.0;

/// All files of a format. What was not there a frame ago is brought into view.
pub fn preview_ui(ui: &mut Ui, model: &Model, format: &str) {
    let language = model.view.language;
    let preview = ui.scope(|ui| match model.export.previews.get(format) {
        None => parts::hint_ui(ui, tr!(language, "It is being prepared…")),
        // The row above shows why there is none.
        Some(Err(_)) => {}
        Some(Ok(files)) => files.iter().for_each(|file| file_ui(ui, model, file)),
    });
    let key = Id::new("export that is in view");
    let in_view: String = parts::remembered(ui, key);
    if in_view != format {
        preview.response.scroll_to_me(None);
        parts::remember(ui, key, format.to_owned());
    }
}

fn file_ui(ui: &mut Ui, model: &Model, file: &PreviewFile) {
    let language = model.view.language;
    ui.horizontal(|ui| {
        ui.label(RichText::new(&file.name).strong().color(Palette::of(ui).text));
        parts::copy_ui(ui, language, &file.name, || file.text.clone());
    });
    ScrollArea::both()
        .id_salt(("preview", &file.name))
        .max_height(MOST_HEIGHT)
        // Also at the lower edge of the pane.
        .min_scrolled_height(MOST_HEIGHT)
        .show(ui, |ui| {
            // A field that cannot be changed, so that parts of it can be selected and copied.
            let mut text = file.text.as_str();
            let field = TextEdit::multiline(&mut text)
                .font(FontId::monospace(12.0))
                .desired_width(f32::INFINITY)
                .desired_rows(4);
            let response = ui.add(field);
            let reported = text!("Text of {file}", file = &file.name).in_language(language);
            response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, &reported));
        });
}
