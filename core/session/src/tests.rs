use std::fs;

use image::Rgb;
use nalgebra::Matrix3;

use super::*;
use handeye_dataset::{CameraInput, Dataset};
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::observation::{Corners, Sight};
use handeye_geometry::targets::{Grid, TargetSpec};

pub(super) fn meta() -> SessionMeta {
    let intrinsics = Intrinsics {
        distortion: Distortion::BrownConrady([0.1, 0.0, 0.0, 0.0, 0.0]),
        ..Intrinsics::pinhole(24, 16, 20.5)
    };
    let links = HandEye::EyeInHand {
        tip_from_camera: Pose::from_translation_xyzw([0.05, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]),
        base_from_target: Pose::identity(),
    };
    SessionMeta {
        created: "2026-05-02T10:11:12Z".into(),
        tool_version: "0.1.0".into(),
        mode: Mode::EyeInHand,
        target: TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 }),
        camera: Some(CameraInput {
            fixed: true,
            accuracy_px: Some(0.25),
            intrinsics: Some(intrinsics),
            model: intrinsics.distortion,
        }),
        seeds: [("scene".to_owned(), u64::MAX)].into(),
        ground_truth: Some(GroundTruth::new(&links, Some(intrinsics))),
        arm: None,
        joint_kinds: None,
        tool_m: None,
        robot_accuracy_mm: None,
    }
}

/// A capture as in documents; its files need not exist.
pub(super) fn record(id: u32) -> CaptureRecord {
    CaptureRecord {
        id: CaptureId(id),
        image: format!("images/{id:04}.png"),
        depth: id.is_multiple_of(2).then(|| format!("depth/{id:04}.tiff")),
        base_from_tip: Some(pose(id as u8)),
        joints_rad: Some(vec![0.1, f64::from(id) / 3.0]),
        sim_time_s: None,
        role: Role::Calibration,
        excluded: false,
        frames: 1,
        corner_noise_px: Some(0.05),
        settled_s: None,
        pose_name: Some("front".into()),
    }
}

pub(super) fn image(seed: u8) -> RgbImage {
    RgbImage::from_fn(24, 16, |x, y| Rgb([seed, (x * 9) as u8, (y * 13) as u8]))
}

pub(super) fn depth() -> DepthImage {
    DepthImage::new(24, 16, (0..24 * 16).map(|i| 0.3 + 0.0001 * i as f32).collect()).expect("as many as pixels")
}

pub(super) fn pose(i: u8) -> Pose<Base, Tip> {
    let q = [0.1, -0.2 * f64::from(i), 0.3, -0.7];
    Pose::from_translation_xyzw([0.1 / 3.0, f64::from(i), -1e-9], q)
}

pub(super) fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// A new session with captures 1, 2, …; it is closed when the store is dropped.
pub(super) fn store_with(folder: &Path, captures: u8) -> Store {
    let mut store = Store::create(folder, meta()).expect("create");
    for i in 1..=captures {
        store.add_capture(&Capture::new(&image(i), pose(i))).expect("add");
    }
    store
}

