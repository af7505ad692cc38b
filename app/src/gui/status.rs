//! The state of the connections in words.

use super::theme::Tone;
use crate::model::{CellSource, Link, LinkState, Model, Simulation};

/// Old enough [s] to say so: a picture that should come many times a second.
pub const STALE_AFTER_S: f64 = 1.0;

/// A state for the user.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// How good it is.
    pub tone: Tone,
    /// What it is, in a few words.
    pub title: String,
    /// Why, and what to do; empty when there is nothing to say.
    pub detail: String,
    /// What the user can press.
    pub action: Option<Action>,
}

/// What helps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Try to connect now.
    Reconnect,
    /// Let simulated time advance.
    StartSimulation,
}

/// The connection as a whole: that of its two halves which is worse off.
pub fn connection(model: &Model) -> Status {
    let (camera, control) = (rank(&model.camera), rank(&model.control));
    let camera_first = lost_since_s(&model.camera) < lost_since_s(&model.control);
    let worse = if camera > control || (camera == control && camera_first) { Link::Camera } else { Link::Control };
    let other = model.link(if worse == Link::Camera { Link::Control } else { Link::Camera });
    let half = match (worse, other.is_connected()) {
        (_, false) => "Connection",
        (Link::Camera, true) => "Camera connection",
        (Link::Control | Link::Motion, true) => "Robot connection",
    };
    of_link(model, model.link(worse), half)
}

/// What the pictures need, when they are not live: a connection, or a simulation that runs.
pub fn hindrance(model: &Model) -> Option<Status> {
    let connection = connection(model);
    if connection.tone != Tone::Good {
        return Some(connection);
    }
    let (title, detail) = match model.resting_simulation()? {
        Simulation::Paused => ("The simulation is paused", "Pictures and joints stand still until it goes on."),
        Simulation::Stopped | Simulation::Running => {
            ("The simulation is stopped", "Pictures are renewed only while it runs.")
        }
    };
    Some(Status {
        tone: Tone::Warning,
        title: title.to_owned(),
        detail: detail.to_owned(),
        action: Some(Action::StartSimulation),
    })
}

/// What is between the start and the first picture.
pub fn before_first_picture(model: &Model) -> Status {
    hindrance(model).unwrap_or_else(|| Status {
        tone: Tone::Busy,
        title: "Waiting for the first picture…".to_owned(),
        detail: "The cell is connected; its camera delivers within a moment.".to_owned(),
        action: None,
    })
}

fn rank(state: &LinkState) -> u8 {
    match state {
        LinkState::Connected { .. } => 0,
        LinkState::StartingCell { .. } | LinkState::Searching { .. } => 1,
        LinkState::Retrying { .. } | LinkState::Lost { .. } => 2,
        LinkState::Failed { .. } => 3,
    }
}

/// When it was lost; later than everything when it was not.
fn lost_since_s(state: &LinkState) -> f64 {
    match state {
        LinkState::Lost { since_s, .. } | LinkState::Retrying { since_s, .. } => *since_s,
        _ => f64::INFINITY,
    }
}

fn of_link(model: &Model, state: &LinkState, half: &str) -> Status {
    let status = |tone, title: String, detail: String, action| Status { tone, title, detail, action };
    match state {
        LinkState::StartingCell { why } => {
            let cell = "A simulated UR5 with a depth camera over a chessboard. It needs nothing else installed.";
            let detail = why.as_deref().map_or_else(|| cell.to_owned(), sentence);
            status(Tone::Busy, "Starting the built-in cell…".to_owned(), detail, None)
        }
        LinkState::Searching { address, attempt, why } => {
            let detail = match why {
                None => "Asking whether a CoppeliaSim or a cell answers there.".to_owned(),
                Some(why) => format!("Try {attempt}. {}", sentence(why)),
            };
            status(Tone::Busy, format!("Searching for {address}…"), detail, Some(Action::Reconnect))
        }
        LinkState::Connected { address, server } => {
            let title = match model.source {
                CellSource::BuiltIn => format!("Connected to the {server}"),
                CellSource::Address(_) => format!("Connected to {server}"),
            };
            status(Tone::Good, title, address.clone(), None)
        }
        LinkState::Lost { since_s, why, .. } => status(
            Tone::Warning,
            format!("{half} lost {} ago", duration(model.now_s - since_s)),
            format!("{} It is tried again in a moment.", sentence(why)),
            Some(Action::Reconnect),
        ),
        LinkState::Retrying { since_s, why, attempt } => status(
            Tone::Warning,
            format!("{half} lost {} ago, retrying", duration(model.now_s - since_s)),
            format!("{} Try {attempt} is under way.", sentence(why)),
            None,
        ),
        LinkState::Failed { why } => {
            let title = match &model.source {
                CellSource::BuiltIn => "The built-in cell did not start".to_owned(),
                CellSource::Address(address) => format!("Cannot connect to {address}"),
            };
            status(Tone::Bad, title, sentence(why), Some(Action::Reconnect))
        }
    }
}

/// First letter large, unless the first word is a name in code; full stop at the end.
fn sentence(text: &str) -> String {
    let is_code =
        text.split_whitespace().next().is_some_and(|word| word.trim_end_matches(['.', ':']).contains(['.', '/']));
    let mut letters = text.chars();
    let Some(first) = letters.next() else { return String::new() };
    let end = if text.ends_with(['.', '!', '?', '…']) { "" } else { "." };
    let first = if is_code { first.to_string() } else { first.to_uppercase().to_string() };
    format!("{first}{}{end}", letters.as_str())
}

/// `3 s`, `2 min 5 s`, `1 h 4 min`.
fn duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0) as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_written_as_people_say_them() {
        assert_eq!(duration(-1.0), "0 s");
        assert_eq!(duration(59.9), "59 s");
        assert_eq!(duration(125.0), "2 min 5 s");
        assert_eq!(duration(3840.0), "1 h 4 min");
    }

    #[test]
    fn a_reason_becomes_a_sentence() {
        assert_eq!(sentence("nothing answers"), "Nothing answers.");
        assert_eq!(sentence("Done."), "Done.");
        assert_eq!(sentence("sim.getObject: no answer"), "sim.getObject: no answer.");
        assert_eq!(sentence(""), "");
    }
}
