use serde_json::json;

use super::*;
use crate::tests::{meta, pose, record};
use handeye_dataset::taught_poses::{Goal, TaughtOn};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::Pose;
use handeye_geometry::targets::Grid;

fn document(captures: u32) -> Document {
    let captures = (1..=captures).map(record).collect();
    Document { captures, ..Document::new(meta()) }
}

fn ids(numbers: &[u32]) -> Vec<CaptureId> {
    numbers.iter().copied().map(CaptureId).collect()
}

fn left(document: &Document) -> Vec<u32> {
    document.captures.iter().map(|capture| capture.id.0).collect()
}

fn taught(names: &[&str]) -> Vec<TaughtPose> {
    names.iter().map(|name| TaughtPose::new(*name, Goal::Joints(vec![0.1; 6]))).collect()
}

fn set_taught(change: TaughtChange, names: &[&str]) -> Edit {
    Edit::SetTaught { change, poses: taught(names) }
}

fn after(document: &Document, edit: &Edit) -> Document {
    document.apply(edit).unwrap_or_else(|e| panic!("{edit}: {e}"))
}

#[test]
fn every_edit_changes_what_it_names_and_nothing_else() {
    let before = document(4);
    let mut expected = before.clone();
    expected.captures.push(record(7));
    assert_eq!(after(&before, &Edit::AddCapture(Box::new(record(7)))), expected);

    assert_eq!(left(&after(&before, &Edit::DeleteCaptures(ids(&[3, 1])))), [2, 4]);

    let mut expected = before.clone();
    expected.captures[1].excluded = true;
    expected.captures[3].excluded = true;
    let excluded = after(&before, &Edit::SetExcluded { ids: ids(&[4, 2]), excluded: true });
    assert_eq!(excluded, expected);
    assert_eq!(after(&excluded, &Edit::SetExcluded { ids: ids(&[2, 4]), excluded: false }), before);

    let mut expected = before.clone();
    expected.captures[0].role = Role::Verification;
    let checked = after(&before, &Edit::SetRole { ids: ids(&[1]), role: Role::Verification });
    assert_eq!(checked, expected);
    let in_use = |document: &Document| document.in_use().map(|capture| capture.id.0).collect::<Vec<_>>();
    assert_eq!((in_use(&excluded), in_use(&checked)), (vec![1, 3], vec![2, 3, 4]));

    let target = TargetSpec::Circles(Grid { columns: 5, rows: 4, square_m: 0.02 });
    assert_eq!(after(&before, &Edit::SetTarget(target)).meta.target, target);
    assert_eq!(after(&before, &Edit::SetMode(Mode::EyeToHand)).meta.mode, Mode::EyeToHand);
    assert_eq!(after(&before, &Edit::SetCamera(None)).meta.camera, None);
    assert_eq!(after(&before, &Edit::SetRobotAccuracy(Some(0.5))).meta.robot_accuracy_mm, Some(0.5));
    for mm in [0.0, -1.0, f64::NAN, 500.0] {
        assert!(matches!(before.apply(&Edit::SetRobotAccuracy(Some(mm))), Err(EditError::Bad { .. })), "{mm}");
    }
    let named = after(&before, &Edit::SetExportNames(json!({"base": "base_link"})));
    assert_eq!(named.export_names, Some(json!({"base": "base_link"})));
    assert_eq!(after(&named, &Edit::SetExportNames(json!(null))), before);
}

