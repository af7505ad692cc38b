//! Whether a driver follows the protocol, and where it does not.
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
use super::error::DriverError;
use super::message::{Ability, Hello};
use super::motion::move_message;
use super::options::DriverOptions;
use super::shared::{DriverExit, Inner, Progress};
use super::spec::DriverSpec;
use super::wire::Excerpt;

pub use report::{Check, Outcome, Report};
use report::{Checked, Found, Wrong, wrong};

/// Number of lines of the driver's log that are shown.
const LOG_LINES: usize = 10;

/// What a conformance run may do.
#[derive(Debug, Clone, Default)]
pub struct ConformanceOptions {
    /// Whether the arm may be moved, by up to 0.2 rad in one joint or 2 cm.
    pub allow_motion: bool,
    /// As for any connection.
    pub driver: DriverOptions,
}

/// The checks of one connection, in their order: what each is called, for which drivers there is something to check and what is
/// reported of others, and what is done.
type Row = (&'static str, fn(&Hello) -> bool, &'static str, fn(&Run) -> Checked);
const CHECKS: [Row; 9] = [
    ("hello", |_| true, "", Run::hello),
    ("clock", |_| true, "", Run::clock),
    ("states", sends_states, "it sends none: poses have to be given by hand", Run::states),
    ("chain", |_| true, "", Run::chain),
    ("images", has_images, "it has none", Run::images),
    (
        "capture",
        |hello| has_images(hello) && sends_states(hello),
        "it has no images, or no states: another driver has them",
        Run::capture,
    ),
    ("later versions", |_| true, "", Run::later_versions),
    ("read-only", Hello::can_move, CANNOT_MOVE, Run::read_only),
    ("motion", Hello::can_move, CANNOT_MOVE, Run::motion),
];
const CANNOT_MOVE: &str = "it says of itself that it moves nothing";

fn sends_states(hello: &Hello) -> bool {
    hello.can(Ability::State)
}

fn has_images(hello: &Hello) -> bool {
    hello.can(Ability::Image)
}

/// Runs all checks that the driver's abilities call for.
///
/// # Errors
/// [`DriverError::Start`] or [`DriverError::Connect`] where there is no driver to talk to; all other errors are in the
/// report.
pub fn run(spec: &DriverSpec, options: &ConformanceOptions, cancel: &CancelToken) -> Result<Report, DriverError> {
    let mut report = Report::new(spec.to_string());
    let driver = match Driver::start(spec, &options.driver, cancel) {
        Ok(driver) => driver,
        Err(error @ (DriverError::Start { .. } | DriverError::Connect { .. })) => return Err(error),
        Err(error) => {
            report.add("hello", Err(error.into()));
            return Ok(report);
        }
    };
    let run = Run { driver: driver.clone(), options: options.clone(), cancel: cancel.clone() };
    let is_connected = run.all(&mut report);
    drop(run);
    let log = driver.take_log();
    let last = log.iter().rev().take(LOG_LINES).rev();
    report.log.extend(last.map(|line| Excerpt::of(line.text.as_bytes()).to_string()));
    if is_connected && report.add("end of input", ends_with_its_input(driver, &options.driver)) {
        report.add("bye, and again", ends_after_bye(spec, &options.driver, cancel));
    }
    Ok(report)
}

/// The checks of a connection.
struct Run {
    driver: Driver,
    options: ConformanceOptions,
    cancel: CancelToken,
}

impl Run {
    /// Makes all checks. False when the connection is over.
    fn all(&self, report: &mut Report) -> bool {
        let mut is_connected = true;
        for (name, concerns, otherwise, check) in CHECKS {
            if !is_connected || self.cancel.is_cancelled() {
                report.add(name, Ok(Found::Skipped("not tried")));
                continue;
            }
            let found = if concerns(self.driver.hello()) { check(self) } else { Ok(Found::Skipped(otherwise)) };
            let is_passed = report.add(name, found);
            // A connection that is over may have ended unnoticed by the check.
            if let Err(gone) = self.driver.check() {
                is_connected = false;
                if is_passed {
                    report.add(name, Err(gone.into()));
                }
            }
        }
        is_connected
    }

    fn can(&self, ability: Ability) -> bool {
        self.driver.hello().can(ability)
    }

