//! The drivers in Python that come with the program: where their files are, which Python they run with, and how they are started.

mod eject;
mod environment;
mod files;
mod script;

use std::ffi::{OsStr, OsString};
use std::io::IsTerminal as _;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::Command;

use clap::Args;

use crate::Failure;
use handeye_driver::DriverSpec;
use handeye_workbench::arguments::heading;

use environment::Audience;

pub use eject::{EjectArgs, eject};
#[cfg(test)]
pub use files::ALL;
pub use files::{FOLDER, FRANKA, MUJOCO, ORBBEC, PYBULLET, REALSENSE, ROS2, ROSBRIDGE, Shipped, UR_RTDE, V4L, XARM};

/// The variable with the name that a driver shows in its help.
pub const NAME_VARIABLE: &str = "HANDEYE_DRIVER";

const PYTHON_OPTION: &str = "--python";

/// Options of a driver, which it reads itself.
#[derive(Debug, Args)]
pub struct PythonArgs {
    /// The Python to run the driver with, which has its packages, in place of an environment that is made for it.
    #[arg(long, value_name = "PATH", help_heading = heading::CELL)]
    python: Option<PathBuf>,
    /// Options of the driver; `--help` lists them.
    #[arg(value_name = "OPTIONS", trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

/// Becomes the driver: it takes over the pipes and the signals.
pub fn run(driver: &Shipped, args: &PythonArgs) -> Result<(), Failure> {
    let (python, options) = split(args)?;
    let folder = files::written().map_err(Failure::failed)?;
    let asks_for_help = options.iter().any(|word| word == "--help" || word == "-h");
    let mut command = match python {
        Some(python) => Command::new(python),
        // Help needs no packages.
        None if asks_for_help => Command::new(environment::PYTHON),
        None => environment::python_of(driver, audience()).map_err(Failure::failed)?,
    };
    let program = command.get_program().to_owned();
    let error = command
        .arg(folder.join(driver.file))
        .args(options)
        .env(NAME_VARIABLE, format!("handeye driver {}", driver.name))
        .exec();
    Err(Failure::failed(environment::EnvironmentError::NoPython { python: program.into(), why: error.to_string() }))
}

/// A workbench, unless the user has started the driver in a terminal.
fn audience() -> Audience {
    if std::io::stdout().is_terminal() { Audience::Person } else { Audience::Workbench }
}

/// Creates the environment of one of these drivers, if a command line starts one that has none yet.
pub fn prepare(spec: &DriverSpec) -> Result<(), Failure> {
    let DriverSpec::Command(words) = spec else { return Ok(()) };
    let [_, command, name, options @ ..] = words.as_slice() else { return Ok(()) };
    let Some(driver) = files::ALL.iter().find(|driver| command == "driver" && driver.name == name) else {
        return Ok(());
    };
    if options.iter().any(|option| option.starts_with(PYTHON_OPTION)) {
        return Ok(());
    }
    environment::python_of(driver, Audience::Person).map(drop).map_err(Failure::failed)
}

/// Removes `--python` from the options, wherever it is.
fn split(args: &PythonArgs) -> Result<(Option<PathBuf>, Vec<OsString>), Failure> {
    let mut python = args.python.clone();
    let mut rest = Vec::new();
    let mut words = args.options.iter();
    while let Some(word) = words.next() {
        let joined = word.to_str().and_then(|word| word.strip_prefix(PYTHON_OPTION)?.strip_prefix('=')).map(OsStr::new);
        if word == PYTHON_OPTION || joined.is_some() {
            let path = joined.or_else(|| words.next().map(OsString::as_os_str));
            let missing = || Failure::unusable(anyhow::anyhow!("--python needs the path of a Python"));
            python = Some(path.ok_or_else(missing)?.into());
        } else {
            rest.push(word.clone());
        }
    }
    Ok((python, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_python_is_taken_from_among_the_options_of_the_driver() {
        let args = |python: Option<&str>, options: &[&str]| PythonArgs {
            python: python.map(PathBuf::from),
            options: options.iter().map(OsString::from).collect(),
        };
        let all: [(Option<&str>, &[&str]); 3] = [
            (None, &["--host", "a", "--python", "/p", "--arm", "ur5e"]),
            (None, &["--python=/p", "--host", "a", "--arm", "ur5e"]),
            (Some("/p"), &["--host", "a", "--arm", "ur5e"]),
        ];
        for (python, options) in all {
            let (python, rest) = split(&args(python, options)).expect("options");
            assert_eq!(python, Some(PathBuf::from("/p")));
            assert_eq!(rest, ["--host", "a", "--arm", "ur5e"]);
        }
        assert!(split(&args(None, &["--host", "a", "--python"])).is_err());
    }
}
