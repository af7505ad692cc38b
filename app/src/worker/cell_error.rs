//! What an error of the client means for a connection.

use handeye_sim_link::client::LinkError;
use handeye_sim_link::client::cell::Arm;

use crate::text;
use crate::text::Text;
use crate::worker::port::PortError;

/// Whether the cell is there, as far as is known without asking.
pub(crate) fn check_arm(arm: &mut Arm) -> Result<(), PortError> {
    check(arm.sim().connection().is_connected())
}

pub(crate) fn port_error(error: LinkError) -> PortError {
    let text = match &error {
        // Which call found out is of no interest when nobody is there for any call.
        LinkError::Unreachable { endpoint, .. } => text!(
            "Nothing answers at {endpoint}. Start CoppeliaSim or a cell there, check that its ZMQ remote API add-on is \
             enabled and which port its status bar shows (usually 23000).",
            endpoint = endpoint
        ),
        LinkError::NoSuchObject { path, there, .. } if there.is_empty() => text!(
            "The scene has no {path}. Open the scene of the cell, or say under Connect, Objects of the scene, where it has \
             that part",
            path = path
        ),
        LinkError::NoSuchObject { path, there, .. } => text!(
            "The scene has no {path}, but {there}. Say under Connect, Objects of the scene, which it is, or open the scene \
             of the cell",
            path = path,
            there = there.join(", ")
        ),
        LinkError::Disconnected { .. } => closed(),
        other => Text::verbatim(other.to_string()),
    };
    match error {
        LinkError::BadEndpoint { .. } => PortError::Hopeless(text),
        error if error.is_connection_loss() => PortError::Lost(text),
        _ => PortError::Refused(text),
    }
}

/// Why nothing answers now.
pub(super) fn closed() -> Text {
    text!("The server closed the connection. Start it again if it has ended.")
}

pub(super) fn check(is_connected: bool) -> Result<(), PortError> {
    if is_connected { Ok(()) } else { Err(PortError::Lost(closed())) }
}