#[test]
fn taught_poses_change_only_as_the_edit_says() {
    let add = |name: &str| TaughtChange::Add(name.into());
    let before = after(&document(0), &set_taught(TaughtChange::Replace, &["a", "b"]));
    let fits = [
        set_taught(add("c"), &["a", "b", "c"]),
        set_taught(TaughtChange::Remove("a".into()), &["b"]),
        set_taught(TaughtChange::Rename { from: "a".into(), to: "z".into() }, &["z", "b"]),
        set_taught(TaughtChange::Reorder("a".into()), &["b", "a"]),
        set_taught(TaughtChange::Import(2), &["a", "b", "c", "d"]),
        set_taught(TaughtChange::Replace, &[]),
    ];
    for edit in fits {
        let Edit::SetTaught { poses, .. } = &edit else { panic!("not poses") };
        assert_eq!(after(&before, &edit).taught, *poses);
    }
    let contradicts = [
        set_taught(add("a"), &["a", "b", "c"]),
        set_taught(add("c"), &["a", "b", "d"]),
        set_taught(TaughtChange::Remove("a".into()), &["a"]),
        set_taught(TaughtChange::Remove("c".into()), &["a"]),
        set_taught(TaughtChange::Rename { from: "a".into(), to: "b".into() }, &["b"]),
        set_taught(TaughtChange::Rename { from: "a".into(), to: "c".into() }, &["a", "c"]),
        set_taught(TaughtChange::Reorder("c".into()), &["b", "a"]),
    ];
    for edit in contradicts {
        assert!(matches!(before.apply(&edit), Err(EditError::TaughtChange(_))), "{edit}");
    }
    let twice = before.apply(&set_taught(TaughtChange::Import(1), &["a", "b", "a"]));
    assert_eq!(twice, Err(EditError::SamePoseName("a".into())));
    let mut poses = taught(&["a", "b"]);
    for goal in [
        Goal::Joints(vec![0.0; 7]),
        Goal::Joints(vec![]),
        Goal::Joints(vec![f64::NAN; 6]),
        Goal::Tip(Pose::from_translation_xyzw([f64::INFINITY, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])),
    ] {
        poses[1].goal = goal;
        let edit = Edit::SetTaught { change: TaughtChange::Replace, poses: poses.clone() };
        assert!(matches!(before.apply(&edit), Err(EditError::Bad { .. })), "{poses:?}");
    }
    assert!(matches!(before.apply(&set_taught(add(" "), &["a", "b", " "])), Err(EditError::Bad { .. })));
}

#[test]
fn poses_of_two_cells_may_have_the_same_name_and_other_joints() {
    let cell = |base: &str| {
        Some(TaughtOn { base: base.into(), joints: Vec::new(), tip_at_zero_m: None, target: meta().target })
    };
    let on = |base: &str, joints| TaughtPose {
        cell: cell(base),
        ..TaughtPose::new("front", Goal::Joints(vec![0.1; joints]))
    };
    let first = Edit::SetTaught { change: TaughtChange::Replace, poses: vec![on("one", 6)] };
    let add = TaughtChange::Add("front".into());
    let both = Edit::SetTaught { change: add.clone(), poses: vec![on("one", 6), on("another", 7)] };
    let before = after(&document(0), &first);
    assert_eq!(after(&before, &both).taught.len(), 2);
    let twice = Edit::SetTaught { change: add, poses: vec![on("one", 6), on("one", 6)] };
    assert_eq!(before.apply(&twice), Err(EditError::SamePoseName("front".into())));
}