    fn hello(&self) -> Checked {
        let hello = self.driver.hello();
        if !sends_states(hello) && !has_images(hello) {
            return wrong("`can` has neither `state` nor `image`: there is nothing to work with");
        }
        let can: Vec<String> = hello.can.iter().filter(|a| **a != Ability::Unknown).map(Ability::to_string).collect();
        let text = format!("{} {}, can {}", hello.name, hello.version, can.join(", "));
        let fields = [("`version`", &hello.version), ("`clock`", &hello.clock)];
        let missing: Vec<_> = fields.iter().filter(|(_, value)| value.is_empty()).map(|(name, _)| *name).collect();
        if missing.is_empty() {
            return Ok(Found::Passed(text));
        }
        Ok(Found::Warning(format!("{text}; {} is missing, which the window would show", missing.join(" and "))))
    }

    /// Waits, and fails if the driver is gone meanwhile.
    fn wait(&self, patience: Duration) -> Result<(), Wrong> {
        self.driver.shared().wait(patience, Some(&self.cancel), |_| None::<()>)?;
        Ok(())
    }

    /// Sends what only a later version would, and looks whether the driver is still there.
    fn later_versions(&self) -> Checked {
        let shared = self.driver.shared();
        let line = "{\"type\":\"of_a_later_version\",\"with\":[1,{\"a\":null}],\"id\":0}\n".to_owned();
        shared.send_line(line)?;
        let before = shared.lock().pongs;
        let answered = |inner: &mut Inner| (inner.pongs > before + 1).then_some(());
        match shared.wait(self.options.driver.silence, Some(&self.cancel), answered) {
            Ok(Some(())) => Ok(Found::Passed("a message of an unknown type is ignored".into())),
            Ok(None) => wrong("after a message of an unknown type no ping is answered: ignore what is not known"),
            Err(error) => Err(Wrong::from(error).after("after a message of an unknown type")),
        }
    }

    /// Asks for a motion to where the arm is, which must be refused.
    fn read_only(&self) -> Checked {
        let patience = self.options.driver.answer;
        let here = self.driver.first_state(patience, &self.cancel)?;
        let shared = self.driver.shared();
        let goal = self.goal_here(&here.reading);
        let id = shared.request(|id| move_message(id, &goal, 0.01))?;
        let answered = |inner: &mut Inner| match inner.requests.get(&id) {
            Some(Progress::Sent) => None,
            other => Some(other.cloned()),
        };
        match shared.wait(patience, Some(&self.cancel), answered)? {
            Some(Some(Progress::Refused(why))) if why.is_empty() => {
                Ok(Found::Warning("`move` is refused before `arm`, without a `why` that the user could read".into()))
            }
            Some(Some(Progress::Refused(why))) => Ok(Found::Passed(format!("`move` is refused before `arm`: {why}"))),
            None => wrong("`move` is not answered before `arm`: it has to be refused"),
            Some(_) => {
                let _gone_too = self.driver.stop().is_err();
                wrong("`move` was accepted before `arm`: a driver begins read-only and refuses it")
            }
        }
    }
}

/// Closes the input of a process, or the connection, without `bye`.
fn ends_with_its_input(driver: Driver, options: &DriverOptions) -> Checked {
    let shared = driver.shared().clone();
    shared.update(|inner| inner.trial.leaves_without_bye = true);
    let began = Instant::now();
    drop(driver);
    match shared.lock().burial {
        Some(DriverExit::Ended { .. }) => {
            Ok(Found::Passed(format!("it ends {:.2} s after its input is closed", began.elapsed().as_secs_f64())))
        }
        Some(DriverExit::Closed) => Ok(Found::Passed("it closes its end when the connection is closed".into())),
        Some(DriverExit::Killed) | None => wrong(format!(
            "it does not end within {} s after its standard input is closed, which is how it hears that the workbench is gone",
            options.farewell.as_secs_f64()
        )),
        Some(DriverExit::LeftOpen) => {
            wrong("it does not close its end of a connection that was closed: it must brake and wait for the next")
        }
    }
}

/// Starts it again and sends `bye`.
fn ends_after_bye(spec: &DriverSpec, options: &DriverOptions, cancel: &CancelToken) -> Checked {
    let again = Driver::start(spec, options, cancel).map_err(|error| Wrong::from(error).after("the second time"))?;
    let shared = again.shared().clone();
    drop(again);
    match &shared.lock().burial {
        Some(DriverExit::Ended { is_success: false, status }) => {
            Ok(Found::Warning(format!("it ends after `bye`, with {status} and not with 0")))
        }
        Some(DriverExit::Ended { .. }) => Ok(Found::Passed("it starts again and ends after `bye`".into())),
        Some(DriverExit::Closed) => {
            Ok(Found::Passed("it is there for the next connection and closes it after `bye`".into()))
        }
        Some(DriverExit::Killed | DriverExit::LeftOpen) | None => {
            wrong(format!("it does not end within {} s after `bye`", options.farewell.as_secs_f64()))
        }
    }
}
