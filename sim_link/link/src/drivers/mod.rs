//! A robot and a camera behind [drivers](handeye_driver).

mod camera;
mod chosen;
mod control;
mod motion;
#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, PoisonError};

use handeye_coppeliasim::CancelToken;
use handeye_driver::{BadSpec, DriverCell, DriverCellSpec, DriverError, DriverHost, DriverOptions, NoCell};
use handeye_geometry::frames::{Base, Pose, Tip};

use crate::{CameraPort, Cell, Connected, ControlPort, MotionPort, PortError};
use camera::DriverCamera;
pub use chosen::Drivers;
use control::DriverControl;
use handeye_wording::Text;
use handeye_wording::text;
use motion::DriverMotion;

/// Starts the drivers, or connects to them, once for all workers; and again when they have ended.
pub struct DrivenCell {
    drivers: Drivers,
    /// The host, or why these drivers are not valid.
    host: Result<DriverHost, BadSpec>,
    typed: TypedPose,
}

impl DrivenCell {
    /// Nothing is started yet.
    pub(crate) fn new(drivers: Drivers) -> Self {
        let host = spec(&drivers).map(|spec| DriverHost::new(spec, DriverOptions::default()));
        Self { drivers, host, typed: TypedPose::default() }
    }

    /// The drivers that run. The other workers wait for the first.
    fn cell(&self, shutdown: &CancelToken) -> Result<DriverCell, PortError> {
        let host = self.host.as_ref().map_err(|why| PortError::Hopeless(why.into()))?;
        host.cell(shutdown).map_err(no_cell)
    }

    fn is_freehand(&self) -> bool {
        self.drivers.robot.is_none()
    }

    fn connected<Port>(&self, port: Port, cell: &DriverCell) -> Connected<Port> {
        let named = |driver: &handeye_driver::Driver| {
            let hello = driver.hello();
            format!("{} {}", hello.name, hello.version).trim_end().to_owned()
        };
        let robot = named(cell.robot());
        let server = match cell.camera().filter(|_| cell.is_two()) {
            Some(camera) => format!("{robot}, {}", named(camera)),
            None => robot,
        };
        Connected { port, address: self.drivers.to_string(), server }
    }
}

impl Cell for DrivenCell {
    fn control(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn ControlPort>>, PortError> {
        let cell = self.cell(shutdown)?;
        let port = DriverControl::new(cell.clone(), self.is_freehand().then(|| self.typed.clone()));
        Ok(self.connected(Box::new(port), &cell))
    }

    fn camera(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn CameraPort>>, PortError> {
        let cell = self.cell(shutdown)?;
        if cell.camera().is_none() {
            let reported =
                text!("The driver has no images: name a driver for the camera under Connect, beside that of the robot");
            return Err(PortError::Hopeless(reported));
        }
        let port = DriverCamera::new(cell.clone(), self.is_freehand().then(|| self.typed.clone()), shutdown.clone());
        Ok(self.connected(Box::new(port), &cell))
    }

    fn motion(&self, shutdown: &CancelToken) -> Result<Connected<Box<dyn MotionPort>>, PortError> {
        let cell = self.cell(shutdown)?;
        Ok(self.connected(Box::new(DriverMotion::new(cell.clone())), &cell))
    }

    fn rest(&self) {
        if let Ok(host) = &self.host {
            host.rest();
        }
    }

    fn again(&self) {
        if let Ok(host) = &self.host {
            host.again();
        }
    }
}

/// The pose that a person reads off the pendant, where no driver reports it. All clones are the same.
#[derive(Debug, Clone, Default)]
struct TypedPose(Arc<Mutex<Option<Pose<Base, Tip>>>>);

impl TypedPose {
    fn set(&self, pose: Option<Pose<Base, Tip>>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = pose;
    }

    fn get(&self) -> Option<Pose<Base, Tip>> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Where a person types the poses, the camera's driver replaces the robot's.
fn spec(drivers: &Drivers) -> Result<DriverCellSpec, BadSpec> {
    let robot = drivers.robot.as_deref().map(str::parse).transpose()?;
    let camera = drivers.camera.as_deref().map(str::parse).transpose()?;
    match (robot, camera) {
        (Some(robot), camera) => Ok(DriverCellSpec { robot, camera }),
        (None, Some(camera)) => Ok(DriverCellSpec { robot: camera, camera: None }),
        (None, None) => Err(BadSpec::Empty),
    }
}

/// The connection error when there are no drivers.
fn no_cell(why: NoCell) -> PortError {
    match why {
        NoCell::Later { error, tries, pause } => PortError::Later { why: error.into(), tries, pause },
        NoCell::Over { error, tries } if tries > 1 => PortError::Hopeless(text!(
            "{tries} starts in a row failed, so it is not started again by itself: {why}. Look at the command and at \
             what the driver says, then try again",
            tries = tries,
            why = error
        )),
        NoCell::Over { error, .. } => port_error(error),
        NoCell::Rests { error } => {
            PortError::Rests(error.map_or_else(|| text!("The driver was not started"), Text::from))
        }
    }
}

/// The connection error for an error of a driver.
#[expect(clippy::needless_pass_by_value, reason = "it is used up")]
fn port_error(error: DriverError) -> PortError {
    let text = Text::from(&error);
    match error {
        DriverError::Gone { .. } | DriverError::Connect { .. } | DriverError::NoAnswer { .. } => PortError::Lost(text),
        DriverError::Start { .. } | DriverError::Cannot { .. } => PortError::Hopeless(text),
        _ => PortError::Refused(text),
    }
}
