//! The state of the connections in words.

use super::style::theme::Tone;
use handeye_wording::text;
pub use handeye_workbench::model::STALE_AFTER_S;
use handeye_workbench::model::{CellSource, Link, LinkState, Model, Simulation};
use handeye_workbench::text::{Language, Text};

/// The age of the robot's state, if it is not current.
pub fn robot_age(model: &Model) -> Option<Text> {
    if model.is_robot_live() {
        return None;
    }
    Some(match model.robot_read_s {
        Some(read_s) => text!("last read {ago} ago", ago = duration(model.now_s - read_s)),
        None => text!("not read yet"),
    })
}

/// A pause \[s\] that is over before it can be read.
const SOON_S: f64 = 2.0;

/// A state for the user.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// How good it is.
    pub tone: Tone,
    /// What it is, in a few words.
    pub title: Text,
    /// Why, and what to do; empty if there is nothing to report.
    pub detail: Text,
    /// What the user can press.
    pub action: Option<Action>,
}

/// A remedy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Try to connect now.
    Reconnect,
    /// Try to connect now, or stop restarting drivers.
    ReconnectOrStop,
    /// Stop restarting drivers.
    StopTrying,
    /// Let simulated time advance.
    StartSimulation,
    /// Let a paused simulation continue.
    ContinueSimulation,
}

/// The connection as a whole: the worse one of its two halves.
pub fn connection(model: &Model) -> Status {
    let (camera, control) = (rank(&model.camera), rank(&model.control));
    let camera_first = lost_since_s(&model.camera) < lost_since_s(&model.control);
    let worse = if camera > control || (camera == control && camera_first) { Link::Camera } else { Link::Control };
    let other = model.link(if worse == Link::Camera { Link::Control } else { Link::Camera });
    let half = match (worse, other.is_connected()) {
        (_, false) => text!("Connection"),
        (Link::Camera, true) => text!("Camera connection"),
        (Link::Control | Link::Motion, true) => text!("Robot connection"),
    };
    of_link(model, model.link(worse), half)
}

/// What the images need, when they are not live: a connection, or a running simulation.
pub fn hindrance(model: &Model) -> Option<Status> {
    let connection = connection(model);
    if connection.tone != Tone::Good {
        return Some(connection);
    }
    let (title, detail, action) = match model.resting_simulation()? {
        Simulation::Paused => (
            text!("The simulation is paused"),
            text!("Images and joints stand still until it goes on."),
            Action::ContinueSimulation,
        ),
        Simulation::Stopped | Simulation::Running => (
            text!("The simulation is stopped"),
            text!("Images are updated only while it runs."),
            Action::StartSimulation,
        ),
    };
    Some(Status { tone: Tone::Warning, title, detail, action: Some(action) })
}

/// What is missing between the start and the first image.
pub fn before_first_image(model: &Model) -> Status {
    hindrance(model).unwrap_or_else(|| Status {
        tone: Tone::Busy,
        title: text!("Waiting for the first image…"),
        detail: text!("The cell is connected; its camera delivers within a moment."),
        action: None,
    })
}

fn rank(state: &LinkState) -> u8 {
    match state {
        LinkState::Connected { .. } => 0,
        LinkState::StartingCell { .. } | LinkState::Searching { .. } => 1,
        LinkState::Retrying { .. } | LinkState::Lost { .. } => 2,
        LinkState::Resting { .. } | LinkState::Failed { .. } => 3,
    }
}

/// When it was lost; later than everything when it was not.
fn lost_since_s(state: &LinkState) -> f64 {
    match state {
        LinkState::Lost { since_s, .. } | LinkState::Retrying { since_s, .. } => *since_s,
        _ => f64::INFINITY,
    }
}

