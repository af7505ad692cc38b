//! Which versions of the simulator are supported.

use crate::error::LinkError;
use crate::sim::Sim;

/// The oldest version that is supported: the first in which `sim.moveToPose` takes a map of parameters and
/// `sim.getShapeBB` reports where the box about a shape is.
const OLDEST: i64 = 40_700;

/// The version of the simulator, 41000 is 4.10.0; 0 when it does not report it.
///
/// # Errors
/// [`LinkError::TooOld`]; otherwise as for any call.
pub(super) fn program_version(sim: &mut Sim) -> Result<i64, LinkError> {
    match sim.program_version() {
        Ok(version @ 1..OLDEST) => Err(LinkError::TooOld { version: Some(version) }),
        Ok(version) => Ok(version),
        // A server that answers no still serves the cell.
        Err(LinkError::Remote { .. } | LinkError::UnexpectedReply { .. }) => Ok(0),
        Err(error) => Err(error),
    }
}
