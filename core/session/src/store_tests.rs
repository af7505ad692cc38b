use image::RgbImage;

use super::*;
use crate::tests::{depth, folder, image, meta, names, old_session, pose, store_with};
use crate::{EditError, Role};
use handeye_dataset::Dataset;
use handeye_geometry::frames::Pose;

fn exclude(id: u32, excluded: bool) -> Edit {
    Edit::SetExcluded { ids: vec![CaptureId(id)], excluded }
}

fn delete(id: u32) -> Edit {
    Edit::DeleteCaptures(vec![CaptureId(id)])
}

/// Everything in a folder and below, with content.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for name in names(folder) {
        let path = folder.join(name);
        if path.is_dir() {
            all.extend(content(&path));
        } else {
            all.push((path.clone(), fs::read(&path).expect("read")));
        }
    }
    all
}

#[test]
fn what_was_done_and_undone_is_there_after_closing() {
    let dir = folder();
    let mut store = store_with(dir.path(), 3);
    store.apply(exclude(2, true)).expect("exclude");
    store.apply(delete(1)).expect("delete");
    store.undo().expect("undo");
    let (history, sequence) = (store.history().clone(), store.sequence());
    drop(store);
    let mut store = Store::open(dir.path()).expect("open");
    assert_eq!((store.history(), store.sequence()), (&history, sequence));
    assert_eq!((store.history().undo_edit(), store.history().redo_edit()), (Some(&exclude(2, true)), Some(&delete(1))));
    store.redo().expect("redo");
    assert_eq!(store.document().capture(CaptureId(1)), None);
    for _ in 0..2 {
        store.undo().expect("undo");
    }
    assert_eq!(store.load_rgb(&store.document().captures[0]).expect("image"), image(1));
    for _ in 0..3 {
        store.undo().expect("undo of a capture");
    }
    assert!(matches!(store.undo().expect_err("all is undone").problem, SessionProblem::Edit(EditError::NothingToUndo)));
    assert_eq!(store.add_capture(&Capture::new(&image(9), pose(9))).expect("add"), CaptureId(4), "numbers stay used");
}

#[test]
fn a_session_begins_again_until_the_first_capture_was_in_it() {
    let dir = folder();
    let mut store = store_with(dir.path(), 0);
    let other = |store: &Store| {
        let mut document = (**store.document()).clone();
        document.meta.created.push('!');
        document
    };
    let document = other(&store);
    assert!(store.begin_again(document.clone()).expect("begin again"));
    assert!(!store.begin_again(document.clone()).expect("the same"));
    let sequence = store.sequence();
    drop(store);
    let mut store = Store::open(dir.path()).expect("open");
    assert_eq!((&**store.document(), store.sequence()), (&document, sequence));

    store.add_capture(&Capture::new(&image(1), pose(1))).expect("add");
    store.apply(delete(1)).expect("delete");
    let before = content(dir.path());
    let document = other(&store);
    assert!(!store.begin_again(document).expect("it had a capture"));
    assert_eq!(content(dir.path()), before);
    store.undo().expect("the capture comes back");
}

#[test]
fn create_never_replaces_anything() {
    let home = folder();
    let session = home.path().join("session");
    drop(store_with(&session, 1));
    let other = home.path().join("other");
    fs::create_dir(&other).expect("folder");
    fs::write(other.join("thesis.tex"), "years of work").expect("write");
    let before = content(home.path());
    let error = Store::create(&session, meta()).expect_err("a session");
    assert!(matches!(error.problem, SessionProblem::Exists), "{error}");
    let error = Store::create(&other, meta()).expect_err("not empty");
    assert!(matches!(error.problem, SessionProblem::NotEmpty), "{error}");
    assert_eq!(content(home.path()), before);

    let mut unusable = meta();
    unusable.target = handeye_geometry::targets::TargetSpec::Circles(handeye_geometry::targets::Grid {
        columns: 1,
        rows: 1,
        square_m: 0.0,
    });
    let fresh = home.path().join("fresh");
    assert!(matches!(Store::create(&fresh, unusable).expect_err("no grid").problem, SessionProblem::Edit(_)));
    assert!(!fresh.exists());
    // The folder as left when the program was killed before the session began.
    fs::create_dir(&fresh).expect("folder");
    for name in [".lock", ".journal.jsonl.partial", ".session.json.partial"] {
        fs::write(fresh.join(name), "{\"se").expect("write");
    }
    Store::create(&fresh, meta()).expect("an interrupted beginning is no obstacle");
}

