//! The virtual environment that a driver runs in: created in the cache the first time, and then reused.

use std::collections::hash_map::DefaultHasher;
use std::fs::File;
use std::hash::{Hash as _, Hasher as _};
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use serde_json::json;

use super::files;
use super::files::Shipped;
use super::script::Needs;
use crate::out;

/// The Python that environments are created with.
pub const PYTHON: &str = "python3";
/// Written into an environment once it is complete.
const COMPLETE: &str = "complete";
/// How often the workbench is notified that the environment is still being created: it waits ten seconds for the next
/// message.
const STILL_AT_IT: Duration = Duration::from_secs(2);

/// Why a driver has no Python to run with.
#[derive(Debug, thiserror::Error)]
pub enum EnvironmentError {
    /// The home folder is not known.
    #[error("there is no cache folder for the driver's environment: set XDG_CACHE_HOME or HOME")]
    NoCache,
    /// A folder or file of the cache.
    #[error("{}: {why}. XDG_CACHE_HOME names another folder for caches", path.display())]
    NotWritten {
        path: PathBuf,
        /// The system's message.
        why: String,
    },
    /// No such program.
    #[error(
        "{} cannot be started: {why}. Install Python (Debian, Ubuntu: sudo apt install python3 python3-venv), or name one that has \
         the driver's packages with --python PATH", python.display()
    )]
    NoPython {
        /// What was started.
        python: PathBuf,
        /// The system's message.
        why: String,
    },
    /// It is too old.
    #[error(
        "this is Python {found}, and the driver needs {needed}: name a newer one that has its packages with --python PATH"
    )]
    Old {
        /// Its version.
        found: String,
        /// What the driver needs.
        needed: String,
    },
    /// `python3 -m venv` fails.
    #[error(
        "python3 -m venv failed: {why}. Install what it needs (Debian, Ubuntu: sudo apt install python3-venv), or name a Python that \
         has {packages} with --python PATH"
    )]
    NoVenv {
        /// What it printed last, or how it ended.
        why: String,
        /// What the driver needs.
        packages: String,
    },
    /// pip fails.
    #[error(
        "pip could not install {packages}: {why}. This needs the network, once; without it name a Python that has them with \
         --python PATH"
    )]
    NoPackages {
        /// What the driver needs.
        packages: String,
        /// What it printed last, or how it ended.
        why: String,
    },
}

/// Who waits for an environment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Audience {
    /// A user, who reads standard error.
    Person,
    /// A workbench that awaits `hello` on standard output.
    Workbench,
}

/// The Python of a driver's environment, which is created if it does not exist yet; that of the shell for a driver without packages.
pub fn python_of(driver: &Shipped, audience: Audience) -> Result<Command, EnvironmentError> {
    // A test checks that every driver states its needs.
    let needs =
        Needs::of(driver.source).unwrap_or_else(|| Needs { requires_python: ">=3".into(), dependencies: Vec::new() });
    let base = Base::of(Path::new(PYTHON))?;
    if !needs.has_python(base.version) {
        let (major, minor) = base.version;
        return Err(EnvironmentError::Old { found: format!("{major}.{minor}"), needed: needs.requires_python });
    }
    if needs.dependencies.is_empty() {
        // What it imports comes with something else, such as ROS, for this Python and by the shell's PYTHONPATH.
        return Ok(Command::new(PYTHON));
    }
    let cache = files::cache()?;
    let folder = cache.join(format!("{}-{:016x}", driver.name, key(&needs, &base)));
    ensure(&folder, driver.name, &needs, audience)?;
    let mut command = Command::new(folder.join("bin").join("python"));
    // The packages of a shell that is set up for ROS would come before the environment's own.
    command.env_remove("PYTHONPATH").env_remove("PYTHONHOME");
    Ok(command)
}

/// The Python that an environment refers to.
#[derive(Hash)]
struct Base {
    executable: String,
    version: (u32, u32),
}

impl Base {
    fn of(python: &Path) -> Result<Self, EnvironmentError> {
        const ASK: &str = "import sys; print(sys.version_info[0], sys.version_info[1], sys.executable)";
        let failed = |why: String| EnvironmentError::NoPython { python: python.to_path_buf(), why };
        let output = Command::new(python).args(["-c", ASK]).stdin(Stdio::null()).output();
        let output = output.map_err(|error| failed(error.to_string()))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let mut words = text.trim().splitn(3, ' ');
        let mut number = || words.next()?.parse().ok();
        match (number(), number()) {
            (Some(major), Some(minor)) => {
                Ok(Self { executable: words.next().unwrap_or_default().to_owned(), version: (major, minor) })
            }
            _ => Err(failed(format!("it ends with {}", output.status))),
        }
    }
}

