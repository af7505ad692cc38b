//! The layouts of viewers as messages, each created once per program run.
//!
//! The library creates a blueprint in a recording that refers to itself and never ends: two threads and its memory leak
//! for every [`Blueprint`](rerun::blueprint::Blueprint) that is sent. So a layout is sent to a recording of ours once, and
//! its messages are kept for all sessions.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Point3;
use rerun::blueprint::BlueprintActivation;
use rerun::log::{Chunk, LogMsg};
use rerun::sink::CallbackSink;
use rerun::{
    ComponentBatch as _, ComponentDescriptor, Position3D, RecordingStream, RecordingStreamBuilder,
    RecordingStreamError, SerializedComponentBatch,
};

use super::APPLICATION_ID;
use super::blueprint::{self, Arranged};
use handeye_workbench::scene::Extent;

/// A layout.
pub struct Arrangement {
    layout: Vec<LogMsg>,
    /// The entities of the views in 3D.
    spaces: Vec<String>,
    /// Activates it in viewers.
    activation: Vec<LogMsg>,
}

/// What was created so far.
static MADE: Mutex<BTreeMap<Arranged, Arc<Arrangement>>> = Mutex::new(BTreeMap::new());

/// The layout.
///
/// # Errors
/// When the library cannot create it.
pub fn of(arranged: Arranged) -> Result<Arc<Arrangement>, RecordingStreamError> {
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(arrangement) = made.get(&arranged) {
        return Ok(Arc::clone(arrangement));
    }
    let arrangement = Arc::new(Arrangement::make(arranged)?);
    made.insert(arranged, Arc::clone(&arrangement));
    Ok(arrangement)
}

impl Arrangement {
    fn make(arranged: Arranged) -> Result<Self, RecordingStreamError> {
        let builder = RecordingStreamBuilder::new(APPLICATION_ID).send_properties(false);
        let messages = messages(builder, |stream| {
            blueprint::of(arranged).send(stream, BlueprintActivation { make_active: true, make_default: true })
        })?;
        let ours = messages.into_iter().filter(|message| message.store_id().is_blueprint());
        let (activation, layout): (Vec<LogMsg>, Vec<LogMsg>) =
            ours.partition(|message| matches!(message, LogMsg::BlueprintActivationCommand(_)));
        let spaces = layout.iter().filter_map(space).collect();
        Ok(Self { layout, spaces, activation })
    }

    /// Fits the views in 3D to all of it: the view that a viewer chooses by itself is fitted to what is there when it opens,
    /// and to points far behind the cell.
    fn frame(&self, stream: &RecordingStream, extent: &Extent) -> Result<(), RecordingStreamError> {
        let Some(LogMsg::SetStoreInfo(store)) = self.layout.first() else { return Ok(()) };
        let id = store.info.store_id.recording_id().clone();
        let builder = RecordingStreamBuilder::new(APPLICATION_ID).recording_id(id).blueprint();
        let messages = messages(builder, |stream| {
            // The time line of everything in a layout; among rows at one time the last counts.
            stream.set_time_sequence("blueprint", 0);
            for space in &self.spaces {
                stream.log_serialized_batches(format!("{space}/EyeControls3D"), false, eye(extent))?;
            }
            Ok(())
        })?;
        for message in messages.into_iter().filter(|message| matches!(message, LogMsg::ArrowMsg(..))) {
            stream.record_msg(message);
        }
        Ok(())
    }

    /// Sends it to viewers of a recording, with this extent in view; including the layout itself the first time.
    ///
    /// # Errors
    /// When the library cannot encode where the eye is.
    pub fn send(
        &self,
        stream: &RecordingStream,
        with_layout: bool,
        extent: Option<&Extent>,
    ) -> Result<(), RecordingStreamError> {
        let layout = if with_layout { self.layout.as_slice() } else { &[] };
        for message in layout {
            stream.record_msg(message.clone());
        }
        let framed = extent.map_or(Ok(()), |extent| self.frame(stream, extent));
        self.activation.iter().for_each(|message| stream.record_msg(message.clone()));
        framed
    }
}

