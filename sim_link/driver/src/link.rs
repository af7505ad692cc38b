//! The two ends of a driver: its pipes as a process, or a TCP connection.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

use super::error::DriverError;
use super::family::{Family, Process};
use super::spec::DriverSpec;

/// Longest wait for a TCP connection, and for a driver that does not take what is sent to it.
const TCP_PATIENCE: Duration = Duration::from_secs(3);
/// Interval at which the end of a process is checked.
const POLL: Duration = Duration::from_millis(5);

/// A driver that is reached.
pub struct Link {
    pub output: Box<dyn Read + Send>,
    /// Writes to the driver. Dropping it closes its standard input.
    pub input: Box<dyn Write + Send>,
    /// Its standard error; none over TCP.
    pub errors: Option<Box<dyn Read + Send>>,
    /// How it is ended.
    pub end: LinkEnd,
}

/// Ends a driver.
#[derive(Debug)]
pub enum LinkEnd {
    /// A process, the first of its group, and all that come from it.
    Process(Child, Family),
    /// A connection.
    Tcp(TcpStream),
}

impl Link {
    /// Starts the program, or connects.
    ///
    /// # Errors
    /// [`DriverError::Start`], [`DriverError::Connect`].
    pub fn open(spec: &DriverSpec) -> Result<Self, DriverError> {
        match spec {
            DriverSpec::Command(words) => Self::start(words),
            DriverSpec::Tcp(address) => Self::connect(address),
        }
    }

    fn start(words: &[String]) -> Result<Self, DriverError> {
        let failed = |why: String| DriverError::Start { command: words.join(" "), why };
        let (program, arguments) = words.split_first().ok_or_else(|| failed("no program is named".to_owned()))?;
        let mut command = Command::new(executable(program));
        // A separate group: Ctrl-C in a terminal is for the workbench, which brakes the arm before it ends the driver.
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
        let family = Family::of(&mut command);
        let mut child = command.spawn().map_err(|error| failed(error.to_string()))?;
        let (input, output, errors) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(input), Some(output)) = (input, output) else {
            return Err(failed("it has no pipes".to_owned()));
        };
        Ok(Self {
            output: Box::new(output),
            input: Box::new(input),
            errors: errors.map(|errors| Box::new(errors) as Box<dyn Read + Send>),
            end: LinkEnd::Process(child, family),
        })
    }

    fn connect(address: &str) -> Result<Self, DriverError> {
        let failed = |why: String| DriverError::Connect { address: address.to_owned(), why };
        let addresses = address.to_socket_addrs().map_err(|error| failed(error.to_string()))?;
        let mut why = "the name has no address".to_owned();
        for address in addresses {
            let connected = TcpStream::connect_timeout(&address, TCP_PATIENCE).and_then(|stream| {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(TCP_PATIENCE))?;
                Ok((stream.try_clone()?, stream.try_clone()?, stream))
            });
            match connected {
                Ok((output, input, end)) => {
                    let (output, input) = (Box::new(output), Box::new(input));
                    return Ok(Self { output, input, errors: None, end: LinkEnd::Tcp(end) });
                }
                Err(error) => why = error.to_string(),
            }
        }
        Err(failed(why))
    }
}

/// The name of the program that drivers come with.
const WORKBENCH: &str = "handeye";

/// The program to start for the first word of a command: this program for its own name, so that the drivers that come with
/// it are found where it is not on the `PATH`, and are of its version.
fn executable(named: &str) -> PathBuf {
    let own = || std::env::current_exe().ok().filter(|own| own.file_stem().is_some_and(|stem| stem == WORKBENCH));
    Some(named).filter(|&named| named == WORKBENCH).and_then(|_| own()).unwrap_or_else(|| named.into())
}

impl LinkEnd {
    /// Exit status of the process, if it has ended within this time; never over TCP.
    pub fn ended_within(&mut self, patience: Duration) -> Option<ExitStatus> {
        let Self::Process(child, _) = self else { return None };
        let until = Instant::now() + patience;
        loop {
            match child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if Instant::now() < until => std::thread::sleep(POLL),
                Ok(None) | Err(_) => return None,
            }
        }
    }

    /// Running processes of the driver; none over TCP.
    pub fn living(&mut self) -> Vec<Process> {
        let Self::Process(child, family) = self else { return Vec::new() };
        let is_running = matches!(child.try_wait(), Ok(None));
        family.living(is_running.then_some(child.id().cast_signed()))
    }

    /// Ends it now, with all that it has started, and with these.
    pub fn kill(&mut self, living: Vec<Process>) {
        match self {
            Self::Process(child, family) => {
                if let Ok(id) = i32::try_from(child.id()) {
                    // Nobody is left in the group: that is what was wanted.
                    let _gone_already = killpg(Pid::from_raw(id), Signal::SIGKILL).is_err();
                }
                let _reaped = child.wait().is_ok();
                family.kill(living);
            }
            Self::Tcp(stream) => {
                let _closed_already = stream.shutdown(Shutdown::Both).is_err();
            }
        }
    }
}
