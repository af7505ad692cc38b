//! The command line on sessions: the journal is authoritative, and every command reads the same from it.

use std::fs;
use std::path::Path;

use handeye_result::{CalibrationResult, ViewRecordStatus};
use handeye_session::{CaptureId, Edit, Role, Store};
use serde_json::Value;

use crate::solved::{copy_of_session, handeye, text, utf8};

fn calibrated(session: &Path) -> CalibrationResult {
    let output = handeye(&["calibrate", "-q", utf8(session), "--json", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    CalibrationResult::from_json(&text(&output.stdout)).expect("a result")
}

fn diagnosed(session: &Path) -> Value {
    let output = handeye(&["doctor", "-q", utf8(session), "--json", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("a diagnosis")
}

fn status(result: &CalibrationResult) -> Vec<(String, ViewRecordStatus)> {
    result.views.iter().map(|view| (view.name.clone(), view.status)).collect()
}

/// Keeps two captures for verification and excludes one of them and another one.
fn edit(session: &Path) {
    let mut store = Store::open(session).expect("open");
    store.apply(Edit::SetRole { ids: vec![CaptureId(1), CaptureId(6)], role: Role::Verification }).expect("role");
    store.apply(Edit::SetExcluded { ids: vec![CaptureId(4), CaptureId(6)], excluded: true }).expect("exclude");
}

#[test]
fn captures_that_are_excluded_or_verify_touch_no_number_and_are_named_for_what_they_are() {
    let (_home, session) = copy_of_session();
    edit(&session);
    let (_other_home, without) = copy_of_session();
    let mut store = Store::open(&without).expect("open");
    store.apply(Edit::DeleteCaptures([1, 4, 6].map(CaptureId).to_vec())).expect("delete");
    drop(store);

    let (result, reference) = (calibrated(&session), calibrated(&without));
    assert_eq!((&result.hand_eye, &result.intrinsics), (&reference.hand_eye, &reference.intrinsics));
    assert_eq!(result.provenance.input_sha256, reference.provenance.input_sha256);
    let mut expected = status(&reference);
    expected.insert(2, ("images/0004.png".to_owned(), ViewRecordStatus::Excluded));
    assert_eq!(status(&result), expected);
    assert_eq!(diagnosed(&session)["hypotheses"], diagnosed(&without)["hypotheses"]);

    assert_eq!((result.verification.map(|it| it.captures), reference.verification), (Some(1), None));
    // The verifying capture is checked, and the excluded one is not.
    let report = handeye(&["calibrate", "-q", utf8(&session)]);
    let report = text(&report.stdout);
    assert!(report.contains("verification on 1 capture"), "{report}");
    let section = report.lines().skip_while(|line| !line.starts_with("verification")).skip(1);
    let checked: Vec<&str> = section.take_while(|line| line.starts_with(' ')).collect();
    assert!(checked.len() == 1 && checked[0].contains("images/0001.png"), "{checked:?}");
    assert!(!text(&handeye(&["calibrate", "-q", utf8(&without)]).stdout).contains("verification"));
}

#[test]
fn a_session_is_read_from_its_journal_and_not_from_the_files_that_follow_from_it() {
    let (_home, session) = copy_of_session();
    edit(&session);
    let (result, diagnosis) = (calibrated(&session), diagnosed(&session));
    // Another program has reordered the poses, and changed the target in the description.
    let table = fs::read_to_string(session.join("poses.csv")).expect("text");
    let mut cells: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let name = cells[1][0];
    cells[1][0] = cells[2][0];
    cells[2][0] = name;
    let swapped: Vec<String> = cells.iter().map(|row| row.join(",")).collect();
    fs::write(session.join("poses.csv"), swapped.join("\n")).expect("written");
    let description = fs::read_to_string(session.join("dataset.toml")).expect("text");
    fs::write(session.join("dataset.toml"), description.replace("columns = 10", "columns = 9")).expect("written");
    assert_eq!((calibrated(&session), diagnosed(&session)), (result, diagnosis));
}

#[test]
fn journal_images_and_depths_are_enough_for_every_command() {
    let (_home, session) = copy_of_session();
    edit(&session);
    let (result, diagnosis) = (calibrated(&session), diagnosed(&session));
    let views = |session: &Path, name: &str| {
        let out = session.with_file_name(name);
        let file = session.join("result.json");
        let solved = handeye(&["calibrate", "-q", utf8(session), "--json", utf8(&file)]);
        assert_eq!(solved.status.code(), Some(0), "{}", text(&solved.stderr));
        let exported = handeye(&["export", utf8(session), "--format", "colmap", "nerfstudio", "--out", utf8(&out)]);
        assert_eq!(exported.status.code(), Some(0), "{}", text(&exported.stderr));
        (fs::read_to_string(out.join("images.txt")), fs::read_to_string(out.join("transforms.json")))
    };
    let (images, transforms) = views(&session, "whole");
    for name in ["session.json", "dataset.toml", "poses.csv", "result.json", ".lock"] {
        fs::remove_file(session.join(name)).expect("removed");
    }
    fs::remove_dir_all(session.join("exports")).expect("removed");
    assert!(result.depth.is_some_and(|depth| depth.errors.is_some()), "{:?}", result.depth);
    let with_depths = result.clone();
    assert_eq!((calibrated(&session), diagnosed(&session)), (result, diagnosis));
    let (bare_images, bare_transforms) = views(&session, "bare");
    assert_eq!(bare_images.expect("written"), images.expect("written"));
    assert_eq!(bare_transforms.expect("written"), transforms.expect("written"));
    // The answer from the corners differs from that from corners and depths, and nothing is known about a depth camera.
    fs::remove_dir_all(session.join("depth")).expect("removed");
    let of_corners = calibrated(&session);
    assert_eq!(of_corners.depth, None);
    let depths = |result: &CalibrationResult| result.estimate.as_ref().and_then(|estimate| estimate.depths);
    assert!(depths(&with_depths).is_some() && depths(&of_corners).is_none(), "{:?}", with_depths.estimate);
    let place = |result: &CalibrationResult| result.hand_eye.as_ref().expect("a hand-eye").translation_m;
    let off_m = place(&of_corners).iter().zip(place(&with_depths)).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!(off_m < 1e-3, "{off_m}");
}
