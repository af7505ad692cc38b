//! Whether a driver keeps to the protocol, and where it does not.
//!
//! The run talks to the driver through the same connection that the workbench uses, so what passes here works there. A
//! message that breaks the protocol ends a connection, and so the run: the first one is reported with its line.

mod capture;
mod motion;
mod reading;
mod report;

use std::time::{Duration, Instant};

use handeye_geometry::progress::CancelToken;

use super::client::Driver;
use super::error::{DriverError, Ending};
use super::message::Ability;
use super::motion::move_message;
use super::options::DriverOptions;
use super::shared::{Burial, Inner, Progress};
use super::spec::DriverSpec;
use super::wire::Excerpt;

pub use report::{Check, Outcome, Report};

/// How many lines of the driver's log are shown.
const LOG_LINES: usize = 10;

/// What a conformance run may do.
#[derive(Debug, Clone, Default)]
pub struct ConformanceOptions {
    /// Whether the arm may be moved, by up to 0.2 rad in one joint or 2 cm.
    pub allow_motion: bool,
    /// As for any connection.
    pub driver: DriverOptions,
}

/// A check, or how it failed.
type Checked<'a> = fn(&Run<'a>) -> Result<Check, Check>;

/// Runs all checks that the driver's abilities call for.
///
/// # Errors
/// [`DriverError::Start`] or [`DriverError::Connect`] where there is no driver to talk to; all else is in the report.
pub fn run(spec: &DriverSpec, options: &ConformanceOptions, cancel: &CancelToken) -> Result<Report, DriverError> {
    let mut report = Report::new(spec.to_string());
    let driver = match Driver::start(spec, &options.driver, cancel) {
        Ok(driver) => driver,
        Err(error @ (DriverError::Start { .. } | DriverError::Connect { .. })) => return Err(error),
        Err(error) => {
            report.add(failed("hello", &error));
            return Ok(report);
        }
    };
    let run = Run { driver: &driver, options, cancel };
    let ended = run.all(&mut report);
    let log = driver.take_log();
    let last = log.iter().rev().take(LOG_LINES).rev();
    report.log.extend(last.map(|line| Excerpt::of(line.text.as_bytes()).to_string()));
    if ended.is_ok() {
        let closed = closed_without_farewell(driver, &options.driver);
        let is_fine = closed.outcome != Outcome::Failed;
        report.add(closed);
        if is_fine {
            report.add(said_farewell(spec, &options.driver, cancel));
        }
    }
    Ok(report)
}

/// The checks of a connection.
struct Run<'a> {
    driver: &'a Driver,
    options: &'a ConformanceOptions,
    cancel: &'a CancelToken,
}

impl<'a> Run<'a> {
    fn all(&self, report: &mut Report) -> Result<(), ()> {
        let checks: [(&'static str, Checked<'a>); 9] = [
            ("hello", Self::hello),
            ("clock", Self::clock),
            ("states", Self::states),
            ("chain", Self::chain),
            ("images", Self::images),
            ("capture", Self::capture),
            ("later versions", Self::later_versions),
            ("read-only", Self::read_only),
            ("motion", Self::motion),
        ];
        let mut is_connected = true;
        for (name, check) in checks {
            if !is_connected || self.cancel.is_cancelled() {
                report.add(skipped(name, "not tried"));
                continue;
            }
            let (Ok(found) | Err(found)) = check(self);
            report.add(found);
            // A connection that is over may have ended unnoticed by the check.
            if let Err(gone) = self.driver.check() {
                is_connected = false;
                if report.passed {
                    report.add(failed(name, &gone));
                }
            }
        }
        if is_connected { Ok(()) } else { Err(()) }
    }

    fn can(&self, ability: Ability) -> bool {
        self.driver.hello().can(ability)
    }

    fn hello(&self) -> Result<Check, Check> {
        let hello = self.driver.hello();
        let can: Vec<String> = hello.can.iter().filter(|a| **a != Ability::Unknown).map(Ability::to_string).collect();
        if !self.can(Ability::State) && !self.can(Ability::Image) {
            return Err(wrong("hello", "`can` has neither `state` nor `image`: there is nothing to work with"));
        }
        let mut missing = Vec::new();
        if hello.version.is_empty() {
            missing.push("`version`");
        }
        if hello.clock.is_empty() {
            missing.push("`clock`");
        }
        let text = format!("{} {}, can {}", hello.name, hello.version, can.join(", "));
        if missing.is_empty() {
            return Ok(passed("hello", text));
        }
        Ok(warning("hello", format!("{text}; {} is missing, which the window would show", missing.join(" and "))))
    }

    /// Waits, and says if the driver is gone meanwhile.
    fn wait(&self, name: &'static str, patience: Duration) -> Result<(), Check> {
        let nothing = |_: &mut Inner| None::<()>;
        gone(name, self.driver.shared().wait(patience, Some(self.cancel), nothing)).map(|_| ())
    }

    /// Sends what only a later version would, and looks whether the driver is still there.
    fn later_versions(&self) -> Result<Check, Check> {
        const NAME: &str = "later versions";
        let shared = self.driver.shared();
        let line = "{\"type\":\"of_a_later_version\",\"with\":[1,{\"a\":null}],\"id\":0}\n".to_owned();
        gone(NAME, shared.send_line(line))?;
        let before = shared.lock().pongs;
        let heard = shared
            .wait(self.options.driver.silence, Some(self.cancel), |inner| (inner.pongs > before + 1).then_some(()));
        match heard {
            Ok(Some(())) => Ok(passed(NAME, "a message of an unknown type is ignored")),
            Ok(None) => {
                Err(wrong(NAME, "after a message of an unknown type no ping is answered: ignore what is not known"))
            }
            Err(error) => {
                let found = failed(NAME, &error);
                Err(Check { text: format!("after a message of an unknown type, {}", found.text), ..found })
            }
        }
    }

