use std::fs;

use super::*;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("list")
        .map(|entry| entry.expect("entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_failed_write_keeps_the_old_content_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("result.json");
    write(&path, b"old").expect("first write");
    // A folder cannot be replaced by a file, so this rename fails after the bytes are written.
    let taken = folder.path().join("taken");
    fs::create_dir_all(taken.join("inside")).expect("a folder in the way");
    assert!(write(&taken, b"new").is_err());
    assert_eq!(fs::read(&path).expect("still there"), b"old");
    assert_eq!(names(folder.path()), ["result.json", "taken"]);
}

#[test]
fn a_new_write_replaces_the_whole_content() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("result.json");
    write(&path, b"a long old content").expect("first write");
    write(&path, b"new").expect("second write");
    assert_eq!(fs::read(&path).expect("read"), b"new");
}

#[test]
fn what_an_interrupted_write_leaves_is_known_by_its_name() {
    for left in [".a.json.partial", ".a.json.Xy12Zw.partial"] {
        assert!(is_partial(left, "a.json"), "{left}");
    }
    for other in ["a.json", "a.json.partial", ".a.json", ".b.json.x.partial", ".a.jsonl.x.partial", ".a.json.xpartial"]
    {
        assert!(!is_partial(other, "a.json"), "{other}");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let partial = partial(&folder.path().join("a.json")).expect("a file");
    let name = partial.path().file_name().expect("a name").to_string_lossy().into_owned();
    assert!(is_partial(&name, "a.json"), "{name}");
}

#[cfg(unix)]
mod links {
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    use super::*;

    #[test]
    fn a_link_in_the_place_of_the_file_is_replaced_and_never_followed() {
        let home = tempfile::tempdir().expect("a temporary folder");
        let precious = home.path().join("precious");
        fs::write(&precious, "years of work").expect("written");
        let folder = home.path().join("foreign");
        fs::create_dir(&folder).expect("a folder");
        for name in ["result.json", ".result.json.partial", "track.json", ".track.json.partial"] {
            symlink(&precious, folder.join(name)).expect("a link");
        }
        symlink(home.path().join("not-there"), folder.join("dangling.json")).expect("a link");

        write(&folder.join("result.json"), b"new").expect("written");
        write(&folder.join("dangling.json"), b"new").expect("written");
        create(&folder.join("track.json")).expect("created").write_all(b"new").expect("written");

        assert_eq!(fs::read_to_string(&precious).expect("read"), "years of work");
        assert!(!home.path().join("not-there").exists());
        for name in ["result.json", "dangling.json", "track.json"] {
            let path = folder.join(name);
            assert!(fs::symlink_metadata(&path).expect("there").is_file(), "{name} is still a link");
            assert_eq!(fs::read(&path).expect("read"), b"new", "{name}");
        }
    }

    #[test]
    fn a_linked_folder_is_followed_by_its_user_and_not_inside_of_a_session_or_a_data_set() {
        let home = tempfile::tempdir().expect("a temporary folder");
        let elsewhere = home.path().join("elsewhere");
        let foreign = home.path().join("foreign");
        fs::create_dir_all(elsewhere.join("deep")).expect("a folder");
        fs::create_dir(&foreign).expect("a folder");
        symlink(&elsewhere, foreign.join("exports")).expect("a link");
        write(&foreign.join("exports/a.yaml"), b"mine").expect("a link that a user made");
        for mark in ["session.json", "journal.jsonl", "dataset.toml"] {
            fs::write(foreign.join(mark), "").expect("written");
            for inside in ["exports/a.yaml", "exports/b.yaml", "exports/deep/b.yaml"] {
                for write in [|path: &Path| write(path, b"theirs"), |path: &Path| create(path).map(drop)] {
                    let error = write(&foreign.join(inside)).expect_err(inside).to_string();
                    assert!(error.contains("foreign/exports is a link"), "{error}");
                }
            }
            fs::remove_file(foreign.join(mark)).expect("removed");
        }
        assert_eq!(names(&elsewhere), ["a.yaml", "deep"]);
        assert_eq!(fs::read(elsewhere.join("a.yaml")).expect("read"), b"mine");
        assert!(names(&elsewhere.join("deep")).is_empty());
        // The session itself may be reached through a link: that one is the user's.
        fs::write(foreign.join("session.json"), "").expect("written");
        symlink(&foreign, home.path().join("current")).expect("a link");
        write(&home.path().join("current/result.json"), b"new").expect("written");
    }

    #[test]
    fn a_link_inside_of_a_session_is_not_followed_to_another_session_either() {
        let home = tempfile::tempdir().expect("a temporary folder");
        let (mine, foreign) = (home.path().join("mine"), home.path().join("foreign"));
        for session in [&mine, &foreign] {
            fs::create_dir(session).expect("a folder");
            fs::write(session.join("journal.jsonl"), "").expect("written");
        }
        symlink(&mine, foreign.join("exports")).expect("a link");
        let error = write(&foreign.join("exports/journal.jsonl"), b"theirs").expect_err("a link").to_string();
        assert!(error.contains("foreign/exports is a link"), "{error}");
        assert!(fs::read(mine.join("journal.jsonl")).expect("read").is_empty());
    }

    #[test]
    fn a_new_file_has_the_permissions_of_any_new_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("usual"), "").expect("written");
        write(&folder.path().join("ours"), b"").expect("written");
        let mode = |name: &str| fs::metadata(folder.path().join(name)).expect("there").permissions().mode();
        assert_eq!(mode("ours"), mode("usual"));
    }
}
