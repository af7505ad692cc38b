//! The finding on sessions that share a lens and do not agree on it.

use super::{Finding, FindingCode, Severity};
use crate::diagnose::Calibration;
use crate::shared_lens::OddSession;
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Sessions whose lens differs from that of the others: a warning where it is a different lens.
pub fn finding(calibration: &Calibration) -> Option<Finding> {
    let shared = calibration.shared_lens.as_ref()?;
    let farthest = shared.odd.iter().max_by(|a, b| apart_px(a).total_cmp(&apart_px(b)))?;
    let each = shared.odd.iter().map(|odd| {
        text!(
            "{session} (focal length {own} px by itself, {others} ± {sigma} px by the others; principal point {apart} px apart)",
            session = Text::verbatim(odd.name.clone()),
            own = shown(odd.focal_px, 2),
            others = shown(odd.others_focal_px, 2),
            sigma = shown(odd.sigma_px, 2),
            apart = shown(odd.centre_apart_px, 2)
        )
    });
    let list = Text::list(each);
    let (severity, text) = if shared.has_others() {
        let text = text!(
            "The sessions do not have one lens: {list}. Focus or zoom changed between them, or another camera took one. \
             Calibrate the sessions named by themselves, or capture them again with focus and zoom locked.",
            list = list
        );
        (Severity::Warning, text)
    } else {
        let text = text!(
            "The lenses of the sessions differ by more than noise explains, and by less than another focus would: {list}. The \
             lens model does not follow the lens, or focus was touched; the shared lens is a mean of both. Views that cover the \
             whole image in every session bring them together.",
            list = list
        );
        (Severity::Advice, text)
    };
    let finding = Finding::new(FindingCode::LensesDiffer, severity, text);
    let finding =
        finding.with("sessions", shared.sessions as f64, "").with("odd_sessions", shared.odd.len() as f64, "");
    let finding = finding.with("chance", shared.p_value, "");
    let finding = finding.with("focal_by_itself", farthest.focal_px, "px");
    let finding = finding.with("focal_by_others", farthest.others_focal_px, "px");
    let finding = finding.with("focal_difference_sigma", farthest.sigma_px, "px");
    Some(finding.with("centre_apart", farthest.centre_apart_px, "px"))
}

/// By how much it differs in focal length or principal point.
fn apart_px(odd: &OddSession) -> f64 {
    (odd.focal_px - odd.others_focal_px).abs().max(odd.centre_apart_px)
}
