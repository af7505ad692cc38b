//! A session of the built-in cell, recorded and solved once for all tests, each of which works on a copy.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

use handeye_tests::handeye_binary;

/// The result of one run of `handeye auto --json -`.
pub struct Solved {
    folder: PathBuf,
    /// Its output.
    pub auto: Output,
}

static SOLVED: LazyLock<Solved> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("solved_session");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).expect("that of the last run goes");
    }
    let auto = command().args(["auto", "--json", "-", "--out"]).arg(&folder).output().expect("it runs");
    assert!(auto.status.success(), "{}", String::from_utf8_lossy(&auto.stderr));
    Solved { folder, auto }
});

/// The run that made the session.
pub fn solved() -> &'static Solved {
    &SOLVED
}

pub fn copy_of_session() -> (tempfile::TempDir, PathBuf) {
    let home = tempfile::tempdir().expect("a folder");
    let copy = home.path().join("session");
    copy_folder(&SOLVED.folder, &copy);
    (home, copy)
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("list") {
        let path = entry.expect("entry").path();
        let goal = to.join(path.file_name().expect("a name"));
        if path.is_dir() {
            copy_folder(&path, &goal);
        } else {
            std::fs::copy(&path, &goal).expect("copied");
        }
    }
}

/// The program, independent of the terminal of the test.
pub fn command() -> Command {
    let mut command = Command::new(handeye_binary());
    command.stdin(Stdio::null()).env_remove("RUST_LOG");
    command
}

/// Runs it.
pub fn handeye(arguments: &[&str]) -> Output {
    command().args(arguments).output().expect("the binary is built: cargo build -p handeye_app")
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn utf8(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}
