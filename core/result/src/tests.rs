use serde_json::{Value, json};

use super::testing::*;
use super::*;

fn of_every_kind() -> Vec<CalibrationResult> {
    vec![golden(), eye_to_hand(), intrinsics_only(), pose_pairs_only(), CalibrationResult::default()]
}

#[test]
fn a_result_reads_back_bit_for_bit() {
    for result in of_every_kind() {
        let text = result.to_json().expect("text");
        assert_eq!(CalibrationResult::from_json(&text).expect("result"), result);
    }
    assert_eq!(golden().links().map(|l| l.mount_from_camera()), Some(golden_pose().relabel()));
}

#[test]
fn unknown_numbers_are_null_and_no_key_is_left_out() {
    let value: Value = serde_json::from_str(&intrinsics_only().to_json().expect("text")).expect("JSON");
    for key in ["mode", "hand_eye", "target"] {
        assert_eq!(value.get(key), Some(&Value::Null), "{key}");
    }
    assert_eq!(value["quality"].get("heldout_rms_px"), Some(&Value::Null));
    assert_eq!(value["views"][0].get("influence_mm"), Some(&Value::Null));
    let fixed = IntrinsicsEstimate::new(&golden_intrinsics(), None, true);
    let value = serde_json::to_value(&fixed).expect("JSON");
    assert_eq!(value["sigma"], json!({"fx": null, "fy": null, "cx": null, "cy": null}));
    let value = serde_json::to_value(golden()).expect("JSON");
    assert_eq!(value["methods"][1]["status"], "3 views are not enough");
    assert_eq!(value["methods"][1].get("translation_m"), Some(&Value::Null));
    assert_eq!(value["views"][3]["status"], "no_target");
}

#[test]
fn eye_to_hand_names_its_own_frames() {
    let value = serde_json::to_value(eye_to_hand()).expect("JSON");
    assert_eq!(value["mode"], "eye_to_hand");
    assert_eq!(
        (&value["hand_eye"]["parent_frame"], &value["hand_eye"]["child_frame"]),
        (&json!("base"), &json!("camera"))
    );
    assert_eq!((&value["target"]["parent_frame"], &value["target"]["child_frame"]), (&json!("tip"), &json!("target")));
    assert!(value["hand_eye"]["rotation_xyzw"][3].as_f64().expect("w") >= 0.0);
}

#[test]
fn a_document_that_must_not_be_is_refused_with_the_path_of_the_value() {
    let good = serde_json::to_value(golden()).expect("JSON");
    let cases: &[(&str, Value, &str)] = &[
        ("/format", json!("mrcal"), "format is \"mrcal\""),
        ("/version", json!(2), "version 2"),
        ("/mode", json!("eye_on_base"), "eye_on_base"),
        ("/mode", json!(null), "mode is null"),
        ("/mode", json!("eye_to_hand"), "hand_eye.parent_frame"),
        ("/hand_eye/child_frame", json!("target"), "hand_eye.child_frame"),
        ("/hand_eye/rotation_xyzw", json!([0, 0, 0, 0.99]), "hand_eye.rotation_xyzw is not a unit quaternion"),
        ("/hand_eye/rotation_xyzw", json!([0, 0, 1]), "line "),
        ("/hand_eye/translation_m/0", json!(null), "line "),
        ("/hand_eye/covariance", json!([[1, 2], [2, 1]]), "line "),
        ("/hand_eye/covariance/0/0", json!(-1.0), "hand_eye.covariance has a negative variance"),
        ("/hand_eye/covariance/0/1", json!(1e-7), "hand_eye.covariance is not symmetric"),
        ("/intrinsics/fx", json!(-900.0), "intrinsics must be"),
        ("/intrinsics/model", json!("plumb_bob"), "intrinsics.model"),
        ("/intrinsics/distortion", json!([0, 0, 0, 0]), "intrinsics.model"),
        ("/views/0/status", json!("bad"), "no_target"),
        ("/quality/rms_px", json!(-1), "quality.rms_px"),
        ("/methods/0/translation_m", json!(null), "methods[0].status"),
        ("/methods/0/rotation_xyzw", json!([1, 1, 1, 1]), "methods[0].rotation_xyzw"),
    ];
    for (path, value, needle) in cases {
        let mut document = good.clone();
        *document.pointer_mut(path).expect("a value to replace") = value.clone();
        let error = CalibrationResult::from_json(&document.to_string()).expect_err(path).to_string();
        assert!(error.contains(needle) && !error.contains('\n'), "{path}: {error}");
    }
    assert!(CalibrationResult::from_json("{\"format\": ").is_err());
    assert!(CalibrationResult::from_json("[]").is_err());
}

#[test]
fn a_number_that_is_none_is_not_written() {
    let mut result = golden();
    result.quality.rms_px = Some(f64::NAN);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("result.json");
    let error = result.write(&file).expect_err("a NaN").to_string();
    assert!(error.contains("result.json: quality.rms_px"), "{error}");
    assert!(!file.exists());
}

