//! Calls that do not answer at once: they wait for passes of the simulation, for a callback, or for the clock.

use std::time::Duration;

use ciborium::Value;

use super::args::ApiError;
use super::cell::Cell;
use handeye_cell::world::State;

/// What a function answers.
#[derive(Debug)]
pub enum Answer {
    /// Return values.
    Values(Vec<Value>),
    /// A reply that is already bytes.
    Encoded(Vec<u8>),
    /// The list of functions of a namespace, or an error if there is no such namespace.
    Info(String),
    /// Nothing, or an error if there is no namespace of this name.
    Require(String),
    /// Something that takes longer.
    Later(Box<dyn Task>),
}

/// Why a task goes on.
#[derive(Debug, Clone, PartialEq)]
pub enum Wake {
    /// It has just been made.
    Started,
    /// A pass is over, or none will come because the simulation does not advance.
    PassOver,
    /// Its callback has returned.
    Executed(Vec<Value>),
    /// The time that it waited for has come.
    TimeReached,
}

/// What a task waits for next.
#[derive(Debug)]
pub enum Next {
    /// The end of the pass that is under way.
    Pass,
    /// The return of a function of the client.
    Callback {
        name: String,
        /// Its arguments.
        args: Vec<Value>,
    },
    /// A time on the server's clock.
    Time(Duration),
    /// Nothing: it is done.
    Return(Vec<Value>),
}

/// A call under way.
pub trait Task: std::fmt::Debug + Send {
    /// Goes on until there is something to wait for.
    ///
    /// # Errors
    /// The call has failed, and with it the task.
    fn resume(&mut self, cell: &mut Cell, wake: Wake) -> Result<Next, ApiError>;

    /// Comes to rest within its limits as soon as they allow, and then returns. Tasks that move nothing go on.
    fn brake(&mut self, _cell: &Cell) {}

    /// Whether it moves an object that must brake when its client disconnects.
    fn is_moving(&self) -> bool {
        false
    }
}

/// `sim.step`: until the pass under way is over.
#[derive(Debug)]
pub struct StepTask;

impl Task for StepTask {
    fn resume(&mut self, _cell: &mut Cell, wake: Wake) -> Result<Next, ApiError> {
        Ok(if wake == Wake::Started { Next::Pass } else { Next::Return(Vec::new()) })
    }
}

/// `sim.stopSimulation(true)`: until the simulation has stopped, but not for longer than twenty passes.
#[derive(Debug, Default)]
pub struct StopTask {
    passes: usize,
}

impl Task for StopTask {
    fn resume(&mut self, cell: &mut Cell, _wake: Wake) -> Result<Next, ApiError> {
        if cell.world.simulation().state() == State::Stopped || self.passes == 20 {
            return Ok(Next::Return(Vec::new()));
        }
        self.passes += 1;
        Ok(Next::Pass)
    }
}

/// `sim.wait`: for an amount of simulated or real time; returns by how much it was exceeded.
#[derive(Debug)]
pub struct WaitTask {
    /// Seconds to wait.
    pub seconds: f64,
    /// Whether `since_s` is simulated time.
    pub simulated: bool,
    /// Time at the call.
    pub since_s: f64,
}

impl WaitTask {
    /// Interval at which a wait for simulated time checks whether the simulation advances again. A shorter one would
    /// make no visible difference, and the server sleeps in between.
    const LOOK_AGAIN: Duration = Duration::from_millis(20);
}

impl Task for WaitTask {
    fn resume(&mut self, cell: &mut Cell, _wake: Wake) -> Result<Next, ApiError> {
        let now_s = if self.simulated { cell.world.simulation().time_s() } else { cell.now.as_secs_f64() };
        // A simulation that was started again has its clock back at zero.
        self.since_s = self.since_s.min(now_s);
        let over_s = now_s - self.since_s - self.seconds;
        if over_s >= 0.0 {
            return Ok(Next::Return(vec![Value::Float(over_s)]));
        }
        if !self.simulated {
            let left = Duration::try_from_secs_f64(-over_s).unwrap_or(Duration::MAX);
            return Ok(Next::Time(cell.now.saturating_add(left)));
        }
        if cell.world.simulation().is_advancing() {
            Ok(Next::Pass)
        } else {
            Ok(Next::Time(cell.now + Self::LOOK_AGAIN))
        }
    }
}

/// `sim.testCB`: calls a function of the client repeatedly and returns its last result.
#[derive(Debug)]
pub struct CallbackTask {
    pub name: String,
    /// Its arguments.
    pub args: Vec<Value>,
    /// Calls still to make.
    pub left: u64,
}

impl Task for CallbackTask {
    fn resume(&mut self, _cell: &mut Cell, wake: Wake) -> Result<Next, ApiError> {
        match wake {
            Wake::Executed(values) if self.left == 0 => Ok(Next::Return(values)),
            _ => {
                self.left = self.left.saturating_sub(1);
                Ok(Next::Callback { name: self.name.clone(), args: self.args.clone() })
            }
        }
    }
}