#[test]
fn a_session_is_open_for_writing_once_and_for_reading_always() {
    let dir = folder();
    let store = store_with(dir.path(), 1);
    let error = Store::open(dir.path()).expect_err("locked");
    assert!(matches!(error.problem, SessionProblem::Locked), "{error}");
    assert!(error.to_string().contains("is open in another program"), "{error}");
    assert_eq!(Session::open(dir.path()).expect("reading").document, *store.document());
    drop(store);
    Store::open(dir.path()).expect("free again");
}

#[test]
fn a_change_that_does_not_fit_leaves_every_file_as_it_was() {
    let dir = folder();
    let mut store = store_with(dir.path(), 1);
    let before = (content(dir.path()), store.history().clone());
    let good = image(0);
    let nan = Pose::from_translation_xyzw([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
    let small = DepthImage::new(3, 3, vec![0.5; 9]).expect("nine");
    let (other_size, nothing) = (RgbImage::new(25, 16), RgbImage::new(0, 0));
    let capture = Capture::new(&good, pose(0));
    let wrong = [
        Capture { base_from_tip: Some(nan), ..capture },
        Capture { depth_m: Some(&small), ..capture },
        Capture { joints_rad: Some(&[f64::INFINITY]), ..capture },
        Capture { sim_time_s: Some(f64::NAN), ..capture },
        Capture { frames: 0, ..capture },
        Capture { corner_noise_px: Some(f64::NAN), ..capture },
        Capture { image: &other_size, ..capture },
        Capture { image: &nothing, ..capture },
    ];
    for capture in wrong {
        let error = store.add_capture(&capture).expect_err("a spoiled capture");
        assert!(matches!(error.problem, SessionProblem::Edit(EditError::Bad { .. })), "{error}");
        assert!(error.to_string().contains("capture 2 (images/0002.png)"), "{error}");
    }
    let not_there = crate::tests::record(2);
    let nan_record = CaptureRecord { sim_time_s: Some(f64::NAN), ..not_there.clone() };
    for edit in [exclude(7, true), exclude(1, false), delete(7), Edit::AddCapture(Box::new(nan_record))] {
        let error = store.apply(edit).expect_err("does not fit");
        assert!(matches!(error.problem, SessionProblem::Edit(_)), "{error}");
    }
    let error = store.apply(Edit::AddCapture(Box::new(not_there))).expect_err("has no files");
    assert!(matches!(error.problem, SessionProblem::Unreadable(_)), "{error}");
    assert!(matches!(
        store.redo().expect_err("nothing undone").problem,
        SessionProblem::Edit(EditError::NothingToRedo)
    ));
    let deep = (0..200).fold(serde_json::Value::Null, |inner, _| serde_json::json!([inner]));
    let error = store.apply(Edit::SetExportNames(deep)).expect_err("could not be read again");
    assert!(matches!(error.problem, SessionProblem::Json(_)), "{error}");
    assert_eq!((content(dir.path()), store.history().clone()), before);
}

#[test]
fn a_capture_does_not_come_back_without_its_files() {
    let dir = folder();
    let mut store = store_with(dir.path(), 2);
    store.apply(delete(2)).expect("delete");
    fs::remove_file(dir.path().join("images/0002.png")).expect("remove");
    let error = store.undo().expect_err("the image is gone");
    assert!(error.to_string().contains("images/0002.png"), "{error}");
    assert_eq!(store.document().captures.len(), 1);
    drop(store);
    Store::open(dir.path()).expect("the session without it is whole");
    fs::remove_file(dir.path().join("images/0001.png")).expect("remove");
    assert!(Store::open(dir.path()).expect_err("gone").to_string().contains("images/0001.png"));
}

#[test]
fn left_over_files_of_an_interrupted_capture_do_no_harm() {
    let dir = folder();
    drop(store_with(dir.path(), 1));
    fs::copy(dir.path().join("images/0001.png"), dir.path().join("images/0002.png")).expect("copy");
    fs::write(dir.path().join("images/.0003.png.partial"), "\u{89}PN").expect("write");
    fs::write(dir.path().join(".session.json.partial"), "{\"for").expect("write");
    let mut store = Store::open(dir.path()).expect("open");
    assert_eq!(store.add_capture(&Capture::new(&image(5), pose(5))).expect("add"), CaptureId(2));
    assert_eq!(store.load_rgb(&store.document().captures[1]).expect("image"), image(5));
}

#[test]
fn files_that_lag_behind_the_journal_are_written_again() {
    let dir = folder();
    let mut store = store_with(dir.path(), 2);
    let old = ["session.json", "poses.csv", "dataset.toml"].map(|name| {
        let path = dir.path().join(name);
        (fs::read(&path).expect("read"), path)
    });
    store.apply(exclude(1, true)).expect("exclude");
    store.apply(Edit::SetMode(handeye_estimate::handeye::Mode::EyeToHand)).expect("mode");
    drop(store);
    let new = content(dir.path());
    for (bytes, path) in &old {
        fs::write(path, bytes).expect("write");
    }
    let read = Session::open(dir.path()).expect("reading sees the journal");
    assert!(read.document.captures[0].excluded);
    drop(Store::open(dir.path()).expect("open"));
    assert_eq!(content(dir.path()), new);
    // Missing or damaged, they follow from the journal just the same.
    for (_, path) in &old {
        fs::remove_file(path).expect("remove");
    }
    drop(Store::open(dir.path()).expect("open"));
    assert_eq!(content(dir.path()), new);
    for (bytes, path) in &old {
        fs::write(path, &bytes[..bytes.len() / 2]).expect("write");
    }
    drop(Store::open(dir.path()).expect("open"));
    assert_eq!(content(dir.path()), new);
}

#[test]
fn a_document_by_an_older_program_is_not_overwritten() {
    let dir = folder();
    old_session(dir.path(), &["images/0001.png"]);
    let old = fs::read(dir.path().join(DOCUMENT)).expect("read");
    let mut store = Store::open(dir.path()).expect("open");
    let begun = fs::read(dir.path().join(JOURNAL)).expect("journal");
    store.apply(delete(1)).expect("delete");
    drop(store);
    fs::write(dir.path().join(DOCUMENT), &old).expect("write");
    let error = Store::open(dir.path()).expect_err("two truths");
    assert!(matches!(error.problem, SessionProblem::OlderProgram), "{error}");
    assert_eq!(fs::read(dir.path().join(DOCUMENT)).expect("read"), old);
    // This far a program comes that is killed when it gives an old session its journal.
    fs::write(dir.path().join(JOURNAL), begun).expect("write");
    assert_eq!(Store::open(dir.path()).expect("open").document().captures.len(), 1);
}

#[test]
fn a_change_counts_when_a_file_that_follows_from_it_cannot_be_written() {
    let dir = folder();
    let mut store = store_with(dir.path(), 2);
    let table = dir.path().join("poses.csv");
    fs::remove_file(&table).expect("remove");
    fs::create_dir_all(table.join("in the way")).expect("folder");
    let error = store.apply(delete(1)).expect_err("no table");
    assert!(matches!(error.problem, SessionProblem::Behind(_)), "{error}");
    assert_eq!(error.file, table);
    assert_eq!(store.document().captures.len(), 1);
    assert_eq!(*Session::open(dir.path()).expect("read").document, **store.document());
    fs::remove_dir_all(&table).expect("remove");
    store.apply(exclude(2, true)).expect("exclude");
    store.undo().expect("undo");
    assert_eq!(Dataset::read(dir.path()).expect("a data set").entries.len(), 1);
}

#[test]
fn a_document_that_is_ahead_of_its_journal_says_that_entries_are_missing() {
    let dir = folder();
    let mut store = store_with(dir.path(), 2);
    let journal = fs::read(dir.path().join(JOURNAL)).expect("read");
    store.apply(delete(1)).expect("delete");
    drop(store);
    let whole = content(dir.path());
    fs::write(dir.path().join(JOURNAL), &journal).expect("an older copy");
    for error in [Session::open(dir.path()).expect_err("behind"), Store::open(dir.path()).expect_err("behind")] {
        assert!(matches!(error.problem, SessionProblem::Damaged { row: 4, .. }), "{error}");
        assert!(error.to_string().contains("journal.jsonl") && error.to_string().contains("row 4"), "{error}");
    }
    // The advice of the message, with both outcomes.
    fs::remove_file(dir.path().join(JOURNAL)).expect("move it away");
    let mut store = Store::open(dir.path()).expect("open");
    assert_eq!((store.document().captures.len(), store.history().undo_edit()), (1, None));
    assert!(store.sequence() > 4, "an interruption here would look like a journal that is behind");
    assert_eq!(store.add_capture(&Capture::new(&image(3), pose(3))).expect("add"), CaptureId(3));
    drop(store);
    for (path, bytes) in whole {
        fs::write(path, bytes).expect("bring it back");
    }
    let mut store = Store::open(dir.path()).expect("open");
    store.undo().expect("undo");
    assert_eq!(store.document().captures.len(), 2);
}

#[test]
fn a_copy_is_complete_and_independent() {
    let home = folder();
    let (from, to) = (home.path().join("a"), home.path().join("deep/b"));
    let mut store = store_with(&from, 2);
    let (image, depth) = (image(3), depth());
    store.add_capture(&Capture { depth_m: Some(&depth), ..Capture::new(&image, pose(3)) }).expect("add");
    store.apply(Edit::SetRole { ids: vec![CaptureId(1)], role: Role::Verification }).expect("role");
    store.apply(delete(3)).expect("delete");
    store.write_result(&CalibrationResult::default()).expect("result");
    fs::write(from.join("notes.txt"), "mine").expect("write");
    // The files that an interrupted copy leaves.
    fs::create_dir_all(home.path().join("deep/.b.partial/images")).expect("folder");
    fs::write(home.path().join("deep/.b.partial/.lock"), "").expect("write");
    fs::write(home.path().join("deep/.b.partial/images/0009.png"), "half").expect("write");

    let mut copy = store.save_as(&to).expect("copy");
    assert_eq!((copy.folder(), copy.history(), copy.sequence()), (&*to, store.history(), store.sequence()));
    assert_eq!(names(&home.path().join("deep")), ["b"]);
    let mut files = names(&from);
    files.retain(|name| name != "notes.txt");
    assert_eq!(names(&to), files);
    assert_eq!(names(&to.join("images")), names(&from.join("images")));
    assert_eq!(Dataset::read(&to).expect("a data set").entries.len(), 1);

    let before = content(&from);
    copy.undo().expect("undo");
    let back = copy.document().captures[2].clone();
    assert_eq!(copy.load_rgb(&back).expect("image"), image);
    assert_eq!(copy.load_depth_m(&back).expect("depth"), Some(depth));
    copy.apply(delete(1)).expect("delete");
    assert_eq!(content(&from), before);
    let error = Store::open(&to).expect_err("the copy is open");
    assert!(matches!(error.problem, SessionProblem::Locked), "{error}");
}

#[test]
fn a_copy_never_replaces_anything_and_leaves_nothing_when_it_fails() {
    let home = folder();
    let store = store_with(&home.path().join("a"), 2);
    drop(store_with(&home.path().join("b"), 1));
    fs::create_dir_all(home.path().join("c/inside")).expect("folder");
    fs::create_dir_all(home.path().join(".d.partial")).expect("folder");
    fs::write(home.path().join(".d.partial/mine"), "mine").expect("write");
    fs::create_dir(home.path().join("empty")).expect("folder");
    let before = content(home.path());
    let exists = |goal: &str| store.save_as(&home.path().join(goal)).expect_err(goal).problem;
    assert!(matches!(exists("a"), SessionProblem::Exists));
    assert!(matches!(exists("b"), SessionProblem::Exists));
    assert!(matches!(exists("c"), SessionProblem::NotEmpty));
    assert!(matches!(exists("d"), SessionProblem::NotEmpty));
    assert_eq!(content(home.path()), before);
    drop(store.save_as(&home.path().join("empty")).expect("an empty folder gives way"));

    fs::remove_file(home.path().join("a/images/0002.png")).expect("remove");
    let error = store.save_as(&home.path().join("e")).expect_err("an image is gone");
    assert!(error.to_string().contains("0002.png"), "{error}");
    assert!(!home.path().join("e").exists() && !home.path().join(".e.partial").exists());
}

#[test]
fn an_old_session_of_another_image_size_is_noticed() {
    let dir = folder();
    old_session(dir.path(), &["images/0001.png"]);
    let mut store = Store::open(dir.path()).expect("open");
    let large = RgbImage::new(48, 32);
    assert!(store.add_capture(&Capture::new(&large, pose(1))).is_err());
    store.apply(delete(1)).expect("delete");
    store.add_capture(&Capture::new(&large, pose(1))).expect("the first of its size");
}
