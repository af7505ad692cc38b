//! The control worker: reads the robot, starts the simulation, stops the arm.

use std::sync::Arc;
use std::time::Duration;

use handeye_coppeliasim::CancelToken;
use handeye_driver::LogLevel;
use handeye_geometry::frames::{Base, Pose, Tip};

use crate::connect::state::Link;
use crate::messages::state::Severity;
use crate::motion::stop_line::StopLine;
use crate::track::state::BoardMotion;
use crate::worker::channels::LatestSlot;
use crate::worker::link::{Duty, Outlet};
use crate::worker::shared::MAX_EVENTS;
use crate::{connect, motion};
use handeye_link::{Cell, Connected, ControlPort, PortError};
use handeye_link::{CellSource, RobotState, Simulation};
use handeye_wording::text;

/// Pause between two readings: numbers that change faster cannot be read, and each reading redraws the window.
const PERIOD: Duration = Duration::from_millis(100);

/// Requests to the control worker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ControlTask {
    /// Look at the [`StopLine`] now.
    CheckStop,
    /// Let simulated time advance.
    StartSimulation,
    /// Move the board of a simulated cell.
    MoveBoard(BoardMotion),
    /// Hide it, or show it again.
    HideBoard(bool),
    /// Let a robot behind a driver be moved, or no longer.
    Arm(bool),
    /// The pose that the user reads off the pendant.
    TypePose(Option<Pose<Base, Tip>>),
}

/// The job of the control worker.
pub struct Control {
    stop: Arc<StopLine>,
    robot: Arc<LatestSlot<Option<RobotState>>>,
    /// The newest state in the slot is a known one.
    is_known: bool,
    /// The built-in cell belongs to this program, which starts its simulation; on a user's CoppeliaSim that is for the
    /// user to decide.
    start_by_itself: bool,
    /// The connection is new, and its facts are not reported yet.
    owes_facts: bool,
}

impl Control {
    /// For a cell, with the places that it shares with the application.
    pub fn new(source: &CellSource, stop: Arc<StopLine>, robot: Arc<LatestSlot<Option<RobotState>>>) -> Self {
        Self { stop, robot, is_known: false, start_by_itself: source.is_built_in(), owes_facts: true }
    }

    fn stop_if_pressed(&self, port: &mut dyn ControlPort, outlet: &Outlet) -> Result<(), PortError> {
        let Some(number) = self.stop.wanted() else { return Ok(()) };
        match port.stop() {
            Ok(()) => {
                self.stop.finish(number);
                outlet.report(motion::Event::Stopped);
                Ok(())
            }
            Err(error) => {
                let text = text!("The arm may still move, the stop failed: {error}", error = error.why().clone());
                outlet.notice(Severity::Error, text);
                Err(error)
            }
        }
    }
}

impl Duty for Control {
    type Port = Box<dyn ControlPort>;
    type Task = ControlTask;
    const LINK: Link = Link::Control;

    fn connect(&mut self, connector: &dyn Cell, shutdown: &CancelToken) -> Result<Connected<Self::Port>, PortError> {
        let mut connected = connector.control(shutdown)?;
        self.owes_facts = true;
        if self.start_by_itself && connected.port.state()?.is_some_and(|state| state.simulation == Simulation::Stopped)
        {
            connected.port.start_simulation()?;
        }
        Ok(connected)
    }

    fn turn(&mut self, port: &mut Self::Port, outlet: &Outlet) -> Result<Duration, PortError> {
        self.stop_if_pressed(port.as_mut(), outlet)?;
        if std::mem::take(&mut self.owes_facts) || port.facts_differ() {
            outlet.report(connect::Event::Cell(Box::new(port.facts()?)));
        }
        for (level, words) in port.heard() {
            let severity = match level {
                LogLevel::Error => Severity::Error,
                LogLevel::Warn => Severity::Warning,
                LogLevel::Info => Severity::Info,
                LogLevel::Debug => continue,
            };
            if outlet.events.len() < MAX_EVENTS {
                outlet.report(connect::Event::Heard { severity, words });
            } else {
                tracing::warn!(?severity, words, "the window is too busy to show what a driver says");
            }
        }
        let state = port.state()?;
        let was_known = std::mem::replace(&mut self.is_known, state.is_some());
        if was_known || state.is_some() {
            self.robot.put(state);
            (outlet.waker)();
        }
        Ok(PERIOD)
    }

    fn perform(&mut self, port: Option<&mut Self::Port>, task: Self::Task, outlet: &Outlet) -> Result<(), PortError> {
        let Some(port) = port else {
            if matches!(task, ControlTask::StartSimulation) {
                let text = text!("The simulation cannot be started: there is no connection to the cell");
                outlet.notice(Severity::Warning, text);
            }
            return Ok(());
        };
        match task {
            ControlTask::CheckStop => self.stop_if_pressed(port.as_mut(), outlet),
            ControlTask::StartSimulation => match port.start_simulation() {
                Ok(()) => {
                    outlet.notice(Severity::Info, text!("Simulation started"));
                    Ok(())
                }
                Err(PortError::Refused(why)) => {
                    outlet.notice(Severity::Error, text!("The simulation did not start: {why}", why = why));
                    Ok(())
                }
                Err(error) => Err(error),
            },
            ControlTask::MoveBoard(motion) => board_answer(port.move_board(&motion.of_cell()), outlet),
            ControlTask::HideBoard(hidden) => board_answer(port.hide_board(hidden), outlet),
            ControlTask::Arm(on) => match port.arm(on) {
                Err(PortError::Refused(why)) => {
                    outlet.notice(Severity::Error, text!("The robot cannot be moved from here: {why}", why = why));
                    Ok(())
                }
                answer => answer,
            },
            ControlTask::TypePose(pose) => match port.type_pose(pose) {
                Err(PortError::Refused(why)) => {
                    outlet.notice(Severity::Warning, why);
                    Ok(())
                }
                answer => answer,
            },
        }
    }
}

fn board_answer(answer: Result<(), PortError>, outlet: &Outlet) -> Result<(), PortError> {
    match answer {
        Err(PortError::Refused(why)) => {
            outlet.notice(Severity::Warning, text!("The board stays as it is: {why}", why = why));
            Ok(())
        }
        answer => answer,
    }
}
