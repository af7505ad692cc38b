//! What the estimate decided and found in addition to the answer.

use egui::Ui;

use crate::style::parts;
use handeye_workbench::model::{self, Model, Solved};
use handeye_workbench::tr;

/// One line each; nothing for what is as usual.
pub fn estimate_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let lines = model::estimated(&solved.calibration, solved.depth.as_ref());
    if lines.is_empty() {
        return;
    }
    parts::section_ui(ui, tr!(language, "What the estimate found out"));
    for line in lines {
        parts::stated_ui(ui, &line.what.in_language(language), &line.value.in_language(language))
            .on_hover_text(line.meaning.in_language(language));
        if let Some(why) = line.why {
            parts::caption_ui(ui, &why.in_language(language));
        }
    }
}
