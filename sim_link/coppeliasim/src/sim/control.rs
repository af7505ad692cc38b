//! The simulation as a whole: run, pause, stop, step, and the simulator's settings.

use std::time::Duration;

use ciborium::Value;

use super::Sim;
use super::simulation_state::SimulationState;
use crate::constants::INT_PROGRAM_VERSION;
use crate::error::LinkError;
use crate::options::CallOptions;

/// Longest wait for the end of a simulation: it takes about three passes, and those of a large scene are slow.
const END: Duration = Duration::from_secs(10);

impl Sim {
    /// Starts the simulation, or lets a paused one go on.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call, as everywhere here.
    pub fn start_simulation(&mut self) -> Result<(), LinkError> {
        self.call("sim.startSimulation", Vec::new()).map(drop)
    }

    /// Pauses the simulation within two passes.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn pause_simulation(&mut self) -> Result<(), LinkError> {
        self.call("sim.pauseSimulation", Vec::new()).map(drop)
    }

    /// Stops the simulation within a few passes; every object goes back to where it was before the start, and every
    /// client's stepping mode ends.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn stop_simulation(&mut self) -> Result<(), LinkError> {
        self.call("sim.stopSimulation", Vec::new()).map(drop)
    }

    /// [`Sim::stop_simulation`], and waits for the end: until then a start is ignored, and the next client to start it
    /// would get a simulation that ends.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; [`LinkError::Timeout`] when the end does not come within ten seconds.
    pub fn stop_simulation_and_wait(&mut self) -> Result<(), LinkError> {
        self.stop_simulation()?;
        let began = std::time::Instant::now();
        while self.get_simulation_state()? != SimulationState::Stopped {
            if began.elapsed() > END {
                return Err(LinkError::Timeout { call: "sim.stopSimulation".to_owned(), after: began.elapsed() });
            }
            // A pass later, or at once where no more passes run.
            self.step(&CallOptions::default())?;
        }
        Ok(())
    }

    /// Whether time advances.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn get_simulation_state(&mut self) -> Result<SimulationState, LinkError> {
        let call = "sim.getSimulationState";
        let code = self.call(call, Vec::new())?.integer(0)?;
        SimulationState::from_code(code).ok_or_else(|| LinkError::UnexpectedReply {
            call: call.to_owned(),
            expected: "a simulation state".to_owned(),
            got: code.to_string(),
        })
    }

    /// Simulated time (s).
    ///
    /// # Errors
    /// Any [`LinkError`] of a call; [`LinkError::UnexpectedReply`] when it is not finite.
    pub fn get_simulation_time(&mut self) -> Result<f64, LinkError> {
        let call = "sim.getSimulationTime";
        let time_s = self.call(call, Vec::new())?.number(0)?;
        // Waiting for such a time would never end.
        time_s.is_finite().then_some(time_s).ok_or_else(|| LinkError::UnexpectedReply {
            call: call.to_owned(),
            expected: "a finite time".to_owned(),
            got: time_s.to_string(),
        })
    }

    /// Simulated time that one pass takes (s).
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_simulation_time_step(&mut self) -> Result<f64, LinkError> {
        self.call("sim.getSimulationTimeStep", Vec::new())?.number(0)
    }

    /// Takes the simulation into this client's hand: time advances only in [`Sim::step`], until it is given back by
    /// `false` as often as it was taken.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn set_stepping(&mut self, enable: bool) -> Result<(), LinkError> {
        self.call("sim.setStepping", vec![Value::from(enable)]).map(drop)
    }

    /// Waits until the next pass of the simulation is complete, and in stepping mode makes it happen: images and poses
    /// read afterwards belong together. Returns at once when the simulation is stopped or paused.
    ///
    /// # Errors
    /// [`LinkError::Held`] when another client has kept the pass from beginning for three seconds, in stepping mode or by
    /// a lock; this client's own stepping and locks are then over. Otherwise as for any call.
    pub fn step(&mut self, options: &CallOptions) -> Result<(), LinkError> {
        let options = CallOptions { awaits_pass: true, ..options.clone() };
        self.call_with("sim.step", Vec::new(), &options).map(drop)
    }

    /// Holds the simulation where it is until [`Sim::release_lock`], so that several calls see the same instant.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub fn acquire_lock(&mut self) -> Result<(), LinkError> {
        self.call("sim.acquireLock", Vec::new()).map(drop)
    }

    /// Lets the simulation go on.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn release_lock(&mut self) -> Result<(), LinkError> {
        self.call("sim.releaseLock", Vec::new()).map(drop)
    }

    /// An integer setting of the simulator.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn get_int_param(&mut self, id: i64) -> Result<i64, LinkError> {
        self.call("sim.getInt32Param", vec![Value::from(id)])?.integer(0)
    }

    /// Version of the simulator: 41000 is 4.10.0.
    ///
    /// # Errors
    /// Any [`LinkError`] of a call.
    pub(crate) fn program_version(&mut self) -> Result<i64, LinkError> {
        self.get_int_param(INT_PROGRAM_VERSION)
    }
}
