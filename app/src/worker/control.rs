//! The control worker: reads the robot, starts the simulation, stops the arm.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use handeye_sim_link::client::CancelToken;

use super::link::{Duty, Outlet};
use super::port::{Connected, Connector, ControlPort, PortError};
use super::slot::LatestSlot;
use crate::command::Event;
use crate::text;
use crate::model::{CellSource, Link, RobotState, Severity, Simulation};

/// Rest between two readings: numbers that change faster cannot be read, and each reading draws the window.
const PERIOD: Duration = Duration::from_millis(100);

/// The way of a stop to the arm. It is not a message in a queue that may be full, but a flag that the worker looks at
/// before anything else, and it stays raised until the arm has been stopped.
#[derive(Debug, Default)]
pub struct StopLine(AtomicBool);

impl StopLine {
    /// Asks for a stop.
    pub fn press(&self) {
        self.0.store(true, Ordering::Release);
    }

    /// Whether a stop is asked for and not done.
    pub fn is_pressed(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }

    fn release(&self) {
        self.0.store(false, Ordering::Release);
    }
}

/// What the control worker can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlTask {
    /// Look at the [`StopLine`] now.
    CheckStop,
    /// Let simulated time advance.
    StartSimulation,
}

/// The duty of the control worker.
pub struct Control {
    stop: Arc<StopLine>,
    robot: Arc<LatestSlot<RobotState>>,
    /// The built-in cell belongs to this program, which starts its simulation; on somebody's CoppeliaSim that is for
    /// the user to decide.
    start_by_itself: bool,
}

impl Control {
    /// For a cell, with the places that it shares with the application.
    pub fn new(source: &CellSource, stop: Arc<StopLine>, robot: Arc<LatestSlot<RobotState>>) -> Self {
        Self { stop, robot, start_by_itself: *source == CellSource::BuiltIn }
    }

    fn stop_if_pressed(&self, port: &mut dyn ControlPort, outlet: &Outlet) -> Result<(), PortError> {
        if !self.stop.is_pressed() {
            return Ok(());
        }
        // Released first: pressing again while the arm is being stopped is a new stop, not a lost one.
        self.stop.release();
        match port.stop() {
            Ok(()) => outlet.report(Event::Stopped),
            Err(error) => {
                self.stop.press();
                outlet.notice(Severity::Error, text!("The arm may still move, the stop failed: {error}", error = &error));
                return Err(error);
            }
        }
        Ok(())
    }
}

impl Duty for Control {
    type Port = Box<dyn ControlPort>;
    type Task = ControlTask;
    const LINK: Link = Link::Control;

    fn connect(
        &mut self,
        connector: &dyn Connector,
        shutdown: &CancelToken,
    ) -> Result<Connected<Self::Port>, PortError> {
        let mut connected = connector.connect_control(shutdown)?;
        if self.start_by_itself && connected.port.state()?.simulation == Simulation::Stopped {
            connected.port.start_simulation()?;
        }
        Ok(connected)
    }

    fn turn(&mut self, port: &mut Self::Port, outlet: &Outlet) -> Result<Duration, PortError> {
        self.stop_if_pressed(port.as_mut(), outlet)?;
        self.robot.put(port.state()?);
        (outlet.waker)();
        Ok(PERIOD)
    }

    fn perform(&mut self, port: Option<&mut Self::Port>, task: Self::Task, outlet: &Outlet) -> Result<(), PortError> {
        let Some(port) = port else {
            if task == ControlTask::StartSimulation {
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
        }
    }
}
