//! Numbers of the `sim.*` API that the client uses, as of CoppeliaSim 4.10; all of them hold since 4.7.

/// Stands for the world as a reference frame.
pub const HANDLE_WORLD: i64 = -1;
/// Stands for every object.
pub const HANDLE_ALL: i64 = -2;
/// Denotes every object that the simulation handles by itself.
pub const HANDLE_ALL_EXCEPT_EXPLICIT: i64 = -3;
/// Stands for the parent of the object as a reference frame.
pub const HANDLE_PARENT: i64 = -11;

/// Simulation state: stopped.
pub(crate) const SIMULATION_STOPPED: i64 = 0;
/// Simulation state: paused.
pub(crate) const SIMULATION_PAUSED: i64 = 8;
/// Bit of the simulation states in which time advances.
pub(crate) const SIMULATION_ADVANCING: i64 = 16;

/// Float parameter of a vision sensor: near clipping plane (m).
pub(crate) const VISION_NEAR_CLIPPING: i64 = 1000;
/// Float parameter of a vision sensor: far clipping plane (m).
pub(crate) const VISION_FAR_CLIPPING: i64 = 1001;
/// Float parameter of a vision sensor: opening angle along the larger image side (rad).
pub(crate) const VISION_PERSPECTIVE_ANGLE: i64 = 1004;
/// Integer parameter of a vision sensor: 0 means orthographic.
pub(crate) const VISION_PERSPECTIVE: i64 = 1018;

/// Option of the depth call: metres rather than the fraction between the clipping planes.
pub(crate) const DEPTH_IN_METRES: i64 = 1;

/// Integer parameter: version, 41000 is 4.10.0.
pub(crate) const INT_PROGRAM_VERSION: i64 = 1;

/// Stands for the whole scene as the base of a tree.
pub const HANDLE_SCENE: i64 = -12;

/// Option of the name of an object: the shortest path that leads to it.
pub(crate) const ALIAS_SHORTEST_PATH: i64 = 1;

/// Type of an object: a shape.
pub(crate) const OBJECT_SHAPE: i64 = 0;
/// Type of an object: a joint.
pub(crate) const OBJECT_JOINT: i64 = 1;
/// Type of an object: a dummy.
pub(crate) const OBJECT_DUMMY: i64 = 4;
/// Type of an object: a vision sensor.
pub(crate) const OBJECT_VISION_SENSOR: i64 = 9;
/// Type of a joint: it turns about one axis.
pub const JOINT_REVOLUTE: i64 = 10;
/// Type of a joint: it shifts along one axis.
pub const JOINT_PRISMATIC: i64 = 11;

/// Mode of a joint that forces move and a controller holds; in the others it is where it is put.
pub(crate) const JOINT_MODE_DYNAMIC: i64 = 5;

/// Result of a motion step: not there yet.
pub(crate) const MOTION_RUNNING: i64 = 0;
/// Result of a motion step: there.
pub(crate) const MOTION_DONE: i64 = 1;
/// Result of a motion step: at rest somewhere else, because the motion was ended early.
pub(crate) const MOTION_STOPPED: i64 = 2;