/// Different needs or a different Python need a different environment.
fn key(needs: &Needs, base: &Base) -> u64 {
    let mut hasher = DefaultHasher::new();
    needs.dependencies.hash(&mut hasher);
    base.hash(&mut hasher);
    hasher.finish()
}

/// Creates an environment, unless it exists. One program creates it, others wait for that one; an incomplete one is created
/// again.
fn ensure(folder: &Path, name: &str, needs: &Needs, audience: Audience) -> Result<(), EnvironmentError> {
    let is_complete = || folder.join(COMPLETE).is_file() && folder.join("bin").join("python").is_file();
    if is_complete() {
        return Ok(());
    }
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |error: std::io::Error| EnvironmentError::NotWritten { path, why: error.to_string() }
    };
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    let lock = folder.with_extension("lock");
    let file = File::create(&lock).map_err(failed(&lock))?;
    let _locked = waited_for(audience, move || file.lock().map(|()| file)).map_err(failed(&lock))?;
    if is_complete() {
        return Ok(());
    }
    make(folder, name, needs, audience)?;
    std::fs::write(folder.join(COMPLETE), needs.dependencies.join("\n")).map_err(failed(folder))
}

fn make(folder: &Path, name: &str, needs: &Needs, audience: Audience) -> Result<(), EnvironmentError> {
    let packages = needs.dependencies.join(" ");
    out::note(format_args!(
        "making a Python environment for the driver {name} in {}, once; it downloads {packages} and what that needs",
        folder.display()
    ));
    let mut venv = Command::new(PYTHON);
    venv.args(["-m", "venv", "--clear"]).arg(folder);
    run(&mut venv, audience).map_err(|why| EnvironmentError::NoVenv { why, packages: packages.clone() })?;
    let mut pip = Command::new(folder.join("bin").join("python"));
    pip.args(["-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--progress-bar", "off"]);
    pip.args(&needs.dependencies).env_remove("PYTHONPATH").env_remove("PYTHONHOME");
    run(&mut pip, audience).map_err(|why| EnvironmentError::NoPackages { packages, why })?;
    out::note("the environment is made");
    Ok(())
}

/// Runs a program to its end, printing its output to standard error. On failure its last line, or how it ended.
fn run(command: &mut Command, audience: Audience) -> Result<(), String> {
    let started = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = started.map_err(|error| error.to_string())?;
    let outputs = [child.stdout.take().map(boxed), child.stderr.take().map(boxed)];
    waited_for(audience, move || {
        let readers = outputs.into_iter().flatten().map(|output| thread::spawn(move || printed(output)));
        let readers: Vec<_> = readers.collect();
        let last = readers.into_iter().rev().find_map(|reader| reader.join().ok().flatten());
        let status = child.wait().map_err(|error| error.to_string())?;
        if status.success() { Ok(()) } else { Err(last.unwrap_or_else(|| status.to_string())) }
    })
}

fn boxed(output: impl Read + Send + 'static) -> Box<dyn Read + Send> {
    Box::new(output)
}

/// Prints lines to standard error as they come; returns the last one.
fn printed(output: Box<dyn Read + Send>) -> Option<String> {
    let lines = BufReader::new(output).lines().map_while(Result::ok);
    let lines = lines.map(|line| line.trim().to_owned()).filter(|line| !line.is_empty());
    lines.inspect(|line| out::note(format_args!("  {line}"))).last()
}

/// Does a long task on a thread of its own, and notifies a workbench meanwhile that the driver is being prepared.
fn waited_for<T: Send + 'static>(audience: Audience, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (send, done) = mpsc::channel();
    let worker = thread::spawn(move || {
        let result = work();
        // The receiver is below.
        let _waits = send.send(()).is_ok();
        result
    });
    let mut output = std::io::stdout();
    while let Err(mpsc::RecvTimeoutError::Timeout) = done.recv_timeout(STILL_AT_IT) {
        if audience == Audience::Workbench {
            let line = json!({"type": "preparing", "text": "a Python environment is being made, once"});
            // If nobody reads it, the driver will notice.
            let _written = writeln!(output, "{line}").and_then(|()| output.flush()).is_ok();
        }
    }
    worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