pub(super) fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .expect("list")
        .map(|e| e.expect("entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_session_reads_back_bit_for_bit_and_is_a_dataset() {
    let home = folder();
    let dir = home.path().join("new/session");
    let mut store = Store::create(&dir, meta()).expect("create");
    let depth = depth();
    let joints = [0.1, -0.2, 0.3, 0.4, 0.5, 1.0 / 3.0];
    for i in 0..3 {
        let image = image(i);
        let full = Capture {
            depth_m: (i != 1).then_some(&depth),
            joints_rad: Some(&joints),
            sim_time_s: Some(0.05),
            frames: 8,
            corner_noise_px: Some(0.02),
            settled_s: Some(0.5),
            pose_name: Some("front"),
            ..Capture::new(&image, pose(i))
        };
        assert_eq!(store.add_capture(&full).expect("add"), CaptureId(u32::from(i) + 1));
    }
    let session = Session::open(&dir).expect("open");
    assert_eq!(session.document.meta, meta());
    assert_eq!(session.document, *store.document());
    let captures = &session.document.captures;
    assert_eq!((captures[0].joints_rad.as_deref(), captures[0].frames), (Some(&joints[..]), 8));
    assert_eq!(session.load_rgb(&captures[2]).expect("image"), image(2));
    assert_eq!(session.load_depth_m(&captures[2]).expect("depth"), Some(depth));
    assert_eq!(session.load_depth_m(&captures[1]).expect("no depth"), None);
    let truth = session.document.meta.ground_truth.as_ref().expect("truth");
    assert!(truth.links(Mode::EyeInHand).is_some() && truth.links(Mode::EyeToHand).is_none());

    let data = Dataset::read(&dir).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((data.mode, data.target, data.camera), (Some(Mode::EyeInHand), meta().target, meta().camera));
    assert_eq!(data.entries.len(), captures.len());
    for (i, (entry, record)) in data.entries.iter().zip(captures).enumerate() {
        let bits = |m: &Matrix3<f64>| m.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let rotation = |p: &Pose<Base, Tip>| bits(p.rotation().to_rotation_matrix().matrix());
        let read = entry.base_from_tip.expect("a pose");
        assert_eq!(entry.name, record.image);
        assert_eq!((read.translation(), rotation(&read)), (pose(i as u8).translation(), rotation(&pose(i as u8))));
        assert_eq!(rotation(&record.base_from_tip.expect("a pose")), rotation(&pose(i as u8)));
        assert_eq!(data.load_rgb(entry).expect("image"), image(i as u8));
    }
    let files = [".lock", "dataset.toml", "depth", "images", "journal.jsonl", "poses.csv", "session.json"];
    assert_eq!(names(&dir), files);
}

/// With images only, the camera is calibrated, in the window and for other programs.
#[test]
fn images_alone_are_a_session_without_a_robot_and_their_data_set_has_those_in_use() {
    let dir = folder();
    let mut store = Store::create(dir.path(), meta()).expect("create");
    for i in 1..=4 {
        store.add_capture(&Capture::new(&image(i), None)).expect("add");
    }
    let excluded = Edit::SetExcluded { ids: vec![CaptureId(2)], excluded: true };
    store.apply(excluded).expect("exclude");
    let error = store.add_capture(&Capture::new(&image(9), pose(1))).expect_err("of a robot");
    assert!(error.to_string().contains("the others have none: begin a new session"), "{error}");

    let document = Session::open(dir.path()).expect("open").document;
    assert_eq!((&*document, document.mode()), (&**store.document(), None));
    let seen = document.observations((24, 16), |_| Some(Sight { corners: Corners::default(), depth: None }));
    assert_eq!((seen.observations.mode, seen.observations.views.len()), (None, 4));
    let data = Dataset::read(dir.path()).unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<&str> = data.entries.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!((data.mode, data.camera), (None, meta().camera));
    assert_eq!(names, ["images/0001.png", "images/0003.png", "images/0004.png"]);
    let of_session = Session::open(dir.path()).and_then(|session| session.input_sha256()).expect("read");
    assert_eq!(data.input_sha256().expect("read"), of_session);
    let files: Vec<_> = std::fs::read_dir(dir.path().join("images")).expect("a folder").collect();
    assert_eq!(files.len(), 4, "what was refused left nothing behind");

    let other = folder();
    let mut with_robot = store_with(other.path(), 1);
    let error = with_robot.add_capture(&Capture::new(&image(2), None)).expect_err("of no robot");
    assert!(error.to_string().contains("the others have one: begin a new session"), "{error}");
}

#[test]
fn the_dataset_has_the_captures_in_use_and_no_others() {
    let dir = folder();
    let mut store = store_with(dir.path(), 5);
    let in_dataset = |folder: &Path| -> Vec<String> {
        let data = Dataset::read(folder).unwrap_or_else(|e| panic!("{e}"));
        data.entries.into_iter().map(|entry| entry.name).collect()
    };
    store.apply(Edit::DeleteCaptures(vec![CaptureId(1)])).expect("delete");
    store.apply(Edit::SetExcluded { ids: vec![CaptureId(2)], excluded: true }).expect("exclude");
    store.apply(Edit::SetRole { ids: vec![CaptureId(4)], role: Role::Verification }).expect("outlier");
    assert_eq!(in_dataset(dir.path()), ["images/0003.png", "images/0005.png"]);
    store.undo().expect("undo");
    assert_eq!(in_dataset(dir.path()), ["images/0003.png", "images/0004.png", "images/0005.png"]);
    let target = TargetSpec::Circles(Grid { columns: 5, rows: 4, square_m: 0.02 });
    store.apply(Edit::SetTarget(target)).expect("another target");
    assert_eq!(Dataset::read(dir.path()).expect("a data set").target, target);
}

#[test]
fn an_empty_folder_is_not_a_session() {
    let dir = folder();
    for error in [Session::open(dir.path()).expect_err("empty"), Store::open(dir.path()).expect_err("empty")] {
        assert!(matches!(error.problem, SessionProblem::NotASession), "{error}");
    }
    assert_eq!(names(dir.path()), Vec::<String>::new(), "a lock was left in a folder that is not a session");
    assert!(Session::open(&dir.path().join("none")).is_err() && Store::open(&dir.path().join("none")).is_err());
}

/// The text of a `session.json` of version 1.0, as it was written before there were journals.
pub(super) fn old_document(images: &[&str]) -> String {
    let captures: Vec<serde_json::Value> = images
        .iter()
        .map(|image| {
            serde_json::json!({
                "image": image, "depth": null, "joints_rad": [0.5], "sim_time_s": 1.25,
                "base_from_tip": {"translation_m": [0.1, 0.2, 0.3], "rotation_xyzw": [0.0, 0.0, 0.6, 0.8]}
            })
        })
        .collect();
    let mut text = serde_json::to_value(meta()).expect("meta");
    text["format"] = "handeye-session".into();
    text["version"] = "1.0".into();
    text["captures"] = captures.into();
    text.to_string()
}

pub(super) fn old_session(folder: &Path, images: &[&str]) {
    fs::create_dir_all(folder.join("images")).expect("folder");
    for (i, name) in images.iter().enumerate() {
        image(i as u8).save(folder.join(name)).expect("image");
    }
    fs::write(folder.join(DOCUMENT), old_document(images)).expect("write");
}

#[test]
fn a_session_without_a_journal_opens_and_gets_one() {
    let dir = folder();
    old_session(dir.path(), &["images/0003.png", "images/first.png", "images/0007.png"]);
    let read = Session::open(dir.path()).expect("read");
    let ids: Vec<u32> = read.document.captures.iter().map(|capture| capture.id.0).collect();
    assert_eq!(ids, [3, 8, 7]);
    assert_eq!(read.document.captures[0].frames, 1);
    assert_eq!(names(dir.path()), ["images", "session.json"], "reading has changed the folder");

    let mut store = Store::open(dir.path()).expect("open");
    assert_eq!(*store.document(), read.document);
    assert_eq!(store.add_capture(&Capture::new(&image(9), pose(9))).expect("add"), CaptureId(9));
    store.apply(Edit::DeleteCaptures(vec![CaptureId(9)])).expect("delete");
    drop(store);
    let mut store = Store::open(dir.path()).expect("open again");
    assert_eq!(*store.document(), read.document);
    store.undo().expect("undo");
    assert_eq!(store.load_rgb(&store.document().captures[3]).expect("image"), image(9));
}

#[test]
fn a_damaged_old_session_is_an_error_that_names_the_file() {
    let dir = folder();
    old_session(dir.path(), &["images/0001.png"]);
    let path = dir.path().join(DOCUMENT);
    let good = fs::read_to_string(&path).expect("text");
    let cases = [
        ("\"1.0\"", "\"2.0\"", "version \"2.0\""),
        ("\"1.0\"", "\"one\"", "version \"one\""),
        ("\"handeye-session\"", "\"jupyter\"", "format is \"jupyter\""),
        ("images/0001.png", "images/0009.png", "images/0009.png"),
        ("images/0001.png", "../0001.png", "not inside of the session"),
        ("\"rotation_xyzw\":[0.0,0.0,0.6,", "\"rotation_xyzw\":[9.0,9.0,9.0,", "not a unit quaternion"),
        ("\"square_m\":0.015", "\"square_m\":-1", "square_m"),
        ("\"mode\":\"eye_in_hand\"", "\"mode\":\"eye\"", "eye"),
        ("\"captures\"", "\"capture\"", "captures"),
    ];
    for (from, to, needle) in cases {
        assert!(good.contains(from), "{from}");
        fs::write(&path, good.replace(from, to)).expect("write");
        for error in [Session::open(dir.path()).expect_err(to), Store::open(dir.path()).expect_err(to)] {
            let error = error.to_string();
            assert!(error.contains(needle) && !error.contains('\n'), "{to}: {error}");
        }
    }
    for cut in [0, 10, good.len() / 2, good.len() - 3] {
        fs::write(&path, &good[..cut]).expect("write");
        assert!(Store::open(dir.path()).is_err());
        let error = Store::create(dir.path(), meta()).expect_err("a damaged session is not thrown away");
        assert!(matches!(error.problem, SessionProblem::Exists), "{error}");
    }
    fs::write(&path, good.replace("\"1.0\"", "\"1.7\"").replacen('{', "{\"later\": 1,", 1)).expect("write");
    assert!(Session::open(dir.path()).is_ok(), "a newer minor version reads");
}
