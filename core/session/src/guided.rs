//! A guided session as it is kept in a session folder.

use handeye_plan::guided::{Guide, Outcome};
use handeye_result::guided_record::{EndingRecord, GuidedRecord, StepRecord};
use handeye_wording::English;

/// A guided session so far.
pub fn guided_record(guide: &Guide) -> GuidedRecord {
    let mm = |metres: f64| metres * 1e3;
    let steps = guide.steps().iter().map(|step| StepRecord {
        translation_m: step.base_from_tip.translation().into(),
        rotation_xyzw: step.base_from_tip.xyzw(),
        joints: step.joints.map(|joints| joints.to_vec()),
        why: step.why.text().in_language(English),
        before_mm: step.why.errors_m().map(|(from_m, _)| mm(from_m)),
        promised_mm: step.why.errors_m().map(|(_, to_m)| mm(to_m)),
        achieved_mm: step.achieved_m.map(mm),
        travel_s: step.travel_s,
        candidates: step.candidates,
        outcome: match step.outcome {
            Outcome::Pending => "pending",
            Outcome::Captured => "captured",
            Outcome::Failed => "failed",
            Outcome::Skipped => "skipped",
        }
        .to_owned(),
    });
    let ending = guide
        .ended()
        .map(|ending| EndingRecord { code: ending.code().to_owned(), text: ending.text().in_language(English) });
    let box_mm = guide.options().tool_box.map(|tool_box| tool_box.bounds().map(|corner| (corner * 1e3).into()));
    GuidedRecord {
        goal_mm: mm(guide.options().goal_m),
        box_mm,
        seed: guide.options().seed,
        steps: steps.collect(),
        ending,
    }
}
