//! Support for the end-to-end tests: where things are, and how to run them as a user does.

use std::path::{Path, PathBuf};

/// Root of the workspace.
pub fn workspace_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or_else(|| Path::new("."))
}

/// Folder of the reference data sets: `$HANDEYE_DATA`, else `../shared/data` beside the workspace. `None`, and a line
/// that says so, when there is none.
pub fn reference_data(test: &str) -> Option<PathBuf> {
    let folder =
        std::env::var_os("HANDEYE_DATA").map_or_else(|| workspace_root().join("../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("{test}: skipped, no data sets at {}", folder.display());
    None
}

/// Python with the official client, as `./test` sets it up. `None`, and a line that says so, outside `./test`.
pub fn python(test: &str) -> Option<PathBuf> {
    let python = std::env::var_os("HANDEYE_PYTHON").map(PathBuf::from);
    if python.is_none() {
        eprintln!("{test}: skipped, HANDEYE_PYTHON is not set (run ./test)");
    }
    python
}

/// The `handeye` binary beside the running test; `./test` and `cargo test --workspace` build it first.
pub fn handeye_binary() -> PathBuf {
    let mut folder = std::env::current_exe().unwrap_or_default();
    folder.pop();
    if folder.ends_with("deps") {
        folder.pop();
    }
    folder.join(format!("handeye{}", std::env::consts::EXE_SUFFIX))
}
