//! The layouts of viewers as messages, each made once in a program.
//!
//! The library makes a blueprint in a recording that refers to itself and never ends: two threads and its memory stay for
//! every [`Blueprint`](rerun::blueprint::Blueprint) that is sent. So a layout is sent to a recording of ours once, and its
//! messages are kept for all sessions.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use rerun::blueprint::BlueprintActivation;
use rerun::log::LogMsg;
use rerun::sink::CallbackSink;
use rerun::{RecordingStream, RecordingStreamBuilder, RecordingStreamError};

use super::{APPLICATION_ID, blueprint};
use crate::model::Step;

/// The layout of a step.
pub struct Arrangement {
    layout: Vec<LogMsg>,
    /// Has viewers take it.
    activation: Vec<LogMsg>,
}

/// What was made so far.
static MADE: Mutex<BTreeMap<Step, Arc<Arrangement>>> = Mutex::new(BTreeMap::new());

/// The layout of a step.
///
/// # Errors
/// When the library cannot make it.
pub fn of(step: Step) -> Result<Arc<Arrangement>, RecordingStreamError> {
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(arrangement) = made.get(&step) {
        return Ok(Arc::clone(arrangement));
    }
    let arrangement = Arc::new(Arrangement::make(step)?);
    made.insert(step, Arc::clone(&arrangement));
    Ok(arrangement)
}

impl Arrangement {
    fn make(step: Step) -> Result<Self, RecordingStreamError> {
        let messages = Arc::new(Mutex::new(Vec::new()));
        let taken = Arc::clone(&messages);
        let sink = CallbackSink::new(move |batch: &[LogMsg]| {
            taken.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(batch);
        });
        let builder = RecordingStreamBuilder::new(APPLICATION_ID).enabled(true).send_properties(false);
        let (_enabled, info, properties, batching, hooks, _blueprint) = builder.into_args();
        let stream = RecordingStream::new(info, properties, batching, hooks, Box::new(sink))?;
        blueprint::of(step).send(&stream, BlueprintActivation { make_active: true, make_default: true })?;
        // Its end waits until everything has arrived.
        drop(stream);
        let messages = std::mem::take(&mut *messages.lock().unwrap_or_else(PoisonError::into_inner));
        let ours = messages.into_iter().filter(|message| message.store_id().is_blueprint());
        let (activation, layout) = ours.partition(|message| matches!(message, LogMsg::BlueprintActivationCommand(_)));
        Ok(Self { layout, activation })
    }

    /// Has viewers of a recording take it; with the layout itself the first time.
    pub fn send(&self, stream: &RecordingStream, with_layout: bool) {
        let layout = if with_layout { self.layout.as_slice() } else { &[] };
        for message in layout.iter().chain(&self.activation) {
            stream.record_msg(message.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_has_a_layout_that_viewers_are_told_to_take_last() {
        for step in Step::ALL {
            let arrangement = of(step).expect("made");
            assert!(arrangement.layout.len() > 10, "{step:?}: {}", arrangement.layout.len());
            assert!(matches!(arrangement.layout[0], LogMsg::SetStoreInfo(_)), "{step:?}");
            let [LogMsg::BlueprintActivationCommand(command)] = arrangement.activation.as_slice() else {
                panic!("{step:?}: nothing is activated")
            };
            let id = &command.blueprint_id;
            assert!(arrangement.layout.iter().all(|message| message.store_id() == id), "{step:?}");
        }
    }
}
