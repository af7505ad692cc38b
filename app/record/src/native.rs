//! The native viewer: a program `rerun` that the user has installed.

use std::env;
use std::ffi::OsStr;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use handeye_wording::text;
use handeye_workbench::text::Text;

/// Its name.
const PROGRAM: &str = "rerun";

/// How long it may take to report its version. A Python that starts for the first time takes seconds.
const PATIENCE: Duration = Duration::from_secs(15);

/// Between two checks of a running program.
const LOOK: Duration = Duration::from_millis(50);

/// Memory that the viewer may use before it drops the oldest data.
const VIEWER_MEMORY: &str = "25%";

/// Finds a viewer on the `PATH` that understands what this program sends.
///
/// # Errors
/// What is missing and how to get it.
pub fn find() -> Result<PathBuf, Text> {
    find_on(&env::var_os("PATH").unwrap_or_default())
}

fn find_on(path: &OsStr) -> Result<PathBuf, Text> {
    let ours = rerun::build_info().version;
    let wanted = format!("{}.{}.{}", ours.major, ours.minor, ours.patch);
    let is_there = |folder: PathBuf| Some(folder.join(PROGRAM)).filter(|program| program.is_file());
    let Some(program) = env::split_paths(path).find_map(is_there) else {
        return Err(text!(
            "There is no native Rerun viewer: `pip install rerun-sdk=={version}` brings one",
            version = wanted
        ));
    };
    let reported = version(&program).map_err(|error| {
        text!("The native Rerun viewer {program} does not start: {error}", program = program.display(), error = error)
    })?;
    // Recordings are understood across patches of the same minor version.
    if parse_version(&reported)
        .is_some_and(|[major, minor, _]| [major, minor] == [u32::from(ours.major), u32::from(ours.minor)])
    {
        return Ok(program);
    }
    Err(text!(
        "The native Rerun viewer {program} has another version ({reported}): `pip install rerun-sdk=={version}` brings the \
         right one",
        program = program.display(),
        reported = reported.lines().next().unwrap_or_default().chars().take(40).collect::<String>(),
        version = wanted
    ))
}

/// `rerun-cli 0.36.3 (…` has 0, 36, 3.
fn parse_version(reported: &str) -> Option<[u32; 3]> {
    let numbers = reported.split_whitespace().nth(1)?.split(['-', '+']).next()?;
    let mut numbers = numbers.split('.').map(str::parse);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?, numbers.next()?.ok()?])
}

fn version(program: &Path) -> io::Result<String> {
    let mut child = command(program).arg("--version").stdout(Stdio::piped()).spawn()?;
    let mut stdout = child.stdout.take();
    if wait(&mut child, PATIENCE, || false)?.is_none() {
        child.kill()?;
        child.wait()?;
        return Err(io::Error::new(io::ErrorKind::TimedOut, "it does not say its version"));
    }
    let mut reported = String::new();
    if let Some(stdout) = &mut stdout {
        stdout.take(4096).read_to_string(&mut reported)?;
    }
    Ok(reported)
}

/// Starts the viewer; it reads from this address.
///
/// # Errors
/// When it cannot be started.
pub fn start(program: &Path, url: &str) -> io::Result<Child> {
    let mut viewer = command(program);
    // Without `--connect` the viewer would open a port of its own to the whole network.
    viewer.args(["--connect", url]);
    viewer.args(["--hide-welcome-screen", "--memory-limit", VIEWER_MEMORY]).stdout(Stdio::null());
    // Ctrl-C in the terminal is meant for this program only.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut viewer, 0);
    viewer.spawn()
}

fn command(program: &Path) -> Command {
    let mut command = Command::new(program);
    // With CI set the viewer sends no statistics of its use, and the settings of the user stay as they are.
    command.env("CI", "true").env_remove("FORCE_RERUN_ANALYTICS").stdin(Stdio::null()).stderr(Stdio::null());
    command
}

/// Waits until a program ends, for at most this long, or until there is no more reason to wait; `None` when it still
/// runs.
///
/// # Errors
/// When the system cannot tell.
pub fn wait(child: &mut Child, patience: Duration, give_up: impl Fn() -> bool) -> io::Result<Option<ExitStatus>> {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if began.elapsed() >= patience || give_up() {
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::text::Language;

    fn viewer_that_says(reported: &str) -> tempfile::TempDir {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join(PROGRAM);
        std::fs::write(&program, format!("#!/bin/sh\necho '{reported}'\n")).expect("written");
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("allowed");
        folder
    }

    #[test]
    fn a_viewer_of_the_same_minor_version_is_taken_and_another_one_is_not() {
        let ours = rerun::build_info().version;
        let same = format!("rerun-cli {}.{}.99 (map_view) [rustc 1.95.0]", ours.major, ours.minor);
        let folder = viewer_that_says(&same);
        assert_eq!(find_on(folder.path().as_os_str()), Ok(folder.path().join(PROGRAM)));

        for reported in [format!("rerun-cli {}.{}.0", ours.major, ours.minor + 1), "something else".to_owned()] {
            let folder = viewer_that_says(&reported);
            let why = find_on(folder.path().as_os_str()).expect_err(&reported).in_language(Language::English);
            assert!(why.contains(&reported) && why.contains("pip install rerun-sdk=="), "{why}");
        }
    }

    #[test]
    fn a_missing_viewer_is_said_with_the_way_to_get_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let why = find_on(folder.path().as_os_str()).expect_err("none").in_language(Language::English);
        assert!(why.contains("pip install rerun-sdk=="), "{why}");
    }
}
