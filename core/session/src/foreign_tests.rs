//! Sessions of another user, with links in them.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use crate::tests::{folder, image, names, pose, store_with};
use crate::{Capture, CaptureId, Edit, Session, Store};
use handeye_dataset::Dataset;
use handeye_result::CalibrationResult;

const PRECIOUS: &str = "years of work";

/// A session with two captures, next to a file and a folder of the user.
struct Home(tempfile::TempDir);

impl Home {
    fn new() -> Self {
        let home = Self(folder());
        drop(store_with(&home.session(), 2));
        fs::write(home.precious(), PRECIOUS).expect("written");
        fs::create_dir(home.elsewhere()).expect("a folder");
        home
    }

    fn session(&self) -> PathBuf {
        self.0.path().join("session")
    }

    fn precious(&self) -> PathBuf {
        self.0.path().join("precious")
    }

    fn elsewhere(&self) -> PathBuf {
        self.0.path().join("elsewhere")
    }

    /// Puts a link in the place of a file or folder of the session, which moves to where the link leads.
    fn link_away(&self, name: &str) -> PathBuf {
        let (from, to) = (self.session().join(name), self.elsewhere().join(name));
        fs::rename(&from, &to).expect("moved");
        symlink(&to, &from).expect("a link");
        to
    }

    fn assert_untouched(&self) {
        assert_eq!(fs::read_to_string(self.precious()).expect("read"), PRECIOUS);
    }
}

/// Everything that a window does to a session.
fn use_all(folder: &Path) {
    let mut store = Store::open(folder).expect("open");
    store.add_capture(&Capture::new(&image(3), pose(3))).expect("add");
    store.apply(Edit::SetExcluded { ids: vec![CaptureId(1)], excluded: true }).expect("exclude");
    store.write_result(&CalibrationResult::default()).expect("result");
    store.undo().expect("undo");
}

#[test]
fn links_in_the_place_of_files_are_replaced_and_what_they_lead_to_stays() {
    let home = Home::new();
    // Both what is written and the names under which earlier programs began to write.
    for name in ["session.json", "dataset.toml", "poses.csv", "result.json", "images/0003.png"] {
        let path = home.session().join(name);
        let hidden = path.with_file_name(format!(".{}.partial", path.file_name().expect("a name").to_string_lossy()));
        symlink(home.precious(), hidden).expect("a link");
        drop(fs::remove_file(&path));
        if name == "session.json" {
            // Not a link to a foreign document: such a link is not replaced either.
            symlink(home.0.path().join("not-there"), &path).expect("a link");
        } else {
            symlink(home.precious(), &path).expect("a link");
        }
    }
    use_all(&home.session());
    home.assert_untouched();
    assert!(!home.0.path().join("not-there").exists());
    assert_eq!(Session::open(&home.session()).expect("open").document.captures.len(), 3);
}

#[test]
fn a_journal_a_lock_or_a_folder_of_images_that_is_a_link_is_refused_before_anything_is_written() {
    for name in ["journal.jsonl", ".lock", "images", "depth"] {
        let home = Home::new();
        let away = home.link_away(name);
        let before = (fs::read(&away).ok(), away.is_dir().then(|| names(&away)));
        let error = Store::open(&home.session()).expect_err(name).to_string();
        assert!(error.contains(name) && error.contains("is a link"), "{name}: {error}");
        assert_eq!((fs::read(&away).ok(), away.is_dir().then(|| names(&away))), before, "{name}");
    }
}

#[test]
fn a_pipe_in_the_place_of_a_file_is_no_file_to_wait_for() {
    for name in ["journal.jsonl", "session.json", ".lock"] {
        let home = Home::new();
        fs::remove_file(home.session().join(name)).expect("removed");
        let made = std::process::Command::new("mkfifo").arg(home.session().join(name)).status();
        assert!(made.expect("mkfifo").success());
        match Store::open(&home.session()) {
            Err(error) => assert!(error.to_string().contains("is not a file"), "{name}: {error}"),
            // It follows from the journal, and is written again.
            Ok(_) => assert_eq!(name, "session.json"),
        }
    }
}

#[test]
fn a_copy_is_never_made_through_a_link_that_waits_for_it() {
    let home = Home::new();
    fs::write(home.elsewhere().join(".lock"), "").expect("written");
    fs::write(home.elsewhere().join("thesis.tex"), PRECIOUS).expect("written");
    symlink(home.elsewhere(), home.0.path().join(".copy.partial")).expect("a link");
    let store = Store::open(&home.session()).expect("open");
    assert!(store.save_as(&home.0.path().join("copy")).is_err());
    assert_eq!(names(&home.elsewhere()), [".lock", "thesis.tex"]);
}

