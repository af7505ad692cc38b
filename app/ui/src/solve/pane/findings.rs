//! What is weak, the evidence, and what to do next.

use egui::{Label, RichText, Ui};
use handeye_estimate::diagnose::findings::{Finding, Severity};

use super::evidence;
use crate::style::parts;
use crate::style::theme::Palette;
use handeye_workbench::model::{Model, Solved};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// The list, the most severe first.
pub fn findings_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Findings"));
    if solved.findings.is_empty() {
        parts::hint_ui(ui, tr!(language, "Nothing stands out."));
    }
    for finding in &solved.findings {
        finding_ui(ui, finding, language);
    }
}

fn finding_ui(ui: &mut Ui, finding: &Finding, language: Language) {
    let palette = Palette::of(ui);
    let (colour, severity) = match finding.severity {
        Severity::Info => (palette.weak, tr!(language, "Good to know")),
        Severity::Advice => (palette.accent, tr!(language, "Advice")),
        Severity::Warning => (palette.warning, tr!(language, "Warning")),
        Severity::Problem => (palette.bad, tr!(language, "Problem")),
    };
    ui.horizontal_top(|ui| {
        parts::dot_ui(ui, colour);
        ui.vertical(|ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            ui.label(RichText::new(severity).small().color(colour));
            let reported = finding.text.in_language(language);
            ui.add(Label::new(RichText::new(reported).color(palette.text)).wrap());
            let numbers = evidence::line(finding, language);
            if !numbers.is_empty() {
                parts::caption_ui(ui, &numbers);
            }
        });
    });
}
