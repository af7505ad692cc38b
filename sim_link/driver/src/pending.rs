//! A start of drivers that goes on in its own thread, since one that is being prepared takes minutes.

use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use handeye_geometry::progress::CancelToken;

use super::cell::{DriverCell, DriverCellSpec};
use super::error::DriverError;
use super::options::{DriverOptions, Preparing};

/// Interval at which a preparation is checked.
const POLL: Duration = Duration::from_millis(20);

#[derive(Debug)]
pub struct PendingStart {
    driver: String,
    started: Receiver<Result<DriverCell, DriverError>>,
    preparing: Preparing,
    /// Gives it up.
    pub halt: CancelToken,
}

/// Result of waiting for a start.
pub(super) enum Waited {
    /// It is over.
    Ended(Result<DriverCell, DriverError>),
    /// It goes on, with what is being done.
    Preparing(PendingStart, DriverError),
}

impl PendingStart {
    /// Begins it. Raising `cancel` gives it up as well.
    ///
    /// # Errors
    /// [`DriverError::Start`] where no thread can be started for it.
    pub fn begin(spec: &DriverCellSpec, options: DriverOptions, cancel: &CancelToken) -> Result<Self, DriverError> {
        let (send, started) = sync_channel(1);
        let (spec, cancel) = (spec.clone(), cancel.clone());
        let driver = spec.robot.to_string();
        let (halt, preparing) = (options.halt.clone(), options.preparing.clone());
        let thread = std::thread::Builder::new().name("driver-start".into());
        let began = thread.spawn(move || {
            // Nobody waits for it any more: the cell that is dropped ends its drivers.
            let _dropped = send.send(DriverCell::start(&spec, &options, &cancel)).is_err();
        });
        match began {
            Ok(_) => Ok(Self { driver, started, preparing, halt }),
            Err(error) => Err(DriverError::Start { command: driver, why: error.to_string() }),
        }
    }

    /// Waits for its end, or until the driver reports that it is being prepared: then the start goes on.
    pub fn wait(self) -> Waited {
        loop {
            match self.started.recv_timeout(POLL) {
                Ok(started) => return Waited::Ended(started),
                Err(RecvTimeoutError::Disconnected) => {
                    let why = "the thread that starts it failed".to_owned();
                    return Waited::Ended(Err(DriverError::Start { command: self.driver, why }));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Some(what) = self.preparing.text() {
                let error = DriverError::Preparing { driver: self.driver.clone(), what };
                return Waited::Preparing(self, error);
            }
        }
    }
}
