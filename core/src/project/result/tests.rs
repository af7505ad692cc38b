use nalgebra::{Matrix6, Vector6};
use serde_json::{Value, json};

use super::*;
use crate::geometry::frames::{Base, Target, Tip};

/// Calibration that the exports of other programs are compared with: tip to camera, 1280×720, `plumb_bob`.
pub(crate) const GOLDEN_TRANSLATION_M: [f64; 3] = [0.045, -0.032, 0.061];
pub(crate) const GOLDEN_XYZW: [f64; 4] = [0.195832126, 0.036412615, 0.644503346, 0.738200065];

pub(crate) fn golden_pose() -> Pose<Tip, Camera> {
    Pose::from_translation_xyzw(GOLDEN_TRANSLATION_M, GOLDEN_XYZW)
}

pub(crate) fn golden_intrinsics() -> Intrinsics {
    let distortion = Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.0]);
    Intrinsics { width: 1280, height: 720, fx: 912.4, fy: 911.8, cx: 640.7, cy: 361.2, distortion }
}

/// A full eye-in-hand result.
pub(crate) fn golden() -> CalibrationResult {
    let mut result = CalibrationResult::default();
    let base_from_target = Pose::<Base, Target>::from_translation_xyzw([0.4, -0.1, 0.02], [0.0, 0.6, 0.0, -0.8]);
    let covariance = Matrix6::from_diagonal(&Vector6::new(1.6e-7, 1.6e-7, 2.5e-7, 9e-7, 9e-7, 4e-7));
    let links = HandEye::EyeInHand { tip_from_camera: golden_pose(), base_from_target };
    result.set_links(&links, Some(&covariance), None);
    result.intrinsics = Some(IntrinsicsEstimate::new(&golden_intrinsics(), Some([0.4, 0.4, 0.3, 1.0 / 3.0]), false));
    result.quality = Quality { rms_px: Some(0.31), sigma_px: Some(0.2), ..Quality::default() };
    result.methods = vec![
        MethodRecord::solved("park_martin", &golden_pose().relabel()),
        MethodRecord::failed("tsai_lenz", &"3 views are not enough"),
    ];
    let statuses =
        [ViewRecordStatus::Used, ViewRecordStatus::Excluded, ViewRecordStatus::Outlier, ViewRecordStatus::NoTarget];
    result.views = statuses
        .into_iter()
        .enumerate()
        .map(|(i, status)| ViewRecord {
            name: format!("images/{i:04}.png"),
            status,
            rms_px: Some(0.3),
            influence_mm: None,
            distance: (status == ViewRecordStatus::Outlier).then_some(3.5),
            corners_aside: vec![4, 17],
            renumbered: status == ViewRecordStatus::Excluded,
        })
        .collect();
    result.estimate = Some(EstimateDetails {
        modelled_error_95_mm: Some(0.2),
        moved_mm: Some(1.5),
        reference_point_m: Some([0.01, -0.02, 0.45]),
        degrees_of_freedom: Some(31.5),
        region_scale: Some(0.97),
        view_sigma_px: Some(0.0),
        widening: Some(WideningRecord { factor: 1.4, by: "neighbours".to_owned(), lens_factor: Some(2.0) }),
        target_size: Some(TargetSizeEstimate { true_over_stated: 1.001, sigma: 0.002, determined: true }),
        board: Some(BoardEstimate {
            warp_mm: [0.16, -0.03],
            warp_sigma_mm: Some([0.01, 0.02]),
            scale: 1.0,
            scale_sigma: None,
        }),
        joint_offsets: Some(JointOffsetsEstimate {
            offsets_deg: vec![0.0, 0.2],
            sigma_deg: vec![1.0, 0.02],
            heldout_before_px: 2.0,
            heldout_after_px: 1.0,
            accepted: true,
        }),
        robot_field: Some(RobotFieldEstimate {
            origin_m: [0.4, -0.1, 0.5],
            reach_m: 0.3,
            position_slopes: [[1e-3, 0.0, -2e-3], [0.0, 5e-4, 0.0], [0.0; 3]],
            orientation_slopes_rad_per_m: [[0.0; 3], [2e-3, 0.0, 0.0], [0.0; 3]],
            typical_mm: 0.4,
            typical_deg: 0.03,
            heldout_rms_px: Some(0.6),
        }),
        depths: Some(DepthsEstimate {
            captures: 12,
            noise_mm: 0.02,
            turned: false,
            other_probability: 0.01,
            heldout_before_px: 0.11,
            heldout_after_px: 0.1,
            accepted: true,
        }),
        print: Some(PrintEstimate {
            rms_mm: 0.05,
            x_mm: vec![0.05, -0.05],
            y_mm: vec![-0.05, 0.05],
            sigma_mm: vec![0.01, 0.02],
        }),
        residual_distortion: Some(ResidualDistortionEstimate {
            degree: 1,
            x_px: vec![0.01, -0.02, 0.03],
            y_px: vec![0.0, 0.04, -0.05],
            rms_px: 0.06,
        }),
    });
    result.findings = vec![crate::diagnose::record::FindingRecord {
        code: "large_residual".to_owned(),
        severity: "warning".to_owned(),
        text: "The corners of view images/0001.png fit badly.".to_owned(),
        views: vec!["images/0001.png".to_owned()],
        evidence: vec![crate::diagnose::record::EvidenceRecord {
            name: "rms".to_owned(),
            value: Some(1.5),
            unit: "px".to_owned(),
        }],
    }];
    result.verification = Some(VerificationSummary {
        captures: 3,
        rms_px: 0.25,
        centre_rms_mm: 0.125,
        orientation_rms_deg: 0.01,
        as_stated: Some(true),
    });
    result.truth = Some(TruthComparison { translation_error_mm: Some(0.2), ..TruthComparison::default() });
    result.provenance.tool_version = "0.1.0".to_owned();
    result.provenance.input_sha256 = Some("00ff".repeat(16));
    result.provenance.options.insert("robust".to_owned(), json!(true));
    result
}

