//! What the user fixes about a recording.

use egui::{ComboBox, Ui, WidgetInfo, WidgetType};

use crate::style::parts;
use handeye_workbench::command::Outbox;
use handeye_workbench::import;
use handeye_workbench::model::{Found, ImportState};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Keys in which the hypotheses differ.
pub fn differing(found: &Found) -> Vec<&'static str> {
    let all: Vec<_> = found.hypotheses().iter().map(|h| h.conventions(&found.recording)).collect();
    let Some(first) = all.first() else { return Vec::new() };
    let value = |of: &[handeye_import::Convention], key: &str| {
        of.iter().find(|convention| convention.key == key).map(|convention| convention.value.clone())
    };
    let keys = first.iter().map(|convention| convention.key);
    keys.filter(|key| all.iter().any(|of| value(of, key) != value(first, key))).collect()
}

/// A choice for every convention that is open or was fixed.
pub fn fixed_ui(ui: &mut Ui, import: &ImportState, found: &Found, language: Language, outbox: &mut Outbox) {
    let open = differing(found);
    let all: Vec<_> = found.hypotheses().iter().flat_map(|h| h.conventions(&found.recording)).collect();
    let fixed = import.fixed.keys().map(String::as_str).filter(|key| !open.contains(key) && !super::is_typed(key));
    for key in open.iter().copied().chain(fixed) {
        let mut values: Vec<&str> = Vec::new();
        for convention in all.iter().filter(|convention| convention.key == key) {
            if !values.contains(&convention.value.as_str()) {
                values.push(&convention.value);
            }
        }
        let by_data = tr!(language, "from the data");
        let now = import.fixed.get(key).map(String::as_str);
        parts::row_ui(ui, name(key, language), |ui| {
            let combo = ComboBox::from_id_salt(("convention", key)).width(260.0).selected_text(now.unwrap_or(by_data));
            let shown = combo.show_ui(ui, |ui| {
                for (value, reported) in std::iter::once((None, by_data)).chain(values.iter().map(|v| (Some(*v), *v))) {
                    if ui.selectable_label(now == value, reported).clicked() && now != value {
                        let value = value.map(str::to_owned);
                        outbox.send(import::Command::FixConvention { key: key.to_owned(), value });
                    }
                }
            });
            shown.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, name(key, language)));
        });
    }
}

/// The name of a key of `handeye import --set`.
fn name(key: &str, language: Language) -> &'static str {
    match key {
        "mode" => tr!(language, "Where the camera sits"),
        "pose" => tr!(language, "Robot poses"),
        "length_unit" => tr!(language, "Lengths"),
        "angle_unit" => tr!(language, "Angles"),
        "rotation" => tr!(language, "Rotations"),
        "pairing" => tr!(language, "Pairing"),
        "images" => tr!(language, "Images"),
        "poses" => tr!(language, "Series of poses"),
        "target_poses" => tr!(language, "Series of target poses"),
        "target_pose" => tr!(language, "Target poses"),
        "target_length_unit" => tr!(language, "Target lengths"),
        "target_rotation" => tr!(language, "Target rotations"),
        _ => tr!(language, "Convention"),
    }
}