    /// Asks for a motion to where the arm stands, which must be refused.
    fn read_only(&self) -> Result<Check, Check> {
        const NAME: &str = "read-only";
        if !self.driver.hello().can_move() {
            return Ok(skipped(NAME, "it says of itself that it moves nothing"));
        }
        let patience = self.options.driver.answer;
        let here = gone(NAME, self.driver.first_state(patience, self.cancel))?;
        let shared = self.driver.shared();
        let goal = self.goal_here(&here.reading);
        let id = gone(NAME, shared.request(|id| move_message(id, &goal, 0.01)))?;
        let answered = |inner: &mut Inner| match inner.requests.get(&id) {
            Some(Progress::Sent) => None,
            other => Some(other.cloned()),
        };
        match gone(NAME, shared.wait(patience, Some(self.cancel), answered))? {
            Some(Some(Progress::Refused(why))) if why.is_empty() => {
                Ok(warning(NAME, "`move` is refused before `arm`, without a `why` that the user could read"))
            }
            Some(Some(Progress::Refused(why))) => Ok(passed(NAME, format!("`move` is refused before `arm`: {why}"))),
            None => Err(wrong(NAME, "`move` is not answered before `arm`: it has to be refused")),
            Some(_) => {
                let _gone_too = self.driver.stop().is_err();
                Err(wrong(NAME, "`move` was accepted before `arm`: a driver begins read-only and refuses it"))
            }
        }
    }
}

/// A check that fails where the connection does.
fn gone<T>(name: &'static str, result: Result<T, DriverError>) -> Result<T, Check> {
    result.map_err(|error| failed(name, &error))
}

/// Closes the input of a process, or the connection, without `bye`.
fn closed_without_farewell(driver: Driver, options: &DriverOptions) -> Check {
    const NAME: &str = "end of input";
    let shared = driver.shared().clone();
    shared.update(|inner| inner.trial.leaves_without_bye = true);
    let began = Instant::now();
    drop(driver);
    let took_s = began.elapsed().as_secs_f64();
    let text = match shared.lock().burial {
        Some(Burial::Ended { .. }) => return passed(NAME, format!("it ends {took_s:.2} s after its input is closed")),
        Some(Burial::Closed) => return passed(NAME, "it closes its end when the connection is closed"),
        Some(Burial::Killed) | None => format!(
            "it does not end within {} s after its standard input is closed, which is how it hears that the workbench is gone",
            options.farewell.as_secs_f64()
        ),
        Some(Burial::LeftOpen) => {
            "it does not close its end of a connection that was closed: it must brake and wait for the next".to_owned()
        }
    };
    wrong(NAME, text)
}

/// Starts it again and says `bye`.
fn said_farewell(spec: &DriverSpec, options: &DriverOptions, cancel: &CancelToken) -> Check {
    const NAME: &str = "bye, and again";
    let again = match Driver::start(spec, options, cancel) {
        Ok(driver) => driver,
        Err(error) => {
            let found = failed(NAME, &error);
            return Check { text: format!("the second time, {}", found.text), ..found };
        }
    };
    let shared = again.shared().clone();
    drop(again);
    match &shared.lock().burial {
        Some(Burial::Ended { is_success: false, status }) => {
            warning(NAME, format!("it ends after `bye`, with {status} and not with 0"))
        }
        Some(Burial::Ended { .. }) => passed(NAME, "it starts again and ends after `bye`"),
        Some(Burial::Closed) => passed(NAME, "it is there for the next connection and closes it after `bye`"),
        Some(Burial::Killed | Burial::LeftOpen) | None => {
            wrong(NAME, format!("it does not end within {} s after `bye`", options.farewell.as_secs_f64()))
        }
    }
}

fn passed(name: &'static str, text: impl Into<String>) -> Check {
    Check { name, outcome: Outcome::Passed, text: text.into(), message: None, line: None }
}

fn warning(name: &'static str, text: impl Into<String>) -> Check {
    Check { outcome: Outcome::Warning, ..passed(name, text) }
}

fn skipped(name: &'static str, text: impl Into<String>) -> Check {
    Check { outcome: Outcome::Skipped, ..passed(name, text) }
}

fn wrong(name: &'static str, text: impl Into<String>) -> Check {
    Check { outcome: Outcome::Failed, ..passed(name, text) }
}

/// The error of a connection, with the line where it has one.
fn failed(name: &'static str, error: &DriverError) -> Check {
    let check = |text: String| wrong(name, text);
    match error {
        DriverError::Gone { why: Ending::Broken(broken), .. } => Check {
            message: Some(broken.number),
            line: Some(broken.excerpt.to_string()),
            ..check(broken.problem.to_string())
        },
        DriverError::Gone { why, .. } => check(format!("it {why}")),
        DriverError::Refused { what, why, .. } => check(format!("it refuses {what}: {why}")),
        DriverError::NoAnswer { what, after, .. } => {
            check(format!("it has not answered {what} within {} s", after.as_secs_f64()))
        }
        other => check(other.to_string()),
    }
}