pub(crate) fn eye_to_hand() -> CalibrationResult {
    let mut result = golden();
    let links = HandEye::EyeToHand {
        base_from_camera: Pose::from_translation_xyzw([1.0, 0.25, 0.5], [0.5, -0.5, 0.5, -0.5]),
        tip_from_target: Pose::identity(),
    };
    result.set_links(&links, None, None);
    result
}

pub(crate) fn intrinsics_only() -> CalibrationResult {
    CalibrationResult { mode: None, hand_eye: None, target: None, methods: Vec::new(), ..golden() }
}

pub(crate) fn pose_pairs_only() -> CalibrationResult {
    CalibrationResult { intrinsics: None, ..golden() }
}

#[test]
fn a_result_reads_back_bit_for_bit() {
    for result in [golden(), eye_to_hand(), intrinsics_only(), pose_pairs_only(), CalibrationResult::default()] {
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
fn a_result_file_reads_back_and_a_missing_one_is_bad_input() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("result.json");
    assert!(CalibrationResult::read(&file).expect_err("not there").is_bad_input());
    golden().write(&file).expect("write");
    assert_eq!(CalibrationResult::read(&file).expect("read"), golden());
    let nowhere = golden().write(&folder.path().join("no/result.json")).expect_err("no folder");
    assert!(!nowhere.is_bad_input());
}

#[test]
fn every_kind_of_result_fits_the_schema_and_nothing_else_does() {
    let schema: Value =
        serde_json::from_str(include_str!("../../../../assets/schema/handeye-calibration-1.schema.json"))
            .expect("JSON");
    for result in [golden(), eye_to_hand(), intrinsics_only(), pose_pairs_only(), CalibrationResult::default()] {
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
