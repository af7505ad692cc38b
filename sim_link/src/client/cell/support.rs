//! What works with which version of the simulator.

use serde::{Deserialize, Serialize};

use super::ProtocolVersion;
use crate::client::error::LinkError;
use crate::client::sim::Sim;

/// The oldest version that has every function that is called: 4.4 has no resolution of a vision sensor, 4.3 no image by
/// the name used here, 4.2 no objects by path.
const OLDEST: i64 = 40_500;

/// From this version on a motion of the tip takes a map of parameters.
const TIP_MOTIONS: i64 = 40_700;

/// What works with a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Support {
    /// Everything.
    Whole,
    /// Everything, but that the tip of an arm whose kinematics is not built in cannot be moved to a pose: CoppeliaSim 4.6.
    KnownArms,
    /// The simulation cannot be held for a moment, so images belong to their poses only where nothing moves:
    /// CoppeliaSim 4.5.
    AtRest,
}

impl Support {
    /// Of a server; one that does not tell its version is taken to have everything.
    pub fn of(protocol: ProtocolVersion, program_version: i64) -> Self {
        match program_version {
            _ if protocol == ProtocolVersion::V1 => Self::AtRest,
            1..TIP_MOTIONS => Self::KnownArms,
            _ => Self::Whole,
        }
    }
}

/// The version of the simulator, 41000 is 4.10.0; 0 when it does not tell.
///
/// # Errors
/// [`LinkError::TooOld`]; otherwise as for any call.
pub(super) fn program_version(sim: &mut Sim) -> Result<i64, LinkError> {
    match sim.program_version() {
        Ok(version @ 1..OLDEST) => Err(LinkError::TooOld { version: version_name(version) }),
        Ok(version) => Ok(version),
        // A server that answers no still serves the cell.
        Err(LinkError::Remote { .. } | LinkError::UnexpectedReply { .. }) => Ok(0),
        Err(error) => Err(error),
    }
}

/// How people write a version: 41000 is 4.10.0.
pub fn version_name(version: i64) -> String {
    format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
}
