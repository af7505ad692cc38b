//! The connection error for an error of the client.

use handeye_coppeliasim::cell::Arm;
use handeye_coppeliasim::{Connection, LinkError};

use crate::PortError;
use handeye_wording::Text;
use handeye_wording::text;

/// Whether the cell is connected, as far as is known without a request.
pub(crate) fn check_arm(arm: &mut Arm) -> Result<(), PortError> {
    check(arm.sim().connection())
}

pub(crate) fn port_error(error: LinkError) -> PortError {
    let text = match &error {
        // Which call found out does not matter when no server answers any call.
        LinkError::Unreachable { endpoint, .. } => text!(
            "Nothing answers at {endpoint}. Start CoppeliaSim or a cell there, check that its ZMQ remote API add-on is \
             enabled and which port its status bar shows (usually 23000).",
            endpoint = endpoint
        ),
        LinkError::NoSuchObject { path, there, .. } if there.is_empty() => text!(
            "The scene has no {path}. Open the scene of the cell, or say where it has that part: under Connect, Objects of the \
             scene, or by --object on the command line",
            path = path
        ),
        LinkError::NoSuchObject { path, there, .. } => text!(
            "The scene has no {path}, but {there}. Say which it is, under Connect, Objects of the scene, or by --object on the \
             command line; or open the scene of the cell",
            path = path,
            there = there.join(", ")
        ),
        LinkError::Disconnected { .. } => closed(),
        LinkError::OwnCellEnded { .. } => own_cell_ended(),
        LinkError::OwnCellSilent { after, .. } => text!(
            "The built-in cell has not answered for {seconds} s: this computer has too much to do",
            seconds = after.as_secs()
        ),
        other => other.into(),
    };
    match error {
        LinkError::BadEndpoint { .. } => PortError::Hopeless(text),
        error if is_lost(&error) => PortError::Lost(text),
        LinkError::Held { .. } => PortError::Held(text),
        _ => PortError::Refused(text),
    }
}

/// Whether a new connection is needed: also where the server no longer knows this client, as after this computer was asleep.
pub(crate) fn is_lost(error: &LinkError) -> bool {
    error.is_connection_loss() || matches!(error, LinkError::Forgotten { .. })
}

/// Why nothing answers now.
fn closed() -> Text {
    text!("The server closed the connection. Start it again if it has ended.")
}

/// No action is needed: this program starts it.
fn own_cell_ended() -> Text {
    text!("The built-in cell has ended, and is started again")
}

pub(super) fn check(connection: &mut Connection) -> Result<(), PortError> {
    if connection.is_connected() {
        return Ok(());
    }
    Err(PortError::Lost(if connection.is_of_own_cell() { own_cell_ended() } else { closed() }))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use handeye_wording::English;

    #[test]
    fn the_built_in_cell_is_not_to_be_started_again_by_a_person() {
        let call = || "sim.getObjectPose".to_owned();
        let ended = LinkError::OwnCellEnded { call: call() };
        let silent = LinkError::OwnCellSilent { call: call(), after: Duration::from_secs(30) };
        for (error, says) in [(ended, "is started again"), (silent, "for 30 s: this computer has too much to do")] {
            let PortError::Lost(why) = port_error(error) else { panic!("it is connected to again") };
            let reported = why.in_language(English);
            assert!(reported.contains(says) && !reported.contains("Start it"), "{reported}");
        }
        let PortError::Lost(other) = port_error(LinkError::Disconnected { call: call() }) else { panic!("it is lost") };
        assert!(other.in_language(English).contains("Start it again if it has ended"));
    }
}
