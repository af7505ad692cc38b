//! Requirements of tests that a machine may not have, and how tests report that they skip.
//!
//! A test that cannot run reports it in one line past the test runner, which hides the output of passing tests, and adds
//! a line to the file named by `$HANDEYE_SKIPPED`, from which `./test` makes its summary. Where `$HANDEYE_REQUIRE` names
//! what is missing, as in the gate, the test fails instead.

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A requirement of a test on the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// The reference data sets.
    Data,
    /// Python with the packages of `tests/python/requirements.txt`, as `./test` sets it up.
    Python,
    /// A virtual screen and mouse: Xvfb, xdotool and ImageMagick.
    Xvfb,
    /// A web browser.
    Chromium,
    /// A Vulkan driver, also one in software, for images of the window.
    Vulkan,
}

impl Need {
    /// Its name in `$HANDEYE_REQUIRE`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Data => "data",
            Self::Python => "python",
            Self::Xvfb => "xvfb",
            Self::Chromium => "chromium",
            Self::Vulkan => "vulkan",
        }
    }
}

/// Reports that the running test skips.
///
/// # Panics
/// When `$HANDEYE_REQUIRE` (names with commas between) names the need: then its absence is a failure.
pub fn skip(need: Need, why: &str) {
    let required = std::env::var("HANDEYE_REQUIRE").unwrap_or_default();
    assert!(
        !required.split(',').any(|name| name.trim() == need.name()),
        "$HANDEYE_REQUIRE names {}, and it is missing: {why}",
        need.name()
    );
    let thread = std::thread::current();
    let line = format!("{} skipped, needs {}: {why}\n", thread.name().unwrap_or("a test"), need.name());
    // Written to the handle itself: the test runner captures only what the print macros write.
    let mut written = std::io::stderr().write_all(line.as_bytes());
    if let Some(file) = std::env::var_os("HANDEYE_SKIPPED") {
        let list = std::fs::OpenOptions::new().create(true).append(true).open(file);
        written = written.and(list.and_then(|mut list| list.write_all(line.as_bytes())));
    }
    written.expect("a line about a skipped test can be written");
}

/// Folder of the reference data sets: `$HANDEYE_DATA`, else `../shared/data` next to the workspace. `None` when there
/// is none; then the running test has reported that it skips.
///
/// # Panics
/// When there is none and `$HANDEYE_REQUIRE` requires it.
pub fn data_folder() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("HANDEYE_DATA").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    skip(Need::Data, &format!("no data sets at {}", folder.display()));
    None
}

/// Python as `./test` sets it up (`$HANDEYE_PYTHON`). `None` elsewhere; then the running test has reported that it
/// skips.
///
/// # Panics
/// When it is not set and `$HANDEYE_REQUIRE` requires it.
pub fn python() -> Option<PathBuf> {
    let python = std::env::var_os("HANDEYE_PYTHON").map(PathBuf::from);
    if python.is_none() {
        skip(Need::Python, "HANDEYE_PYTHON is not set (run ./test)");
    }
    python
}

/// Whether all these programs are on the path; where one is not, the running test has reported that it skips.
///
/// # Panics
/// When one is missing and `$HANDEYE_REQUIRE` requires them.
pub fn programs(need: Need, names: &[&str]) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let is_there = |name: &&str| std::env::split_paths(&path).any(|folder| folder.join(name).is_file());
    let missing: Vec<&str> = names.iter().filter(|name| !is_there(name)).copied().collect();
    if !missing.is_empty() {
        skip(need, &format!("not installed: {}", missing.join(", ")));
    }
    missing.is_empty()
}