#[test]
fn a_result_file_reads_back_and_a_missing_one_is_an_error() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("result.json");
    assert!(CalibrationResult::read(&file).is_err(), "not there");
    golden().write(&file).expect("write");
    assert_eq!(CalibrationResult::read(&file).expect("read"), golden());
    assert!(golden().write(&folder.path().join("no/result.json")).is_err(), "no folder");
}

#[test]
fn every_kind_of_result_fits_the_schema_and_nothing_else_does() {
    let schema: Value =
        serde_json::from_str(include_str!("../../../assets/schema/handeye-calibration-1.schema.json")).expect("JSON");
    for result in of_every_kind() {
        let value = serde_json::to_value(&result).expect("JSON");
        assert_eq!(schema_violation(&schema, &schema, &value, "$"), None);
    }
    let good = serde_json::to_value(golden()).expect("JSON");
    let wrong = [
        ("/version", json!(2)),
        ("/hand_eye/rotation_xyzw", json!([0, 0, 1])),
        ("/hand_eye/covariance/5", json!([0, 0, 0])),
        ("/intrinsics/model", json!("plumb_bob")),
        ("/views/0/status", json!("bad")),
        ("/quality", json!({})),
        ("/provenance/tool_version", json!(1)),
    ];
    for (path, value) in wrong {
        let mut document = good.clone();
        *document.pointer_mut(path).expect("a value to replace") = value;
        assert!(schema_violation(&schema, &schema, &document, "$").is_some(), "{path}");
    }
    let mut extra = good;
    extra["surplus"] = json!(1);
    assert!(schema_violation(&schema, &schema, &extra, "$").is_some());
}

/// Where a document breaks the schema. Knows the keywords that the schema uses and fails on any other.
fn schema_violation(root: &Value, schema: &Value, value: &Value, at: &str) -> Option<String> {
    let keywords = schema.as_object().expect("a schema");
    let fail = |why: &str| Some(format!("{at}: {why}"));
    for (keyword, rule) in keywords {
        let violation = match keyword.as_str() {
            "$schema" | "$id" | "title" | "description" | "$defs" | "additionalProperties" => None,
            "$ref" => {
                let target = rule.as_str().and_then(|r| root.pointer(&r[1..])).expect("a definition");
                schema_violation(root, target, value, at)
            }
            "anyOf" => {
                let fits = |s: &Value| schema_violation(root, s, value, at).is_none();
                if rule.as_array().expect("list").iter().any(fits) { None } else { fail("none of the choices") }
            }
            "type" => {
                if has_type(rule, value) {
                    None
                } else {
                    fail("type")
                }
            }
            "const" => {
                if value == rule {
                    None
                } else {
                    fail("const")
                }
            }
            "enum" => {
                if rule.as_array().expect("list").contains(value) {
                    None
                } else {
                    fail("enum")
                }
            }
            "minimum" => {
                if value.as_f64().is_none_or(|v| v >= rule.as_f64().expect("number")) {
                    None
                } else {
                    fail("minimum")
                }
            }
            "exclusiveMinimum" => {
                if value.as_f64().is_none_or(|v| v > rule.as_f64().expect("number")) {
                    None
                } else {
                    fail("minimum")
                }
            }
            "minItems" => {
                if value.as_array().is_none_or(|a| a.len() as u64 >= rule.as_u64().expect("n")) {
                    None
                } else {
                    fail("too short")
                }
            }
            "maxItems" => {
                if value.as_array().is_none_or(|a| a.len() as u64 <= rule.as_u64().expect("n")) {
                    None
                } else {
                    fail("too long")
                }
            }
            "items" => value.as_array().and_then(|items| {
                items.iter().enumerate().find_map(|(i, v)| schema_violation(root, rule, v, &format!("{at}[{i}]")))
            }),
            "required" => rule.as_array().expect("list").iter().find_map(|key| {
                let key = key.as_str().expect("key");
                if value.get(key).is_none() && value.is_object() { fail(&format!("{key} is missing")) } else { None }
            }),
            "properties" => value.as_object().and_then(|object| {
                object.iter().find_map(|(key, v)| match rule.get(key) {
                    Some(s) => schema_violation(root, s, v, &format!("{at}.{key}")),
                    None if schema["additionalProperties"] == json!(false) => fail(&format!("{key} is unknown")),
                    None => None,
                })
            }),
            other => panic!("the schema uses {other}, which this check does not know"),
        };
        if violation.is_some() {
            return violation;
        }
    }
    None
}

fn has_type(rule: &Value, value: &Value) -> bool {
    let one = |name: &str| match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        other => panic!("the schema uses type {other}"),
    };
    rule.as_array()
        .map_or_else(|| one(rule.as_str().expect("type")), |names| names.iter().any(|n| one(n.as_str().expect("type"))))
}
