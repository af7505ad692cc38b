//! Holding the simulation for several calls that have to see, or make, one and the same instant.

use crate::client::error::LinkError;
use crate::client::sim::Sim;

/// Whether the server of a connection can be held, as far as is known.
#[derive(Debug)]
pub(super) struct Hold {
    is_possible: bool,
}

/// A simulation that waits.
#[must_use = "the simulation stands until it is released"]
pub(super) struct Held {
    epoch: u64,
}

impl Default for Hold {
    /// To be found out at the first use.
    fn default() -> Self {
        Self { is_possible: true }
    }
}

impl Hold {
    /// Holds the simulation; `None` when the server cannot be held.
    pub fn acquire(&mut self, sim: &mut Sim) -> Result<Option<Held>, LinkError> {
        if !self.is_possible {
            return Ok(None);
        }
        match sim.acquire_lock() {
            Ok(()) => Ok(Some(Held { epoch: sim.connection().epoch() })),
            Err(error) if error.is_unknown_function() => {
                self.is_possible = false;
                Ok(None)
            }
            Err(error) => {
                // The request may still reach the server, which would then be held with nobody to let go.
                sim.connection().renew();
                Err(error)
            }
        }
    }
}

impl Held {
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
