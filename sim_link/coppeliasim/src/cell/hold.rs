//! Holding the simulation for several calls that have to see, or make, one and the same instant.

use crate::error::LinkError;
use crate::sim::Sim;

/// A simulation that waits.
#[must_use = "the simulation stands until it is released"]
pub(super) struct Held {
    epoch: u64,
}

impl Held {
    /// Holds the simulation.
    pub fn acquire(sim: &mut Sim) -> Result<Self, LinkError> {
        match sim.acquire_lock() {
            Ok(()) => Ok(Self { epoch: sim.connection().epoch() }),
            Err(error) => {
                // The request may still reach the server, which would then be held with no client to release it.
                sim.connection().renew();
                Err(error)
            }
        }
    }

    /// Lets the simulation go on, whatever came out of the calls.
    pub fn release<T>(self, sim: &mut Sim, outcome: Result<T, LinkError>) -> Result<T, LinkError> {
        if sim.connection().epoch() == self.epoch {
            match sim.release_lock() {
                Ok(()) => return outcome,
                Err(error) => {
                    sim.connection().renew();
                    return outcome.and(Err(error));
                }
            }
        }
        // The conversation broke: a server that is still there must not stay held, and what was read, also by calls that
        // went well, may be of more than one instant.
        sim.connection().renew();
        let broken = sim.connection().broken_off("sim.releaseLock");
        outcome.and(Err(broken))
    }
}
