//! Whether time advances.

use crate::constants::{SIMULATION_ADVANCING, SIMULATION_PAUSED, SIMULATION_STOPPED};

/// Whether time advances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SimulationState {
    /// It does not, and the scene is as it was before the start.
    Stopped,
    /// It does not for now.
    Paused,
    /// It does; also in the passes that lead in and out of a pause or a stop.
    Running,
}

impl SimulationState {
    pub(super) fn from_code(code: i64) -> Option<Self> {
        match code {
            SIMULATION_STOPPED => Some(Self::Stopped),
            SIMULATION_PAUSED => Some(Self::Paused),
            code if code > 0 && code & SIMULATION_ADVANCING != 0 => Some(Self::Running),
            _ => None,
        }
    }
}
