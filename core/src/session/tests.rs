use image::Rgb;
use nalgebra::Matrix3;

use super::*;
use crate::camera::{Distortion, Intrinsics};
use crate::dataset::{CameraInput, Dataset};
use crate::frames::{Base, Pose, Tip};
use crate::handeye::{HandEye, Mode};
use crate::target::{Grid, TargetSpec};

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
        camera: Some(CameraInput { fixed: false, intrinsics: Some(intrinsics), model: intrinsics.distortion }),
        seeds: [("scene".to_owned(), u64::MAX)].into(),
        ground_truth: Some(GroundTruth::new(&links, Some(intrinsics))),
    }
}

/// A capture as documents have it; there need not be files.
pub(super) fn record(id: u32) -> CaptureRecord {
    CaptureRecord {
        id: CaptureId(id),
        image: format!("images/{id:04}.png"),
        depth: (id % 2 == 0).then(|| format!("depth/{id:04}.tiff")),
        base_from_tip: pose(id as u8),
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

fn image(seed: u8) -> RgbImage {
    RgbImage::from_fn(24, 16, |x, y| Rgb([seed, (x * 9) as u8, (y * 13) as u8]))
}

fn pose(i: u8) -> Pose<Base, Tip> {
    let q = [0.1, -0.2 * f64::from(i), 0.3, -0.7];
    Pose::from_translation_xyzw([0.1 / 3.0, f64::from(i), -1e-9], q)
}

fn capture(image: &RgbImage, i: u8) -> Capture<'_> {
    Capture { image, depth_m: None, base_from_tip: pose(i), joints_rad: None, sim_time_s: None }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn names(folder: &Path) -> Vec<String> {
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
    let mut writer = SessionWriter::create(&dir, meta()).expect("create");
    let depth =
        DepthImage::new(24, 16, (0..24 * 16).map(|i| 0.3 + 0.0001 * i as f32).collect()).expect("as many as pixels");
    let joints = [0.1, -0.2, 0.3, 0.4, 0.5, 1.0 / 3.0];
    for i in 0..3 {
        let image = image(i);
        let with_depth = (i != 1).then_some(&depth);
        let full =
            Capture { depth_m: with_depth, joints_rad: Some(&joints), sim_time_s: Some(0.05), ..capture(&image, i) };
        let record = writer.add_capture(&full).expect("add");
        assert_eq!(record.image, format!("images/000{}.png", i + 1));
    }
    let session = Session::open(&dir).expect("open");
    assert_eq!(session.meta, meta());
    assert_eq!(session.captures, writer.captures());
    assert_eq!(session.captures[0].joints_rad.as_deref(), Some(&joints[..]));
    assert_eq!(session.load_rgb(&session.captures[2]).expect("image"), image(2));
    assert_eq!(session.load_depth_m(&session.captures[2]).expect("depth"), Some(depth));
    assert_eq!(session.load_depth_m(&session.captures[1]).expect("no depth"), None);
    let truth = session.meta.ground_truth.as_ref().expect("truth");
    assert!(truth.links(Mode::EyeInHand).is_some() && truth.links(Mode::EyeToHand).is_none());

    let data = Dataset::read(&dir).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((data.mode, data.target, data.camera), (Some(Mode::EyeInHand), meta().target, meta().camera));
    for (i, (entry, record)) in data.entries.iter().zip(&session.captures).enumerate() {
        let bits = |m: &Matrix3<f64>| m.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let rotation = |p: &Pose<Base, Tip>| bits(p.rotation().to_rotation_matrix().matrix());
        let read = entry.base_from_tip.expect("a pose");
        assert_eq!(entry.name, record.image);
        assert_eq!((read.translation(), rotation(&read)), (pose(i as u8).translation(), rotation(&pose(i as u8))));
        assert_eq!(rotation(&record.base_from_tip), rotation(&pose(i as u8)));
        assert_eq!(data.load_rgb(entry).expect("image"), image(i as u8));
    }
    assert_eq!(names(&dir), ["dataset.toml", "depth", "images", "poses.csv", "session.json"]);
}

#[test]
fn a_folder_of_something_else_is_never_overwritten() {
    let home = folder();
    fs::write(home.path().join("thesis.tex"), "years of work").expect("write");
    let error = SessionWriter::create(home.path(), meta()).expect_err("not empty");
    assert!(matches!(error.problem, SessionProblem::NotEmpty) && error.is_bad_input(), "{error}");
    assert_eq!(names(home.path()), ["thesis.tex"]);

    let other = folder();
    fs::write(other.path().join("session.json"), "{\"format\": \"jupyter\"}").expect("write");
    let error = SessionWriter::create(other.path(), meta()).expect_err("another program's");
    assert!(matches!(error.problem, SessionProblem::Format(_)), "{error}");
    fs::write(other.path().join("session.json"), "{\"format\": \"handeye-session\", \"version\": \"2.0\"}")
        .expect("write");
    let error = SessionWriter::create(other.path(), meta()).expect_err("a newer one");
    assert!(matches!(error.problem, SessionProblem::Version { .. }), "{error}");
    assert_eq!(names(other.path()), ["session.json"]);
}

#[test]
fn a_session_is_replaced_by_a_new_one_without_the_old_captures() {
    let dir = folder();
    let mut writer = SessionWriter::create(dir.path(), meta()).expect("create");
    for i in 0..2 {
        writer.add_capture(&capture(&image(i), i)).expect("add");
    }
    fs::write(dir.path().join("notes.txt"), "mine").expect("write");
    let mut writer = SessionWriter::create(dir.path(), meta()).expect("create again");
    assert_eq!(names(&dir.path().join("images")), Vec::<String>::new());
    writer.add_capture(&capture(&image(7), 7)).expect("add");
    let session = Session::open(dir.path()).expect("open");
    assert_eq!(session.captures.len(), 1);
    assert_eq!(session.load_rgb(&session.captures[0]).expect("image"), image(7));
    assert!(dir.path().join("notes.txt").exists());
}

#[test]
fn a_resumed_session_goes_on_behind_its_last_capture() {
    let dir = folder();
    SessionWriter::create(dir.path(), meta()).expect("create").add_capture(&capture(&image(0), 0)).expect("add");
    // What an interrupted capture leaves: an image and a row that the document does not know, and a half file.
    let orphan = dir.path().join("images/0002.png");
    fs::copy(dir.path().join("images/0001.png"), &orphan).expect("copy");
    let table = dir.path().join("poses.csv");
    let rows = fs::read_to_string(&table).expect("text") + "images/0002.png,0,0,0,0,0,0,1\n";
    fs::write(&table, rows).expect("write");
    fs::write(dir.path().join(".session.json.partial"), "{\"for").expect("write");
    assert_eq!(Session::open(dir.path()).expect("open").captures.len(), 1);
    assert_eq!(Dataset::read(dir.path()).expect("a data set").entries.len(), 2);

    let mut writer = SessionWriter::resume(dir.path()).expect("resume");
    assert_eq!(Dataset::read(dir.path()).expect("a data set").entries.len(), 1);
    let record = writer.add_capture(&capture(&image(5), 5)).expect("add").clone();
    assert_eq!(record.image, "images/0002.png");
    let session = Session::open(dir.path()).expect("open");
    assert_eq!(session.load_rgb(&session.captures[1]).expect("image"), image(5));
    assert_eq!(session.meta, meta());
}

#[test]
fn a_capture_that_would_spoil_the_session_is_refused_and_leaves_it_as_it_was() {
    let dir = folder();
    let mut writer = SessionWriter::create(dir.path(), meta()).expect("create");
    let good = image(0);
    writer.add_capture(&capture(&good, 0)).expect("add");
    let before = fs::read(dir.path().join("session.json")).expect("bytes");
    let nan = Pose::from_translation_xyzw([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
    let depth = DepthImage::new(3, 3, vec![0.5; 9]).expect("nine");
    let other_size = RgbImage::new(25, 16);
    let wrong = [
        Capture { base_from_tip: nan, ..capture(&good, 0) },
        Capture { depth_m: Some(&depth), ..capture(&good, 0) },
        Capture { joints_rad: Some(&[f64::INFINITY]), ..capture(&good, 0) },
        Capture { sim_time_s: Some(f64::NAN), ..capture(&good, 0) },
        capture(&other_size, 0),
    ];
    for capture in wrong {
        let error = writer.add_capture(&capture).expect_err("a spoiled capture").to_string();
        assert!(error.contains("images/0002.png") && !error.contains('\n'), "{error}");
    }
    assert_eq!(writer.captures().len(), 1);
    assert_eq!(fs::read(dir.path().join("session.json")).expect("bytes"), before);
    assert!(Dataset::read(dir.path()).is_ok());
}

#[test]
fn a_damaged_session_is_an_error_that_names_the_file() {
    let dir = folder();
    let mut writer = SessionWriter::create(dir.path(), meta()).expect("create");
    writer.add_capture(&capture(&image(0), 0)).expect("add");
    let path = dir.path().join("session.json");
    let good = fs::read_to_string(&path).expect("text");
    let cases = [
        ("\"1.1\"", "\"2.0\"", "version \"2.0\""),
        ("\"1.1\"", "\"one\"", "version \"one\""),
        ("images/0001.png", "images/0009.png", "images/0009.png"),
        ("images/0001.png", "../0001.png", "not inside of the session"),
        ("\"rotation_xyzw\": [", "\"rotation_xyzw\": [9.0, 9.0, 9.0, 9.0], \"was\": [", "not a unit quaternion"),
        ("\"square_m\": 0.015", "\"square_m\": -1", "square_m"),
        ("\"mode\": \"eye_in_hand\"", "\"mode\": \"eye\"", "eye"),
        ("\"captures\"", "\"capture\"", "captures"),
    ];
    for (from, to, needle) in cases {
        assert!(good.contains(from), "{from}");
        // The last pose in the file is that of the capture.
        let at = good.rfind(from).expect("there");
        fs::write(&path, format!("{}{to}{}", &good[..at], &good[at + from.len()..])).expect("write");
        let error = Session::open(dir.path()).expect_err(to).to_string();
        assert!(error.contains(needle) && !error.contains('\n'), "{to}: {error}");
    }
    for cut in [0, 10, good.len() / 2, good.len() - 3] {
        fs::write(&path, &good[..cut]).expect("write");
        assert!(Session::open(dir.path()).is_err());
        assert!(SessionWriter::create(dir.path(), meta()).is_err(), "a damaged session is not thrown away");
    }
    fs::write(&path, good.replace("\"1.1\"", "\"1.7\"").replacen('{', "{\"later\": 1,", 1)).expect("write");
    assert!(Session::open(dir.path()).is_ok(), "a newer minor version reads");
}

#[test]
fn an_empty_folder_is_not_a_session() {
    let dir = folder();
    let error = Session::open(dir.path()).expect_err("empty");
    assert!(matches!(error.problem, SessionProblem::NotASession), "{error}");
    assert!(Session::open(&dir.path().join("none")).is_err());
}
