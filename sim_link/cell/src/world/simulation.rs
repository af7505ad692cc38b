//! The simulation's states, its time, and the world as it was before the start.

use nalgebra::Isometry3;

use super::error::WorldError;
use super::tree::{Kind, Tree};
use crate::world::handle::Handle;

/// Length of a pass in seconds that a new world has.
pub(crate) const DEFAULT_TIME_STEP_S: f64 = 0.05;

/// Lengths of a pass that a client may set.
const TIME_STEPS_S: std::ops::RangeInclusive<f64> = 1e-4..=1.0;

/// State of the simulation, with the API's numbers. Those from 16 on are the advancing ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Nothing moves, time stays at its last value.
    Stopped = 0,
    /// Between two passes, until it is resumed.
    Paused = 8,
    /// The first pass is under way.
    FirstAfterStop = 16,
    /// Any pass.
    Running = 17,
    /// The last pass before a pause.
    LastBeforePause = 19,
    /// The first pass after a pause.
    FirstAfterPause = 20,
    /// A stop was requested.
    AboutToStop = 21,
    /// The last pass.
    LastBeforeStop = 22,
}

/// The clock of the world.
#[derive(Debug, Clone)]
pub struct Simulation {
    state: State,
    time_s: f64,
    time_step_s: f64,
    pause_wanted: bool,
    stop_wanted: bool,
    before_start: Vec<Before>,
}

/// An object as it was before the start.
#[derive(Debug, Clone)]
struct Before {
    handle: Handle,
    parent: Option<Handle>,
    local: Isometry3<f64>,
    joint_rad: Option<f64>,
    hidden: bool,
}

impl Default for Simulation {
    fn default() -> Self {
        Self {
            state: State::Stopped,
            time_s: 0.0,
            time_step_s: DEFAULT_TIME_STEP_S,
            pause_wanted: false,
            stop_wanted: false,
            before_start: Vec::new(),
        }
    }
}

impl Simulation {
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether passes are being run.
    pub fn is_advancing(&self) -> bool {
        !matches!(self.state, State::Stopped | State::Paused)
    }

    /// Simulated seconds since the start; keeps its last value after the end. Time steps are added up one by one, as the
    /// simulator does, with what rounding makes of it: 5 s are 101 passes of 0.05 s away.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// [`Self::time_s`] at the end of the pass under way.
    pub(super) fn time_after_pass_s(&self) -> f64 {
        self.time_s + self.time_step_s
    }

    /// Length of one pass in seconds.
    pub fn time_step_s(&self) -> f64 {
        self.time_step_s
    }

    /// Sets the length of one pass.
    ///
    /// # Errors
    /// While a simulation runs; for a length that is not between 0.1 ms and 1 s.
    pub(crate) fn set_time_step(&mut self, time_step_s: f64) -> Result<(), WorldError> {
        if self.state != State::Stopped {
            return Err(WorldError::SimulationNotStopped);
        }
        if !TIME_STEPS_S.contains(&time_step_s) {
            return Err(WorldError::InvalidArguments);
        }
        self.time_step_s = time_step_s;
        Ok(())
    }

    /// Starts from stopped, remembering where everything is, or resumes from a pause. In any other state it only
    /// cancels a requested pause.
    pub(super) fn start(&mut self, tree: &Tree) {
        match self.state {
            State::Stopped => {
                self.state = State::FirstAfterStop;
                self.time_s = 0.0;
                self.before_start = tree
                    .iter()
                    .map(|(handle, object)| {
                        let joint_rad = match &object.kind {
                            Kind::Joint(joint) => Some(joint.position_rad()),
                            _ => None,
                        };
                        let (parent, local) = (object.parent(), *object.local());
                        Before { handle, parent, local, joint_rad, hidden: object.hidden }
                    })
                    .collect();
            }
            State::Paused => self.state = State::FirstAfterPause,
            _ => {}
        }
        self.pause_wanted = false;
    }

    /// Asks for a pause after the pass that is under way.
    pub(super) fn pause(&mut self) {
        self.pause_wanted = matches!(self.state, State::FirstAfterStop | State::Running | State::FirstAfterPause);
    }

    /// Asks for the end, which comes after about three passes.
    pub(super) fn stop(&mut self) {
        match self.state {
            State::Stopped | State::AboutToStop | State::LastBeforeStop => {}
            State::Paused => self.state = State::AboutToStop,
            _ => self.stop_wanted = true,
        }
    }

    /// Ends a pass: time moves on, the state changes. `true` when this was the last pass.
    pub(super) fn end_pass(&mut self) -> bool {
        self.time_s = self.time_after_pass_s();
        self.state = match self.state {
            State::AboutToStop => State::LastBeforeStop,
            State::LastBeforeStop => State::Stopped,
            State::LastBeforePause if !self.stop_wanted => State::Paused,
            _ if std::mem::take(&mut self.stop_wanted) => State::AboutToStop,
            _ if std::mem::take(&mut self.pause_wanted) => State::LastBeforePause,
            _ => State::Running,
        };
        self.state == State::Stopped
    }

    /// Puts everything back to where it was before the start. What has another parent now stays, as its old pose was
    /// one under the old parent.
    pub(super) fn restore(&mut self, tree: &mut Tree) {
        (self.pause_wanted, self.stop_wanted) = (false, false);
        for Before { handle, parent, local, joint_rad, hidden } in std::mem::take(&mut self.before_start) {
            // What was removed meanwhile stays removed.
            let Ok(object) = tree.get_mut(handle) else { continue };
            if let (Kind::Joint(joint), Some(position_rad)) = (&mut object.kind, joint_rad) {
                joint.reset(position_rad);
            }
            object.hidden = hidden;
            if object.parent() == parent {
                object.local = local;
            }
        }
    }
}
