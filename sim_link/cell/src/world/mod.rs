//! The world of the cell: an object tree and a simulation that advances it in passes. No sockets, no clock.
//!
//! The robot exists twice. Clients see it as its controller does ([`Chain::Reported`]); cameras see it as it really is
//! ([`Chain::Actual`]), with whatever errors the scene gives its joints.

pub mod carrier;
pub mod error;
mod handle;
pub mod joint;
pub mod paths;
pub mod poses;
pub mod sensor;
pub mod simulation;
pub mod tree;

use std::sync::Arc;

use nalgebra::Isometry3;

pub use carrier::Carrier;
pub use error::WorldError;
pub use handle::Handle;
pub use joint::{DriveLimits, Joint, JointMode};
pub use poses::Flagged;
pub use sensor::{Moment, Reported, Shown, VisionSensor};
pub use simulation::{Simulation, State};
pub use tree::{Chain, Kind, Object, Tree, turn_z};

/// The faults of a robot: where it really is, given where its controller believes it to be.
pub trait Faults: std::fmt::Debug + Send {
    /// Sets the displacements of the objects. Called once per pass, after the joints have moved.
    fn apply(&mut self, tree: &mut Tree);
}

/// Which sensors take an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensors {
    /// One that the simulation leaves alone.
    One(Handle),
    /// All that the simulation handles.
    AllButExplicit,
    All,
}

impl Sensors {
    fn include(self, handle: Handle, sensor: &VisionSensor) -> bool {
        match self {
            Self::One(one) => one == handle,
            Self::AllButExplicit => !sensor.explicit,
            Self::All => true,
        }
    }
}

/// The objects whose state belongs to every image.
#[derive(Debug, Clone)]
struct Robot {
    joints: Vec<Handle>,
    tip: Handle,
}

/// The object tree with its simulation.
#[derive(Debug, Default)]
pub struct World {
    /// The objects.
    pub tree: Tree,
    simulation: Simulation,
    /// Passes over the life of the world.
    pass: u64,
    faults: Option<Box<dyn Faults>>,
    /// What moves by itself.
    pub carrier: Option<Carrier>,
    robot: Option<Robot>,
    latest: Option<Arc<Moment>>,
}

impl World {
    /// Gives the robot faults that only the cameras see.
    pub fn set_faults(&mut self, faults: Box<dyn Faults>) {
        self.faults = Some(faults);
        self.apply_faults();
    }

    /// Names the joints and the tip whose reported state is kept with what the sensors show.
    pub fn set_robot(&mut self, joints: Vec<Handle>, tip: Handle) {
        self.robot = Some(Robot { joints, tip });
    }

    /// The simulation's state and time.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Sets the length of a pass.
    ///
    /// # Errors
    /// See [`Simulation::set_time_step`].
    pub fn set_time_step(&mut self, time_step_s: f64) -> Result<(), WorldError> {
        self.simulation.set_time_step(time_step_s)
    }

    /// Starts or resumes the simulation.
    pub fn start_simulation(&mut self) {
        self.simulation.start(&self.tree);
    }

    /// Asks for a pause; it comes within two passes.
    pub fn pause_simulation(&mut self) {
        self.simulation.pause();
    }

    /// Asks for the end; it comes within three passes.
    pub fn stop_simulation(&mut self) {
        self.simulation.stop();
    }

    /// Runs the rest of a pass: joints on their way and what is carried move on, sensors take in what there is to see, time
    /// advances.
    /// Nothing happens unless the simulation is advancing.
    pub fn run_pass(&mut self) {
        if !self.simulation.is_advancing() {
            return;
        }
        let time_step_s = self.simulation.time_step_s();
        for (_, object) in self.tree.iter_mut() {
            if let Kind::Joint(joint) = &mut object.kind {
                joint.advance(time_step_s);
            }
        }
        if let Some(carrier) = &mut self.carrier {
            carrier.advance(&mut self.tree, time_step_s);
        }
        self.pass += 1;
        self.apply_faults();
        let shown = self.look(self.simulation.time_after_pass_s());
        for (handle, object) in self.tree.iter_mut() {
            if let Kind::VisionSensor(sensor) = &mut object.kind
                && Sensors::AllButExplicit.include(handle, sensor)
            {
                sensor.shown = Some(shown.clone());
            }
        }
        if self.simulation.end_pass() {
            self.simulation.restore(&mut self.tree);
            if let Some(carrier) = &mut self.carrier {
                carrier.reset();
            }
            self.apply_faults();
            for (_, object) in self.tree.iter_mut() {
                if let Kind::VisionSensor(sensor) = &mut object.kind {
                    sensor.shown = None;
                }
            }
        }
    }

    /// Has sensors take in what there is to see now, between two passes.
    ///
    /// # Errors
    /// No such sensor; [`WorldError::NotExplicitlyHandled`] for a single one that the simulation handles by itself.
    pub fn handle_sensors(&mut self, which: Sensors) -> Result<(), WorldError> {
        if let Sensors::One(handle) = which
            && !self.tree.sensor(handle)?.explicit
        {
            return Err(WorldError::NotExplicitlyHandled);
        }
        let shown = self.look(self.simulation.time_s());
        for (handle, object) in self.tree.iter_mut() {
            if let Kind::VisionSensor(sensor) = &mut object.kind
                && which.include(handle, sensor)
            {
                sensor.shown = Some(shown.clone());
            }
        }
        Ok(())
    }

    /// Brakes every joint that is on its way to a target position.
    pub fn brake_joints(&mut self) {
        for (_, object) in self.tree.iter_mut() {
            if let Kind::Joint(joint) = &mut object.kind {
                joint.brake();
            }
        }
    }

    /// Where everything that can see or be seen really is. The moment is the same one as long as none of these has
    /// moved, so that what was computed from it stays valid; dummies come and go unseen.
    fn look(&mut self, time_s: f64) -> Shown {
        let poses: Vec<(Handle, Isometry3<f64>)> = self
            .tree
            .iter()
            .filter(|(_, object)| matches!(object.kind, Kind::Shape | Kind::VisionSensor(_)))
            .filter_map(|(handle, _)| Some((handle, self.tree.world_pose(handle, Chain::Actual).ok()?)))
            .collect();
        let hidden: Vec<Handle> =
            self.tree.iter().filter(|(_, object)| object.hidden).map(|(handle, _)| handle).collect();
        let moment = match &self.latest {
            Some(latest) if latest.poses == poses && latest.hidden == hidden => Arc::clone(latest),
            _ => Arc::new(Moment { poses, hidden }),
        };
        self.latest = Some(Arc::clone(&moment));
        Shown { pass: self.pass, time_s, reported: self.reported(), moment }
    }

    /// `None` while the robot is not complete: clients may remove its parts.
    fn reported(&self) -> Option<Reported> {
        let Robot { joints, tip } = self.robot.as_ref()?;
        let position = |&joint: &Handle| Some(self.tree.joint(joint).ok()?.position_rad());
        Some(Reported {
            joints_rad: joints.iter().map(position).collect::<Option<Vec<f64>>>()?,
            world_from_tip: self.tree.world_pose(*tip, Chain::Reported).ok()?,
        })
    }

    fn apply_faults(&mut self) {
        if let Some(faults) = &mut self.faults {
            faults.apply(&mut self.tree);
        }
    }
}

#[cfg(test)]
mod tests;
