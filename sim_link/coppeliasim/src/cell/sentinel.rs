//! Detects a stop that another client requests.
//!
//! To the server a jog is a series of points, not a motion that a stop could brake. So a dummy motion, of a number that
//! slowly grows, runs along with it: the cell's stop ends that one too, and its next step reports it.

use ciborium::Value;

use super::CellInfo;
use crate::constants::MOTION_STOPPED;
use crate::error::LinkError;
use crate::sim::Sim;
use handeye_wire as wire;

/// Slow enough to be quick to brake.
const SPEED: f64 = 1e-3;

/// At that speed more than a day away: an arm may follow for long.
const END: f64 = 100.0;

/// A motion of nothing. CoppeliaSim has no stop for all clients, so there it is not begun.
pub(super) struct Sentinel(Option<Value>);

impl Sentinel {
    /// Begins to listen.
    pub fn begin(sim: &mut Sim, info: &CellInfo) -> Result<Self, LinkError> {
        if !info.is_handeye_cell {
            return Ok(Self(None));
        }
        let one = |value: f64| wire::floats([value]);
        let motion = wire::map([
            ("pos", one(0.0)),
            ("targetPos", one(END)),
            ("maxVel", one(SPEED)),
            ("maxAccel", one(1.0)),
            ("maxJerk", one(1000.0)),
        ]);
        let state = sim.connection().call("sim.moveToConfig_init", vec![motion])?.into_map(0)?;
        Ok(Self(Some(state)))
    }

    /// Whether a client has stopped everything since; to be called once per pass.
    pub fn is_stopped(&mut self, sim: &mut Sim) -> Result<bool, LinkError> {
        let Some(state) = &mut self.0 else { return Ok(false) };
        let reply =
            sim.connection().call("sim.moveToConfig_step", vec![state.clone()]).map_err(LinkError::of_motion_step)?;
        let code = reply.integer(0)?;
        *state = reply.into_map(1)?;
        Ok(code == MOTION_STOPPED)
    }

    /// Has the server forget it.
    pub fn end(self, sim: &mut Sim) -> Result<(), LinkError> {
        let Some(state) = self.0 else { return Ok(()) };
        sim.connection().call("sim.moveToConfig_cleanup", vec![state]).map(drop)
    }
}