fn of_link(model: &Model, state: &LinkState, half: Text) -> Status {
    let status = |tone, title, detail, action| Status { tone, title, detail, action };
    match state {
        LinkState::StartingCell { why } => {
            let detail = match why {
                None => {
                    text!("A simulated arm with a depth camera over a chessboard. It needs nothing else installed.")
                }
                Some(why) => sentence(why, model.view.language),
            };
            status(Tone::Busy, text!("Starting the built-in cell…"), detail, None)
        }
        LinkState::Searching { address, attempt, why } => {
            let detail = match why {
                None if matches!(model.source, CellSource::Drivers(_)) => {
                    text!("The driver is started, or connected to, and has to say what it is.")
                }
                None => text!("Checking whether CoppeliaSim or a cell answers there."),
                Some(why) => text!("Try {attempt}. {why}", attempt = attempt, why = sentence(why, model.view.language)),
            };
            let title = text!("Searching for {address}…", address = address);
            status(Tone::Busy, title, detail, Some(try_now(model)))
        }
        LinkState::Connected { address, server } => {
            let title = match model.source {
                CellSource::BuiltIn(_) => text!("Connected to the built-in cell"),
                CellSource::Address(_) | CellSource::Drivers(_) => text!("Connected to {server}", server = server),
            };
            status(Tone::Good, title, Text::verbatim(address.clone()), None)
        }
        LinkState::Lost { since_s, why, attempt, next_s } => {
            let pause_s = next_s - model.now_s;
            let detail = if pause_s < SOON_S {
                text!("{why} It is tried again in a moment.", why = sentence(why, model.view.language))
            } else {
                let (why, number, pause) = (sentence(why, model.view.language), attempt + 1, duration(pause_s));
                text!("{why} Try {number} comes in {pause}.", why = why, number = number, pause = pause)
            };
            let title = text!("{half} lost {ago} ago", half = half, ago = duration(model.now_s - since_s));
            status(Tone::Warning, title, detail, Some(try_now(model)))
        }
        LinkState::Retrying { since_s, why, attempt } => status(
            Tone::Warning,
            text!("{half} lost {ago} ago, retrying", half = half, ago = duration(model.now_s - since_s)),
            text!("{why} Try {attempt} is under way.", why = sentence(why, model.view.language), attempt = attempt),
            may_be_given_up(model).then_some(Action::StopTrying),
        ),
        LinkState::Resting { why } => {
            let detail =
                text!("{why} It is not tried again until you ask for it.", why = sentence(why, model.view.language));
            status(Tone::Warning, text!("Not connected"), detail, Some(Action::Reconnect))
        }
        LinkState::Failed { why } => {
            let title = match &model.source {
                CellSource::BuiltIn(_) => text!("The built-in cell did not start"),
                CellSource::Address(address) => text!("Cannot connect to {address}", address = address),
                CellSource::Drivers(drivers) => text!("Cannot connect to {address}", address = drivers.to_string()),
            };
            status(Tone::Bad, title, sentence(why, model.view.language), Some(Action::Reconnect))
        }
    }
}

/// A try starts a program, which the user may not want.
fn may_be_given_up(model: &Model) -> bool {
    matches!(model.source, CellSource::Drivers(_))
}

fn try_now(model: &Model) -> Action {
    if may_be_given_up(model) { Action::ReconnectOrStop } else { Action::Reconnect }
}

/// A reason as a sentence of the window's language.
fn sentence(why: &Text, language: Language) -> Text {
    Text::verbatim(sentence_of(&why.in_language(language), if language == Language::Chinese { "。" } else { "." }))
}

/// First letter in upper case, unless the first word is a name in code; full stop at the end.
fn sentence_of(text: &str, full_stop: &'static str) -> String {
    let is_code =
        text.split_whitespace().next().is_some_and(|word| word.trim_end_matches(['.', ':']).contains(['.', '/']));
    let mut letters = text.chars();
    let Some(first) = letters.next() else { return String::new() };
    let end = if text.ends_with(['.', '!', '?', '…', '。']) { "" } else { full_stop };
    let first = if is_code { first.to_string() } else { first.to_uppercase().to_string() };
    format!("{first}{}{end}", letters.as_str())
}

/// `3 s`, `2 min 5 s`, `1 h 4 min`.
pub fn duration(seconds: f64) -> String {
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
        assert_eq!(sentence_of("nothing answers", "."), "Nothing answers.");
        assert_eq!(sentence_of("Done.", "."), "Done.");
        assert_eq!(sentence_of("sim.getObject: no answer", "."), "sim.getObject: no answer.");
        assert_eq!(sentence_of("", "."), "");
        let why = text!("the robot's driver has not sent a state yet");
        assert_eq!(
            sentence(&why, Language::English).in_language(Language::Chinese),
            "The robot's driver has not sent a state yet."
        );
        assert_eq!(sentence(&why, Language::Chinese).in_language(Language::English), "机器人的驱动还没有发送状态。");
    }
}
