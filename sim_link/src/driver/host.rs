//! One cell of drivers for several threads, started when it is needed and again when it is gone.

use std::sync::{Mutex, PoisonError};

use handeye_core::progress::CancelToken;

use super::cell::{DriverCell, DriverCellSpec};
use super::error::DriverError;
use super::options::DriverOptions;

/// Keeps a cell running. Threads ask it for the cell whenever theirs is gone; what it gives is the same cell for all.
#[derive(Debug)]
pub struct DriverHost {
    spec: DriverCellSpec,
    options: DriverOptions,
    cell: Mutex<Option<DriverCell>>,
}

impl DriverHost {
    /// Nothing is started yet.
    pub fn new(spec: DriverCellSpec, options: DriverOptions) -> Self {
        Self { spec, options, cell: Mutex::new(None) }
    }

    /// Which drivers.
    pub fn spec(&self) -> &DriverCellSpec {
        &self.spec
    }

    /// The cell; one that is gone is ended and started again, read-only as every new one. Whoever asks meanwhile waits for
    /// the same start.
    ///
    /// # Errors
    /// As [`DriverCell::start`].
    pub fn cell(&self, cancel: &CancelToken) -> Result<DriverCell, DriverError> {
        let mut kept = self.cell.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cell) = kept.as_ref().filter(|cell| cell.check().is_ok()) {
            return Ok(cell.clone());
        }
        // The old one first, both halves of it, whoever has them yet: a device takes one program at a time.
        if let Some(old) = kept.take() {
            old.close();
        }
        let cell = DriverCell::start(&self.spec, &self.options, cancel)?;
        Ok(kept.insert(cell).clone())
    }

    /// Ends the cell, whoever has it yet.
    pub fn close(&self) {
        if let Some(cell) = self.cell.lock().unwrap_or_else(PoisonError::into_inner).take() {
            cell.close();
        }
    }
}
