//! The Python module: its wheel is built as for a release except for optimization, installed with pip, and used.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use handeye_geometry::testing::python;
use handeye_tests::{handeye_binary, workspace_root};
use tempfile::TempDir;

/// A folder with the installed module.
fn module(python: &Path) -> &'static Path {
    static INSTALLED: OnceLock<TempDir> = OnceLock::new();
    INSTALLED.get_or_init(|| installed(python)).path()
}

fn installed(python: &Path) -> TempDir {
    let wheels = tempfile::tempdir().expect("a folder");
    let site = tempfile::tempdir().expect("a folder");
    // Next to the running test, so that crates compiled for the other packages are reused. All of them are in Cargo's
    // cache: the workspace was built with this package.
    let profile = handeye_binary().parent().map(Path::to_path_buf).unwrap_or_default();
    let target = profile.parent().expect("a profile lies in a target folder");
    run(Command::new(python)
        .args(["-m", "maturin", "build", "--profile", "dev", "--locked", "--offline", "--quiet", "--manifest-path"])
        .arg(workspace_root().join("core/python/Cargo.toml"))
        .arg("--target-dir")
        .arg(target)
        .arg("--out")
        .arg(wheels.path()));
    let found: Vec<PathBuf> = std::fs::read_dir(wheels.path()).expect("a folder").flatten().map(|e| e.path()).collect();
    let [wheel] = found.as_slice() else { panic!("one wheel was to be built: {found:?}") };
    let name = wheel.file_name().and_then(|name| name.to_str()).expect("a name");
    assert!(name.starts_with(&format!("handeye-{}-cp39-abi3-", env!("CARGO_PKG_VERSION"))), "{name}");
    run(Command::new(python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-index", "--target"])
        .arg(site.path())
        .arg(wheel));
    site
}

/// Its output.
fn run(command: &mut Command) -> String {
    let output = command.output().expect("the program runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}\n{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// Runs a script of `tests/python` with the module.
fn script(name: &str, arguments: &[&Path]) -> Option<String> {
    let python = python()?;
    let mut command = Command::new(&python);
    command.env("PYTHONPATH", module(&python)).env("PYTHONDONTWRITEBYTECODE", "1");
    Some(run(command.arg(workspace_root().join("tests/python").join(name)).args(arguments)))
}

#[test]
fn python_gets_what_opencv_the_command_line_and_the_truth_say() {
    let folder = tempfile::tempdir().expect("a folder");
    let schema = workspace_root().join("assets/schema/handeye-calibration-1.schema.json");
    let Some(text) = script("handeye_module.py", &[&handeye_binary(), &schema, folder.path()]) else { return };
    println!("{text}");
    // One line per check.
    assert_eq!(text.lines().count(), 21, "{text}");
}

#[test]
fn the_page_about_python_does_what_it_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = workspace_root().join("docs/howto/python.md");
    let Some(text) = script("run_page.py", &[&handeye_binary(), &page, folder.path()]) else { return };
    println!("{text}");
}