/// The messages that are logged to a temporary recording.
fn messages(
    builder: RecordingStreamBuilder,
    log: impl FnOnce(&RecordingStream) -> Result<(), RecordingStreamError>,
) -> Result<Vec<LogMsg>, RecordingStreamError> {
    let messages = Arc::new(Mutex::new(Vec::new()));
    let taken = Arc::clone(&messages);
    let sink = CallbackSink::new(move |batch: &[LogMsg]| {
        taken.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(batch);
    });
    let (_enabled, info, properties, batching, hooks, _blueprint) = builder.enabled(true).into_args();
    let stream = RecordingStream::new(info, properties, batching, hooks, Box::new(sink))?;
    log(&stream)?;
    // Its end waits until everything has arrived.
    drop(stream);
    Ok(std::mem::take(&mut *messages.lock().unwrap_or_else(PoisonError::into_inner)))
}

/// The entity of the view that a message describes, if that is one in 3D.
fn space(message: &LogMsg) -> Option<String> {
    let LogMsg::ArrowMsg(_, message) = message else { return None };
    let chunk = Chunk::from_arrow_msg(message).ok()?;
    let mut classes = chunk.iter_slices::<String>("ViewBlueprint:class_identifier".into());
    let is_space = classes.any(|classes| classes.iter().any(|class| class.as_str() == "3D"));
    is_space.then(|| chunk.entity_path().to_string())
}

/// Where the eye of a view is and what it looks at, as in the archetype `EyeControls3D` of viewers.
fn eye(extent: &Extent) -> impl Iterator<Item = SerializedComponentBatch> {
    let part = |component: &'static str, at: Point3<f64>| {
        let [x, y, z]: [f32; 3] = at.coords.map(|metres| metres as f32).into();
        [Position3D::new(x, y, z)].serialized(ComponentDescriptor {
            archetype: Some("rerun.blueprint.archetypes.EyeControls3D".into()),
            component: component.into(),
            component_type: Some("rerun.components.Position3D".into()),
        })
    };
    [part("EyeControls3D:position", extent.eye()), part("EyeControls3D:look_target", extent.centre)]
        .into_iter()
        .flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::model::Step;

    #[test]
    fn every_step_has_a_layout_that_viewers_are_told_to_take_last() {
        for step in Step::ALL {
            let arrangement = of(Arranged { step, is_eye_to_hand: false, has_joints: true }).expect("made");
            assert_eq!(arrangement.spaces.len(), 1, "{step:?}");
            assert!(arrangement.layout.len() > 10, "{step:?}: {}", arrangement.layout.len());
            assert!(matches!(arrangement.layout[0], LogMsg::SetStoreInfo(_)), "{step:?}");
            let [LogMsg::BlueprintActivationCommand(command)] = arrangement.activation.as_slice() else {
                panic!("{step:?}: nothing is activated")
            };
            let id = &command.blueprint_id;
            assert!(arrangement.layout.iter().all(|message| message.store_id() == id), "{step:?}");
        }
    }

    #[test]
    fn the_eye_of_the_space_is_told_where_the_cell_is_in_the_layout_that_is_shown() {
        let arrangement = of(Arranged { step: Step::Solve, is_eye_to_hand: false, has_joints: true }).expect("made");
        let extent = Extent { centre: Point3::new(0.5, -0.25, 0.75), radius_m: 0.5 };
        let (stream, storage) = RecordingStreamBuilder::new(APPLICATION_ID).memory().expect("a recording");
        arrangement.frame(&stream, &extent).expect("framed");
        stream.flush_blocking().expect("flushed");
        let messages = storage.take();
        let mut eyes = messages.iter().filter_map(|message| match message {
            LogMsg::ArrowMsg(id, message) if id.is_blueprint() => Some((id, Chunk::from_arrow_msg(message).ok()?)),
            _ => None,
        });
        let (id, chunk) = eyes.next().expect("an eye");
        assert_eq!(Some(id), arrangement.layout.first().map(LogMsg::store_id));
        assert_eq!(chunk.entity_path().to_string(), format!("{}/EyeControls3D", arrangement.spaces[0]));
        let mut targets = chunk.iter_slices::<[f32; 3]>("EyeControls3D:look_target".into());
        assert_eq!(targets.next(), Some(&[[0.5, -0.25, 0.75]][..]));
        let mut places = chunk.iter_slices::<[f32; 3]>("EyeControls3D:position".into());
        let [x, y, z] = places.next().expect("a place")[0];
        let away = Point3::new(f64::from(x), f64::from(y), f64::from(z)) - extent.centre;
        assert!((away.norm() - extent.distance_m()).abs() < 1e-5, "{away}");
        assert!(eyes.next().is_none());
    }
}
