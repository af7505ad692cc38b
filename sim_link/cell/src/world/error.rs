//! Errors of the world, in the words of the simulator's own API.

/// A refused operation on the world.
///
/// The texts are CoppeliaSim's, so that a script which looks for one of them finds it here too.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// No object has this handle.
    #[error("object does not exist.")]
    NoSuchObject,
    /// The object that a pose is to be relative to does not exist.
    #[error("reference object does not exist.")]
    NoSuchReference,
    /// A path that matches nothing, or that is not a path.
    #[error("object does not exist, or alias/path is ill formatted.")]
    NoSuchPath,
    /// The object that a relative path starts from does not exist.
    #[error("proxy object does not exist.")]
    NoSuchProxy,
    /// The operation is for joints.
    #[error("object is not a joint.")]
    NotAJoint,
    /// The operation is for vision sensors.
    #[error("object is not a vision sensor.")]
    NotAVisionSensor,
    /// The sensor is refreshed by the simulation, not on request.
    #[error("object not tagged for explicit handling.")]
    NotExplicitlyHandled,
    /// NaN, an infinity, or numbers that describe no rotation.
    #[error("invalid data.")]
    InvalidData,
    /// Numbers out of range, or options that contradict each other.
    #[error("invalid arguments.")]
    InvalidArguments,
    /// The operation is only possible while no simulation runs.
    #[error("simulation is not stopped.")]
    SimulationNotStopped,
    /// The new parent is the object itself or one of its descendants.
    #[error("object cannot become its own ancestor.")]
    CyclicParent,
    /// The world holds as many objects, or nests them as deeply, as it takes.
    #[error("the built-in cell holds no more than {limit} {what}.")]
    TooMany {
        what: &'static str,
        /// How many.
        limit: usize,
    },
}