#[test]
fn an_edit_that_does_not_fit_is_refused_with_the_reason() {
    let before = document(2);
    let unknown = Err(EditError::UnknownCapture(CaptureId(3)));
    assert_eq!(before.apply(&Edit::DeleteCaptures(ids(&[1, 3]))), unknown);
    assert_eq!(before.apply(&Edit::SetExcluded { ids: ids(&[3]), excluded: true }), unknown);
    assert_eq!(before.apply(&Edit::SetRole { ids: ids(&[3]), role: Role::Verification }), unknown);
    assert_eq!(before.apply(&Edit::DeleteCaptures(vec![])), Err(EditError::NoCapture));
    assert_eq!(before.apply(&Edit::AddCapture(Box::new(record(2)))), Err(EditError::UsedNumber(CaptureId(2))));
    let same_image = CaptureRecord { id: CaptureId(9), ..record(2) };
    assert_eq!(before.apply(&Edit::AddCapture(Box::new(same_image))), Err(EditError::UsedNumber(CaptureId(9))));

    let nan = Pose::from_translation_xyzw([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
    let spoiled = [
        CaptureRecord { id: CaptureId(0), ..record(3) },
        CaptureRecord { image: "../0003.png".into(), ..record(3) },
        CaptureRecord { depth: Some("/etc/passwd".into()), ..record(3) },
        CaptureRecord { base_from_tip: Some(nan), ..record(3) },
        CaptureRecord { joints_rad: Some(vec![f64::INFINITY]), ..record(3) },
        CaptureRecord { sim_time_s: Some(f64::NAN), ..record(3) },
        CaptureRecord { frames: 0, ..record(3) },
        CaptureRecord { corner_noise_px: Some(-0.1), ..record(3) },
        CaptureRecord { settled_s: Some(f64::NAN), ..record(3) },
    ];
    for record in spoiled {
        let error = before.apply(&Edit::AddCapture(Box::new(record.clone()))).expect_err("spoiled");
        assert!(matches!(error, EditError::Bad { .. }), "{record:?}: {error}");
    }
    let small = TargetSpec::Chessboard(Grid { columns: 2, rows: 7, square_m: 0.01 });
    assert!(matches!(before.apply(&Edit::SetTarget(small)), Err(EditError::Bad { .. })));
    let unknown_lens = CameraInput { fixed: true, accuracy_px: None, intrinsics: None, model: Distortion::None };
    assert!(matches!(before.apply(&Edit::SetCamera(Some(unknown_lens))), Err(EditError::Bad { .. })));
    let mut no_focus = Intrinsics::pinhole(24, 16, 20.0);
    no_focus.fx = f64::NAN;
    let unusable = CameraInput { fixed: true, accuracy_px: None, intrinsics: Some(no_focus), model: Distortion::None };
    assert!(matches!(before.apply(&Edit::SetCamera(Some(unusable))), Err(EditError::Bad { .. })));
    let lens = before.meta.camera.and_then(|camera| camera.intrinsics).expect("a lens");
    for (fixed, px) in [(false, 0.5), (true, 0.0), (true, f64::NAN), (true, 1e4)] {
        let of = CameraInput { fixed, accuracy_px: Some(px), intrinsics: Some(lens), model: lens.distortion };
        assert!(matches!(before.apply(&Edit::SetCamera(Some(of))), Err(EditError::Bad { .. })), "{fixed} {px}");
    }
}

#[test]
fn an_edit_that_changes_nothing_is_no_step() {
    let before = document(2);
    let idle = [
        Edit::SetExcluded { ids: ids(&[1]), excluded: false },
        Edit::SetRole { ids: ids(&[1, 2]), role: Role::Calibration },
        Edit::SetTarget(before.meta.target),
        Edit::SetMode(before.meta.mode),
        Edit::SetCamera(before.meta.camera),
        Edit::SetRobotAccuracy(before.meta.robot_accuracy_mm),
        set_taught(TaughtChange::Replace, &[]),
        Edit::SetExportNames(json!(null)),
    ];
    for edit in idle {
        assert_eq!(before.apply(&edit), Err(EditError::NoChange), "{edit}");
    }
}

#[test]
fn edits_have_names_for_a_menu() {
    let named = [
        (Edit::AddCapture(Box::new(record(12))), "capture 12"),
        (Edit::DeleteCaptures(ids(&[3])), "delete capture 3"),
        (Edit::DeleteCaptures(ids(&[3, 4])), "delete 2 captures"),
        (Edit::SetExcluded { ids: ids(&[3, 4]), excluded: true }, "exclude 2 captures"),
        (Edit::SetRole { ids: ids(&[3]), role: Role::Verification }, "use capture 3 for verification"),
        (Edit::SetMode(Mode::EyeToHand), "change to eye to hand"),
        (set_taught(TaughtChange::Rename { from: "a".into(), to: "b".into() }, &[]), "rename pose a to b"),
        (set_taught(TaughtChange::Import(3), &[]), "import 3 poses"),
    ];
    for (edit, name) in named {
        assert_eq!(edit.to_string(), name);
    }
}

#[test]
fn edits_read_back_as_they_were_written() {
    let edits = [
        Edit::AddCapture(Box::new(record(12))),
        Edit::DeleteCaptures(ids(&[3])),
        Edit::SetExcluded { ids: ids(&[3]), excluded: true },
        Edit::SetRole { ids: ids(&[3]), role: Role::Verification },
        Edit::SetTarget(meta().target),
        Edit::SetMode(Mode::EyeToHand),
        Edit::SetCamera(None),
        Edit::SetCamera(meta().camera),
        Edit::SetRobotAccuracy(Some(0.03)),
        Edit::SetRobotAccuracy(None),
        Edit::SetTaught {
            change: TaughtChange::Rename { from: "a\n".into(), to: "b".into() },
            poses: vec![TaughtPose::new("b", Goal::Tip(pose(1)))],
        },
        Edit::SetExportNames(json!({"a": [1, 0.1, null]})),
    ];
    for edit in edits {
        let text = serde_json::to_string(&edit).expect("text");
        assert!(!text.contains('\n'), "{text}");
        assert_eq!(serde_json::from_str::<Edit>(&text).expect(&text), edit);
    }
}
