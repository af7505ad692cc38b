//! All captures together.

use egui::{Label, RichText, Ui};
use handeye_estimate::verify::Verification;

use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::model::Model;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// A ratio below this would be shown as zero.
const LEAST_RATIO: f64 = 0.01;

/// Errors of prediction, and whether they are as large as stated; also with corrected tip poses, if the errors of the arm are
/// known.
pub fn summary_ui(ui: &mut Ui, model: &Model, verification: &Verification, corrected: Option<&Verification>) {
    let language = model.view.language;
    let count = verification.captures.len();
    let title = text!("Errors of prediction over {count} {count|capture|captures}, RMS", count = count);
    parts::section_ui(ui, &title.in_language(language));
    if corrected.is_some() {
        let what =
            tr!(language, "By the tip poses that the robot reports → by tip poses corrected for the errors of the arm");
        parts::hint_ui(ui, what);
    }
    let both = |shown: &dyn Fn(&Verification) -> String| {
        let corrected = corrected.map(|corrected| format!(" → {}", shown(corrected)));
        shown(verification) + &corrected.unwrap_or_default()
    };
    let mm = |metres: f64| format!("{:.3} mm", metres * 1e3);
    parts::stated_ui(ui, tr!(language, "Middle of the board"), &both(&|it| mm(it.centre_rms_m)))
        .on_hover_text(tr!(language, "Distance between the measured and the predicted middle of the board"));
    let deg = |it: &Verification| format!("{:.3}°", it.orientation_rms_rad.to_degrees());
    parts::stated_ui(ui, tr!(language, "Its orientation"), &both(&deg));
    parts::stated_ui(ui, tr!(language, "Its corners"), &both(&|it| format!("{:.3} px", it.rms_px)));
    let scatter = |it: &Verification| it.origin_scatter_m.map_or_else(|| "–".to_owned(), mm);
    parts::stated_ui(ui, tr!(language, "Scatter of its position"), &both(&scatter)).on_hover_text(tr!(
        language,
        "How much the position of the board differs from capture to capture. A board that was moved leaves it small while every prediction is wrong"
    ));
    let Some(corrected) = corrected else { return verdict_ui(ui, language, verification, false) };
    parts::hint_ui(ui, tr!(language, "Corrected:"));
    verdict_ui(ui, language, corrected, false);
    parts::hint_ui(ui, tr!(language, "As reported:"));
    verdict_ui(ui, language, verification, corrected.is_as_stated() == Some(true));
}

/// `explained` if corrected tip poses have no such errors.
fn verdict_ui(ui: &mut Ui, language: Language, verification: &Verification, explained: bool) {
    let palette = Palette::of(ui);
    let (colour, verdict) = match &verification.consistency {
        None => (palette.weak, text!("The calibration states no uncertainty to compare these errors with")),
        Some(consistency) => {
            let is_least = consistency.ratio < LEAST_RATIO;
            let ratio = if is_least { format!("<{LEAST_RATIO:.2}") } else { format!("{:.2}", consistency.ratio) };
            let limit = format!("{:.2}", consistency.limit);
            if consistency.is_consistent() {
                let text = text!(
                    "The errors are of the size that the calibration states: their mean square is {ratio} times the \
                     expected one, and at most {limit} times in 99 of 100 cases",
                    ratio = ratio,
                    limit = limit
                );
                (palette.good, text)
            } else if explained {
                let text = text!(
                    "The errors are larger than the calibration by reported tip poses states: their mean square is {ratio} times \
                     the expected one, and at most {limit} times in 99 of 100 cases. Corrected tip poses do not have them: they are \
                     those of the arm",
                    ratio = ratio,
                    limit = limit
                );
                (palette.weak, text)
            } else {
                let text = text!(
                    "The errors are larger than the calibration states: their mean square is {ratio} times the expected \
                     one, and at most {limit} times in 99 of 100 cases. The board may have been moved, or the arm is less exact here than \
                     where the calibration was made",
                    ratio = ratio,
                    limit = limit
                );
                (palette.warning, text)
            }
        }
    };
    ui.horizontal_top(|ui| {
        parts::dot_ui(ui, colour);
        ui.add(Label::new(RichText::new(verdict.in_language(language)).color(palette.text)).wrap());
    });
}