#[test]
fn what_interrupted_writes_have_left_is_cleared_and_nothing_else() {
    let home = Home::new();
    let left = [".session.json.a1B2c3.partial", ".poses.csv.partial", "images/.0003.png.XyZ123.partial"];
    let mine = [".notes.partial", ".result.json.a1B2c3.partial", "images/.holiday.png.a1B2c3.partial"];
    for name in left.iter().chain(&mine) {
        fs::write(home.session().join(name), "half").expect("written");
    }
    drop(Store::open(&home.session()).expect("open"));
    for name in left {
        assert!(!home.session().join(name).exists(), "{name}");
    }
    for name in mine {
        assert!(home.session().join(name).exists(), "{name}");
    }
}

#[test]
fn a_pose_table_of_a_session_names_nothing_outside_and_that_of_a_data_set_may() {
    let home = Home::new();
    fs::copy(home.session().join("images/0001.png"), home.0.path().join("private.png")).expect("copied");
    let table = home.session().join("poses.csv");
    let good = fs::read_to_string(&table).expect("text");
    fs::write(&table, good.replace("images/0001.png", "images/../../private.png")).expect("written");
    let error = Dataset::read(&home.session()).expect_err("outside").to_string();
    assert!(error.contains("poses.csv, row 2") && error.contains("../private.png"), "{error}");
    assert!(error.contains("not inside of the session"), "{error}");

    let data = home.0.path().join("data");
    fs::create_dir(&data).expect("a folder");
    for name in ["dataset.toml", "poses.csv"] {
        let text = fs::read_to_string(home.session().join(name)).expect("text");
        fs::write(
            data.join(name),
            text.replace("images/0002.png", "../session/images/0002.png").replace("images/../../", "../"),
        )
        .expect("written");
    }
    let read = Dataset::read(&data).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(read.outside, ["../private.png", "../session/images/0002.png"]);
    for entry in &read.entries {
        read.load_rgb(entry).unwrap_or_else(|e| panic!("{e}"));
    }
}

#[test]
fn journal_and_images_alone_are_the_session() {
    let home = Home::new();
    let whole = Session::open(&home.session()).expect("open");
    let of_data_set = Dataset::read(&home.session()).expect("a data set").input_sha256().expect("a digest");
    assert_eq!(whole.input_sha256().expect("a digest"), of_data_set);
    for name in ["session.json", "dataset.toml", "poses.csv", ".lock"] {
        fs::remove_file(home.session().join(name)).expect("removed");
    }
    fs::remove_dir_all(home.session().join("depth")).expect("removed");
    let bare = Session::open(&home.session()).expect("open");
    assert_eq!(bare.document, whole.document);
    assert_eq!(bare.image_size().expect("images"), Some((24, 16)));
    assert_eq!(bare.input_sha256().expect("a digest"), of_data_set);
    assert_eq!(names(&home.session()), ["images", "journal.jsonl"], "reading has changed the folder");
}

#[test]
fn depth_that_is_gone_is_missed_where_it_is_needed() {
    let home = folder();
    let mut store = store_with(home.path(), 0);
    let (rgb, depth) = (image(1), crate::tests::depth());
    store.add_capture(&Capture { depth_m: Some(&depth), ..Capture::new(&rgb, pose(1)) }).expect("add");
    drop(store);
    fs::remove_file(home.path().join("depth/0001.tiff")).expect("removed");
    let session = Session::open(home.path()).expect("a calibration needs no depth");
    let error = session.load_depth_m(&session.document.captures[0]).expect_err("gone").to_string();
    assert!(error.contains("depth/0001.tiff"), "{error}");
    let error = Store::open(home.path()).expect_err("a session is written whole").to_string();
    assert!(error.contains("depth/0001.tiff") && error.contains("bring it back"), "{error}");
    image(1).save(home.path().join("images/0001.png")).expect("saved");
    fs::remove_file(home.path().join("images/0001.png")).expect("removed");
    assert!(Session::open(home.path()).expect_err("gone").to_string().contains("images/0001.png"));
}

#[test]
fn images_of_two_sizes_are_of_two_cameras() {
    let home = Home::new();
    ::image::RgbImage::new(48, 32).save(home.session().join("images/0002.png")).expect("saved");
    let error = Session::open(&home.session()).expect("open").image_size().expect_err("two sizes").to_string();
    assert!(error.contains("images/0002.png") && error.contains("48×32") && error.contains("24×16"), "{error}");
}
